"""Text from microscopes' programs: headers are read, profiles and lists of points refused."""

import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gen import cli
from gen.runtime.errors import InputError
from tests.maps import read

LINES = np.random.default_rng(2).normal(
    scale=1e-3, size=(3, 4)
)  # 3 lines of 4 pixels along x
NUMBERS = (
    "\n".join("\t".join(repr(float(each)) for each in line) for line in LINES) + "\n"
)

GWYDDION = "# Channel: Topo\n# Width: 10.00 µm\n# Height: 6.00 µm\n# Value units: m\n"
SPIP = "# File Format = ASCII\n# x-pixels = 4\n# y-pixels = 3\n# x-length = 10000\n"
KOALA = (
    "h=3 w=4\npixel size=2.5e-06 m\ndata unit=rad\nheight conversion factor (-> m)=2e-7\n"
)
NOVA = (
    "File Format = ASCII\nCreated by Nova\nNX = 4\nNY = 3\nScale X = 2.5\nScale Y = 2\n"
)
HEADERS = {
    "Gwyddion": (GWYDDION, 1e6),
    "two units": (GWYDDION.replace("6.00 µm", "6000 nm"), 1e6),
    "two units, Attocube": (
        "# x-length: 10\n# y-length: 6000\n# x-unit: um\n# y-unit: nm\n# z-unit: nm\n",
        1e-3,
    ),
    "German": (
        "# Kanal: Topo\n# Breite: 10,00 µm\n# Höhe: 6,00 µm\n# Einheiten: m\n",
        1e6,
    ),
    "Japanese": ("# チャネル： Topo\n# 幅: 10 µm\n# 高さ： 6 µm\n# 値の単位: m\n", 1e6),
    "SPIP": (SPIP + "# y-length = 6000\n# z-unit = um\n# Start of Data:\n", 1.0),
    "SPIP without a unit": (SPIP + "# y-length = 6000\n# Bit2nm = 0.5\n", 5e-4),
    "Nova": (NOVA + "Unit X = um\nUnit Data = nm\nStart of Data :\n", 1e-3),
}


def written(folder, content, encoding="utf-8"):
    (folder / "scan.txt").write_text(content, encoding=encoding)
    return folder / "scan.txt"


def same(topography, um):
    """4 x 3 pixels on 10 x 6 um, x along the lines, heights in units of so many um."""
    assert topography.sides == pytest.approx((7.5, 4.0))
    np.testing.assert_allclose(topography.heights, um * LINES.T, rtol=1e-12)
    assert not topography.warnings


@pytest.mark.parametrize(("header", "um"), HEADERS.values(), ids=HEADERS)
def test_headers_state_lengths_and_units(tmp_path, header, um):
    same(read(written(tmp_path, header + NUMBERS)), um)


def test_lengths_of_the_header_may_be_given_again(tmp_path):
    """The pixels are 10 um x 6 um, their centres 7.5 um x 4 um apart."""
    path = written(tmp_path, GWYDDION + NUMBERS)
    for side in ("10,6", "7.5,4"):
        assert read(path, side).sides == pytest.approx((7.5, 4))
    assert read(path, "10,6", override_scale=True).sides == (10, 6)
    with pytest.raises(
        InputError, match=r"7.5 x 4 um between its outer nodes, --side says 10,7"
    ):
        read(path, "10,7")


PHASE = GWYDDION.replace("Topo", "Phase").replace(": m", ": deg") + NUMBERS


@pytest.fixture
def three(tmp_path):
    """Three exports in one file: a phase, and two maps of heights."""
    zoom = GWYDDION.replace("Topo", "Zoom") + NUMBERS
    return written(tmp_path, "\n".join([PHASE, GWYDDION + NUMBERS, zoom]))


def test_of_concatenated_exports_the_first_with_heights_is_read(three):
    topography = read(three)
    same(topography, 1e6)
    words = "channel 1 'Topo' (not 0 'Phase' (in deg, no heights), 2 'Zoom')"
    assert words in topography.steps[0]


@pytest.mark.parametrize("channel", ["Zoom", "2"])
def test_a_concatenated_export_is_chosen_by_name_or_index(three, channel):
    assert "channel 2 'Zoom'" in read(three, channel=channel).steps[0]


@pytest.mark.parametrize(
    ("channel", "fault"), [("Top", "no such channel"), ("Phase", "holds no heights")]
)
def test_a_concatenated_export_without_heights_is_refused(three, channel, fault):
    holds = "holds 0 'Phase' .in deg, no heights., 1 'Topo', 2 'Zoom'"
    with pytest.raises(InputError, match=f"--channel '{channel}': {fault}.*{holds}"):
        read(three, channel=channel)


def test_a_name_of_two_exports_is_refused(tmp_path):
    path = written(tmp_path, 2 * (GWYDDION + NUMBERS))
    with pytest.raises(
        InputError, match="several channels have this name; give an index"
    ):
        read(path, channel="Topo")


