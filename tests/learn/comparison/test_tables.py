"""Intervals of scores, drawn by surface; what the nMSE is; bars and predictions in pictures."""

import json
import shutil

import numpy as np
import pytest
from comparisons import run, table
from databases import database_of

from gen.runtime.errors import InputError
from learn import dataset, split
from learn.comparison import paper, tables
from learn.comparison.folder import Folder
from learn.comparison.grid import reach
from learn.dataset import Request

SCENE = "samples = 60\nsamples_per_surface = 3\n[surface]\nnodes = 9\n"
TREE = ["--model", "decision-tree"]


@pytest.fixture(scope="module")
def thrice(tmp_path_factory):
    """A comparison of rows that are three of each surface."""
    folder = tmp_path_factory.mktemp("thrice")
    assert run("compare", database_of(folder, SCENE), "-o", folder / "found", *TREE) == 0
    return folder / "found"


def test_surfaces_are_drawn_not_rows(thrice):
    found = tables.read(Folder(thrice / "area"))
    rows = len(table(thrice / "area/baseline/decision-tree.csv"))
    assert found.rows[0].intervals.resampled == f"{rows // 3} surfaces"
    groups = [row["group"] for row in table(thrice / "area/rows.csv")]
    assert {groups.count(each) for each in groups} == {3}


def test_files_and_tables_state_the_intervals_their_level_and_their_draws(thrice, capsys):
    assert run("show", thrice) == 0
    said = " ".join(capsys.readouterr().out.split())
    (row,) = table(thrice / "area/scores.csv")
    surfaces = row["drawn"].removesuffix(" surfaces")
    assert (
        "90 % intervals of the scores on the test rows [%]: bootstrap, 1,000 resamples"
        in said
    )
    assert f"of {surfaces} surfaces; nMaxE has none" in said
    assert (row["level"], row["resamples"]) == ("0.9", "1000")
    for name in ("nmse", "nmae", "r2"):
        low, value, high = (
            float(row[key]) for key in (f"{name}_low", name, f"{name}_high")
        )
        assert low <= value <= high
        assert f"{low:.2f} to {high:.2f}" in said
    assert "nmaxe_low" not in row


def test_what_the_nmse_is_stands_beside_the_table_with_the_factor_of_the_data(
    thrice, capsys
):
    truth, _ = Folder(thrice / "area").prediction("baseline", "decision-tree")
    factor = float(np.var(truth) / np.mean(truth))
    assert run("show", thrice, "--no-pictures") == 0
    said = " ".join(capsys.readouterr().out.split())
    assert f"over their mean, {factor:.2g} % of area here and 2.4 % in the paper" in said
    assert f"{factor / paper.SPREAD:.2g} times the paper's" in said
    (row,) = table(thrice / "area/scores.csv")
    assert float(row["variance_over_mean"]) == pytest.approx(factor, rel=1e-12)
    assert float(row["nmse"]) == pytest.approx(
        (100 - float(row["r2"])) * factor, rel=1e-9
    )


def test_rows_that_do_not_belong_to_the_predictions_are_refused(thrice, tmp_path):
    shutil.copytree(thrice, tmp_path, dirs_exist_ok=True)
    rows = (thrice / "area/rows.csv").read_text().splitlines(keepends=True)
    (tmp_path / "area/rows.csv").write_text("".join(rows[:-1]))
    with pytest.raises(
        InputError, match=r"decision-tree.csv has 12 rows, rows.csv has 11"
    ):
        tables.read(Folder(tmp_path / "area"))


@pytest.mark.long
def test_winners_beyond_the_grid_and_searches_of_too_few_candidates_are_said(
    work, capsys
):
    assert run("tune", "database.h5", "-o", "out", *TREE) == 0
    path = work / "out/area/tuned/decision-tree.json"
    result = json.loads(path.read_text())
    deepest = reach("max_depth", paper.SPACES["decision-tree"]["max_depth"])[-1]
    result["settings"]["max_depth"] = deepest
    result["search"] |= {"winner": "grid", "ends": ["min_samples_leaf"]}
    path.write_text(json.dumps(result))
    capsys.readouterr()
    assert run("show", "out", "--no-pictures") == 0
    said = capsys.readouterr().out
    assert f"max_depth = {deepest} lies beyond the grid" in said
    assert "at an end of what was tried: a better one may lie beyond" in said
    assert table("out/area/tuning.csv")[0]["ends"] == "min_samples_leaf"
    result["search"]["candidates_scored"] = 9
    path.write_text(json.dumps(result))
    assert run("show", "out", "--no-pictures") == 0
    assert "not searched: 9 candidates were judged" in capsys.readouterr().out
    assert table("out/area/tuning.csv")[0]["winner"] == "not searched"


@pytest.mark.long
@pytest.mark.filterwarnings("ignore::sklearn.exceptions.ConvergenceWarning")
def test_the_library_s_own_process_stands_beside_the_one_with_the_paper_s_kernel(
    work, capsys
):
    """The table said "their libraries' settings" of a process whose kernel was ours."""
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.preprocessing import normalize

    assert run("compare", "database.h5", "-o", "out", "--model", "gaussian-process") == 0
    said = capsys.readouterr().out
    assert "the paper's" in said
    assert "its library's own" in said
    ours, library = table("out/area/scores.csv")
    assert (ours["result"], library["result"]) == ("baseline", "library")
    assert ours["paper_r2"]
    assert not library["paper_r2"]
    (rows,) = dataset.read(Request((work / "database.h5",)))
    parts = split.draw(rows, 0)
    inputs, target = normalize(rows.inputs), rows.target
    process = GaussianProcessRegressor(random_state=0).fit(
        inputs[parts.train], target[parts.train]
    )
    expected = 100 * process.score(inputs[parts.test], target[parts.test])
    assert float(library["r2"]) == pytest.approx(expected, rel=1e-6)
    assert run("show", "out") == 0
