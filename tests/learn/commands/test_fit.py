"""`learn fit`: with a tuned winner, of several databases, and on several ranks."""

import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest
from comparisons import run, table
from databases import database_of

from gen.surface import generate
from learn import Surrogate


def test_a_tuned_winner_is_taken_with_what_it_rests_on(work, capsys, monkeypatch):
    from learn.comparison import grid

    space = {"alpha": [1e-5, 1e-3], "gamma": [0.001], "kernel": ["rbf"]}
    monkeypatch.setitem(grid.SCALED, "kernel-ridge", space)
    tune = ["tune", "database.h5", "-o", "out", "--model", "kernel-ridge", "--seed", "3"]
    assert run(*tune, "--features", "dimensionless", "--target", "area") == 0
    assert "for features" in capsys.readouterr().out
    assert table("out/area/tuning.csv")[0]["grid"] == "for features without units"
    fit = ["fit", "database.h5", "--from", "out", "--target", "area", "-o", "t.surrogate"]
    assert run(*fit) == 0
    card = Surrogate.load("t.surrogate").card
    assert card["seed"] == 3
    assert card["features"] == "dimensionless"
    assert card["targets"]["area"]["settings_from"] == "tuned in out/area"
    assert card["targets"]["area"]["comparison"] == "out/area"
    assert card["targets"]["area"]["settings"]["gamma"] == "0.001"
    assert run(*fit, "--features", "paper") == 2
    assert "made with features 'dimensionless', not 'paper'" in capsys.readouterr().err
    assert run(*fit, "--model", "svm") == 2
    assert "no tuned svm" in capsys.readouterr().err
    assert run(*fit, "--target", "both") == 2
    said = "out/force has no tuned kernel-ridge: give --target area, or first "
    assert f"{said}python -m learn tune --model kernel-ridge --target force" in (
        capsys.readouterr().err
    )


SCENES = {
    "coarse": "samples = 80\nseed = 5\n[surface]\nnodes = 17\n",
    "soft": """
        samples = 60
        seed = 6
        [surface]
        nodes = 17
        [contact]
        modulus = 2.0
        hardness_ratio = [0.003, 0.1]
    """,
    "fine": 'samples = 30\nseed = 7\n[surface]\nnodes = 33\ngenerator = "midpoint"\n',
}


@pytest.fixture(scope="module")
def several(tmp_path_factory):
    """A folder with databases of elastic and yielding bodies, two grids, and their surrogate."""
    folder = tmp_path_factory.mktemp("several")
    files = [database_of(folder, text, name) for name, text in SCENES.items()]
    assert run("fit", *files, "--features", "hybrid", "-o", folder / "all.surrogate") == 0
    assert run("fit", *files, "-o", folder / "free.surrogate") == 0
    return folder


@pytest.fixture
def trial(several, tmp_path, monkeypatch):
    """A current folder with copies of what `several` has made."""
    shutil.copytree(several, tmp_path / "trial")
    monkeypatch.chdir(tmp_path / "trial")


@pytest.mark.long
@pytest.mark.usefixtures("trial")
def test_the_card_of_several_databases_names_them_all(capsys):
    surrogate = Surrogate.load("all.surrogate")
    card = surrogate.card
    found = [(Path(each["database"]).name, each["rows"]) for each in card["databases"]]
    assert found == [("coarse.h5", 80), ("soft.h5", 60), ("fine.h5", 30)]
    assert [each["generator"] for each in card["databases"]][1:] == [
        "diamond-square",
        "midpoint",
    ]
    assert card["columns"][-1] == ["log2(nodes)", "1"]
    assert card["elastic"] is True
    assert sum(each["rows"] for each in card["targets"]["area"]["databases"]) == 34
    assert run("card", "all.surrogate") == 0
    said = capsys.readouterr().out
    for text in (
        *(
            "17 x 17 nodes, side 1000 um and 33 x 33 nodes",
            "and elastic bodies",
            "midpoint",
        ),
        *("Databases, and scores on their test rows", "coarse.h5", "soft.h5, sha256"),
    ):
        assert text in said, text


