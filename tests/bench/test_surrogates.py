"""Reports on surrogates: the same functions as the commands', on a few rows of the paper preset."""

import dataclasses
import json
import math
import signal

import numpy as np
import pytest

import gen.cli
from bench import __main__ as bench
from bench import databases
from bench.surrogates import cases, generalisation_report, times
from bench.surrogates.cases import CASES, FINE, HOME, HURST, resampled, scan_length, unseen_hurst
from bench.surrogates.cost import cost, of_the_paper, sizes, tuning_seconds
from bench.surrogates.cost import report as report_of_costs
from bench.surrogates.fitting import fit, parted, read, request_for
from bench.surrogates.generalisation import generalisation
from bench.surrogates.generalisation_report import covers, state_of, verdict
from bench.surrogates.throughput import loaded, markdown_table, throughput
from bench.surrogates.times import PAPER_BREAK_EVEN
from bench.table import read_table
from gen.database import Counts, Reader
from gen.generation.plan import parameters
from gen.generation.run import RunResult
from gen.generation.sample import compute_rows
from gen.runtime.errors import InputError
from gen.scene import Scene
from learn.surrogate.break_even import break_even

ROW = {
    "tested_on": "fine grid (257)",
    "model": "kernel-ridge",
    "features": "paper",
    "trained": 1000,
    "judged": 500,
    "nmse": 1.0,
    "nmae": 10.0,
    "nmaxe": 10.0,
    "r2": 90.0,
    "reference": 2.0,
    "flagged": 0.9,
    "covered": 0.5,
    "slack": 0.05,
    "mending": 100,
    "mended_nmae": 9.0,
    "mended_covered": 0.7,
    "resampled_nmae": math.nan,
    "grid_nmae": math.nan,
}


@pytest.fixture(scope="module")
def paper(tmp_path_factory):
    """200 rows of the paper preset."""
    folder = tmp_path_factory.mktemp("paper")
    path = databases.of_the_paper(None, folder, 200)
    assert path == folder / "paper.h5"
    return path


def test_the_papers_break_even_follows_from_its_times():
    assert of_the_paper()["break_even"] == pytest.approx(PAPER_BREAK_EVEN, abs=1)


def test_break_even_is_where_the_lines_cross():
    queries = break_even(100.0, 0.01, 0.002)
    assert queries * 0.01 >= 100.0 + queries * 0.002 > (queries - 1) * 0.01 + 0.002
    assert break_even(1.0, 0.01, 0.01) == math.inf


def test_the_median_leaves_the_first_call_out(monkeypatch):
    now, calls = [0.0], []
    monkeypatch.setattr(times, "process_time", lambda: now[0])
    monkeypatch.setattr(times, "ENOUGH", 0.35)

    def call():
        now[0] += 100.0 if not calls else 0.1
        calls.append(None)

    assert times.median_seconds(call) == pytest.approx(0.1)
    assert len(calls) == 1 + 4
    assert times.mean_seconds([call, call]) == pytest.approx(0.1)


def test_databases_are_resumed_and_others_are_refused(tmp_path, capsys):
    text = "samples = 6\n[surface]\nnodes = 9\n"
    (tmp_path / "scene.toml").write_text(text)
    path = str(tmp_path / "small.h5")
    assert gen.cli.main(["run", str(tmp_path / "scene.toml"), "-o", path, "--rows", "0:2"]) == 0
    capsys.readouterr()
    for _ in range(2):
        databases.generated(tmp_path, "small", text)
        with Reader(tmp_path / "small.h5") as reader:
            assert reader.counts().done == 6
    said = capsys.readouterr().err
    assert said.count("generating") == 1, "a complete database is not generated again"
    with pytest.raises(InputError, match=r"small\.h5: is a database of another scene \(surface"):
        databases.generated(tmp_path, "small", text.replace("9", "17"))
    with pytest.raises(InputError, match="give one of the paper preset"):
        databases.of_the_paper(tmp_path / "small.h5", tmp_path, 6)


def test_a_signal_ends_the_report_with_what_to_do(tmp_path, monkeypatch, capsys):
    interrupted = RunResult(Counts(4, 2, 0), signal.SIGTERM, "")
    monkeypatch.setattr(databases, "generate_database", lambda request, world: interrupted)
    with pytest.raises(KeyboardInterrupt):
        databases.generated(tmp_path, "small", "samples = 6\n")
    said = capsys.readouterr().err.strip()
    assert said.endswith("small.h5: interrupted; the same command goes on")


def test_scaled_scenes_have_the_same_areas():
    texts = ("", scan_length(0.3, 0.0003), scan_length(300.0, 1.0))
    head = "samples = 4\nseed = 5\n"
    small = ("nodes = 33\n", "[surface]\nnodes = 33\n")
    scenes = [
        Scene.parse(
            head + text.replace("[surface]\n", small[1]) if text else head + small[1], "test"
        )
        for text in texts
    ]
    deltas = [parameters(scene, 0, 4).delta for scene in scenes]
    np.testing.assert_allclose(deltas[1], 0.0003 * deltas[0], rtol=1e-12)
    areas = [compute_rows(scene, 0, 4)["area_percent"] for scene in scenes]
    np.testing.assert_array_equal(areas[1], areas[0])
    np.testing.assert_array_equal(areas[2], areas[0])


