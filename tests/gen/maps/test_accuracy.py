"""Errors that are asked for on the command line, and the limits of maps that they cannot pass."""

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import bem
from gen import cli
from gen.maps.limits import limits_of
from gen.maps.read import Topography, read
from gen.maps.scan import Instrument
from gen.maps.settings import Reading
from gen.surface import generate
from tests.bem.waves import random_waves

ROUGH = generate("diamond-square", 17, 0.7, 5.0, np.random.default_rng(4))
STEEL = ["--young", "210e3", "--poisson", "0.3"]
PERIODIC = ["--e-star", "1e4", "--boundary", "periodic"]
COATED = [*STEEL, "--layer-thickness", "60", "--layer-young", "1e6"]


@pytest.fixture
def surface(here):
    np.save(here / "rough.npy", ROUGH)
    return "rough.npy"


def answered_within(options, bodies=PERIODIC):
    """Press waves of 1/8 of the side on 128 nodes a side with some options, and return the row."""
    np.save("fine.npy", 1000 * random_waves(1, 8, 0.8, 1)(128))
    command = ["contact", "fine.npy", "--side", "1000", *bodies, "--pressure", "300"]
    assert cli.main([*command, *options, "--csv", "fine.csv"]) == 0
    return pd.read_csv("fine.csv").iloc[0]


@pytest.mark.usefixtures("here")
def test_an_error_of_the_area_takes_fewer_nodes_and_is_told(capsys):
    row = answered_within(["--error", "3%", "--plot", "fine.png"])
    printed = re.sub(" +", " ", capsys.readouterr().out)
    contact = bem.solve_within(
        np.load("fine.npy"), 1e3, 0.03, pressure=300, modulus=1e4, boundary="periodic"
    )
    nodes = contact.pressure.shape
    assert (row.solved_nodes_x, row.solved_nodes_y) == nodes
    assert f"solved on {nodes[0]} x {nodes[1]} of 128 x 128 nodes" in printed
    parts = contact.budget.errors["area"]
    assert row.continuum_area_percent == pytest.approx(contact.continuum_area_percent)
    assert row.area_relative_error_percent == pytest.approx(100 * parts.total)
    assert row.area_relative_error_asked_percent == pytest.approx(3)
    assert row.area_relative_error_from_grid_percent == pytest.approx(100 * parts.grid)
    assert row.area_relative_error_from_solver_percent == pytest.approx(
        100 * parts.solver
    )
    assert (
        f"% of it at 95 %, asked 3 %: grid {100 * parts.grid:.2g} %, dropped waves 0 %,"
        f" solver {100 * parts.solver:.2g} %" in printed
    )
    assert Path("fine.png").stat().st_size > 0


@pytest.mark.usefixtures("here")
def test_an_answer_within_an_error_is_that_of_all_nodes():
    errors = ["--error", "area=2%, mean_gap=0.03,stiffness=4%"]
    row = answered_within(errors)
    full = answered_within(["--stiffness"])
    for column, error in {
        "continuum_area_percent": 0.02,
        "mean_gap_um": 0.03,
        "stiffness_N_per_m": 0.04,
    }.items():
        assert row[column] == pytest.approx(full[column], rel=error)
    assert not [name for name in full.index if "solved_" in name or "relative" in name]


@pytest.mark.usefixtures("here")
def test_a_contact_on_a_layer_has_its_error():
    bodies = [*COATED, "--boundary", "periodic"]
    row = answered_within(["--error", "3%"], bodies)
    full = answered_within([], bodies)
    assert row.solved_nodes_x < 128
    area = full.continuum_area_percent
    assert row.continuum_area_percent == pytest.approx(area, rel=0.03)


@pytest.mark.usefixtures("here")
def test_each_map_and_load_has_a_grid_for_its_error(capsys):
    for name, waves, nodes in (("a", 8, 128), ("b", 4, 96), ("fractal", 31, 64)):
        np.save(f"{name}.npy", 1000 * random_waves(1, waves, 0.8, 1)(nodes))
    maps = ["a.npy", "b.npy", "fractal.npy"]
    command = ["contact", *maps, "--side", "1000", *PERIODIC, "--pressure", "0,300"]
    assert cli.main([*command, "--error", "3%", "--csv", "maps.csv"]) == 0
    printed = capsys.readouterr()
    assert "left out: 300 MPa: area to 3 % not reachable" in printed.err
    assert "area_relative_error_percent" in printed.out
    assert "from_grid" not in printed.out
    rows = pd.read_csv("maps.csv")
    rows = rows[(rows.row == "surface") & (rows.given_pressure_MPa > 0)]
    assert list(rows.surface) == ["a.npy", "b.npy"]
    assert (rows.area_relative_error_percent <= 3).all()
    assert (rows.solved_nodes_x <= [64, 64]).all()