@pytest.mark.usefixtures("trial")
def test_predictions_know_the_grid_and_elastic_bodies():
    surrogate = Surrogate.load("all.surrogate")
    for nodes in (17, 33):
        heights = generate(
            "diamond-square", nodes, 0.65, 12.0, np.random.default_rng(nodes)
        )
        elastic = surrogate.predict(heights, 1000.0, [15.0])
        assert "nodes" not in elastic.reasons[0]
        assert "hardness" not in elastic.reasons[0]
        hard = surrogate.predict(heights, 1000.0, [15.0], hardness=1e6)
        np.testing.assert_allclose(hard.area, elastic.area, rtol=1e-4)
        soft = surrogate.predict(heights, 1000.0, [15.0], hardness=0.01)
        assert (soft.area > elastic.area).all()
        assert (soft.force < elastic.force).all()
    unseen = generate("diamond-square", 65, 0.65, 12.0, np.random.default_rng(1))
    (reason,) = surrogate.predict(unseen, 1000.0, [15.0]).reasons
    assert "log2(nodes) 6.022 outside 4.087 to 5.044" in reason
    (reason,) = surrogate.predict(heights, 1000.0, [15.0], hardness=1e-4).reasons
    assert "hardness/E* 0.0001 outside 0.003 to inf" in reason


def test_blocks_that_no_features_have_are_refused(work, capsys):
    for options, word in (
        (["--features", "hybrid", "--blocks", "40"], "--blocks 40: give 33 or 65"),
        (["--blocks", "65"], "only hybrid features have blocks"),
    ):
        assert run("fit", "database.h5", "-o", "t.surrogate", *options) == 2
        assert word in capsys.readouterr().err


@pytest.mark.long
@pytest.mark.parametrize("normalise", ["standard", "l2", "min-max"])
@pytest.mark.parametrize("features", ["dimensionless", "paper"])
def test_gaussian_processes_do_not_collapse(work, features, normalise):
    """Wherever the search for the likelihood starts."""
    given = [
        "--model",
        "gaussian-process",
        "--features",
        features,
        "--normalise",
        normalise,
    ]
    assert run("fit", "database.h5", *given, "-o", "g.surrogate") == 0
    surrogate = Surrogate.load("g.surrogate")
    for target, about in surrogate.card["targets"].items():
        assert about["scores"]["r2"] > 95, target


def test_a_model_that_is_no_better_than_a_constant_is_not_written(
    work, capsys, database, change
):
    """As where the target has nothing to do with the surface: one line says so."""
    change(
        "force", slice(None), np.random.default_rng(1).permutation(90.0 + np.arange(90))
    )
    fit = [
        "fit",
        database,
        "--target",
        "force",
        "--features",
        "paper",
        "-o",
        "f.surrogate",
    ]
    assert run(*fit, "--model", "decision-tree") == 2
    said = capsys.readouterr().err.splitlines()
    assert "no better than a constant" in said[-1]
    assert not Path("f.surrogate").exists()


def test_targets_that_few_rows_have_are_fitted_with_the_others(
    work, yielding, tmp_path, capsys
):
    """The split sees them all; where none can show them all, one line names the target."""
    given = ["--target", "area,force,yielded_percent", "-o", "y.surrogate"]
    for number, code in ((0, 2), (1, 2), (8, 0)):
        path = shutil.copy(yielding, tmp_path / f"few{number}.h5")
        with h5py.File(path, "r+") as file:
            share = file["yielded_percent"][:]
            least = np.sort(share)[::-1][number] if number else np.inf
            file["yielded_percent"][:] = np.where(share > least, share, 0.0)
        assert run("fit", path, *given, "--model", "decision-tree") == code
        assert code == 0 or "yielded_percent" in capsys.readouterr().err.splitlines()[-1]


def test_a_database_without_a_target_shows_its_mean_error(
    work, yielding, tmp_path, capsys
):
    """Where nothing yields the error has nothing to be divided by."""
    path = shutil.copy(yielding, tmp_path / "none.h5")
    with h5py.File(path, "r+") as file:
        file["yielded_percent"][:] = 0.0
    other = shutil.copy(yielding, tmp_path / "some.h5")
    given = ["--target", "area,yielded_percent", "-o", "y.surrogate"]
    assert run("fit", other, path, *given) == 0
    assert run("card", "y.surrogate") == 0
    shown = capsys.readouterr().out
    assert not {"inf", "nan"} & set(shown.split())
    judged = Surrogate.load("y.surrogate").card["targets"]["yielded_percent"]["databases"]
    assert np.isnan(judged[1]["nmae"])
    assert np.isfinite([judged[0]["nmae"], judged[0]["mae"], judged[1]["mae"]]).all()
