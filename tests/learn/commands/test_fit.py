"""`learn fit`: with a tuned winner, of several databases, and on several ranks."""

import contextlib
import io
import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest
from comparisons import run, table
from databases import database_of

from gen.surface import generate
from learn import Surrogate

TUNE_FIRST = (
    "out/force has no tuned kernel-ridge: give --target area, or first python -m learn tune"
    " --model kernel-ridge --target force"
)
FROM = ["fit", "database.h5", "--from", "out", "--target", "area", "-o", "t.surrogate"]


@pytest.fixture(scope="module")
def comparison(solved, tmp_path_factory):
    """A folder with a database, a comparison with a tuned model, and what its tuning has told."""
    from learn.comparison import grid

    folder = tmp_path_factory.mktemp("tuned")
    shutil.copy(solved, folder / "database.h5")
    space = {"alpha": [1e-5, 1e-3], "gamma": [0.001], "kernel": ["rbf"]}
    tune = ["tune", "database.h5", "-o", "out", "--model", "kernel-ridge", "--seed", "3"]
    with (
        pytest.MonkeyPatch.context() as patch,
        contextlib.chdir(folder),
        contextlib.redirect_stdout(io.StringIO()) as told,
    ):
        patch.setitem(grid.SCALED, "kernel-ridge", space)
        assert run(*tune, "--features", "dimensionless", "--target", "area") == 0
    (folder / "told.txt").write_text(told.getvalue())
    return folder


@pytest.fixture
def tuned(comparison, monkeypatch):
    """The folder with the comparison as the working directory."""
    monkeypatch.chdir(comparison)


@pytest.mark.usefixtures("tuned")
def test_a_comparison_tells_for_which_features_its_grid_is():
    assert "for features" in Path("told.txt").read_text()
    assert table("out/area/tuning.csv")[0]["grid"] == "for features without units"


@pytest.mark.usefixtures("tuned")
def test_a_tuned_winner_is_taken_with_what_it_rests_on():
    assert run(*FROM) == 0
    card = Surrogate.load("t.surrogate").card
    assert card["seed"] == 3
    assert card["features"] == "dimensionless"
    assert card["targets"]["area"]["settings_from"] == "tuned in out/area"
    assert card["targets"]["area"]["comparison"] == "out/area"
    assert card["targets"]["area"]["settings"]["gamma"] == "0.001"


@pytest.mark.usefixtures("tuned")
@pytest.mark.parametrize(
    ("options", "told"),
    [
        (["--features", "paper"], "made with features 'dimensionless', not 'paper'"),
        (["--model", "svm"], "no tuned svm"),
        (
            ["--target", "both"],
            TUNE_FIRST,
        ),
    ],
)
def test_options_that_a_comparison_contradicts_are_refused(options, told, capsys):
    assert run(*FROM, *options) == 2
    assert told in capsys.readouterr().err


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
    """Databases of elastic and yielding bodies on two grids."""
    folder = tmp_path_factory.mktemp("several")
    return [database_of(folder, text, name) for name, text in SCENES.items()]


@pytest.fixture(scope="module")
def path_of_all(several):
    """The path of a surrogate of hybrid features of all databases."""
    path = several[0].with_name("all.surrogate")
    assert run("fit", *several, "--features", "hybrid", "-o", path) == 0
    return path


@pytest.fixture(scope="module")
def of_all(path_of_all):
    """This surrogate."""
    return Surrogate.load(path_of_all)


def test_several_databases_are_learnt_without_their_coarse_contacts(several, tmp_path):
    assert run("fit", *several, "-o", tmp_path / "free.surrogate") == 0


@pytest.mark.long
def test_a_surrogate_of_several_databases_knows_them_all(of_all):
    card = of_all.card
    rows = [(Path(part["database"]).name, part["rows"]) for part in card["databases"]]
    assert rows == [("coarse.h5", 80), ("soft.h5", 60), ("fine.h5", 30)]
    generators = [part["generator"] for part in card["databases"]]
    assert generators[1:] == ["diamond-square", "midpoint"]
    assert card["columns"][-1] == ["log2(nodes)", "1"]
    assert card["elastic"] is True
    assert sum(part["rows"] for part in card["targets"]["area"]["databases"]) == 34


@pytest.mark.long
@pytest.mark.parametrize(
    "text",
    [
        "17 x 17 nodes, side 1000 um and 33 x 33 nodes",
        "and elastic bodies",
        "midpoint",
        "Databases, and scores on their test rows",
        "coarse.h5",
        "soft.h5, sha256",
    ],
)
def test_the_card_of_several_databases_names_them_all(path_of_all, text, capsys):
    assert run("card", path_of_all) == 0
    assert text in capsys.readouterr().out


def heights_of(nodes, seed):
    """A surface of the generator of the first database."""
    return generate("diamond-square", nodes, 0.65, 12.0, np.random.default_rng(seed))


@pytest.mark.parametrize("nodes", [17, 33])
def test_both_grids_and_elastic_bodies_are_inside_the_training(of_all, nodes):
    elastic = of_all.predict(heights_of(nodes, nodes), 1000.0, [15.0])
    assert "nodes" not in elastic.reasons[0]
    assert "hardness" not in elastic.reasons[0]


@pytest.mark.parametrize("nodes", [17, 33])
def test_hard_bodies_are_as_elastic_ones_and_soft_ones_have_more_area(of_all, nodes):
    heights = heights_of(nodes, nodes)
    elastic, hard, soft = (
        of_all.predict(heights, 1000.0, [15.0], hardness=hardness)
        for hardness in (None, 1e6, 0.01)
    )
    np.testing.assert_allclose(hard.area, elastic.area, rtol=1e-4)
    assert (soft.area > elastic.area).all()
    assert (soft.force < elastic.force).all()


def test_a_grid_that_no_database_has_is_outside_the_training(of_all):
    (reason,) = of_all.predict(heights_of(65, 1), 1000.0, [15.0]).reasons
    assert "log2(nodes) 6.022 outside 4.087 to 5.044" in reason


def test_a_hardness_that_no_database_has_is_outside_the_training(of_all):
    soft = of_all.predict(heights_of(33, 33), 1000.0, [15.0], hardness=1e-4)
    assert "hardness/E* 0.0001 outside 0.003 to inf" in soft.reasons[0]


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