def test_full_contact_on_fewer_nodes_is_doubted(here, capsys):
    np.save("full.npy", 1000 * random_waves(1, 4, 0.8, 1)(96))
    command = ["contact", "full.npy", "--side", "1000", *PERIODIC, "--pressure", "1e6"]
    assert cli.main([*command, "--error", "area=5%,force=5%", "--csv", "full.csv"]) == 0
    row = pd.read_csv("full.csv").iloc[0]
    assert row.area_percent == 100
    assert row.solved_nodes_x < 96
    assert "every node" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--error", "gap=2%"], "answers with an error are area, mean_gap, stiffness"),
        (["--error", "3"], "above 1e-14 and below 1: 0.01 is one per cent"),
        (["--error", "1e-300"], "above 1e-14 and below 1: 0.01 is one per cent"),
        (["--error", "3%,area=2%"], "the error of area twice"),
        (["--error", "small"], "as 3% or 0.03"),
        (["--error", "3%", "--no-grid-error"], "--no-grid-error: leave it out"),
        (["--error", "3%", "--rtol", "1e-5"], "--rtol: leave it out with --error"),
        (["--error", "3%", "--far-field", "compliant"], "--far-field: leave it out"),
        (
            ["--error", "3%", "--kernel", "concentrated-force"],
            "--kernel: leave it out with --error",
        ),
        (
            ["--error", "3%", *STEEL, "--hardness", "2000", "--flattened", "flat.npy"],
            "--flattened: leave it out with --error",
        ),
        (["--error", "0.1%"], "not reachable"),
    ],
)
def test_an_error_that_cannot_be_asked_for_is_one_line(
    surface, refused, arguments, message
):
    ask = ["contact", surface, "--side", "200", "--pressure", "100", *arguments]
    assert message in refused(cli, *ask)


def waves_of_eight_nodes(boundary="periodic"):
    """Return a surface on 64 nodes a side whose shortest wave has eight."""
    return Topography(
        "waves", random_waves(1, 8, 0.8, 1)(64), (1.0, 1.0), boundary=boundary
    )


def test_the_limits_of_a_map_are_the_nodes_in_its_shortest_wave():
    limits = limits_of(waves_of_eight_nodes())
    assert limits.nodes_a_wave == pytest.approx(8, rel=0.1)
    assert re.fullmatch(r"[78]\.?\d* nodes in its shortest wave", limits.text)
    assert limits.columns["instrument_cut_off_um"] == ""


@pytest.mark.usefixtures("here")
def test_a_report_names_the_limits_of_the_map(capsys):
    row = answered_within(["--error", "3%"])
    assert row.map_nodes_a_wave == pytest.approx(16, rel=0.1)
    printed = re.sub(" +", " ", capsys.readouterr().out)
    assert re.search(r"limits of the map 1[56]\.?\d* nodes in its shortest wave", printed)


@pytest.mark.filterwarnings("ignore:Cannot close a netcdf_file:RuntimeWarning")
@pytest.mark.parametrize(
    ("parameters", "instrument"),
    [
        (
            {"resolution": {"value": 2500, "unit": "nm"}},
            Instrument(cut_off=pytest.approx(2.5)),
        ),
        (
            {"tip_radius": {"value": 0.002, "unit": "mm"}},
            Instrument(tip_radius=pytest.approx(2.0)),
        ),
        ({"resolution": {"value": -1, "unit": "um"}}, Instrument()),
        ({"resolution": {"value": 1, "unit": "px"}}, Instrument()),
        ({"name": "a microscope"}, Instrument()),
    ],
)
def test_the_limits_of_an_instrument_are_read_from_its_file(
    tmp_path, parameters, instrument
):
    library = pytest.importorskip(
        "SurfaceTopography", reason="needs the extra instruments"
    )
    made = library.Topography(
        waves_of_eight_nodes().heights,
        (100.0, 100.0),
        unit="um",
        info={"instrument": {"parameters": parameters}},
    )
    made.to_netcdf(str(tmp_path / "map.nc"))
    topography = read(tmp_path / "map.nc", Reading())
    assert topography.instrument == instrument


def test_the_limits_of_two_maps_are_the_worse_ones():
    first = Instrument(cut_off=2.5)
    second = Instrument(cut_off=1.0, tip_radius=0.1)
    assert first.or_worse(second) == Instrument(cut_off=2.5, tip_radius=0.1)
