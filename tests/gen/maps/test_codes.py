"""Codes for missing heights are named, and flat parts and coarse scales of surfaces are none."""

from dataclasses import replace

import numpy as np
import pytest

from bench.made_maps import MadeMap, surface
from gen import cli
from gen.maps.bodies import composite
from gen.maps.codes import find_codes
from gen.maps.prepare import prepare, surface_warnings
from gen.maps.read import Topography
from gen.maps.settings import Reading
from gen.runtime.errors import InputError
from tests.maps import read, rough_heights, warnings_of

CODES = (
    -1.0,
    0.0,
    -999.25,
    -9999.0,
    -32768.0,
    9999.0,
    99999.0,
    2147483647.0,
    1e38,
    -1e38,
    1.70141e38,
)
NODES = 80


def coded(code, offset=10.0, share=0.01):
    """A rough map [um] with a code at a share of its nodes, and its nodes with the code."""
    heights = rough_heights() + offset
    places = np.random.default_rng(1).choice(
        heights.size, int(share * heights.size), replace=False
    )
    heights.flat[places] = code
    return heights


def written(heights, path):
    if path.suffix == ".npy":
        np.save(path, heights)
    elif path.suffix == ".xyz":
        x, y = np.indices(heights.shape)
        np.savetxt(path, np.stack([x, y, heights], axis=-1).reshape(-1, 3), "%.9g")
    else:
        np.savetxt(path, heights, "%.9g", delimiter="," if path.suffix == ".csv" else " ")
    return path


@pytest.mark.few(2)
@pytest.mark.parametrize("suffix", [".txt", ".npy", ".xyz", ".csv"])
def test_codes_of_every_format_are_named_with_a_mask_that_takes_them_out(
    tmp_path, suffix
):
    for code in CODES:
        path = written(coded(code), tmp_path / f"scan{suffix}")
        scale = ("", "um") if suffix == ".xyz" else ("79", "")
        scan = read(path, *scale)
        [warning] = surface_warnings(prepare(scan, Reading()))
        assert warning.startswith(
            f"64 nodes (1 %) are at {code:.6g} um, the first is (1, 46)"
        )
        assert "--mask 8.9:11.1 makes holes of them, which --fill closes" in warning
        masked = prepare(scan, Reading(mask="8.9:11.1", fill=True))
        assert not surface_warnings(masked)
        assert "masked 64 nodes" in " ".join(masked.steps)


@pytest.mark.parametrize("offset", [0.0, 3.0, 440.0])
def test_codes_are_found_wherever_they_lie_beside_the_heights(offset):
    for code in CODES:
        [found] = find_codes(coded(code, offset))
        assert (found.value, found.number) == (code, 64)


def test_a_code_among_the_heights_is_named_without_a_mask():
    [warning] = warnings_of(coded(0.0, offset=0.0))
    assert "64 nodes (1 %) are at 0 um" in warning
    assert "write nan for them" in warning
    assert "--mask" not in warning


@pytest.mark.parametrize("nodes", [np.s_[20:28, 30:38], np.s_[17], np.s_[:, 70:]])
def test_codes_in_a_block_or_at_a_border_are_found(nodes):
    heights = rough_heights() + 10.0
    heights[nodes] = -1.0
    assert [found.value for found in find_codes(heights)] == [-1.0]


def test_codes_at_both_ends_have_one_mask():
    heights = coded(-32768.0)
    heights[40, 20:30] = 32767.0
    warnings = warnings_of(heights)
    assert len(warnings) == 2
    assert all("--mask 8.9:11.1 makes" in warning for warning in warnings)


def test_a_single_code_is_named_as_nanovea_writes_it():
    """One node of -1.0000 among 440 um with a tilt, four digits and no other fault."""
    heights = np.round(440.0 + rough_heights() + 0.01 * np.arange(NODES)[:, None], 4)
    heights[31, 7] = -1.0
    [warning] = warnings_of(heights)
    assert (
        "the lowest node (31, 7) is a pit, or stands for a missing height, at -1 um"
        in warning
    )
    assert "--mask 43" in warning
    assert "check the unit" not in warning


def test_what_the_command_follows_is_not_told():
    heights = coded(-9999.0)
    heights[5, 5] = 40.0
    assert not warnings_of(heights, Reading(mask="8:12", fill=True))
    assert not [
        line for line in warnings_of(heights, Reading(despike=7.0)) if "9999" in line
    ]


def test_a_code_in_another_unit_is_named_as_the_file_has_it(tmp_path):
    written(1e3 * coded(-9.999), tmp_path / "scan.txt")
    [warning] = prepare(read(tmp_path / "scan.txt", "79", "nm"), Reading()).warnings
    assert "are at -9.999 um (-9999 nm in the file)" in warning


