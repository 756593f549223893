"""What the solver's tolerance does to a surrogate: the study on few rows, and what it advises."""

import numpy as np
import pytest

import bem
from bench import __main__ as bench
from bench.page.content import Figure, Table, Words
from bench.page.parts import contents_of
from bench.surrogates import tolerance_labels as labels
from bench.surrogates.tolerance import advice, choice, report, tolerance
from bench.surrogates.tolerance_labels import DEFAULT, TIGHT, kept, scene_of, solve_all
from bench.table import read_table
from gen.generation.plan import parameters
from gen.generation.sample import surface_of

ROW = {
    "tolerance": TIGHT,
    "features": "paper",
    "trained": 80,
    "judged": 20,
    "seconds": np.nan,
    "ratio": np.nan,
    "label_nmae": 0.0,
    "label_nmaxe": 0.0,
    "label_force": 0.0,
    "right": 100.0,
    "nmse": 1.0,
    "nmae": 5.0,
    "nmaxe": 9.0,
    "r2": 99.0,
    "own_nmae": 5.0,
    "own_r2": 99.0,
}


def rows_of(errors):
    """Rows of one feature set with given test errors; the looser, the faster."""
    measured = [
        ROW
        | {"tolerance": each, "nmae": error, "label_nmae": each}
        | {"seconds": 10 - each, "ratio": 1 - each}
        for each, error in errors.items()
    ]
    return [ROW, *measured]


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """The study on 100 rows at two tolerances, and its folder."""
    folder = tmp_path_factory.mktemp("tolerance")
    return folder, tolerance(folder, 100, tolerances=(0.1,), area_max=60.0)


def test_labels_are_the_solvers_answers(small):
    folder, _ = small
    loose, default = (kept(folder / "databases", each, 100) for each in (0.1, DEFAULT))
    assert (loose[:, -1] > 0).all()
    assert (default[:, -1] > 0).all()
    scene = scene_of(0.1)
    plan = parameters(scene, 0, 100)
    for row in (0, 57):
        heights, delta = surface_of(scene, plan, row), float(plan.delta[row])
        contact = bem.solve(heights, scene.surface.side, delta, rtol=0.1)
        expected = contact.area_percent, contact.force, contact.contact_nodes
        assert loose[row, :-1].tolist() == [*expected]


def test_other_rows_are_kept(tmp_path):
    kept(tmp_path, 0.1, 100)[:] = 5.0
    kept(tmp_path, 0.1, 20)[1] = 7.0
    after = np.array(kept(tmp_path, 0.1, 120))
    assert after.shape == (120, 4)
    assert (after[1] == 7).all()
    assert (after[2:100] == 5).all()
    assert np.isnan(after[100:]).all()
    (path,) = tmp_path.iterdir()
    path.write_bytes(path.read_bytes()[:-5])
    assert kept(tmp_path, 0.1, 120)[:119].tobytes() == after[:119].tobytes()


def test_looser_areas_are_worse_and_tight_ones_teach_as_well_as_exact_ones(small):
    _, found = small
    assert [(row["features"], row["tolerance"]) for row in found] == [
        (features, each) for features in ("paper", "hybrid") for each in (TIGHT, 0.1, DEFAULT)
    ]
    for exact, loose, default in (found[:3], found[3:]):
        assert default["label_nmae"] < 1e-3
        assert loose["label_nmae"] > 1
        assert loose["label_force"] > default["label_force"] > exact["label_force"] == 0
        assert loose["right"] < default["right"]
        assert default["nmae"] == pytest.approx(exact["nmae"], rel=1e-2)
        assert default["ratio"] == 1
        assert loose["own_nmae"] != loose["nmae"]
        assert default["own_nmae"] == pytest.approx(default["nmae"], rel=1e-2)
    assert found[3]["nmae"] < found[0]["nmae"], "hybrid features are the better ones"


def test_what_is_solved_is_not_solved_again(small, monkeypatch):
    folder, found = small

    def never(*_, **__):
        raise AssertionError("solved again")

    monkeypatch.setattr(labels, "compute_rows", never)
    again = tolerance(folder, 100, tolerances=(0.1,), area_max=60.0)
    assert [row["nmae"] for row in again] == [row["nmae"] for row in found]
    with pytest.raises(AssertionError, match="solved again"):
        tolerance(folder, 100, tolerances=(0.01,), area_max=60.0)


def test_what_an_interruption_leaves_is_done_later(tmp_path, monkeypatch):
    solve, done = labels._solved, []

    def interrupted(scene, row):
        if len(done) == 5:
            raise KeyboardInterrupt
        done.append((scene.contact.rtol, row))
        return solve(scene, row)

    monkeypatch.setattr(labels, "BLOCK", 2)
    monkeypatch.setattr(labels, "_solved", interrupted)
    with pytest.raises(KeyboardInterrupt):
        solve_all(tmp_path, (0.1, 0.01), 6)
    for each in (0.1, 0.01):
        known = kept(tmp_path, each, 6)[:, -1] > 0
        assert known.tolist() == [(each, row) in done for row in range(6)]
    assert {row for _, row in done[:4]} == {0, 1}
    done.append(None)
    found = solve_all(tmp_path, (0.1, 0.01), 6)
    assert all((each[:, -1] > 0).all() for each in found.values())
    assert {row for _, row in done[6:]} == {2, 3, 4, 5}, "whole blocks are not solved again"


@pytest.mark.parametrize(
    ("errors", "chosen"),
    [
        ({0.1: 9.0, 0.01: 5.05, DEFAULT: 5.0}, 0.01),
        ({0.1: 5.0, 0.01: 6.0, DEFAULT: 5.0}, DEFAULT),  # good by chance is not good
        ({0.1: 4.9, 0.01: 5.0, DEFAULT: 5.0}, 0.1),
    ],
)
def test_the_loosest_tolerance_that_is_good_enough_is_chosen(errors, chosen):
    assert choice(rows_of(errors), "paper")["tolerance"] == chosen
    text = advice(rows_of(errors))
    assert (f"Choose {chosen:g} for" in text) == (chosen > DEFAULT)


def test_the_report(small, tmp_path):
    folder = tmp_path / "report"
    made = report(small[1])
    paths, text = made.write(folder), made.text
    assert [path.name for path in paths] == ["tolerance.csv", "tolerance.txt", "tolerance.png"]
    figure, *words, table = contents_of("surrogates/tolerance", folder)
    assert isinstance(figure, Figure)
    assert isinstance(table, Table)
    assert words == [Words(line) for line in text.splitlines()]
    _, written = read_table(table.data)
    assert len(written) == 6
    assert set(table.columns) <= written[0].keys()
    assert figure.picture.stat().st_size > 10_000
    assert "Keep the default" in text


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--rows", "50"], "--rows 50: give 100 or more"),
        (["--tolerances", "2"], "--tolerances: give numbers above 1e-10 and below 1"),
        (["--tolerances", "1e-1,x"], "tolerances '1e-1,x': give numbers with commas"),
    ],
)
def test_bad_input_is_one_line(arguments, message, tmp_path, capsys):
    assert bench.main(["tolerance", *arguments, "-o", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
    assert not (tmp_path / "out").exists()
