"""Text from microscopes' programs: headers are read, profiles and lists of points refused."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from gen import cli
from gen.measured.topography import Topography, read
from gen.runtime.errors import InputError

LINES = np.random.default_rng(2).normal(scale=1e-3, size=(3, 4))  # 3 lines of 4 pixels along x
NUMBERS = "\n".join("\t".join(repr(float(each)) for each in line) for line in LINES) + "\n"

GWYDDION = "# Channel: Topo\n# Width: 10.00 µm\n# Height: 6.00 µm\n# Value units: m\n"
SPIP = "# File Format = ASCII\n# x-pixels = 4\n# y-pixels = 3\n# x-length = 10000\n"
NOVA = "File Format = ASCII\nCreated by Nova\nNX = 4\nNY = 3\nScale X = 2.5\nScale Y = 2\n"
WSXM = "WSxM file copyright UAM\nWSxM ASCII Matrix file\nX Amplitude: 10 µm\nY Amplitude: 6 µm\n"
HEADERS = {
    "Gwyddion": (GWYDDION, 1e6),
    "two units": (GWYDDION.replace("6.00 µm", "6000 nm"), 1e6),
    "two units, Attocube": (
        "# x-length: 10\n# y-length: 6000\n# x-unit: um\n# y-unit: nm\n# z-unit: nm\n",
        1e-3,
    ),
    "German": ("# Kanal: Topo\n# Breite: 10,00 µm\n# Höhe: 6,00 µm\n# Einheiten: m\n", 1e6),
    "French": (
        "# Canal : Topo\n# Largeur : 10.0 µm\n# Hauteur : 6 µm\n# Unités : nm\n",
        1e-3,
    ),
    "Japanese": ("# チャネル： Topo\n# 幅: 10 µm\n# 高さ： 6 µm\n# 値の単位: m\n", 1e6),
    "SPIP": (SPIP + "# y-length = 6000\n# z-unit = um\n# Start of Data:\n", 1.0),
    "SPIP without a unit": (SPIP + "# y-length = 6000\n# Bit2nm = 0.5\n", 5e-4),
    "Attocube": ("# x-length: 10\n# y-length: 6\n# x-unit: um\n# z-unit: nm\n", 1e-3),
    "Nova": (
        NOVA + "Unit X = um\nUnit Data = nm\nStart of Data :\n",
        1e-3,
    ),
}


def written(folder: Path, content: str, encoding: str = "utf-8") -> Path:
    (folder / "scan.txt").write_text(content, encoding=encoding)
    return folder / "scan.txt"


def same(topography: Topography, um: float) -> None:
    """4 x 3 pixels on 10 x 6 um, x along the lines, heights in units of so many um."""
    assert topography.sides == pytest.approx((7.5, 4.0))
    np.testing.assert_allclose(topography.heights, um * LINES.T, rtol=1e-12)
    assert not topography.warnings


@pytest.mark.parametrize(("header", "um"), HEADERS.values(), ids=HEADERS)
def test_headers_state_lengths_and_units(tmp_path: Path, header: str, um: float) -> None:
    same(read(written(tmp_path, header + NUMBERS)), um)


def test_a_micro_sign_is_known_in_another_encoding(tmp_path: Path) -> None:
    same(read(written(tmp_path, GWYDDION + NUMBERS, encoding="latin-1")), 1e6)


def test_a_header_that_is_read_is_not_contradicted(tmp_path: Path) -> None:
    scan = written(tmp_path, GWYDDION + NUMBERS)
    same(read(scan, "7.5,4", "m"), 1e6)
    for wrong in (("10", ""), ("", "nm")):
        with pytest.raises(InputError, match="or overrule the file by --override-scale"):
            read(scan, *wrong)
    overruled = read(scan, "10,10", "nm", override_scale=True)
    np.testing.assert_allclose(overruled.heights, 1e-3 * LINES.T, rtol=1e-12)
    assert overruled.sides == (10, 10)
    assert sum("OVERRULED" in step for step in overruled.steps) == 2
    assert len(overruled.warnings) == 2
    with pytest.raises(InputError, match="give --side, --unit or both"):
        read(scan, override_scale=True)


def test_concatenated_exports_are_channels(tmp_path: Path) -> None:
    other = GWYDDION.replace("Topo", "Phase").replace(": m", ": deg")
    zoom = GWYDDION.replace("Topo", "Zoom")
    scan = written(tmp_path, other + NUMBERS + "\n" + GWYDDION + NUMBERS + "\n" + zoom + NUMBERS)
    topography = read(scan)
    same(topography, 1e6)
    assert "channel 1 'Topo' (not 0 'Phase' (in deg, no heights), 2 'Zoom')" in topography.steps[0]
    for wanted in ("Zoom", "2"):
        assert "channel 2 'Zoom'" in read(scan, channel=wanted).steps[0]
    holds = "holds 0 'Phase' .in deg, no heights., 1 'Topo', 2 'Zoom'"
    for wanted, why in (
        ("Top", "no such channel"),
        ("9", "no such"),
        ("Phase", "holds no heights"),
    ):
        with pytest.raises(InputError, match=f"--channel '{wanted}': {why}.*{holds}"):
            read(scan, channel=wanted)
    with pytest.raises(InputError, match="several channels have this name; give an index"):
        read(written(tmp_path, 2 * (GWYDDION + NUMBERS)), channel="Topo")
    with pytest.raises(InputError, match="holds no heights; its channels are 0 'Phase'"):
        read(written(tmp_path, other + NUMBERS))


@pytest.mark.parametrize(
    ("header", "message"),
    [
        (
            GWYDDION.replace("µm", "ft"),
            "unit of lengths 'ft': give --side with --override-scale, or .* in one of m, cm, mm",
        ),
        (GWYDDION.replace("# Value units: m\n", ""), "names no unit; give --unit"),
        (WSXM + "Z Amplitude: 2 nm\n", "names no unit; give --unit"),
        (SPIP.replace("= 4", "= 5"), "its header states . lines of 5 numbers, it holds 3 of 4"),
        (NOVA + "Unit X = um\nDataScaleNeeded = Yes\n", "numbers are to be scaled"),
        ("# scan 10 x 6 µm, 16 bit\n", "give --side, .* .it says 'scan 10 x 6 µm, 16 bit'"),
        ("# Width: 10 µm\n", "give --side, .* .it says 'width: 10 µm'"),
    ],
)
def test_what_a_header_lacks_is_asked_for(tmp_path: Path, header: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        read(written(tmp_path, header + NUMBERS))


def test_remarks_that_are_not_read_are_told(tmp_path: Path) -> None:
    [warning] = read(written(tmp_path, "# heights in nm\n" + NUMBERS), "9,9").warnings
    assert "the file says 'heights in nm', which is not read" in warning
    transposed = written(tmp_path, "# nx = 3\n# ny: 4\n# NX, NY: a grid\n" + NUMBERS)
    assert read(transposed, "9,9").heights.shape == (3, 4)
    assert not read(written(tmp_path, "# from a profilometer\n" + NUMBERS), "9,9").warnings


X, Y = (axis.ravel() for axis in np.mgrid[:9, :9])
LISTS = {
    "profile": np.column_stack([np.linspace(0, 5, 10_001), np.zeros(10_001)]),
    "short profile": np.column_stack([np.arange(4), np.zeros(4)]),
    "doubled points": np.column_stack([X, Y, np.zeros(81)])[[*range(81), 4]],
    "scattered points": np.random.default_rng(0).normal(size=(200, 3)),
    "profile in rows": np.array([np.arange(9), np.zeros(9)]),
}


@pytest.mark.parametrize("numbers", LISTS.values(), ids=LISTS)
def test_profiles_and_lists_of_points_are_refused(tmp_path: Path, numbers: np.ndarray) -> None:
    np.savetxt(tmp_path / "list.txt", numbers, fmt="%g")
    np.save(tmp_path / "list.npy", numbers)
    what = "a profile, x and z" if min(numbers.shape) == 2 else "a list of points, x, y and z"
    for name in ("list.txt", "list.npy"):
        with pytest.raises(InputError, match=f"looks like {what}.*; give the heights as a grid"):
            read(tmp_path / name, "9")


def test_names_of_columns_are_told_and_strips_of_maps_are_read(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="x, z: looks like the columns of a profile"):
        read(written(tmp_path, "x,z\n0,1\n"), "9")
    for shape in ((2, 2), (3, 3), (3, 2), (2, 3), (7, 2), (40, 3), (3, 40)):
        np.save(tmp_path / "strip.npy", np.random.default_rng(3).normal(size=shape))
        assert read(tmp_path / "strip.npy", "9,9").heights.shape == shape


def test_overruled_scales_and_pressures_are_told_everywhere(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    surface = str(written(tmp_path, GWYDDION + NUMBERS))
    scale = ["--side", "90,90", "--unit", "mm", "--override-scale"]
    table = tmp_path / "law.csv"
    soft, steel = ["--delta", "0.5"], ["--delta", "0.001,0.5", "--e-star", "2e5"]
    expected = ((soft, 2), ([*soft, "--e-star", "2e5"], 3), (steel, 3))
    for load, count in expected:
        assert cli.main(["contact", surface, *scale, *load, "--csv", str(table)]) == 0
        said = capsys.readouterr()
        warnings = [line for line in said.err.splitlines() if line.startswith("warning: ")]
        overruled = [line for line in warnings if "own scale is overruled" in line]
        yielding = [line for line in warnings if "above E*/100 = 2000 MPa" in line]
        assert (len(overruled), len(overruled) + len(yielding)) == (2, count)
        assert said.out.count("OVERRULED") == 2
        row = pd.read_csv(table).iloc[-1]
        assert row.warnings.count("overruled") == row.prepared.count("OVERRULED") == 2
        assert row.warnings.count("E*/100") == len(yielding)
    assert cli.main(["describe", surface, *scale, "--csv", str(table)]) == 0
    assert pd.read_csv(table).warnings[0].count("overruled") == 2
