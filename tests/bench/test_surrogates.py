"""Reports on surrogates: the same functions as the commands', on a few rows of the paper preset."""

import dataclasses

import pytest

import gen.cli
from bench import databases
from bench.files import read_table
from bench.report import part_of
from bench.surrogates import cost as times
from bench.surrogates.cost import break_even, cost, of_the_paper, sizes
from bench.surrogates.fitting import fit, parted, read, request_for
from gen.database import Reader
from gen.runtime.errors import InputError


@pytest.fixture(scope="module")
def paper(tmp_path_factory):
    """200 rows of the paper preset."""
    folder = tmp_path_factory.mktemp("paper")
    path = databases.of_the_paper(None, folder, 200)
    assert path == folder / "paper.h5"
    return path


def test_the_papers_break_even_follows_from_its_times():
    """As the paper says."""
    assert of_the_paper()["break_even_searched"] == pytest.approx(15_893, abs=1)


def test_databases_are_resumed_and_others_are_refused(tmp_path, capsys):
    text = "samples = 6\n[surface]\nnodes = 9\n"
    (tmp_path / "scene.toml").write_text(text)
    path = str(tmp_path / "small.h5")
    assert (
        gen.cli.main(["run", str(tmp_path / "scene.toml"), "-o", path, "--rows", "0:2"])
        == 0
    )
    capsys.readouterr()
    for _ in range(2):
        databases.generated(tmp_path, "small", text)
        with Reader(tmp_path / "small.h5") as reader:
            assert reader.counts().done == 6
    said = capsys.readouterr().err
    assert said.count("generating") == 1, "a complete database is not generated again"
    with pytest.raises(
        InputError,
        match=r"small\.h5: is a database of another scene; move it away:\n  surface",
    ):
        databases.generated(tmp_path, "small", text.replace("9", "17"))
    with pytest.raises(InputError, match="give one of the paper preset"):
        databases.of_the_paper(tmp_path / "small.h5", tmp_path, 6)


@pytest.mark.long
def test_a_fit_knows_where_it_was_trained(paper):
    request = request_for(paper, "kernel-ridge", "dimensionless", 100.0)
    parts = parted(read(request, 200))
    fitted = fit(request, parts.train, parts.folds)
    assert fitted.flags(parts.train).mean() <= 0.03
    far = dataclasses.replace(parts.test, inputs=parts.test.inputs + 100.0)
    assert fitted.flags(far).all()
    low, high = fitted.interval(parts.test, 0.9)
    assert ((low <= parts.test.target) & (parts.test.target <= high)).mean() > 0.7
    assert fitted.predict(far).min() >= 0


@pytest.fixture(scope="module")
def costs(paper, tmp_path_factory):
    """The report on costs, on three surfaces."""
    with pytest.MonkeyPatch.context() as quick:
        quick.setattr(times, "ENOUGH", 0.01)
        folder = tmp_path_factory.mktemp("costs")
        return cost(folder, 200, paper, area_max=60.0, surfaces=3)


@pytest.mark.long
def test_costs_are_written_as_tables_and_pictures(costs, tmp_path):
    paths = costs.write(tmp_path, part_of("cost").contents)
    names = [
        "cost.csv",
        "learning.csv",
        "times.csv",
        "totals.csv",
        "cost.png",
        "learning.png",
    ]
    assert [path.name for path in paths] == names
    assert all(path.stat().st_size > 300 for path in paths)
    assert len(read_table(paths[0]).rows) == len(costs.tables["cost"])


@pytest.mark.long
def test_every_question_has_a_break_even_by_its_times(costs):
    ours = [row for row in costs.tables["cost"] if row["solver"] == "ours"]
    assert len(ours) == 3 + 3 + 2
    for row in ours:
        build = row["database"] + row["tuning"] + row["fit"]
        assert row["break_even"] == break_even(build, row["solve"], row["query"])
        if row["asked"] == "new surfaces":
            assert row["database"] >= 200 * 0.9 * row["solve"]


@pytest.mark.long
def test_learning_curves_end_with_all_rows_and_hybrid_features_err_least(costs):
    points = costs.tables["learning"]
    assert [point["trained"] for point in points[:2]] == sizes(points[1]["trained"])
    last = {point["features"]: point["nmae"] for point in points}
    assert last["hybrid"] < last["paper"]
