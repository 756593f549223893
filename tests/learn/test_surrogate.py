"""Surrogates: all nine models predict the same once loaded; intervals hold; files are safe."""

import os
import pickle
from dataclasses import replace

import crafted_surrogates
import numpy as np
import pytest
from mapie.regression import SplitConformalRegressor
from sklearn.linear_model import LinearRegression

import learn
from gen.runtime.errors import InputError
from gen.surface import generate
from learn import Surrogate, split
from learn.comparison.search.spaces import OPTIMA
from learn.executor import Executor
from learn.models import MODELS, pipeline
from learn.reading import Reading
from learn.request import Request
from learn.surrogate import conformal, law, settings, training
from learn.surrogate.estimators import put_together, taken_apart
from learn.surrogate.law import Order


def say(line):
    """Hear nothing."""


def fitted(path, model="kernel-ridge", features="dimensionless", **options):
    targets = options.pop("targets", ("area", "force"))
    scaling = "l2" if features == "paper" else "standard"
    request = Request(path, path, targets, (model,), None, scaling, features, **options)
    return training.fit(request, Executor(), say)


@pytest.fixture(scope="module")
def ridge(solved):
    return fitted(solved)


@pytest.fixture(scope="module")
def heights():
    return generate("diamond-square", 33, 0.7, 12.0, np.random.default_rng(5))


@pytest.mark.parametrize("model", list(MODELS))
def test_every_model_fits_saves_loads_and_predicts_the_same(
    solved, tmp_path, heights, model, monkeypatch
):
    if "n_estimators" in OPTIMA[model]:
        monkeypatch.setitem(OPTIMA[model], "n_estimators", 30)
    monkeypatch.setitem(settings.NETWORK, "max_iter", 200)
    surrogate = fitted(solved, model, "hybrid")
    deltas = np.array([6.0, 20.0, 44.0])
    std = model == "gaussian-process"
    first = surrogate.for_surface(heights, 1000.0).predict(deltas, std=std)
    surrogate.save(tmp_path / "x.surrogate")
    loaded = Surrogate.load(tmp_path / "x.surrogate")
    again = loaded.for_surface(heights, 1000.0).predict(deltas, std=std)
    for target in ("area", "force"):
        np.testing.assert_array_equal(again.values[target], first.values[target])
        np.testing.assert_array_equal(again.low[target], first.low[target])
        np.testing.assert_array_equal(again.high[target], first.high[target])
        assert (first.low[target] <= first.values[target]).all()
        if std:
            np.testing.assert_allclose(again.std[target], first.std[target], rtol=1e-9)
            assert (again.std[target] > 0).all()
    assert bool(first.std) == std
    assert loaded.card == surrogate.card
    scores = surrogate.card["targets"]["area"]["scores"]
    assert scores["r2"] > (60 if model == "decision-tree" else 80)  # 58 rows trained it


@pytest.mark.parametrize("features", ["paper", "dimensionless"])
def test_what_it_predicts_are_the_rows_of_its_test(solved, features):
    from gen.database import Reader
    from gen.generation.plan import parameters
    from gen.generation.sample import surface_of
    from learn import dataset, metrics

    surrogate = fitted(solved, features=features)
    rows = dataset.read(solved, "force")
    test = split.draw(rows).test
    with Reader(solved) as reader:
        scene = reader.scene
    plan = parameters(scene, 0, 90)
    predicted = np.array(
        [
            surrogate.predict(surface_of(scene, plan, row), 1000.0, plan.delta[row]).force[0]
            for row in rows.rows[test]
        ]
    )
    again = vars(metrics.scores(rows.target[test], predicted))
    assert surrogate.card["targets"]["force"]["scores"] == pytest.approx(again)


def test_area_knows_no_units_and_force_scales_with_them(ridge, heights):
    micro = ridge.predict(heights, 1000.0, [5.0, 30.0])
    nano = ridge.predict(heights * 3e-4, 0.3, [5.0 * 3e-4, 30.0 * 3e-4], e_star=2e5)
    np.testing.assert_allclose(nano.area, micro.area, rtol=1e-7)
    np.testing.assert_allclose(nano.force, micro.force * 2e5 * 3e-4 * 0.3 / 1000, rtol=1e-7)


def test_a_surface_costs_its_features_once_and_batches_are_the_single_calls(ridge, heights):
    pressed = ridge.for_surface(heights, 1000.0)
    deltas = np.linspace(5.0, 44.0, 7)
    batch = pressed.predict(deltas)
    single = [pressed.predict(delta, level=None, reasons=False) for delta in deltas]
    np.testing.assert_allclose(batch.area, [each.area[0] for each in single], rtol=1e-9)
    assert not single[0].low
    assert "statistics" in vars(pressed.surface)