def test_unseen_exponents_are_not_trained_on(paper):
    parts = parted(read(request_for(paper, "kernel-ridge", "paper", 100.0), 200))
    everything = [parts.train, parts.calibration, parts.test]
    assert sum(part.size for part in everything) == 200
    assert np.unique(np.concatenate([part.rows for part in everything])).size == 200
    trial = unseen_hurst(parts)
    with Reader(paper) as reader:
        hurst = reader.column("hurst")
    assert hurst[trial.parts.train.rows].max() <= 0.7
    assert hurst[trial.parts.calibration.rows].max() <= 0.7
    assert hurst[trial.judged.rows].min() > 0.7
    assert hurst[trial.mending.rows].min() > 0.7
    assert set(trial.judged.rows) <= set(parts.test.rows)
    assert not set(trial.mending.rows) & set(trial.judged.rows)


def test_rows_of_two_grids_are_matched(paper):
    rows = read(request_for(paper, "kernel-ridge", "paper", 100.0), 50)
    fine, coarse = rows.at(np.array([7, 3, 20])), rows.at(np.array([3, 5, 7]))
    matched, areas = resampled(fine, coarse)
    assert matched.rows.tolist() == [3, 7]
    np.testing.assert_array_equal(areas, rows.target[[3, 7]])


def test_a_fit_knows_where_it_was_trained(paper):
    request = request_for(paper, "kernel-ridge", "dimensionless", 100.0)
    parts = parted(read(request, 200))
    fitted = fit(request, parts.train, parts.calibration, parts.folds)
    assert fitted.flagged(parts.train) == 0
    far = dataclasses.replace(parts.test, inputs=parts.test.inputs + 100.0)
    assert fitted.flagged(far) == 1
    assert fitted.covered(parts.test, 0.9) > 0.7
    assert fitted.predict(far).min() >= 0


@pytest.mark.parametrize(
    ("changes", "state", "words"),
    [
        ({}, "fails", "fails: 5 x the error at home; intervals too narrow (50% inside); says so"),
        ({}, "fails", "nothing tried here mends its error"),
        ({"mended_nmae": 3.0}, "fails", "mended by 100 rows of it (nMAE 3 %)"),
        ({"mended_covered": 0.92}, "fails", "intervals calibrated on such rows hold (92% inside)"),
        ({"flagged": 0.1}, "fails", "does not say so (only 10% of rows flagged)"),
        ({"nmae": 5.0, "r2": 99.0}, "worse", "worse: 2.5 x"),
        ({"nmae": 2.5, "covered": 0.9}, "holds", "holds: 1.25 x the error at home; intervals hold"),
        ({"mended_nmae": 6.9, "reference": 1.0}, "fails", "helped by 100 rows of it (nMAE 6.9 %)"),
        ({"resampled_nmae": 4.0}, "fails", "mended by features of every second node (nMAE 4 %)"),
        ({"grid_nmae": 30.0}, "fails", "the solved area itself changes by 30 % with the grid"),
    ],
)
def test_verdicts_follow_from_the_numbers(changes, state, words):
    row = ROW | changes
    assert state_of(row) == state
    assert words in verdict(row, [row])


def test_other_features_are_a_cure_if_they_are_better():
    hybrid = ROW | {"features": "hybrid", "nmae": 2.0, "covered": 0.86}
    assert "mended by hybrid features (nMAE 2 instead of 10 %)" in verdict(ROW, [ROW, hybrid])
    elsewhere = hybrid | {"tested_on": "another case"}
    assert "hybrid" not in verdict(ROW, [ROW, elsewhere])
    assert covers(hybrid)
    assert not covers(ROW)


def test_generalisation_end_to_end(paper, tmp_path, monkeypatch):
    few = tuple(case for case in CASES if case.name in {FINE, "L = 0.3 um, scaled"})
    monkeypatch.setattr(cases, "CASES", few)
    found = generalisation(tmp_path, 200, given=paper, area_max=60.0)
    rows = {(each.row["tested_on"], each.row["features"]): each.row for each in found}
    names = [HOME, HURST, *(case.name for case in few)]
    assert list(rows) == [
        (name, features) for features in ("paper", "dimensionless", "hybrid") for name in names
    ]
    home = rows[HOME, "hybrid"]
    assert home["nmae"] < 0.7 * rows[HOME, "paper"]["nmae"]
    assert home["nmae"] == home["reference"]
    # Scaled surfaces are the same to features without units, and nowhere near to others.
    scaled = "L = 0.3 um, scaled"
    assert rows[scaled, "paper"]["flagged"] == 1
    assert rows[scaled, "paper"]["nmae"] > 5 * rows[scaled, "dimensionless"]["nmae"]
    assert rows[FINE, "paper"]["grid_nmae"] > 10
    report = generalisation_report.report(found)
    assert HURST in report.text
    table, picture = report.write(tmp_path / "report")
    _, written = read_table(table)
    assert len(written) == 12
    assert written[0]["verdict"].startswith("the measure for the others")
    assert picture.name == "generalisation-kernel-ridge.png"
    assert picture.stat().st_size > 10_000


