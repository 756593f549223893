"""Laws of the means over a scene's population, which have the errors that were asked for."""

import contextlib
import io

import numpy as np
import pandas as pd
import pytest
from strict import json_of
from waves_scene import SCENE

from gen import cli
from gen.law import Order, by_means, by_solver
from gen.law.multilevel import PILOT
from gen.law.surfaces import surfaces_of_scene
from gen.runtime.errors import InputError
from gen.scene import load

LOADS = ["--pressure", "0.005,0.02", "--boundary", "periodic"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with a scene."""
    made = tmp_path_factory.mktemp("means")
    (made / "scene.toml").write_text(SCENE)
    return made


@pytest.fixture(scope="module")
def law(folder):
    """The law of means over both loads, and what the command printed."""
    printed = io.StringIO()
    files = [
        "--csv",
        "law.csv",
        "--json",
        "law.json",
        "--abaqus",
        "law.inp",
        "--no-check",
    ]
    command = ["law", "scene.toml", *LOADS, "--error", "area=20%,mean_gap=20%", *files]
    with contextlib.chdir(folder), contextlib.redirect_stdout(printed):
        assert cli.main(command) == 0
    return folder, printed.getvalue()


@pytest.fixture
def make(folder):
    """Make a law of means over the pressure in Python."""

    def made(error, stopping=None, **order):
        settings = {"pressure": "0.01", "boundary": "periodic", "both_tables": False}
        scene = str(folder / "scene.toml")
        settings |= order
        return by_means(
            Order(inputs=(scene,), errors={"area": error}, **settings), stopping
        )

    return made


def test_the_means_are_those_of_many_surfaces_on_the_full_grid(law):
    folder, _ = law
    rows = pd.read_csv(folder / "law.csv")
    rows = rows[rows.against == "pressure_MPa"]
    plain = by_solver(
        Order(
            inputs=(str(folder / "scene.toml"),),
            pressure="0.005,0.02",
            boundary="periodic",
            grid_error=True,
            surfaces=20,
        )
    ).over_pressure
    for answer, name in (("area", "continuum_area_percent"), ("mean_gap", "mean_gap_um")):
        assert (rows[f"{answer}_relative_error_percent"] <= 20).all()
        of_plain = 2 * plain.curves[name].std / np.sqrt(20)
        within = np.hypot(of_plain, 0.2 * rows[name])
        assert (np.abs(rows[name] - plain.curves[name].value) < within).all()


def test_the_table_has_the_parts_of_each_error_and_standard_errors(law):
    folder, _ = law
    rows = pd.read_csv(folder / "law.csv")
    rows = rows[(rows.against == "pressure_MPa")]
    parts = [
        rows[f"area_relative_error_from_{part}_percent"]
        for part in ("grid", "waves", "solver", "surfaces")
    ]
    total = rows["area_relative_error_percent"]
    squares = np.sum(np.square(parts), axis=0)
    assert np.sqrt(squares) == pytest.approx(total.to_numpy())
    name = "continuum_area_percent"
    reach = (rows[f"{name}_high"] - rows[name]).to_numpy()
    assert reach == pytest.approx((total / 100 * rows[name]).to_numpy())
    # Student's factor is above the normal one
    assert (parts[-1] / 100 * rows[name] > 1.96 * rows[f"{name}_standard_error"]).all()


def test_json_and_print_have_the_surfaces_on_each_grid(law):
    folder, printed = law
    population = json_of(folder / "law.json")["population"]
    assert population["errors_met"]
    assert population["nodes"] == [33, 33]
    assert [grid["nodes"] for grid in population["grids"]] == [[17, 17], [33, 33]]
    numbers = [grid["surfaces"] for grid in population["grids"]]
    assert min(numbers) >= PILOT
    assert f"the means of its first {sum(numbers)} surfaces" in printed
    assert f"surfaces: {numbers[0]} on 17 x 17 nodes, {numbers[1]} on 33 x 33" in printed
    assert "area in the continuum within" in printed


def test_a_program_gets_the_means_and_their_band(law):
    folder, _ = law
    assert (folder / "law.inp").exists()
    assert (folder / "law-soft.inp").exists()


def test_delta_counts_from_the_highest_node_of_each_surface_on_its_full_grid(
    make, folder
):
    table = make(0.9, delta="4", pressure="").over_delta
    first = surfaces_of_scene(load(str(folder / "scene.toml")), "", range(2 * PILOT))
    at_rest = [surface.heights.max() - surface.heights.mean() for surface in first]
    gap = table.curves["mean_gap_um"]
    assert gap.value[0] == pytest.approx(np.mean(at_rest[:PILOT]), rel=1e-9)
    # Without edges the mean gap falls with Delta on every grid.
    assert gap.value[1] == pytest.approx(gap.value[0] - 4, rel=1e-6)


def test_the_same_order_gives_the_same_law(make):
    first, second = (make(0.3).over_pressure.curves for _ in range(2))
    for name, curve in first.items():
        assert (curve.value == second[name].value).all()
        assert (curve.high == second[name].high).all()


def test_a_law_that_has_to_stop_says_what_is_left_of_the_errors(make):
    calls = iter(range(1000))
    law = make(0.02, stopping=lambda: next(calls) > 2 * PILOT + 3)
    assert not law.sampled.is_met
    assert (
        law.sampled.tables["pressure_MPa"].errors(0, {"area": 0.02})["area"].total > 0.02
    )
    assert any("stopped before the errors were met" in note for note in law.notes)


def test_a_law_that_has_to_stop_at_once_has_no_means(make):
    with pytest.raises(InputError, match="stopped before two surfaces"):
        make(0.02, stopping=lambda: True)


def test_a_time_limit_ends_the_command_with_its_errors(folder, capsys):
    command = ["law", "scene.toml", *LOADS, "--error", "1%", "--time-limit", "0.3"]
    with contextlib.chdir(folder):
        assert cli.main(command) == 0
    assert "stopped before the errors were met" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["quick", "--error", "2%"], "waves go on down to the grid"),
        (["scene.toml", "--error", "2%", "--surfaces", "9"], "--surfaces: leave it out"),
        (["scene.toml", "--error", "2%", "--band", "0.8"], "--band: leave it out"),
        (["scene.toml", "quick", "--error", "2%"], "2 inputs with a scene among them"),
        (["scene.toml", "--time-limit", "9"], "--time-limit: needs --error and a scene"),
        (["scene.toml", "--error", "2%", "--time-limit", "0"], "--time-limit 0: give"),
        (["short.toml", "--error", "0.1%"], "not reachable on the 33 x 33 nodes"),
        (["coarse.toml", "--error", "2%"], "needs 31 nodes a side or more"),
        (["mirco.toml", "--error", "2%", "--boundary", "free"], "contact.kernel = "),
        (["soft.toml", "--error", "2%"], "must stay below the hardness"),
    ],
)
def test_what_cannot_have_an_error_is_refused_in_a_line(folder, capsys, words, message):
    (folder / "coarse.toml").write_text(SCENE.replace("nodes = 33", "nodes = 24"))
    (folder / "short.toml").write_text(SCENE.replace("250.0", "120.0"))
    (folder / "soft.toml").write_text(f"{SCENE}hardness = 0.01\n")
    free = SCENE.replace('boundary = "periodic"', 'kernel = "concentrated-force"')
    (folder / "mirco.toml").write_text(free)
    loads = LOADS if "--boundary" not in words else LOADS[:2]
    with contextlib.chdir(folder):
        assert cli.main(["law", *words, *loads]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert "Traceback" not in error


@pytest.mark.long
def test_contacts_between_the_loads_are_means_over_the_same_surfaces(make):
    law = make(0.2, pressure="0.01,0.03", stiffness=True, between=("pressure",))
    between = law.between_pressures
    assert between.at.size > 0
    closure = np.interp(
        between.at, law.over_pressure.at, law.over_pressure.curves["closure_um"].value
    )
    assert between.curves["closure_um"].value == pytest.approx(closure, rel=0.1)


@pytest.mark.long
def test_errors_of_means_hold_in_95_of_100_populations(folder):
    truth = by_solver(
        Order(
            inputs=(str(folder / "scene.toml"),),
            pressure="0.01",
            boundary="periodic",
            grid_error=True,
            surfaces=600,
        )
    ).over_pressure.curves["continuum_area_percent"]
    within = 0
    for seed in range(100):
        path = folder / f"seed{seed}.toml"
        path.write_text(f"seed = {seed}\n{SCENE}")
        law = by_means(
            Order(
                inputs=(str(path),),
                pressure="0.01",
                boundary="periodic",
                both_tables=False,
                errors={"area": 0.05},
            )
        )
        mean = law.over_pressure.curves["continuum_area_percent"].value
        within += bool(abs(mean[0] / truth.value[0] - 1) < 0.05)
    assert within >= 90
