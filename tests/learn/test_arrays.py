"""Arrays of callers: public functions keep copies, and refuse masked places."""

import re
from pathlib import Path

import numpy as np
import pytest

from gen import spectral, statistics, surface
from learn import Surrogate
from learn.features.sets import STATISTICS
from learn.surrogate.model import OnSurface

HEIGHTS = surface.generate("diamond-square", 33, 0.7, 12.0, np.random.default_rng(5))
DESCRIBED = np.array([statistics.describe(HEIGHTS, 31.25).values[name] for name in STATISTICS])
SPECTRUM = spectral.SelfAffineSpectrum(hurst=0.8, roll_off=500.0, cut_off=125.0)
DELTA = np.array([6.0, 20.0])

WITHOUT = {
    *("surface.generate", "statistics.Description"),
    *("scene.load", "scene.Scene", "database.Reader", "spectral.SelfAffineSpectrum", "Prediction"),
}
"""Public functions and classes that no caller gives arrays to compute with."""


def answer(prediction):
    return [prediction.delta, *prediction.values.values(), *prediction.low.values()]


def on_surface(surrogate, given, heights, delta):
    """Ask at once, and again after the caller has filled the heights anew."""
    asked = surrogate.for_surface(heights, (1000.0, 1000.0))
    given["heights"][:] = 3.0
    return answer(asked.predict(delta))


def of_statistics(surrogate, given, rows, delta, length):
    asked = surrogate.of_statistics(rows, delta, length)
    for each in given.values():
        each[:] = 3.0
    return answer(surrogate.predict_rows(asked))


CALLS = {
    "surface.without_last_nodes": (
        {"heights": HEIGHTS},
        lambda s, _, heights: [surface.without_last_nodes(heights)],
    ),
    "statistics.describe": (
        {"heights": HEIGHTS},
        lambda s, _, heights: list(statistics.describe(heights, 31.25).values.values()),
    ),
    "statistics.rms_slope": (
        {"heights": HEIGHTS},
        lambda s, _, heights: [statistics.rms_slope(heights, (31.25, 31.25))],
    ),
    "spectral.generate_spectral": (
        {"sides": np.array([1000.0, 500.0])},
        lambda s, _, sides: [
            spectral.generate_spectral(
                (32, 16), tuple(sides), SPECTRUM, np.random.default_rng(1), rms_height=1.0
            )
        ],
    ),
    "Surrogate": (
        {"heights": HEIGHTS, "delta": DELTA},
        lambda s, _, heights, delta: answer(s.predict(heights, 1000.0, delta)),
    ),
    "model.OnSurface": ({"heights": HEIGHTS, "delta": DELTA}, on_surface),
    "Surrogate.of_statistics": (
        {"rows": np.stack([DESCRIBED] * 2), "delta": DELTA, "length": np.full(2, 1000.0)},
        of_statistics,
    ),
}


@pytest.fixture(scope="module")
def surrogates(made):
    return {
        name: Surrogate.load(made / f"{name}.surrogate") for name in ("hybrid", "dimensionless")
    }


def test_every_public_function_is_called_here():
    pages = Path(__file__).parents[2] / "docs/api"
    text = "".join((pages / f"{name}.md").read_text() for name in ("gen", "learn"))
    listed = set(re.findall(r"^   ([\w.]+)$", text, re.MULTILINE))
    assert listed - WITHOUT - set(CALLS) == set()
    assert {name for name in vars(OnSurface) if not name.startswith("_")} >= {"rows", "predict"}


@pytest.mark.parametrize("features", ["hybrid", "dimensionless"])
@pytest.mark.parametrize("name", CALLS)
def test_arrays_may_be_filled_anew_after_a_call(surrogates, name, features):
    given, call = CALLS[name]
    surrogate = surrogates["dimensionless" if "statistics" in name else features]
    unchanged = {key: each.copy() for key, each in given.items()}
    wanted = [np.array(each) for each in call(surrogate, unchanged, **given)]
    given = {key: each.copy() for key, each in CALLS[name][0].items()}
    found = call(surrogate, given, **given)
    for each in given.values():
        each[:] = 7.0
    for ours, theirs in zip(found, wanted, strict=True):
        np.testing.assert_array_equal(ours, theirs)


@pytest.mark.parametrize("name", CALLS)
def test_masked_places_are_refused_and_masks_of_nothing_are_none(surrogates, name):
    given, call = CALLS[name]
    surrogate = surrogates["dimensionless"]
    wanted = call(surrogate, {key: each.copy() for key, each in given.items()}, **given)
    for key, each in given.items():
        if key == "sides":
            continue
        whole = {key: np.ma.array(each, mask=np.zeros(each.shape, dtype=bool))}
        found = call(surrogate, {k: v.copy() for k, v in given.items()}, **{**given, **whole})
        for ours, theirs in zip(found, wanted, strict=True):
            np.testing.assert_array_equal(ours, theirs)
        masked = np.ma.array(each, mask=np.zeros(each.shape, dtype=bool))
        masked[(0,) * each.ndim] = np.ma.masked
        with pytest.raises(ValueError, match="mask"):
            call(surrogate, {k: v.copy() for k, v in given.items()}, **{**given, key: masked})


@pytest.mark.parametrize("side", [(1000.0,), (1.0, 2.0, 3.0), [[1.0, 2.0]]])
def test_sides_are_one_length_or_two(surrogates, side):
    with pytest.raises(ValueError, match="one length or one for each axis"):
        surrogates["hybrid"].predict(HEIGHTS, side, 5.0)