def test_costs_end_to_end(paper, tmp_path, monkeypatch):
    monkeypatch.setattr(times, "ENOUGH", 0.01)
    costs = cost(tmp_path, 200, given=paper, area_max=60.0, surfaces=3)
    report = report_of_costs(costs)
    paths, text = report.write(tmp_path / "report"), report.text
    names = ["cost.csv", "learning.csv", "cost.txt", "cost.png"]
    assert [path.name for path in paths] == names
    assert all(path.stat().st_size > 300 for path in paths)
    columns, written = read_table(paths[0])
    assert columns[3:] == ["rows", "database", "tuning", "fit", "solve", "query", "break_even"]
    assert [float(row["break_even"]) for row in written] == [
        q["break_even"] for q in costs.questions
    ]
    ours = [each for each in costs.questions if each["solver"] == "ours"]
    for each in ours:
        build = each["database"] + each["tuning"] + each["fit"]
        assert each["break_even"] == break_even(build, each["solve"], each["query"])
        assert each["database"] >= 200 * 0.9 * costs.solver.solve
    assert len(ours) == 3 + 3 + 2
    assert [point["trained"] for point in costs.points[:2]] == sizes(costs.points[1]["trained"])
    assert "Do not use a surrogate for fewer than" in text
    assert "15,892" in text
    assert "Beside it, queries from which on surrogates on new surfaces pay: paper from" in text
    last = {point["features"]: point["nmae"] for point in costs.points}
    assert last["hybrid"] < last["paper"]


def test_learning_curves_double():
    assert sizes(1000) == [100, 200, 400, 1000]
    assert sizes(90) == [90]


def test_throughput_end_to_end(paper, tmp_path, monkeypatch):
    monkeypatch.setattr(times, "ENOUGH", 0.01)
    import learn.cli

    path = tmp_path / "area.surrogate"
    fitted = ["fit", str(paper), "-o", str(path), "--target", "area", "--train-rows", "100"]
    assert learn.cli.main(fitted) == 0
    speeds = throughput(loaded([path]), 2)
    assert [each["what"] for each in speeds] == ["bem.solve", "bem.ladder"] + 8 * ["area.surrogate"]
    assert speeds[0]["solves"] == 1
    batched = next(each for each in speeds if each["how"] == "10,000 rows of features, without")
    assert batched["solves"] > 10
    for each in speeds:
        assert each["solves"] == pytest.approx(speeds[0]["seconds"] / each["seconds"])


def test_the_table_of_throughput_is_markdown():
    speeds = [
        {"what": "bem.solve", "how": "alone", "seconds": 0.01, "solves": 1.0},
        {"what": "x", "how": "y", "seconds": 2e-6, "solves": 5000.0},
    ]
    table = markdown_table(speeds)
    assert table.splitlines()[2:] == [
        "| bem.solve | alone | 10,000 | 100 | 1 |",
        "| x | y | 2 | 500,000 | 5,000 |",
    ]


TUNED = {
    "model": "kernel-ridge",
    "settings": {"alpha": 1e-6},
    "settings_key": "alpha",
    "refit": {},
    "fitted": {},
    "test": None,
    "train": None,
    "failure": "as an example",
    "remarks": [],
    "search": {},
    "times": {"fit": 1.0, "fits": 1, "test": 1.0, "row": 1.0, "search": 12.5},
}


def test_the_time_of_a_search_is_taken_from_its_folder(tmp_path):
    (tmp_path / "area" / "tuned").mkdir(parents=True)
    result = tmp_path / "area" / "tuned" / "kernel-ridge.json"
    with pytest.raises(InputError, match="has no search of kernel ridge"):
        tuning_seconds(tmp_path)
    result.write_text(json.dumps(TUNED), encoding="utf-8")
    assert tuning_seconds(tmp_path) == 12.5


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["generalisation", "--rows", "50"], "--rows 50: give 100 or more"),
        (["generalisation", "--model", "oracle"], "--model 'oracle'"),
        (["cost", "--rows", "50"], "--rows 50: give 200 or more"),
        (["cost", "--comparison", "nowhere"], "--comparison nowhere"),
        (["cost", "--database", "nowhere.h5"], "nowhere.h5 does not exist"),
        (["throughput", "nowhere.surrogate"], "nowhere.surrogate cannot be read"),
    ],
)
def test_bad_input_is_one_line(arguments, message, tmp_path, capsys):
    assert bench.main([*arguments, "-o", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
    assert not (tmp_path / "out").exists()
