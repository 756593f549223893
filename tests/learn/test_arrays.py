"""What callers pass in: copies are kept of arrays, and what is no real number is refused."""

import warnings

import numpy as np
import pytest

import bem
from gen import statistics, surface
from gen.runtime.errors import InputError
from learn import Surrogate
from learn.features.columns import STATISTICS

HEIGHTS = surface.generate("diamond-square", 33, 0.7, 12.0, np.random.default_rng(5))
DESCRIBED = np.array(
    [statistics.describe(HEIGHTS, 31.25).values[name] for name in STATISTICS]
)
DELTA = np.array([6.0, 20.0])


def answer(prediction):
    return [prediction.delta, *prediction.values.values(), *prediction.low.values()]


def on_surface(surrogate, given):
    """Ask at once, and again after the caller has filled the heights anew."""
    asked = surrogate.for_surface(given["heights"], (1000.0, 1000.0))
    given["heights"][:] = 3.0
    return answer(asked.predict(given["delta"]))


def of_statistics(surrogate, given):
    asked = surrogate.of_statistics(**given)
    for each in given.values():
        each[:] = 3.0
    return answer(surrogate.predict_rows(asked))


ROWS = {
    "statistics": np.stack([DESCRIBED] * 2),
    "delta": DELTA,
    "length": np.full(2, 1000.0),
}
CALLS = {
    "surface": ({"heights": HEIGHTS, "delta": DELTA}, on_surface),
    "statistics": (ROWS, of_statistics),
    "described": (
        {"heights": HEIGHTS},
        lambda _, given: [*statistics.describe(given["heights"], 31.25).values.values()],
    ),
}


@pytest.fixture(scope="module")
def surrogate(made):
    return Surrogate.load(made / "dimensionless.surrogate")


def copied(given):
    return {key: each.copy() for key, each in given.items()}


@pytest.mark.parametrize("name", CALLS)
def test_arrays_may_be_filled_anew_after_a_call_and_masked_places_are_refused(
    surrogate, name
):
    arrays, call = CALLS[name]
    wanted = [np.array(each) for each in call(surrogate, copied(arrays))]
    given = copied(arrays)
    found = call(surrogate, given)
    for each in given.values():
        each[:] = 7.0
    np.testing.assert_equal(found, wanted)
    for key, each in arrays.items():
        masked = np.ma.array(each.copy(), mask=np.zeros(each.shape, dtype=bool))
        np.testing.assert_equal(call(surrogate, copied(arrays) | {key: masked}), wanted)
        masked = np.ma.array(each.copy(), mask=np.zeros(each.shape, dtype=bool))
        masked[(0,) * each.ndim] = np.ma.masked
        with pytest.raises(ValueError, match="mask"):
            call(surrogate, copied(arrays) | {key: masked})


@pytest.mark.parametrize("side", [(1000.0,), (1.0, 2.0, 3.0), [[1.0, 2.0]]])
def test_sides_are_one_length_or_two(surrogate, side):
    with pytest.raises(ValueError, match="one length or one for each axis"):
        surrogate.predict(HEIGHTS, side, 5.0)


NO_NUMBERS = {
    "complex": 1j,
    "texts": "9",
    "whole numbers beyond 64 bits": 10**400,
    "objects": object(),
    "logical": True,
    "dates": np.datetime64("2026-01-01"),
}


OF_NO_REAL_TYPE = r"heights are of type .* real numbers are needed"


@pytest.fixture(params=NO_NUMBERS)
def wrong(request):
    """Something that is no real number; warnings are errors while it is passed in."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        yield NO_NUMBERS[request.param]


def test_heights_that_are_no_real_numbers_are_refused(surrogate, wrong):
    heights = np.full(HEIGHTS.shape, wrong)
    with pytest.raises(ValueError, match=OF_NO_REAL_TYPE):
        bem.solve(heights, 1000.0, 9.0)
    with pytest.raises(InputError, match=OF_NO_REAL_TYPE):
        surrogate.predict(heights, 1000.0, 9.0)


def test_a_side_that_is_no_real_number_is_refused(surrogate, wrong):
    with pytest.raises(ValueError, match="side = "):
        bem.solve(HEIGHTS, wrong, 9.0)
    with pytest.raises(InputError, match="side = "):
        surrogate.predict(HEIGHTS, wrong, 9.0)


def test_a_displacement_that_is_no_real_number_is_refused(surrogate, wrong):
    with pytest.raises(ValueError, match="delta = "):
        bem.solve(HEIGHTS, 1000.0, wrong)
    with pytest.raises(InputError, match="delta are of type"):
        surrogate.predict(HEIGHTS, 1000.0, wrong)


def test_a_setting_that_is_no_real_number_is_refused(surrogate, wrong):
    for name in ("e_star", "hardness", "level"):
        with pytest.raises(InputError, match=name):
            surrogate.predict(HEIGHTS, 1000.0, 9.0, **{name: wrong})


def test_rows_of_unequal_length_are_named(surrogate):
    with pytest.raises(InputError, match="heights have rows of unequal length"):
        surrogate.predict([[1.0, 2.0], [3.0]], 1000.0, 9.0)
