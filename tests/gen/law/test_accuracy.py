"""Laws whose contacts have an error that was asked for, on the command line."""

import contextlib
import io
import re

import numpy as np
import pandas as pd
import pytest
from strict import json_of

import bem
from bem.budget import Budget, ErrorParts, Trial
from gen import cli
from gen.law.accuracy import cells, deviations_with_errors, with_bands
from gen.law.curves import Points, tabulated
from gen.law.lines import Deviation
from tests.bem.waves import random_waves

BODIES = ["--side", "1000", "--e-star", "1e4", "--boundary", "periodic"]
PRESSURES = [60.0, 250.0, 300.0]
LOADS = ["--pressure", "60,250,300"]
ERRORS = {"area": 0.03, "delta": 0.02, "stiffness": 0.05}
ERROR = ["--error", "area=3%,delta=2%,stiffness=5%"]


def surface(seed):
    """Return waves of 1/8 of the side and longer, on 128 nodes a side [um]."""
    return 1000 * random_waves(1, 8, 0.8, seed)(128)


def over_pressure(name):
    """Return the table over pressure of a CSV file."""
    rows = pd.read_csv(name)
    return rows[rows.against == "pressure_MPa"].reset_index(drop=True)


@pytest.fixture(scope="module")
def law(tmp_path_factory):
    """The folder with a law within errors, a law on all nodes, and what the first one printed."""
    folder = tmp_path_factory.mktemp("law")
    printed = io.StringIO()
    with contextlib.chdir(folder):
        np.save("a.npy", surface(1))
        command = ["law", "a.npy", *BODIES, *LOADS]
        assert cli.main([*command, "--csv", "full.csv"]) == 0
        files = ["--csv", "within.csv", "--json", "within.json", "--4c", "law.py"]
        with contextlib.redirect_stdout(printed):
            assert cli.main([*command, *ERROR, *files]) == 0
    return folder, printed.getvalue()


@pytest.fixture(scope="module")
def contacts():
    """The contacts of the same surface within these errors."""
    prepared = bem.Surface(surface(1), 1000.0, modulus=1e4, boundary="periodic")
    return [prepared.solve_within(ERRORS, pressure=pressure) for pressure in PRESSURES]


def test_each_load_has_the_grid_that_it_needs_and_the_error_that_it_got(law, contacts):
    table = over_pressure(law[0] / "within.csv")
    for place, contact in enumerate(contacts):
        row = table.iloc[place]
        assert (row.solved_nodes_x, row.solved_nodes_y) == contact.pressure.shape
        assert row.continuum_area_percent == pytest.approx(contact.continuum_area_percent)
        for name, parts in contact.budget.errors.items():
            prefix = f"{name}_relative_error_"
            assert row[f"{prefix}percent"] == pytest.approx(100 * parts.total)
            assert row[f"{prefix}from_grid_percent"] == pytest.approx(100 * parts.grid)
            assert row[f"{prefix}asked_percent"] == pytest.approx(100 * ERRORS[name])
    assert (table.solved_nodes_x < 128).all()
    assert table.map_nodes_a_wave[0] == pytest.approx(16, rel=0.1)


def test_a_law_within_errors_is_that_of_all_nodes(law):
    within = over_pressure(law[0] / "within.csv")
    full = over_pressure(law[0] / "full.csv")
    for column, error in {
        "continuum_area_percent": 0.03,
        "delta_um": 0.02,
        "stiffness_MPa_per_um": 0.05,
    }.items():
        np.testing.assert_allclose(within[column], full[column], rtol=error)
    assert not [name for name in full if "solved_" in name or "relative" in name]


def test_the_band_of_one_surface_within_errors_is_these_errors(law):
    within = over_pressure(law[0] / "within.csv")
    for column, name in {
        "continuum_area_percent": "area",
        "closure_um": "delta",
        "stiffness_MPa_per_um": "stiffness",
    }.items():
        half_width = (within[f"{column}_high"] - within[f"{column}_low"]) / 2
        error = within[f"{name}_relative_error_percent"] / 100
        np.testing.assert_allclose(half_width, error * within[column], rtol=1e-6)


def test_print_json_and_files_say_what_was_asked_and_got(law, contacts):
    folder, printed = law
    worst = max(contact.budget.errors["area"].total for contact in contacts)
    said = f"area in the continuum within {100 * worst:.2g} % at 95 %, at each load by itself"
    document = json_of(folder / "within.json")
    assert any(said in note for note in document["notes"])
    assert said in printed
    code = re.sub(r"\s+#\s+", " ", (folder / "law.py").read_text(encoding="utf-8"))
    assert said in code
    assert "contacts between the loads: area in the continuum within" in code
    assert document["errors_asked_percent"]["area"] == pytest.approx(3)
    errors = document["tables"][1]["errors"]
    assert errors["solved_nodes_x"] == [contact.pressure.shape[0] for contact in contacts]
    assert document["tables"][0]["errors"]["solved_nodes_x"][0] is None
    assert document["limits_of_maps"][0]["map_nodes_a_wave"] == pytest.approx(16, rel=0.1)
    nodes = contacts[0].pressure.shape
    assert f"{nodes[0]} x {nodes[1]}" in printed