@pytest.mark.parametrize("features", ["paper", "dimensionless"])
def test_kernel_ridge_is_scikit_learns(solved, features):
    learnt = fitted(solved, features=features, targets=("area",)).learnt["area"]
    ridge = learnt.pipeline.named_steps["model"]
    inputs = learnt.pipeline.steps[0][1].transform(
        np.abs(np.random.default_rng(0).normal(size=(5000, 23)))
    )
    assert learnt._expansion is not None
    learnt.pipeline.steps[0] = ("scaling", "passthrough")
    theirs = learnt.mean + learnt.deviation * ridge.predict(inputs)
    np.testing.assert_allclose(learnt.raw(inputs), theirs, rtol=1e-6, atol=1e-9)


def test_what_is_unknown_ground_is_said(ridge, heights):
    assert ridge.predict(heights, 1000.0, 1e-3).reasons[0].startswith("delta/h")
    other = generate("diamond-square", 65, 0.7, 12.0, np.random.default_rng(5))
    assert "65 x 65 nodes, trained on 33 x 33" in ridge.predict(other, 1000.0, 9.0).reasons[0]
    oblong = ridge.predict(heights, (1000.0, 500.0), 9.0).reasons[0]
    assert "1000 x 500 um, trained on square patches" in oblong
    inside = [ridge.predict(heights, 1000.0, delta).inside[0] for delta in (5.0, 10.0, 20.0, 30.0)]
    assert sum(inside) >= 2


def test_the_papers_features_are_bound_to_their_length(solved, heights):
    paper = fitted(solved, features="paper")
    reason = paper.predict(heights, 300.0, 9.0).reasons[0]
    assert "side 300 um, trained on 1000 um" in reason
    assert "spacing 9.375 um, trained on 31.25 um" in reason


def test_answers_stay_within_what_is_possible(ridge, heights):
    for delta in (1e-6, 0.01, 1e3, 1e6):
        answer = ridge.predict(heights, 1000.0, delta, level=0.5)
        for target, ceiling in (("area", 100.0), ("force", np.inf)):
            ends = answer.low[target][0], answer.values[target][0], answer.high[target][0]
            assert 0 <= ends[0] <= ends[1] <= ends[2] <= ceiling


@pytest.mark.parametrize(
    ("call", "word"),
    [
        (lambda s, z: s.predict(z, 1000.0, 0.0), "above 0"),
        (lambda s, z: s.predict(z, -1.0, 5.0), "side"),
        (lambda s, z: s.predict(z[0], 1.0, 5.0), "2-D"),
        (lambda s, z: s.predict(z * np.nan, 1.0, 5.0), "finite"),
        (lambda s, z: s.predict(z, 1.0, 5.0, e_star=0.0), "modulus"),
        (lambda s, z: s.predict(z, 1.0, 5.0, level=1.0), "between 0 and 1"),
    ],
)
def test_wrong_questions_are_refused(ridge, heights, call, word):
    with pytest.raises(InputError, match=word):
        call(ridge, heights)


def test_calibration_rows_train_nothing(solved, monkeypatch):
    from learn import dataset

    rows = dataset.read(solved, "area", features="dimensionless")
    parts = split.draw(rows)
    train, calibration = training.without_calibration(rows, parts.train)
    assert calibration.size == 14
    everything = np.concatenate([train, calibration, parts.test])
    np.testing.assert_array_equal(np.sort(everything), np.arange(90))
    assert not set(rows.groups[train]) & set(rows.groups[calibration])


def test_intervals_are_mapies():
    random = np.random.default_rng(0)
    inputs = random.normal(size=(300, 3))
    target = inputs.sum(axis=1) + random.normal(size=300)
    model = LinearRegression().fit(inputs[:100], target[:100])
    held, new = slice(100, 180), slice(180, None)
    found = conformal.calibrate(model.predict(inputs[held]), target[held], target[:100])
    assert found.borders.size == 0
    for level in (0.5, 0.8, 0.9, 0.95):
        theirs = SplitConformalRegressor(model, level, prefit=True)
        theirs.conformalize(inputs[held], target[held])
        predicted, ends = theirs.predict_interval(inputs[new])
        half = found.half_width(predicted, level)
        np.testing.assert_allclose(predicted + half, ends[:, 1, 0], rtol=1e-12)
        np.testing.assert_allclose(predicted - half, ends[:, 0, 0], rtol=1e-12)


