"""Strange text files: read rightly, or refused in one line that names what is wrong."""

import io
import pickle
import re
import struct
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gen import cli
from gen.maps.scan import Scan, arrange
from tests.maps import read

RANDOM = np.random.default_rng(11)
NX, NY = 12, 9
DX, DY = 0.5, 0.25  # um
HEIGHTS = RANDOM.normal(scale=0.05, size=(NX, NY)).round(6)  # um
GAPS = HEIGHTS.copy()
GAPS[[2, 7, 11], [0, 4, 8]] = np.nan
X, Y = DX * np.arange(NX), 3 + DY * np.arange(NY)
POINTS = np.stack([*np.meshgrid(X, Y, indexing="ij"), HEIGHTS], axis=-1).reshape(-1, 3)
MEASURED = POINTS[~np.isnan(GAPS).reshape(-1)]
ROUGH = RANDOM.normal(size=(35, 34)).round(3)
LARGE = np.stack([*np.mgrid[:35, :34].astype(float), ROUGH], axis=-1)
LARGE = LARGE.reshape(-1, 3)
AXES = np.block([[np.zeros((1, 1)), X[None]], [Y[:, None], HEIGHTS.T]])
NUMBERED = np.block(
    [[np.zeros((1, 1)), np.arange(NX)[None]], [np.arange(NY)[:, None], HEIGHTS.T]]
)
MATRIX = HEIGHTS.T  # x along the lines, as under headers


def rows(numbers, separator=" ", number="{:.6f}", end="\n"):
    return "".join(separator.join(map(number.format, row)) + end for row in numbers)


def comma(text):
    return text.replace(".", ",")


def npy(array):
    stream = io.BytesIO()
    np.save(stream, array, allow_pickle=True)
    return stream.getvalue()


def header(width="6 um", height="2.25 um", unit="um"):
    return f"# Width: {width}\n# Height: {height}\n# Value units: {unit}\n"


@dataclass
class Strange:
    """A file with what is given to read it, and what has to come of it: heights or a message."""

    content: str | bytes
    expected: np.ndarray | str
    given: dict[str, Any] = field(default_factory=dict)
    suffix: str = ".txt"
    pixel: tuple[float, float] = (DX, DY)


