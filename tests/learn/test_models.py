"""The nine models beside their libraries' defaults."""

import contextlib
import os
import re
import tempfile
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from comparisons import run
from databases import database_of
from learnt_rows import fitted, read
from small_populations import KIND_SCENES, KINDS

from gen.runtime.errors import InputError
from gen.runtime.memory import free
from learn import Surrogate, cli, models
from learn.comparison.paper import OPTIMA
from learn.features.sets import Scaling
from learn.models import AT_BOUND, MODELS, UNFINISHED, pipeline, remarks, scaling_of


@pytest.mark.parametrize("model", MODELS)
def test_baselines_are_the_libraries_own_and_repeatable(model, samples):
    from sklearn.base import clone

    built = pipeline(MODELS[model], seed=4)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # 200 epochs are not enough for the perceptron
        first = built.fit(*samples).predict(samples[0])
        again = clone(built).fit(*samples).predict(samples[0])
    np.testing.assert_array_equal(first, again)
    estimator = built.named_steps["model"]
    ours = estimator.get_params(deep=False)
    # What we set beyond a bare call: seeds and threads, and what is spelled out.
    spelled = {
        "random_state",
        "seed",
        "n_jobs",
        "estimator",
        "kernel",
        "optimizer",
        "missing",
    }
    spelled |= {"max_depth", "learning_rate", "n_estimators"}
    for name, value in type(estimator)().get_params(deep=False).items():
        if name not in spelled:
            assert ours[name] == value, name


def test_spelled_out_defaults_are_defaults(samples):
    from sklearn.ensemble import AdaBoostRegressor
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF
    from sklearn.preprocessing import normalize
    from xgboost import XGBRegressor

    inputs, target = samples
    theirs = {
        "adaboost": AdaBoostRegressor(random_state=0),
        "xgboost": XGBRegressor(n_jobs=1),
        "gaussian-process": GaussianProcessRegressor(RBF(1.0, "fixed")),
    }
    for name, estimator in theirs.items():
        ours = pipeline(MODELS[name]).fit(inputs, target).predict(inputs)
        expected = estimator.fit(normalize(inputs), target).predict(normalize(inputs))
        np.testing.assert_array_equal(ours, expected)


@pytest.mark.parametrize("model", MODELS)
def test_libraries_tell_users_nothing_in_their_own_words(model, samples):
    """Neither a setting that a library will drop, nor how its optimiser has ended."""
    settings = dict(OPTIMA[model])
    settings |= {"n_estimators": 5} if "n_estimators" in settings else {}
    for tuned in (False, True):
        built = pipeline(MODELS[model], settings if tuned else {}, tuned=tuned)
        if model == "mlp":
            built.set_params(model__max_iter=5)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            with remarks() as said:
                built.fit(*samples)
        assert all(each in {UNFINISHED, AT_BOUND} for each in said), said


def scaled_forces(database, change, factor):
    """Forces of a database that are its areas times a factor, with their scaling."""
    rows = read(database, "area")
    change("force", slice(None), rows.target.copy() * factor)
    forces = read(database, "force")
    return forces.target, scaling_of(forces, np.arange(forces.size))


def test_targets_of_the_size_of_an_area_are_not_scaled(database, change):
    _, scaling = scaled_forces(database, change, 1.0)
    assert scaling == Scaling()


@pytest.mark.parametrize("factor", [2.0**-40, 2.0**40])
def test_targets_of_another_size_are_brought_to_an_areas_by_a_power_of_two(
    database, change, factor
):
    forces, scaling = scaled_forces(database, change, factor)
    assert scaling.mean == 0
    assert np.log2(scaling.deviation) % 1 == 0
    assert 4 <= np.median(scaling.scaled(forces)) < 8
    np.testing.assert_array_equal(scaling.restored(scaling.scaled(forces)), forces)


def answers(surrogate, path):
    """The answers of a surrogate to the rows of its database, by target, and the ends."""
    rows = read(path, "area", features=surrogate.features.name)
    statistics, delta = rows.described[:, 1:], rows.described[:, 0]
    ratio = surrogate.hardness_limits and surrogate.hardness_limits[1]
    asked = surrogate.of_statistics(statistics, delta, 1000.0, hardness_ratio=ratio)
    return surrogate.predict_rows(asked)