@pytest.mark.usefixtures("here")
def test_a_law_of_several_maps_has_their_largest_errors():
    for seed in (1, 2):
        np.save(f"{seed}.npy", surface(seed))
    command = ["law", "1.npy", "2.npy", *BODIES, "--pressure", "300", "--error", "3%"]
    assert cli.main([*command, "--csv", "law.csv"]) == 0
    row = over_pressure("law.csv").iloc[0]
    of_surfaces = [row[f"area_relative_error_percent_surface_{n}"] for n in (1, 2)]
    assert row.area_relative_error_percent == max(of_surfaces)
    assert row.solved_nodes_x == min(
        row.solved_nodes_x_surface_1, row.solved_nodes_x_surface_2
    )


@pytest.mark.usefixtures("here")
def test_a_load_that_cannot_be_reached_is_left_out_with_the_reason(capsys):
    np.save("a.npy", surface(1))
    command = ["law", "a.npy", *BODIES, "--pressure", "0.2,300", "--error", "1%"]
    assert cli.main([*command, "--csv", "law.csv"]) == 0
    printed = capsys.readouterr().out
    assert "not solved, left out: a.npy: 0.2 MPa: area to 1 % not reachable" in printed
    assert list(over_pressure("law.csv").pressure_MPa) == [300]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--error", "gap=2%"], "answers with an error are area, mean_gap, stiffness"),
        (["--error", "3%", "--no-grid-error"], "--no-grid-error: leave it out"),
        (
            ["quick", "--error", "3%"],
            "--error: 2 inputs with a scene among them: give one scene",
        ),
    ],
)
def test_an_error_that_no_law_can_have_is_one_line(here, refused, arguments, message):
    np.save(here / "a.npy", surface(1))
    command = ["law", *arguments, "a.npy", *BODIES, "--pressure", "10"]
    assert message in refused(cli, *command)


@pytest.mark.usefixtures("here")
def test_a_law_of_which_nothing_is_left_ends_with_the_reason(capsys):
    np.save("rough.npy", random_waves(1, 32, 0.3, 1)(64))
    command = ["law", "rough.npy", *BODIES, "--pressure", "10", "--error", "3%"]
    assert cli.main(command) == 2
    assert "rough.npy: area to 3 % not reachable on any grid" in capsys.readouterr().err


def of_one_load(values, errors):
    """Return points under one load, of which errors are known."""
    parts = {
        name: ErrorParts(error, grid=error, waves=0.0, solver=0.0)
        for name, error in errors.items()
    }
    trial = Trial((64, 64), 0.0, parts, "", 1.0, 1.0)
    return Points(
        {name: np.array([value]) for name, value in values.items()},
        reasons=("",),
        budgets=(Budget((128, 128), 1e-3, (trial,)),),
    )


def test_closure_and_stiffness_of_a_free_patch_have_the_errors_of_delta_and_of_both_stiffnesses():
    """The patch gives way by 2 um under 10 MPa, 0.2 um / MPa, of a Delta of 5 um."""
    values = {
        "delta_um": 5.0,
        "closure_um": 3.0,
        "pressure_MPa": 10.0,
        "stiffness_MPa_per_um": 4.0,
    }
    errors = {"delta": 0.02, "stiffness": 0.05}
    points = with_bands(of_one_load(values, errors), errors, "pressure")
    assert points.high["closure_um"] - 3.0 == pytest.approx(0.02 * 5.0)
    # whole stiffness: 1 / (1 / 4 + 0.2)
    whole = 1 / (1 / 4.0 + 0.2)
    interface = 1 / (1 / (whole * 1.0001) - 0.2)
    amplified = (interface / 4.0 - 1) / 0.0001
    half_width = points.high["stiffness_MPa_per_um"] - 4.0
    assert half_width == pytest.approx(0.05 * amplified * 4.0, rel=1e-3)
    assert "pressure_MPa" not in points.low


def test_a_table_of_first_touch_alone_has_no_errors():
    errors = {"area": 0.03}
    values = {"area_percent": np.zeros(1), "pressure_MPa": np.zeros(1)}
    at_rest = Points(values, reasons=("",))
    table = tabulated("delta_um", np.zeros(1), [at_rest, at_rest], 0.9, {})
    row = cells(table, 0, errors, surfaces=2)
    assert row["area_relative_error_percent_surface_2"] == ""
    assert set(row.values()) == {""}


def test_lines_between_points_add_their_distance_to_the_error():
    errors = {"stiffness": 0.05}
    points = of_one_load({"area_percent": 10.0, "delta_um": 1.0}, errors)
    table = tabulated("pressure_MPa", np.array([10.0]), [points], 0.9, {})
    lines = {"conductance": Deviation(0.02, 0.03), "pressure": Deviation(0.01, np.nan)}
    assert "at most: conductance 8 %." in deviations_with_errors([table], errors, lines)