def test_intervals_hold_where_errors_grow():
    random = np.random.default_rng(1)
    inputs = random.uniform(0.0, 10.0, size=(6000, 1))
    target = inputs[:, 0] * (1 + 0.2 * random.normal(size=6000))
    model = LinearRegression().fit(inputs[:1000], target[:1000])
    held = slice(1000, 3000)
    found = conformal.calibrate(model.predict(inputs[held]), target[held], target[:1000])
    assert found.borders.size == conformal.RANGES - 1
    predicted, truth = model.predict(inputs[3000:]), target[3000:]
    for level, share, half in conformal.coverage(found, predicted, truth, (0.5, 0.9, 0.95)):
        assert share == pytest.approx(level, abs=0.03)
        small = predicted < np.quantile(predicted, 0.2)
        inside = np.abs(truth - predicted)[small] <= half[small]
        assert inside.mean() == pytest.approx(level, abs=0.06)


def test_too_few_rows_for_a_level_make_an_infinite_interval():
    scores = np.arange(1.0, 10.0)
    assert conformal.quantile(scores, 0.9) == 9.0
    assert conformal.quantile(scores, 0.91) == np.inf


class Evil:
    """Runs a command when a pickle of it is loaded."""

    def __reduce__(self):
        return os.system, ("touch evil",)


@pytest.mark.parametrize(
    ("content", "word"),
    [
        (b"", "is no surrogate"),
        (b"PK", "fit it anew"),
        (b"heights 1 2 3", "is no surrogate"),
        (b"asperity surrogate\nformat 99\nsha256 " + b"0" * 64 + b"\n", "has format 99"),
        (b"asperity surrogate\nformat 3\nsha256 " + b"0" * 64 + b"\n", "is damaged"),
        (pickle.dumps(Evil()), "is no surrogate"),
    ],
)
def test_what_is_no_surrogate_is_refused_and_runs_nothing(tmp_path, monkeypatch, content, word):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "x.surrogate"
    path.write_bytes(content)
    with pytest.raises(InputError, match=rf"x\.surrogate.*{word}") as caught:
        Surrogate.load(path)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "evil").exists()


def test_a_damaged_file_is_refused(ridge, tmp_path):
    path = tmp_path / "x.surrogate"
    ridge.save(path)
    whole = path.read_bytes()
    for size in (len(whole) // 2, len(whole) - 10):
        path.write_bytes(whole[:size])
        with pytest.raises(InputError, match="is damaged"):
            Surrogate.load(path)
    card, parts = crafted_surrogates.content(whole)
    parts["low"] = parts["low"][:3]
    path.write_bytes(crafted_surrogates.written(card, parts))
    with pytest.raises(InputError, match="is not whole"):
        Surrogate.load(path)


def test_pruned_deep_trees_of_xgboost_come_back(tmp_path):
    inputs = np.random.default_rng(0).normal(size=(400, 5))
    target = inputs[:, 0] ** 2 + inputs[:, 1]
    settings = {"n_estimators": 20, "max_depth": 12, "gamma": 1.0}
    fitted = pipeline(MODELS["xgboost"], settings).fit(inputs, target)
    again = put_together("xgboost", "l2", taken_apart("xgboost", fitted), 5)
    asked = np.random.default_rng(1).normal(size=(2000, 5))
    np.testing.assert_array_equal(again.predict(asked), fitted.predict(asked))


def test_a_prediction_that_is_not_finite_is_never_inside(ridge, heights, tmp_path):
    np.save(tmp_path / "h.npy", heights)
    order = Order((str(tmp_path / "h.npy"),), delta="5:20:3", reading=Reading(side="1000"))
    rows = ridge.for_surface(heights, 1000.0).rows([10.0, 20.0])
    assert ridge.predict_rows(rows).inside.any()
    for deviation in (np.nan, np.inf):
        learnt = {name: replace(each, deviation=deviation) for name, each in ridge.learnt.items()}
        spoilt = replace(ridge, learnt=learnt)
        for reasons in (True, False):
            answer = spoilt.predict_rows(rows, reasons=reasons)
            assert not answer.inside.any()
            assert "the surrogate has no finite area" in answer.reasons[0]
            assert np.isnan(answer.area).all()
            assert np.isnan(answer.high["force"]).all()
        with pytest.raises(
            InputError, match=r"h\.npy: the surrogate has no finite .* at Delta = 5"
        ):
            law.make(spoilt, order, say)


def test_an_old_file_stays_whole_until_the_new_one_is(ridge, tmp_path, monkeypatch):
    path = tmp_path / "x.surrogate"
    ridge.save(path)
    before = path.read_bytes()

    def fail(descriptor):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", fail)
    with pytest.raises(InputError, match="No space left"):
        ridge.save(path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_the_package_offers_the_class_and_nothing_else():
    assert learn.Surrogate is Surrogate
    with pytest.raises(AttributeError, match="Oracle"):
        _ = learn.Oracle