def test_a_file_without_a_channel_of_heights_is_refused(tmp_path):
    with pytest.raises(InputError, match="holds no heights; its channels are 0 'Phase'"):
        read(written(tmp_path, PHASE))


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r\r\n", "\r"])
def test_a_header_of_koala_is_read(tmp_path, end):
    """Its numbers are phases, which the factor converts, and all of its cells are square."""
    path = tmp_path / "scan.txt"
    path.write_bytes((KOALA + NUMBERS).replace("\n", end).encode())
    topography = read(path)
    assert topography.spacing == pytest.approx((2.5, 2.5))
    np.testing.assert_allclose(topography.heights, 0.2 * LINES.T, rtol=1e-12)
    apart = KOALA.replace("h=3 w=4", "w = 4\nh = 3")
    np.testing.assert_array_equal(
        read(written(tmp_path, apart + NUMBERS)).heights, topography.heights
    )


@pytest.mark.parametrize(
    ("header", "message"),
    [
        (
            KOALA.replace("h=3", "h=9"),
            "its header states 9 lines of 4 numbers, it holds 3 of 4",
        ),
        (
            KOALA.replace("=rad", "=nm"),
            "numbers in nm as well as a height conversion factor of 2e-07",
        ),
        (
            "h=3 w=4\npixel size=1 um\ndata unit=rad\n",
            r"0 'matrix 0' \(in rad, no heights\)",
        ),
        (
            "gain=3\noffset=4\n",
            r"line 1: 'gain=3' belongs to a header that is not known; put #",
        ),
    ],
)
def test_a_header_that_does_not_suit_is_told(tmp_path, header, message):
    with pytest.raises(InputError, match=message):
        read(written(tmp_path, header + NUMBERS))


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r\r\n", "\r"])
def test_lines_are_counted_as_editors_do(tmp_path, end):
    path = tmp_path / "scan.txt"
    path.write_bytes(
        end.join(
            ["# made\x0b by hand", "", "1 2 3", "4 5 6", "7 8 x9", "1 2 3", ""]
        ).encode()
    )
    with pytest.raises(InputError, match=r"scan.txt, line 5: 'x9' is not a number"):
        read(path, "9,9")


@pytest.mark.parametrize(
    ("header", "message"),
    [
        (
            GWYDDION.replace("µm", "ft"),
            "unit of lengths 'ft': give --side with --override-scale",
        ),
        (GWYDDION.replace("# Value units: m\n", ""), "names no unit; give --unit"),
        (
            SPIP.replace("= 4", "= 5"),
            "its header states . lines of 5 numbers, it holds 3 of 4",
        ),
        (NOVA + "Unit X = um\nDataScaleNeeded = Yes\n", "numbers are to be scaled"),
        (
            "# scan 10 x 6 µm, 16 bit\n",
            "give --side, .* .it says 'scan 10 x 6 µm, 16 bit'",
        ),
        ("# Width: 10 µm\n", "give --side, .* .it says 'width: 10 µm'"),
    ],
)
def test_what_a_header_lacks_is_asked_for(tmp_path, header, message):
    with pytest.raises(InputError, match=message):
        read(written(tmp_path, header + NUMBERS))


def test_remarks_that_are_not_read_are_told(tmp_path):
    [warning] = read(written(tmp_path, "# heights in nm\n" + NUMBERS), "9,9").warnings
    assert "the file says 'heights in nm', which is not read" in warning
    transposed = written(tmp_path, "# nx = 3\n# ny: 4\n# NX, NY: a grid\n" + NUMBERS)
    assert read(transposed, "9,9").heights.shape == (3, 4)
    assert not read(
        written(tmp_path, "# from a profilometer\n" + NUMBERS), "9,9"
    ).warnings


@pytest.mark.parametrize(
    "text",
    [
        "  1\t2   3  4 5 \r\n\r\n6 7 8 0 2\n9 4 1 7 3\n1 1 2 8 5",
        "  1.0e+00;   2.0e+00;3;4;5;\n   6.0e+00;7;8;0;2;\n9;4;1;7;3\n1;1;2;8;5\n",
        "Heights of a plate\n1 2 3 4 5\n6 7 8 0 2\n9 4 1 7 3\n1 1 2 8 5\n",
    ],
)
def test_reads_text_with_any_separator_and_comments(tmp_path, text):
    heights = read(written(tmp_path, text), "5,4", "um").heights
    assert np.array_equal(
        heights, [[1, 2, 3, 4, 5], [6, 7, 8, 0, 2], [9, 4, 1, 7, 3], [1, 1, 2, 8, 5]]
    )


@settings(max_examples=60, deadline=None)
@given(
    text=st.text("0123456789.,;# \n\teE+-naif_é", max_size=40) | st.binary(max_size=40)
)
def test_no_text_raises_anything_else(text, tmp_path_factory):
    path = tmp_path_factory.mktemp("text") / "a.txt"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    try:
        heights = read(path, "9", "um").heights
    except InputError as refusal:
        assert "\n" not in str(refusal)  # noqa: PT017
    else:
        assert min(heights.shape) >= 2
        assert not np.isinf(heights).any()


@pytest.mark.usefixtures("here")
def test_a_hole_that_is_a_signalling_nan_is_a_hole(capsys):
    """Found by the fuzzer: arithmetic with it makes NumPy warn."""
    heights = np.arange(81.0).reshape(9, 9)
    heights.view("u8")[3, 3] = 0x7FF0000000000001
    np.save("surface.npy", heights)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert cli.main(["describe", "surface.npy", "--side", "9", "--fill"]) == 0
    assert "1 missing" in capsys.readouterr().out
