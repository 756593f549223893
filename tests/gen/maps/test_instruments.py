"""Files that SurfaceTopography reads wrongly or refuses, and the reasons that are told."""

import re
import struct
import zipfile
from pathlib import Path

import numpy as np
import pytest

from gen import cli
from gen.runtime.errors import InputError
from tests.maps import read

SurfaceTopography = pytest.importorskip("SurfaceTopography", reason="needs the extra instruments")

HEIGHTS = np.random.default_rng(4).normal(scale=0.1, size=(9, 7))  # um
DASH = "ISO5436 \N{EN DASH} 2000".encode()


def nms(path: Path, step: float, lowest: float, highest: float) -> Path:
    """Write HEIGHTS as NanoFocus does: 16-bit numbers behind a header with the spacing in nm."""
    header = bytearray(3468)
    header[:16] = struct.pack("<4i", 2, 1, 0, 65535)
    struct.pack_into("<2d", header, 16, lowest, highest)
    struct.pack_into("<2I2d", header, 1368, *HEIGHTS.shape, step, step)
    numbers = np.rint((HEIGHTS.T - lowest) / (highest - lowest) * (2**16 - 2)).astype("<u2")
    path.write_bytes(bytes(header) + numbers.tobytes())
    return path


@pytest.mark.parametrize("lowest", [-1.1, float(np.float32(-1.7))])
def test_nanofocus_files_have_their_spacing_in_nm(tmp_path: Path, lowest: float) -> None:
    """A reader of files of MATLAB takes the second one for its own, without channels."""
    topography = read(nms(tmp_path / "scan.nms", 312.5, lowest, 1.0))
    assert topography.spacing == pytest.approx((0.3125, 0.3125))
    np.testing.assert_allclose(topography.heights, HEIGHTS, atol=2e-5)
    assert "spacing in its header in nm" in topography.steps[0]
    assert not topography.warnings


def test_the_number_that_is_absurd_is_named(tmp_path: Path) -> None:
    wide = SurfaceTopography.Topography(HEIGHTS, (9e6, 7e6), unit="um")
    wide.to_netcdf(str(tmp_path / "wide.nc"))
    [said] = read(tmp_path / "wide.nc").warnings
    assert said.startswith("its nodes are 1e+06 um apart, which no instrument measures")
    high = SurfaceTopography.Topography(1e6 * HEIGHTS, (9.0, 7.0), unit="um")
    high.to_netcdf(str(tmp_path / "high.nc"))
    [said] = read(tmp_path / "high.nc").warnings
    assert re.match(r"its heights span \S+ um, which no instrument", said)
    scale = {"side": "8,6", "override_scale": True}
    assert all("overruled" in said for said in read(tmp_path / "wide.nc", **scale).warnings)


def x3p(path: Path, replaced: tuple[bytes, bytes] = (b"", b""), folder: str = "") -> Path:
    """Write HEIGHTS as x3p; replace a text in the XML, and put the entries into a folder."""
    plain = path.with_name("plain.x3p")
    SurfaceTopography.Topography(HEIGHTS, (9.0, 7.0), unit="um").to_x3p(str(plain))
    with zipfile.ZipFile(plain) as archive, zipfile.ZipFile(path, "w") as other:
        for name in archive.namelist():
            content = archive.read(name)
            if name == "main.xml":
                content = content.replace(*replaced)
            other.writestr(folder + name, content)
    return path


@pytest.mark.parametrize(
    ("replaced", "folder", "remark"),
    [
        ((b"ISO5436 - 2000", DASH), "", "its revision is written with another dash"),
        ((b"ISO5436 - 2000", b"ISO5436-2000"), "", "its revision is written with another dash"),
        ((b"", b""), "scan 1/", "its entries lie in the folder 'scan 1'"),
        (
            (b"ISO5436 - 2000", DASH),
            "a/b/",
            "its entries lie in the folder 'a/b' and its revision is written with another dash",
        ),
    ],
)
def test_x3p_of_other_programs_is_read(
    tmp_path: Path, replaced: tuple[bytes, bytes], folder: str, remark: str
) -> None:
    topography = read(x3p(tmp_path / "scan.x3p", replaced, folder))
    np.testing.assert_allclose(topography.heights, HEIGHTS, rtol=1e-9)
    assert topography.spacing == pytest.approx((1, 1))
    assert f"({remark})" in topography.steps[0]