UM = {"unit": "um"}
SIDE = {"side": f"{DX * (NX - 1)},{DY * (NY - 1)}"}
OVER = {"unit": "um", "override_scale": True}
SHUFFLED = RANDOM.permutation(MEASURED)
JITTERED = LARGE + RANDOM.normal(scale=0.1, size=LARGE.shape)
DOUBLED = np.concatenate([LARGE, LARGE[5:9]])
QUALITY = np.column_stack([LARGE, RANDOM.random(len(LARGE))])
COUNTED = np.column_stack([np.arange(len(MEASURED)), MEASURED])
ROUNDED = np.column_stack([(LARGE[:, :2] / 3).round(3), LARGE[:, 2]])
ROUNDED_OFF = np.column_stack([(LARGE[:, :2] * 0.65).round(1), LARGE[:, 2]])
NPY = npy(np.eye(4))
TERABYTES = NPY.replace(
    b"(4, 4), }" + b" " * 12, b"(9999999, 9999999), }"
)  # header as long
TIFF = b"II*\0\x08" + bytes(9)
DAMAGED = TIFF[:5] + bytes(3) + struct.pack("<HHHII", 1, 256, 4, 1000, 30) + bytes(4)
MICROSCOPE = "Topography of a plate\nexported by the microscope\n"
LIST = "looks like a list of points, x, y and z"
FILES = {
    # Lists of points.
    "points": Strange(rows(POINTS), HEIGHTS, UM),
    "points with gaps": Strange(rows(MEASURED), GAPS, UM),
    "points in any order": Strange(rows(SHUFFLED), GAPS, UM, ".xyz"),
    "points with rounded coordinates": Strange(
        rows(ROUNDED, number="{:.3f}"),
        LARGE[:, 2].reshape(35, 34),
        UM,
        pixel=(1 / 3, 1 / 3),
    ),
    "points rounded too much": Strange(
        rows(ROUNDED_OFF, number="{:.1f}"), f"{LIST}, on no reg", UM
    ),
    "jittered points": Strange(rows(JITTERED), f"{LIST}, on no regular grid within 2 %"),
    "doubled points": Strange(
        rows(DOUBLED), f"{LIST}, 4 of which lie where others do", UM
    ),
    "points and quality": Strange(
        rows(QUALITY), "a list of points with 4 numbers each", UM
    ),
    "numbered points": Strange(rows(COUNTED), GAPS, UM),
    "a profile": Strange(
        rows(LARGE[:, 1:]), "looks like a profile, x and z", SIDE, ".xyz"
    ),
    # Names of columns, with units.
    "z first": Strange("z y x\n" + rows(MEASURED[:, ::-1]), GAPS, UM),
    "units of x and y": Strange(
        "x [mm],y [um],z [um]\n" + rows(MEASURED, ","),
        "has x in mm and y in um; give both",
    ),
    "units in a comment": Strange(
        "# x (um), y (um), z (um)\n" + rows(MEASURED), GAPS, {}, ".xyz"
    ),
    "words above points": Strange(MICROSCOPE + rows(MEASURED), GAPS, UM, ".xyz"),
    "names of a profile": Strange(
        "x in um,z in um\n1,2\n2,3\n", "columns of a profile", SIDE
    ),
    # Coordinates in the first row and column.
    "coordinates": Strange(rows(AXES, ","), HEIGHTS, UM, ".csv"),
    "coordinates and a blank corner": Strange(rows(AXES, ",")[8:], HEIGHTS, UM, ".csv"),
    "coordinates from above": Strange(
        rows(AXES[[0, *range(NY, 0, -1)]]), HEIGHTS, UM, ".prn"
    ),
    "numbers of rows and columns": Strange(rows(NUMBERED, ","), HEIGHTS, SIDE, ".csv"),
    "coordinates in one column": Strange(
        rows(AXES[1:]), "first row holds no coordinates", SIDE
    ),
    "numbers of narrow rows": Strange(
        ",a,b,c\n"
        + rows(np.column_stack([np.arange(20), RANDOM.normal(size=(20, 3))]), ","),
        "first column evenly spaced coordinates",
        SIDE,
    ),
    "coordinates in one row": Strange(rows(AXES[:, 1:]), "column no coordinates", SIDE),
    # Encodings, decimal commas, ends of lines.
    "UTF-16 without a mark": Strange(
        (header() + rows(MATRIX)).encode("utf-16-le"), HEIGHTS
    ),
    "Latin letters": Strange(
        header("6 µm", "2.25 µm", "µm").encode("latin-1") + rows(MATRIX).encode(), HEIGHTS
    ),
    "decimal commas": Strange(comma(header()) + comma(rows(MATRIX, ";")), HEIGHTS),
    "decimal commas between commas": Strange(
        comma(rows(MATRIX, ";")).replace(";", ","),
        "line 1: .* look like decimal commas",
        SIDE,
    ),
    "zeros in front of numbers": Strange(
        8 * "05,02,09,04,01,03,08,07\n", "no lengths; give --side", {}, ".csv"
    ),
    "CR": Strange((header() + rows(MATRIX)).replace("\n", "\r").encode(), HEIGHTS),
    "a scale in words": Strange(
        "pixel size=3e-7 m\n" + rows(MATRIX), "belongs to a header", SIDE
    ),
    # What holds no heights.
    "npy cut off": Strange(NPY[:-9], r"not a whole \.npy file \(", SIDE, ".npy"),
    "npy that claims terabytes": Strange(
        TERABYTES, r"not a whole \.npy file", SIDE, ".npy"
    ),
    "npy of objects": Strange(npy([{}, 1]), "Object arrays", SIDE, ".npy"),
    "pickle": Strange(
        pickle.dumps([[1.0], [3.0]]), r"not a whole \.npy file", SIDE, ".npy"
    ),
    "commas of thousands": Strange(
        "1,500,000;2\n3;4\n", "line 1: '1,500,000' is not", SIDE
    ),
    "a gap": Strange("1,2,3\n4,,6\n", "line 2: '' is not a number", SIDE, ".csv"),
    "ragged": Strange(
        "1;2;3;\n\n4;5;\n", "line 3: 2 numbers where the first row has 3", SIDE
    ),
    "HDF5": Strange(
        b"\x89HDF\r\n\x1a\n\0\0", r"as Hierarchical .* \(HDF5\): ", SIDE, ".h5"
    ),
    "empty file": Strange(b"", "is empty; give a file", SIDE, ".x3p"),
    "cut sur": Strange(b"DIGITAL SURF" + bytes(9), "SUR: .*truncated", SIDE, ".sur"),
    "damaged tif": Strange(DAMAGED, "as Park Systems TIFF: ", SIDE, ".tif"),
    "unknown": Strange(
        bytes(range(256)), "no reader of .* knows its format", SIDE, ".bin"
    ),
    # Units.
    "micron": Strange(
        header("6 micron", "2.25 microns", "Micron") + rows(MATRIX), HEIGHTS
    ),
    "unknown unit": Strange(
        header(unit="mil") + rows(MATRIX), "holds no heights; .* .in mil, no"
    ),
    "unknown unit, overruled": Strange(header(unit="mil") + rows(MATRIX), HEIGHTS, OVER),
}


