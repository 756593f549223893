"""The study of growths: fresh rows, the table, the files."""

import pytest

import bench.__main__ as bench
from bench.page.content import Figure, Table, Words
from bench.page.parts import contents_of
from bench.populations import grow as study
from bench.populations.grow import Trial, judged_on_fresh, report
from gen.scene import load
from learn.executor import Executor
from learn.grow import rounds
from learn.grow.accuracy import Accuracy
from learn.grow.pace import Pace
from learn.grow.rounds import Order
from learn.request import Request


@pytest.fixture(scope="module")
def trial(tmp_path_factory):
    """A growth of small surfaces, judged on 40 fresh ones."""
    folder = tmp_path_factory.mktemp("growth")
    (folder / "small.toml").write_text("samples = 3\n[surface]\nnodes = 9\n")
    scene = load(str(folder / "small.toml"))
    request = Request(
        database=folder / "small.h5",
        output=folder / "small.surrogate",
        models=("decision-tree",),
        normalisation="standard",
        features="hybrid",
        roots=True,
    )
    order, pace = Order(request, 40.0, 200), Pace(None, 1)
    grown = rounds.grow(order, scene, Executor(), pace, lambda line: None, lambda: False)
    truth = judged_on_fresh(grown.last.surrogate, scene, 40)
    return Trial("small", scene.seed, grown, 1, 2.0, truth)


def test_fresh_surfaces_are_independent_of_those_trained_on(trial):
    truth = trial.truth["area"]
    assert truth.groups == 40
    assert 0 < truth.error < truth.nmae < 60
    (row,) = trial.rows()
    assert row["fresh_nmae"] == truth.nmae
    assert row["rows"] == trial.grown.last.rows


def test_a_report_has_the_picture_of_each_population(trial, tmp_path):
    written = report([trial, trial])
    assert list(written.pictures) == ["small"]
    assert len(written.text.splitlines()) == 2
    assert "fresh surfaces" in written.text


def test_fresh_rows_are_the_first_of_later_surfaces():
    scene = load("quick")
    rows = study._fresh_rows(scene.model_copy(update={"samples_per_surface": 5}))
    assert [next(rows) for _ in range(3)] == [5 * (study.FIRST + number) for number in range(3)]


def test_the_command_writes_its_files(trial, monkeypatch, tmp_path):
    both = [Trial(name, 1, trial.grown, 1, 2.0, trial.truth) for name in study.MARKS]
    monkeypatch.setattr(study, "grow", lambda *_: both)
    assert bench.main(["grow", "-o", str(tmp_path / "out")]) == 0
    assert {path.name for path in (tmp_path / "out").iterdir()} == {
        *("grow.csv", "grow.txt", "quick.png", "maps.png")
    }
    kinds = [type(each) for each in contents_of("populations/grow", tmp_path / "out")]
    assert kinds == [Words, Table, Figure, Figure]


def test_unknown_populations_are_refused(tmp_path, capsys):
    arguments = ["grow", "-o", str(tmp_path / "out"), "--population", "moon"]
    assert bench.main(arguments) == 2
    assert "give quick or maps" in capsys.readouterr().err


def test_a_promise_is_said_beside_the_truth(trial):
    changed = Trial("small", 1, trial.grown, 1, 2.0, {"area": Accuracy(12.34, 0.5, 40)})
    assert "12.34 +- 0.50 %" in report([changed]).text