def test_a_harmless_x3p_has_no_remark(tmp_path: Path) -> None:
    assert read(x3p(tmp_path / "scan.x3p")).steps == (
        "read 9 x 7 nodes, lengths in m, 0 missing (0 %)",
    )


AS_X3P = r"SurfaceTopography cannot read it as XML 3D surface profile \(X3P\): "
TIFF = b"II*\0\x08\0\0\0\0\0\0\0\0\0"
DAMAGED = TIFF[:8] + struct.pack("<HHHII", 1, 256, 4, 1000, 30) + bytes(4)
FAULTS = {
    "another revision": (
        ".x3p",
        {"replaced": (b"ISO5436 - 2000", b"ISO 25178")},
        f"{AS_X3P}CorruptFile: Revision should be 'ISO5436 - 2000'",
    ),
    "empty map": (".x3p", {"replaced": (b"<SizeX>9<", b"<SizeX>0<")}, "holds 0 x 7 heights; give"),
    "no main.xml": (".x3p", {"folder": "no-"}, f"{AS_X3P}.*main.xml.* is missing"),
    "no zip": (".x3p", b"PK not a zip" * 99, f"{AS_X3P}.*valid ZIP"),
    "empty file": (".x3p", b"", "is empty; give a file"),
    "empty sur": (".sur", b"", "is empty; give a file"),
    "cut sur": (".sur", b"DIGITAL SURF" + bytes(9), "as Digital Surf SUR: .*truncated"),
    "cut di": (".di", b"\\*File list\r\n" + bytes(99), "as Bruker/Veeco/DI Nanoscope: "),
    "cut ibw": (".ibw", struct.pack("<h", 5) + bytes(99), "as Igor binary wave: "),
    "text in sur": (".sur", b"hello\nworld\n", "as Digital Surf SUR: .*expected value is 'DIGITAL"),
    "tif without a scale": (".tif", TIFF, "as Park Systems TIFF: .*not a Park Systems TIFF"),
    "damaged tif": (".tif", DAMAGED, "as Park Systems TIFF: "),
    "unknown": (".bin", bytes(range(256)), "no reader of SurfaceTopography knows its format"),
    "unknown text": (".log", b"1 2 3\n4 5 bang\n", "line 2: 'bang' is not a number"),
}


@pytest.mark.parametrize(("suffix", "content", "message"), FAULTS.values(), ids=FAULTS)
def test_the_reason_is_that_of_the_reader_of_the_suffix(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    caplog: pytest.LogCaptureFixture,
    suffix: str,
    content,
    message: str,
) -> None:
    path = tmp_path / f"scan{suffix}"
    if isinstance(content, bytes):
        path.write_bytes(content)
    else:
        x3p(path, **content)
    with pytest.raises(InputError, match=message) as refusal:
        read(path)
    assert "tried" not in str(refusal.value)
    assert "line scans" not in str(refusal.value)
    assert not caplog.records
    assert cli.main(["describe", str(path)]) == 2
    said = capsys.readouterr()
    assert (said.out, said.err.count("\n")) == ("", 1)
    assert said.err.startswith(f"gen: {path}")


def test_the_rule_for_points_stands_before_other_readers(tmp_path: Path) -> None:
    from scipy.io import savemat

    savemat(tmp_path / "points.mat", {"points": np.random.default_rng(1).normal(size=(300, 3))})
    with pytest.raises(InputError, match="looks like a list of points, x, y and z, on no"):
        read(tmp_path / "points.mat", "9", "um")