@pytest.mark.parametrize("name", FILES)
def test_strange_files_are_read_rightly_or_refused_by_name(
    tmp_path, refused, caplog, name
):
    strange = FILES[name]
    path = tmp_path / f"scan{strange.suffix}"
    content = strange.content
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    if isinstance(strange.expected, np.ndarray):
        topography = read(path, **strange.given)
        np.testing.assert_allclose(
            topography.heights, strange.expected, rtol=1e-5, atol=1e-9
        )
        assert topography.spacing == pytest.approx(strange.pixel, rel=1e-4)
        return
    options = [
        part for option, value in strange.given.items() for part in (f"--{option}", value)
    ]
    said = refused(cli, "describe", path, *options)
    assert said.startswith(f"gen: {path}")
    assert re.search(strange.expected, said)
    assert not caplog.records


@settings(max_examples=60, deadline=None)
@given(
    nx=st.integers(2, 30),
    ny=st.integers(2, 30),
    step=st.floats(1e-3, 1e3),
    start=st.floats(-1e4, 1e4),
    seed=st.integers(0, 9),
    gaps=st.floats(0, 0.2),
)
def test_points_on_any_grid_become_the_map_they_were_taken_from(
    nx, ny, step, start, seed, gaps
):
    random = np.random.default_rng(seed)
    heights = random.normal(size=(nx, ny))
    kept = random.random((nx, ny)) >= gaps
    kept[:, 0] = kept[0] = True  # the whole extent
    x, y = np.mgrid[:nx, :ny]
    columns = np.column_stack(
        [start + step * x[kept], 7 - 3 * step * y[kept], heights[kept]]
    )
    table = Scan(random.permutation(columns), names=("x", "y", "z"))
    found = arrange(Path("points.txt"), table)
    assert found.widths == pytest.approx((step * nx, 3 * step * ny), rel=1e-6)
    np.testing.assert_array_equal(found.heights, np.where(kept, heights, np.nan)[:, ::-1])


@settings(max_examples=100, deadline=None)
@given(
    shape=st.tuples(st.integers(2, 40), st.integers(2, 40)),
    hurst=st.floats(0, 1),
    tilt=st.floats(-3, 3),
    seed=st.integers(0, 99),
)
def test_rough_maps_are_not_taken_for_coordinates(shape, hurst, tilt, seed):
    """Tilted walks are as smooth along the lines as any rough surface."""
    random = np.random.default_rng(seed)
    steps = random.normal(size=shape)
    heights = hurst * np.cumsum(np.cumsum(steps, axis=0), axis=1) + (1 - hurst) * steps
    heights += tilt * np.arange(shape[1])
    if min(shape) < 4:
        return
    assert arrange(Path("map.txt"), Scan(heights)).heights is heights


def test_smooth_maps_are_maps():
    x, y = np.mgrid[-10:11.0, -10:11.0]
    noisy = x + 2 * y + RANDOM.normal(scale=0.01, size=x.shape)
    levels = RANDOM.integers(0, 4, size=(8, 5)).astype(float)
    smooth = (x, y, x + y, 2 * x - y, x * x + y * y, x * y, np.abs(x), 0 * x, np.sin(x))
    for heights in (*smooth, noisy, noisy[::-1].T, np.maximum(x, y), levels, levels.T):
        assert arrange(Path("map.npy"), Scan(heights)).heights is heights