@pytest.mark.few(1)
@pytest.mark.parametrize(
    "features", ["dimensionless", pytest.param("paper", marks=pytest.mark.long)]
)
@pytest.mark.parametrize("name", KIND_SCENES)
def test_targets_of_every_kind_are_learnt_or_refused_in_a_line(
    kinds, tmp_path, name, features
):
    """A surrogate is better than a constant and keeps its target's signs, or is not written."""
    path, learnt = kinds / f"{name}.h5", set()
    for target in KINDS:
        surrogate = known = None
        try:
            surrogate = fitted(path, features=features, targets=(target,))
        except InputError as error:
            known = re.search(
                rf"{target}.*(no better than a constant|does not vary)", str(error)
            )
        assert surrogate or known, target
        if surrogate is None:
            continue
        learnt.add(target)
        surrogate.save(tmp_path / "x.surrogate")
        scores = surrogate.card["targets"][target]["scores"]
        assert scores["r2"] > 0
        assert 0 <= scores["nmae"] < 1000
        found = answers(Surrogate.load(tmp_path / "x.surrogate"), path)
        for values in (found.values[target], found.low[target], found.high[target]):
            assert not np.isnan(values).any()
        if target in {"negative", "tiny"}:
            assert np.median(found.values[target]) < 0, "is not cut at 0"
    assert (
        learnt >= {"negative", "signed", "tiny", "huge", "spoilt", "distant"}
        or name != "free"
    )


@pytest.mark.long
def test_a_growth_to_a_negative_target_does_not_meet_its_mark_by_the_sign(
    kinds, monkeypatch
):
    monkeypatch.chdir(kinds)
    rows = ["--rows", "90", "--nmae", "0.01", "--features", "dimensionless"]
    given = ["--target", "negative", "--model", "decision-tree", *rows]
    shown = cli.main(["grow", "free.toml", "-o", "grown.surrogate", "--trust", *given])
    card = Surrogate.load("grown.surrogate").card
    assert shown in {0, 2}
    assert not card["grown"]["met"]
    assert card["grown"]["bounds"]["negative"] > 0.01


@pytest.mark.long
def test_a_share_is_cut_at_100_percent_and_an_output_without_bounds_is_not(kinds):
    surrogate = fitted(kinds / "free.h5", targets=("area", "negative"))
    assert surrogate.learnt["area"].bounds == (0.0, 100.0)
    assert surrogate.learnt["negative"].bounds == (-np.inf, np.inf)


@pytest.fixture(scope="module")
def bounded(kinds, tmp_path_factory):
    """A loaded surrogate of an output with bounds in `[store]`, and its database."""
    bounds = "least = { signed = -4 }\nmost = { signed = 96 }\n"
    text = (kinds / "free.toml").read_text() + bounds
    with contextlib.chdir(kinds):
        database_of(Path(), text, "bounded", "--trust")
    path = tmp_path_factory.mktemp("bounded") / "b.surrogate"
    fitted(kinds / "bounded.h5", targets=("signed",)).save(path)
    return Surrogate.load(path), kinds / "bounded.h5"


@pytest.mark.long
def test_an_output_has_the_bounds_that_its_scene_gives(bounded):
    surrogate, _ = bounded
    assert surrogate.learnt["signed"].bounds == (-4.0, 96.0)


@pytest.mark.long
def test_answers_and_intervals_are_cut_at_the_bounds_of_their_column(bounded):
    surrogate, path = bounded
    tight = {"signed": replace(surrogate.learnt["signed"], bounds=(0.0, 0.5))}
    cut = answers(replace(surrogate, learnt=tight), path)
    for each in (cut.values, cut.low, cut.high):
        assert each["signed"].min() >= 0.0
        assert each["signed"].max() <= 0.5


def test_a_fit_asks_the_system_and_no_file_that_others_could_make(
    solved, tmp_path, monkeypatch, capsys
):
    """A FIFO of the name that fits once shared has held them up for ever."""
    os.mkfifo(tmp_path / f"asperity-memory-{os.getuid()}")
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    line = ["compare", solved, "-o", tmp_path / "out", "--model", "decision-tree"]
    monkeypatch.setattr(models, "free", lambda: 10 * models.MIB)
    assert run(*line) == 2
    assert "this machine has 0.0 to give" in capsys.readouterr().err
    monkeypatch.undo()
    assert run(*line) == 0
    assert 0 < free() <= os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