def test_codes_beyond_numbers_are_refused_with_their_mask(tmp_path):
    path = written(coded(-1.7976931348623157e308), tmp_path / "scan.npy")
    with pytest.raises(
        InputError, match=r"first at the node \(1, 46\), .*: --mask 8.9:"
    ) as refusal:
        prepare(read(path, "79"), Reading())
    assert "unit" not in str(refusal.value)
    assert not prepare(read(path, "79"), Reading(mask="8.9:", fill=True)).warnings


HONED, TURNED = (
    surface(MadeMap(kind, 0, (200, 180), 0.5, 50.0)) for kind in ("honed", "turned")
)


@pytest.mark.parametrize("share", [3e-4, 0.003, 0.01, 0.1, 0.4, 0.7])
def test_flat_tops_and_bottoms_are_no_codes(share):
    """Plateau-honed maps, and those of an instrument that saturates at either end."""
    noise = np.random.default_rng(3).normal(size=(NODES, NODES))
    for heights in (HONED, TURNED, rough_heights(), rough_heights(cut_off=8.0), noise):
        top, bottom = np.quantile(heights, [1 - share, share])
        for clipped in (np.minimum(heights, top), np.maximum(heights, bottom)):
            assert not find_codes(clipped)
            assert not find_codes(np.round(clipped, 3))


@pytest.mark.parametrize("steps", [4, 16, 50, 256, 4096])
def test_steps_of_a_coarse_scale_are_no_codes(steps):
    for heights in (HONED, TURNED, rough_heights()):
        assert not find_codes(np.round(heights / np.ptp(heights) * steps))


COMMANDS = {
    "describe": "describe coded.npy --side 79",
    "contact": "contact coded.npy --side 79 --delta 0.1",
    "contact, second body": "contact clean.npy --against coded.npy --side 79 --delta 0.1",
    "law": "law coded.npy --side 79 --pressure 0.001,0.002 --e-star 1 --no-grid-error -o law",
    "scene": "scene coded.npy -o drafted.toml",
    "run": "run windows.toml -o windows.h5",
}


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_that_reads_maps_names_them(name, here, capsys, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(here))
    np.save("coded.npy", coded(-9999.0))
    np.save("clean.npy", rough_heights(1))
    (here / "windows.toml").write_text(
        'samples = 1\n[surface]\ngenerator = "scans"\nfiles = "coded.npy"\nnodes = 32\n'
        '[surface.reading]\nside = 79\n[surface.preparation]\nlevel = "plane"\n'
        '[load]\nquantity = "pressure/(E* slope_rms)"\nrange = [0.003, 0.1]\n'
    )
    words = COMMANDS[name].split()
    words += ["--side", "79"] if name == "scene" else []
    assert cli.main(words) == 0
    printed = capsys.readouterr()
    lines = [
        line for line in (printed.out + printed.err).splitlines() if "-9999 um" in line
    ]
    mask = "mask 8.9:11.1 makes holes of them, which "
    mask += "fill closes" if name in {"scene", "run"} else "--fill closes"
    assert lines
    assert all(
        "64 nodes (1 %) are at -9999 um" in line and mask in line for line in lines
    )


@pytest.mark.parametrize("turned", ["x", "y", "none"])
@pytest.mark.parametrize("shift", [(0.0, 0.0), (7.0, -3.0)])
def test_two_bodies_have_the_codes_of_both_and_no_slopes_of_them(turned, shift):
    coded_one = prepare(Topography("one", coded(-9999.0), (79.0, 79.0)), Reading())
    clean = prepare(Topography("two", rough_heights(1), (79.0, 79.0)), Reading())
    for bodies, named in (((coded_one, clean), "body 1"), ((clean, coded_one), "body 2")):
        both = composite(*bodies, turned, shift)
        [warning] = surface_warnings(both)
        assert warning.startswith(f"{named}: 64 nodes (1 %) are at -9999 um")


def test_many_codes_leave_no_neighbours_and_nothing_is_said_by_numpy():
    heights = rough_heights() + 10.0
    heights[::2, ::2] = heights[1::2, 1::2] = -9999.0
    assert any(
        "3200 nodes (50 %) are at -9999 um" in line for line in warnings_of(heights)
    )


def test_nothing_is_masked():
    heights = coded(-9999.0)
    prepared = prepare(Topography("map", heights, (79.0, 79.0)), Reading())
    assert np.array_equal(prepared.heights, heights)
    same = replace(prepared, warnings=(), doubtful=None)
    assert surface_warnings(same) != surface_warnings(prepared)  # slopes leave codes out
