"""Maps read from files: heights and lengths in um, what is missing, what is contradicted."""

import re
import struct
import zipfile

import numpy as np
import pytest
from launch import python
from scipy.io import savemat

from bem.problem import BOUNDARIES, node_spacing
from gen.maps.prepare import prepare
from gen.maps.settings import Reading
from gen.runtime.errors import InputError
from gen.runtime.installation import command_for
from tests.maps import read

SurfaceTopography = pytest.importorskip(
    "SurfaceTopography", reason="needs the extra instruments"
)

HEIGHTS = np.random.default_rng(5).normal(size=(7, 5))  # um; oblong, odd and even
HOLES = np.zeros(HEIGHTS.shape, dtype=bool)
HOLES[2, 3] = HOLES[5, 0] = True
HIGHEST = float(HEIGHTS[~HOLES].max())
PIXEL = 2.0, 0.5  # um


def written(path, unit, per_um):
    """HEIGHTS with HOLES as SurfaceTopography's own writers put them into a file."""
    sizes = tuple(
        nodes * pixel * per_um for nodes, pixel in zip(HEIGHTS.shape, PIXEL, strict=True)
    )
    masked = np.ma.array(HEIGHTS * per_um, mask=HOLES)
    topography = SurfaceTopography.Topography(masked, sizes, unit=unit)
    write = {
        ".x3p": topography.to_x3p,
        ".gwy": topography.to_gwy,
        ".nc": topography.to_netcdf,
    }
    write[path.suffix](str(path))
    return path


