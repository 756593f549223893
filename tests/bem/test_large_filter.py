"""The filter of large fields, whose rows and columns are padded in the cache only."""

import numpy as np
import pytest

from bem import convolution, large_filter
from bem.convolution import Filter, displacement_filter, fast_period
from bem.large_filter import LargeFilter
from bem.workers import on_threads

SHAPES = [(64, 40), (100, 30), (129, 64), (40, 90), (33, 33), (1, 17), (31, 1)]


def spectrum_of(shape: tuple[int, int]) -> np.ndarray:
    """The spectrum of an even kernel with periods that hold the padded field."""
    periods = fast_period(shape[0]), fast_period(shape[1])
    distances = [np.minimum(np.arange(p), -np.arange(p) % p) for p in periods]
    kernel = 1 / (1.0 + np.hypot(distances[0][:, np.newaxis], distances[1]))
    return np.fft.rfft2(kernel).real


@pytest.mark.parametrize("dtype", ["float64", "float32"])
@pytest.mark.parametrize("shape", SHAPES)
def test_it_filters_as_the_padded_filter_does(
    monkeypatch: pytest.MonkeyPatch, shape: tuple[int, int], dtype: str
) -> None:
    """More rows and columns than are taken at a time, fewer, and a rest; one after the other."""
    monkeypatch.setattr(large_filter, "COLUMN_BYTES", 2**14)
    spectrum = spectrum_of(shape)
    plain, large = Filter(shape, spectrum, dtype), LargeFilter(shape, spectrum, dtype)
    for seed in (1, 2):  # what the first leaves behind is not in the second
        field = np.random.default_rng(seed).standard_normal(shape).astype(dtype)
        expected = plain(field)
        accepted = 20 * np.finfo(dtype).eps * np.abs(expected).max()
        np.testing.assert_allclose(large(field), expected, rtol=0, atol=accepted)


@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_threads_change_no_bit(monkeypatch: pytest.MonkeyPatch, dtype: str) -> None:
    monkeypatch.setattr(large_filter, "ROWS", 8)
    monkeypatch.setattr(large_filter, "COLUMN_BYTES", 2**13)
    shape = 70, 45
    operator = LargeFilter(shape, spectrum_of(shape), dtype)
    field = np.random.default_rng(3).standard_normal(shape).astype(dtype)
    expected = operator(field)
    for threads in (3, 1, 2):
        with on_threads(threads):
            np.testing.assert_array_equal(operator(field), expected)


def test_both_precisions_take_turns_in_the_same_memory() -> None:
    shape = 33, 20
    double = LargeFilter(shape, spectrum_of(shape))
    single = double.in_single_precision()
    assert np.shares_memory(single.field, double.field)
    first, second = np.random.default_rng(4).standard_normal((2, *shape))
    for field in (first, second, first):
        alone = LargeFilter(shape, spectrum_of(shape))
        np.testing.assert_array_equal(double(field), alone(field))
        rounded = alone.in_single_precision()(field.astype(np.float32))
        np.testing.assert_array_equal(single(field.astype(np.float32)), rounded)


def test_an_interrupted_transform_leaves_nothing_behind(monkeypatch: pytest.MonkeyPatch) -> None:
    shape = 64, 40
    operator = LargeFilter(shape, spectrum_of(shape))
    field = np.random.default_rng(5).standard_normal(shape)
    expected = operator(field)

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    for step in ("filter_columns", "transform_back"):
        with monkeypatch.context() as patch:
            patch.setattr(large_filter._Lane, step, interrupt)
            with pytest.raises(KeyboardInterrupt):
                operator(1e9 * field)
        np.testing.assert_array_equal(operator(field), expected)


def test_it_counts_all_of_its_buffers() -> None:
    operator = LargeFilter((40, 30), spectrum_of((40, 30)))
    lane = operator._lanes[0]
    held = [operator._factors, operator.field, operator._waves.base]
    held += [lane._padded, lane._returned, lane._filtered]
    held += [lane._source.base, lane._target.base]
    total = sum(array.nbytes for array in held)
    assert total <= operator.bytes <= total + 60 * 1024


@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_large_free_patches_are_filtered_by_it(monkeypatch: pytest.MonkeyPatch, dtype: str) -> None:
    monkeypatch.setattr(convolution, "LARGE_NODES", 41 * 30)
    monkeypatch.setattr(convolution, "_FILTERS", convolution._Filters())
    kept = [
        displacement_filter(shape, "uniform-pressure", 1.0, dtype) for shape in ((41, 30), (41, 29))
    ]
    assert [type(operator) for operator in kept] == [LargeFilter, Filter]
    nodes = np.array([0, 31, 1229])
    assert np.array_equal(kept[0].field.reshape(-1)[kept[0].places(nodes)], np.zeros(3))
