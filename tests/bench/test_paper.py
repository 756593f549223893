"""The paper, side by side: each part on few rows, and what the folder says it holds."""

import csv
import os

import numpy as np
import pytest

import learn.cli
from bench import __main__ as bench
from bench import hertz, picture
from bench.page.content import Absent, Figure, Table, Words
from bench.paper import deviations, facts, fine, models, predictions, report, surfaces
from bench.paper.contents import ORDER, RECORD, contents, files_of, keep, record, whole
from bench.surrogates import databases
from bench.surrogates.break_even import PAPER_BREAK_EVEN, break_even
from bench.table import write_table
from gen.database import Reader
from gen.runtime.errors import InputError
from gen.statistics import describe
from learn.comparison import paper
from learn.metrics import Scores

COST = ("asked", "solver", "features", *("rows", "database", "tuning", "fit", "solve", "query"))


def table_of(path):
    with path.open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module", autouse=True)
def _few_rows():
    """Fewer rows on the finer grid, and pictures that are drawn faster."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(report, "tests_of", lambda rows: 20)
        patch.setattr(picture, "DPI", 40)
        yield


@pytest.fixture(scope="module")
def preset(tmp_path_factory):
    """120 rows of the paper preset."""
    return databases.of_the_paper(None, tmp_path_factory.mktemp("paper"), 120, print)


@pytest.fixture(scope="module")
def comparison(preset, tmp_path_factory):
    """Two baselines and a small search."""
    folder = tmp_path_factory.mktemp("comparison")
    compared = [str(preset), "-o", str(folder), "--area-max", "60"]
    trees = [*compared, "--model", "decision-tree", "--model", "kernel-ridge"]
    assert learn.cli.main(["compare", *trees]) == 0
    assert learn.cli.main(["tune", *compared, "--model", "kernel-ridge"]) == 0
    return folder


@pytest.fixture(scope="module")
def cost(tmp_path_factory):
    """What `bench cost` writes, with round numbers."""
    folder = tmp_path_factory.mktemp("cost")
    rows = [
        ("statistics at hand", "the paper's", "paper, as published", 100, 1000, 50, 5, 10, 0.1),
        ("new surfaces", "the paper's", "paper", 100, 1000, 50, 5, 10, 0.2),
        ("new surfaces", "ours", "paper", 100, 2.0, 0.0, 1.0, 0.02, 0.01),
        ("new surfaces", "ours", "hybrid", 100, 2.5, 2.0, 1.0, 0.02, 0.03),
    ]
    evens = [break_even(sum(row[4:7]), *row[7:]) for row in rows]
    even = [(*row, value) for row, value in zip(rows, evens, strict=True)]
    write_table(folder / "cost.csv", (*COST, "break_even"), even)
    return folder


@pytest.fixture(scope="module")
def made(preset, comparison, cost, tmp_path_factory):
    """The whole report on few rows: its folder, its inputs, the files that it told of."""
    folder, compare = tmp_path_factory.mktemp("made"), hertz.compare
    given = {"given": preset, "comparison": comparison, "costs": cost, "command": "as typed"}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(hertz, "compare", lambda: compare(3))
        return folder, given, report.write_report(folder, 200, **given)


def test_the_papers_numbers_fit_together():
    assert facts.TRAIN_ROWS == 12_703
    # Most models' nMSE and R2 are of the same test rows: one ratio for all but AdaBoost.
    spreads = {name: facts.spread_of(each) for name, each in paper.TEST["baseline"].items()}
    odd = [name for name, value in spreads.items() if abs(value / facts.SPREAD - 1) > 0.15]
    assert odd == ["adaboost"]
    assert max(facts.RANGES["area_percent"]) == facts.AREA_MAX


def test_spread_is_variance_over_mean():
    truth = np.random.default_rng(1).gamma(2.0, size=500)
    prediction = truth + np.random.default_rng(2).normal(0, 0.1, 500)
    from learn.metrics import scores

    spread = facts.spread_of(scores(truth, prediction))
    assert spread == pytest.approx(truth.var() / truth.mean(), rel=1e-12)


@pytest.mark.parametrize(
    ("ours", "theirs", "text"),
    [(2.0, 1.0, "x 2"), (0.02, 190.0, "1/9,500"), (1.0, 0.0, ""), (300.0, 1.0, "x 300")],
)
def test_ratios_are_readable(ours, theirs, text):
    assert deviations.ratio(ours, theirs) == text


def test_levels_are_one_surface():
    for generator in ("diamond-square", "midpoint"):
        coarse, fine_grid = (surfaces.surface(0.6, generator, cells + 1) for cells in (8, 32))
        offset = fine_grid[::4, ::4] - coarse
        assert np.ptp(offset) < 1e-12


def test_marks_are_what_the_statistics_count():
    heights = surfaces.surface(surfaces.ROUGH)
    values = describe(heights, 1.0).values
    along = [surfaces._above(heights, axis) for axis in (0, 1)]
    assert sum(marks.sum() for marks in along) == round(values["peak_density"] * 2 * heights.size)
    assert heights[along[0] & along[1]].mean() == pytest.approx(values["asperity_mean"])


def test_everything_there_is_shown_in_the_papers_order(made):
    folder, _, paths = made
    shown = contents(folder)
    assert not [each for each in shown if isinstance(each, Absent)]
    files = [path for each in shown for path in files_of(each)]
    assert list(dict.fromkeys(files)) == paths
    assert all(path.stat().st_size > 60 for path in paths)
    assert all(each.command == "as typed" for each in shown)
    assert all(30 < len(each.caption) < 900 for each in shown)
    assert list(record(folder)) == list(ORDER)
    sections = [each.caption.split()[:2] for each in shown if each.caption.startswith("Section")]
    numbers = [float(number.rstrip(",")) for _, number in sections]
    assert numbers == sorted(numbers)


def test_tables_hold_both_sides(made, preset):
    folder, *_ = made
    with Reader(preset) as reader:
        highest = reader.column("height_max").max()
    first = {row["parameter"]: row for row in table_of(folder / "table-1.csv")}
    assert len(first) == len(facts.RANGES)
    heights = first["largest height of the surface"]
    assert float(heights["ours_high"]) == pytest.approx(highest, rel=1e-3)
    assert float(heights["paper_high"]) == 79.25
    bandwidth = first["Nayak's bandwidth parameter along x"]
    assert bandwidth["explanation"] == deviations.BANDWIDTH
    assert float(bandwidth["ours_inside_percent"]) < 90
    tuned = [row for row in table_of(folder / "table-2.csv") if row["our_optimum"]]
    assert {row["model"] for row in tuned} == {"Kernel Ridge"}
    third = {row["model"]: row for row in table_of(folder / "table-3.csv")}
    assert "55 fits instead of 800" in third["Kernel Ridge"]["explanation"]
    assert third["AdaBoost"]["explanation"] == "not searched here"
    fourth = table_of(folder / "table-4.csv")
    assert [(row["model"], row["result"]) for row in fourth] == [
        ("Decision Tree", "baseline"),
        ("Kernel Ridge", "baseline"),
        ("Kernel Ridge", "tuned"),
    ]
    assert fourth[0]["R2_paper"] == "96.31"
    fifth = {row["score_percent"]: row for row in table_of(folder / "table-5.csv")}
    assert float(fifth["r2"]["ours_hybrid"]) > float(fifth["r2"]["ours_paper"])
    assert fifth["nmae"]["paper"] == "3.95"


def test_costs_meet_where_the_lines_cross(made):
    folder, *_ = made
    rows = {row["cost"]: row for row in table_of(folder / "total-cost.csv")}
    even = rows["contacts from which on it pays"]
    assert even["ours_paper"] == "300"
    assert even["ours_hybrid"] == "never"
    numbers = {row["quantity"]: row for row in table_of(folder / "numbers.csv")}
    assert numbers["break-even [contacts]"]["paper"] == f"{PAPER_BREAK_EVEN:,}"
    assert numbers["rows of the database"]["explanation"] == "as asked for"


def test_more_displacement_and_smoother_surfaces_touch_more(made):
    rows = {row["panels"]: row for row in table_of(made[0] / "topographies.csv")}
    areas = {name: float(row["area_percent"]) for name, row in rows.items()}
    assert areas["a, d"] < min(areas["b, e"], areas["c, f"])
    assert [float(row["delta_um"]) for row in rows.values()] == [25, 35, 25]


def test_only_what_its_inputs_changed_is_made_again(made, cost):
    folder, given, paths = made
    said = []
    assert report.write_report(folder, 200, **given, remark=said.append) == paths
    assert said == []
    os.utime(cost / "cost.csv", (1, 1))
    (folder / "profile.png").unlink()
    assert report.write_report(folder, 200, **given, remark=said.append) == paths
    assert [line.split()[-1] for line in said] == ["numbers", "profile", "cost"]


def test_what_is_missing_is_absent_with_what_to_do(tmp_path, made):
    assert all(isinstance(each, Absent) for each in contents(tmp_path))
    assert len(contents(tmp_path)) == len(ORDER)
    drawn = tmp_path / "profile.png"
    drawn.write_bytes(b"png")
    keep(tmp_path, "profile", "key", [Figure(drawn, "a", "b"), Words("c")])
    shown = [each for each in contents(tmp_path) if not isinstance(each, Absent)]
    assert shown == [Figure(drawn, "a", "b"), Words("c")]
    drawn.unlink()
    assert all(isinstance(each, Absent) for each in contents(tmp_path))
    assert whole(tmp_path, record(tmp_path)["profile"]) == []
    (tmp_path / RECORD).write_text("{")
    with pytest.raises(InputError, match="delete it, all is made anew"):
        contents(tmp_path)


def test_without_a_comparison_there_is_nothing_of_models(preset):
    inputs = report.Inputs(preset, preset, None, None, "")
    parts = [part.name for part in report.parts_of(inputs)]
    left = set(ORDER) - set(parts)
    assert left == {"table-3", "baselines", "tuned", "table-4", "cost"}
    for name in left:
        what, how = ORDER[name]
        assert "python -m" in how
        assert "\n" not in what + how


def test_kinds_that_were_not_made_are_left_out(preset, tmp_path):
    compared = [str(preset), "-o", str(tmp_path / "one"), "--area-max", "60"]
    assert learn.cli.main(["compare", *compared, "--model", "decision-tree"]) == 0
    assert predictions.predictions(tmp_path, tmp_path / "one", "tuned", "") == []
    (drawn,) = predictions.predictions(tmp_path, tmp_path / "one", "baseline", "")
    assert "The closest of these here: Decision Tree" in drawn.caption
    (table,) = models.table_2(tmp_path, None, "")
    assert isinstance(table, Table)
    assert "Not searched here: Decision Tree" in table.caption


def test_why_says_what_is_known():
    alike = models._why(Scores(1.16, 3.07, 9.84, 99.52), 1.2, 3.6)
    assert alike == "R2 alike; nMSE x 1.5 by the areas' spread"
    assert models._why(Scores(16.71, 12.8, 25.03, 90.71), 2.7, 3.6) == (
        f"worse R2: {deviations.UNEXPLAINED}; {deviations.TWO_SPREADS}"
    )


def test_a_finer_grid_of_something_else_is_refused(tmp_path):
    text = "samples = 1\n[surface]\nnodes = 257\nhurst = [0.5, 0.6]\n"
    path = databases.generated(tmp_path, "other", text, print)
    with pytest.raises(InputError, match=r"another grid \(surface.hurst"):
        fine.check(path)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--comparison", "nowhere"], "--comparison nowhere: give a folder of learn compare"),
        (["--cost", "nowhere"], "--cost nowhere: give a folder of python -m bench cost"),
        (["--database", "nowhere.h5"], "nowhere.h5 does not exist"),
        (["--fine", "nowhere.h5"], "nowhere.h5 does not exist"),
        (["--fine", "PRESET"], "has 129 nodes a side, give one with more than 129"),
        (["--rows", "5"], "--rows"),
    ],
)
def test_bad_input_is_one_line(arguments, message, preset, tmp_path, capsys):
    given = [str(preset) if each == "PRESET" else each for each in arguments]
    assert bench.main(["paper", *given, "-o", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
    assert not (tmp_path / "out").exists()