@pytest.mark.parametrize("suffix", [".x3p", ".gwy", ".nc"])
@pytest.mark.parametrize(("unit", "per_um"), [("nm", 1e3), ("um", 1.0), ("m", 1e-6)])
@pytest.mark.filterwarnings("ignore:Cannot close a netcdf_file:RuntimeWarning")
def test_files_give_back_heights_and_lengths_in_um(tmp_path, suffix, unit, per_um):
    topography = read(written(tmp_path / f"scan{suffix}", unit, per_um))
    assert topography.sides == pytest.approx((6 * 2.0, 4 * 0.5), rel=1e-6)
    assert topography.spacing == pytest.approx(PIXEL, rel=1e-6)
    assert topography.missing == 2
    expected = np.where(HOLES, np.nan, HEIGHTS)
    np.testing.assert_allclose(topography.heights, expected, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("boundary", BOUNDARIES)
def test_the_size_of_a_pixel_is_that_of_the_file_whatever_the_boundary(
    tmp_path, boundary
):
    topography = read(written(tmp_path / "scan.nc", "nm", 1e3), boundary=boundary)
    assert topography.spacing == pytest.approx(PIXEL, rel=1e-6)
    np.save(tmp_path / "bare.npy", HEIGHTS)
    bare = read(tmp_path / "bare.npy", "14,2.5", boundary=boundary)
    for found in (topography, bare):
        assert found.boundary == boundary
        for axis, nodes in enumerate(HEIGHTS.shape):
            assert found.spacing[axis] == node_spacing(nodes, found.sides[axis], boundary)


def test_a_unit_is_asked_for_where_the_file_names_none(tmp_path):
    scan = written(tmp_path / "scan.nc", None, 1e3)
    with pytest.raises(InputError, match="names no unit; give --unit"):
        read(scan)
    assert read(scan, unit="nm").sides == pytest.approx((12.0, 2.0))
    with pytest.raises(InputError, match="--unit 'ft': give one of m, cm, mm"):
        read(scan, unit="ft")


@pytest.mark.parametrize(
    ("heights", "message"),
    [
        (np.full((4, 4), np.nan), "all of its 16 heights are missing"),
        (np.array([[1.0, np.inf], [0.0, 1.0]]), "1 of 4 heights are infinite"),
        (np.full((3, 3), -1e70), r"heights of 1e\+70 um; check their unit"),
    ],
)
def test_what_is_no_surface_is_refused(tmp_path, heights, message):
    np.save(tmp_path / "scan.npy", heights)
    with pytest.raises(InputError, match=message):
        prepare(read(tmp_path / "scan.npy", "9"), Reading())


def test_without_the_extra_the_message_names_it(tmp_path):
    program = (
        "import sys; sys.modules['SurfaceTopography'] = None\n"
        "from gen.cli import main; sys.exit(main(['describe', 'scan.x3p']))"
    )
    (tmp_path / "scan.x3p").write_bytes(b"PK\3\4")
    run = python("-c", program, folder=tmp_path)
    assert run.returncode == 2
    assert run.stderr.strip().endswith(
        f"without SurfaceTopography: {command_for('instruments')}"
    )


def test_a_line_scan_is_refused_by_name(tmp_path):
    path = tmp_path / "line.nc"
    SurfaceTopography.UniformLineScan(np.arange(9.0), 8.0, unit="um").to_netcdf(str(path))
    with pytest.raises(InputError, match=r"line\.nc: it holds line scans only"):
        read(path)


@pytest.fixture
def two(tmp_path):
    """A file with two channels of heights."""
    path = tmp_path / "two.mat"
    savemat(path, {"front": HEIGHTS, "back": -HEIGHTS})
    return path


def test_the_first_channel_is_read_and_the_others_are_named(two):
    assert "channel 0 'front' (not 1 'back')" in read(two, "12,2", "um").steps[0]


@pytest.mark.parametrize("channel", ["back", "1"])
def test_a_channel_is_chosen_by_name_or_index(two, channel):
    topography = read(two, "12,2", "um", channel=channel)
    np.testing.assert_array_equal(topography.heights, -HEIGHTS)
    assert "channel 1 'back' (not 0 'front')" in topography.steps[0]


def test_an_unknown_channel_is_refused_with_those_of_the_file(two):
    message = r"'side': no such channel; .* holds 0 'front', 1 'back'"
    with pytest.raises(InputError, match=message):
        read(two, "12,2", "um", channel="side")


@pytest.mark.parametrize(
    ("replaced", "message"),
    [
        (
            (b"ISO5436 - 2000", b"ISO 25178"),
            r"as XML 3D .*: CorruptFile.*Revision should be ",
        ),
        ((b"<SizeX>9<", b"<SizeX>0<"), "holds 0 x 7; give 2-D heights"),
    ],
)
def test_a_damaged_x3p_is_refused_with_the_reason(tmp_path, replaced, message):
    with pytest.raises(InputError, match=message):
        read(x3p(tmp_path / "scan.x3p", replaced))


@pytest.fixture
def in_metres(tmp_path):
    """A file whose um are written as m: its nodes are 2 m and 0.5 m apart."""
    return written(tmp_path / "scan.nc", "m", 1.0)


@pytest.mark.parametrize("wrong", [{"side": "1000,200"}, {"unit": "um"}])
def test_a_scale_that_contradicts_the_file_is_refused(in_metres, wrong):
    with pytest.raises(InputError, match="or overrule the file by --override-scale"):
        read(in_metres, **wrong)


def test_lengths_of_the_file_can_be_overruled(in_metres):
    topography = read(in_metres, "1000,200", override_scale=True)
    assert topography.sides == (1000, 200)
    assert np.nanmax(topography.heights) == pytest.approx(1e6 * HIGHEST)
    assert (
        "OVERRULED by --override-scale: 1.2e+07 x 2e+06 um, taken as 1000 x 200 um"
        in topography.steps
    )


def test_the_unit_of_the_file_can_be_overruled(in_metres):
    topography = read(in_metres, unit="um", override_scale=True)
    assert topography.sides == pytest.approx((12, 2))
    assert np.nanmax(topography.heights) == pytest.approx(HIGHEST)
    warning = "the file's own scale is overruled: unit m, taken as um"
    assert topography.warnings == (warning,)


def test_the_unit_of_the_file_itself_overrules_nothing(in_metres):
    warnings = read(in_metres, unit="m", override_scale=True).warnings
    assert not any("overruled:" in warning for warning in warnings)


SMOOTH = np.random.default_rng(4).normal(scale=0.1, size=(9, 7))  # um
DASH = "ISO5436 \N{EN DASH} 2000".encode()


def nms(path, step, lowest, highest):
    """Write SMOOTH as NanoFocus does: 16-bit numbers behind a header with the spacing in nm."""
    header = bytearray(3468)
    header[:16] = struct.pack("<4i", 2, 1, 0, 65535)
    struct.pack_into("<2d", header, 16, lowest, highest)
    struct.pack_into("<2I2d", header, 1368, *SMOOTH.shape, step, step)
    numbers = np.rint((SMOOTH.T - lowest) / (highest - lowest) * (2**16 - 2)).astype(
        "<u2"
    )
    path.write_bytes(bytes(header) + numbers.tobytes())
    return path


@pytest.mark.parametrize("lowest", [-1.1, float(np.float32(-1.7))])
def test_nanofocus_files_have_their_spacing_in_nm(tmp_path, lowest):
    """A reader of files of MATLAB takes the second one for its own, without channels."""
    topography = read(nms(tmp_path / "scan.nms", 312.5, lowest, 1.0))
    assert topography.spacing == pytest.approx((0.3125, 0.3125))
    np.testing.assert_allclose(topography.heights, SMOOTH, atol=2e-5)
    assert "spacing in its header in nm" in topography.steps[0]
    assert not topography.warnings


@pytest.fixture
def wide(tmp_path):
    """A file whose nodes are 1 m apart."""
    path = tmp_path / "wide.nc"
    SurfaceTopography.Topography(SMOOTH, (9e6, 7e6), unit="um").to_netcdf(str(path))
    return path


def test_nodes_that_no_instrument_measures_are_named(wide):
    [warning] = read(wide).warnings
    assert warning.startswith(
        "its nodes are 1e+06 um apart, which no instrument measures"
    )


def test_nodes_whose_distance_is_overruled_are_not_named(wide):
    warnings = read(wide, "8,6", override_scale=True).warnings
    assert all("overruled" in warning for warning in warnings)


def test_heights_that_no_instrument_measures_are_named(tmp_path):
    high = SurfaceTopography.Topography(1e6 * SMOOTH, (9.0, 7.0), unit="um")
    high.to_netcdf(str(tmp_path / "high.nc"))
    [warning, *_] = prepare(read(tmp_path / "high.nc"), Reading()).warnings
    assert re.match(r"its heights span \S+ um, which no instrument", warning)


def x3p(path, replaced=(b"", b""), folder=""):
    """Write SMOOTH as x3p; replace a text in the XML, and put the entries into a folder."""
    plain = path.with_name("plain.x3p")
    SurfaceTopography.Topography(SMOOTH, (9.0, 7.0), unit="um").to_x3p(str(plain))
    with zipfile.ZipFile(plain) as archive, zipfile.ZipFile(path, "w") as other:
        for name in archive.namelist():
            content = archive.read(name)
            if name == "main.xml":
                content = content.replace(*replaced)
            other.writestr(folder + name, content)
    return path


def test_x3p_of_other_programs_is_read(tmp_path):
    topography = read(x3p(tmp_path / "scan.x3p", (b"ISO5436 - 2000", DASH), "a/b/"))
    np.testing.assert_allclose(topography.heights, SMOOTH, rtol=1e-9)
    assert topography.spacing == pytest.approx((1, 1))
    remark = "its entries lie in the folder 'a/b' and its revision is written with another dash"
    assert f"({remark})" in topography.steps[0]


def test_a_text_of_an_archive_that_is_too_long_to_be_one_is_not_parsed(tmp_path):
    """Some kB hold hundreds of MB of a comment."""
    comment = b"<!--" + bytes(5 * 2**20).replace(b"\0", b"-") + b"-->"
    path = x3p(tmp_path / "scan.x3p", (b"</Record1>", b"</Record1>" + comment))
    with pytest.raises(
        InputError, match=r"scan\.x3p: its text main\.xml has 5\.2 MB; at most 4"
    ):
        read(path)


def test_members_that_are_too_large_for_their_archive_are_not_unpacked(tmp_path):
    path = x3p(tmp_path / "scan.x3p")
    with zipfile.ZipFile(path, "a", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("zeros", bytes(70 * 2**20))
    with pytest.raises(
        InputError, match=r"holds 73\.4 MB in a file of .* kB; at most 67\.1 MB"
    ):
        read(path)


def test_maps_that_are_too_large_for_their_file_are_not_read(tmp_path, monkeypatch):
    """Any format, also one that packs its numbers in its own way."""
    monkeypatch.setattr("gen.maps.instruments.LARGEST", 100)
    monkeypatch.setattr("gen.maps.instruments.PACKED", 0.01)
    for suffix in (".nc", ".gwy"):
        path = tmp_path / f"scan{suffix}"
        write = {".gwy": "to_gwy", ".nc": "to_netcdf"}[suffix]
        getattr(SurfaceTopography.Topography(SMOOTH, (9.0, 7.0), unit="um"), write)(
            str(path)
        )
        with pytest.raises(InputError, match="holds 504 bytes in a file of"):
            read(path)
