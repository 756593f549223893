"""Filters for small and for large fields, against each other; what they keep and leave behind."""

import gc
import threading

import numpy as np
import pytest

from bem.bodies import HALF_SPACE
from bem.operators import filters
from bem.operators.displacement import displacement_filter, fast_period
from bem.operators.filters import (
    CosineFilter,
    Filter,
    LargeFilter,
    filtered,
    spectral_filter,
)
from bem.threads import on_threads

SHAPES = [(64, 40), (100, 30), (129, 64), (40, 90), (33, 33), (1, 17), (31, 1)]
FREE = "free", HALF_SPACE, 1.0


def spectrum_of(shape, even=True):
    """The spectrum of an even kernel with periods that hold the padded field, or those of it."""
    periods = (fast_period(shape[0]), fast_period(shape[1])) if even else shape
    distances = [np.minimum(np.arange(p), -np.arange(p) % p) for p in periods]
    kernel = 1 / (1.0 + np.hypot(distances[0][:, np.newaxis], distances[1]))
    return np.fft.rfft2(kernel).real[: periods[0] // 2 + 1], periods


def made(monkeypatch, shape, dtype, large, even=True):
    with monkeypatch.context() as patch:
        patch.setattr(filters, "LARGE", large)
        spectrum, periods = spectrum_of(shape, even)
        return spectral_filter(shape, spectrum, dtype, periods)


@pytest.mark.parametrize("even", [True, False])
@pytest.mark.parametrize("dtype", ["float64", "float32"])
@pytest.mark.parametrize("shape", SHAPES)
def test_large_fields_are_filtered_as_small_ones(monkeypatch, shape, dtype, even):
    """More rows and columns than are taken at a time, fewer, and a rest; one after the other."""
    monkeypatch.setattr(filters, "BATCH_BYTES", 2**14)
    small, large = (made(monkeypatch, shape, dtype, bound, even) for bound in (2**30, 0))
    assert [type(small), type(large)] == [Filter, LargeFilter]
    for seed in (1, 2):  # what the first leaves behind is not in the second
        field = np.random.default_rng(seed).standard_normal(shape).astype(dtype)
        expected = filtered(small, field).copy()
        accepted = 20 * np.finfo(dtype).eps * np.abs(expected).max()
        np.testing.assert_allclose(
            filtered(large, field), expected, rtol=0, atol=accepted
        )
        if not even:
            half = spectrum_of(shape, even)[0]
            spectrum = np.concatenate([half, half[shape[0] - len(half) : 0 : -1]])
            plain = np.fft.irfft2(np.fft.rfft2(field) * spectrum, s=shape)
            np.testing.assert_allclose(expected, plain, rtol=0, atol=accepted)


@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_threads_change_no_bit(monkeypatch, dtype):
    monkeypatch.setattr(filters, "ROWS", 8)
    monkeypatch.setattr(filters, "BATCH_BYTES", 2**13)
    operator = made(monkeypatch, (70, 45), dtype, 0)
    field = np.random.default_rng(3).standard_normal((70, 45)).astype(dtype)
    expected = filtered(operator, field).copy()
    for threads in (3, 1, 2):
        with on_threads(threads):
            np.testing.assert_array_equal(filtered(operator, field), expected)


@pytest.mark.parametrize("large", [0, 2**30])
def test_both_precisions_take_turns(monkeypatch, large):
    """Buffers of large ones lie in the same memory."""
    shape = 33, 20
    double, alone = (made(monkeypatch, shape, "float64", large) for _ in range(2))
    single, rounded = double.in_single_precision(), alone.in_single_precision()
    assert np.shares_memory(single.field, double.field) == (large == 0)
    first, second = np.random.default_rng(4).standard_normal((2, *shape))
    for field in (first, second, first):
        here = filtered(double, field).copy()
        np.testing.assert_array_equal(here, filtered(alone, field))
        here = filtered(single, field).copy()
        np.testing.assert_array_equal(here, filtered(rounded, field))


@pytest.mark.parametrize("large", [0, 2**30])
def test_an_interrupted_transform_leaves_nothing_behind(monkeypatch, large):
    operator = made(monkeypatch, (64, 40), "float64", large)
    field = np.random.default_rng(5).standard_normal((64, 40))
    expected = filtered(operator, field).copy()

    def interrupt(*_, **__):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(filters._Lane, "filter_columns", interrupt)
        patch.setattr(filters.np, "multiply", interrupt)
        with pytest.raises(KeyboardInterrupt):
            filtered(operator, 1e9 * field)
    np.testing.assert_array_equal(filtered(operator, field), expected)


@pytest.mark.parametrize("shape", [(1, 1), (5, 8), (12, 7)])
def test_cosines_filter_the_mirrored_field(shape):
    field = np.random.default_rng(1).standard_normal(shape)
    spectrum = np.random.default_rng(2).uniform(1, 2, shape)
    rows = np.concatenate([field, field[::-1]])
    mirrored = np.concatenate([rows, rows[:, ::-1]], axis=1)
    along, across = (
        np.minimum(np.arange(2 * n), 2 * n - np.arange(2 * n)) for n in shape
    )
    whole = np.pad(spectrum, ((0, 1), (0, 1)))[np.ix_(along, across)]
    expected = np.fft.ifft2(np.fft.fft2(mirrored) * whole).real[: shape[0], : shape[1]]
    operator = CosineFilter(spectrum)
    np.testing.assert_allclose(filtered(operator, field), expected, rtol=0, atol=1e-13)
    single = filtered(operator.in_single_precision(), field)
    assert single.dtype == np.float32
    np.testing.assert_allclose(single, expected, rtol=0, atol=2e-6)


def test_what_filters_occupy_is_bounded_for_all_threads_together(monkeypatch):
    monkeypatch.setattr(filters, "KEPT_BYTES", 3 * 2**20)
    ready, done = threading.Barrier(4), threading.Event()
    earlier = set(filters._MEMORIES)  # this thread keeps filters of earlier tests

    def occupied_here():
        return sum(each.bytes for each in filters._MEMORIES if each not in earlier)

    def solve():
        for nodes in range(20, 60):
            displacement_filter((nodes, nodes), *FREE, "float64")
        ready.wait(600)
        done.wait(600)

    threads = [threading.Thread(target=solve) for _ in range(3)]
    for thread in threads:
        thread.start()
    ready.wait(600)
    occupied = occupied_here()
    done.set()
    for thread in threads:
        thread.join()
    fewest = (
        3 * filters.FEWEST_KEPT * displacement_filter((61, 61), *FREE, "float64").bytes
    )
    assert 0 < occupied <= 3 * 2**20 + fewest
    del threads, thread
    gc.collect()
    assert occupied_here() == 0


@pytest.mark.parametrize("columns", [24, 25])
def test_rows_are_transformed_to_fouriers_waves(columns):
    rows = np.random.default_rng(1).normal(size=(3, columns))
    transform = filters.row_transform(3, columns, True)
    transform.band[:] = rows
    assert transform.waves() == pytest.approx(np.fft.rfft(rows), abs=1e-12)


def test_rows_are_transformed_to_cosines():
    places = (np.arange(20) + 0.5) / 20
    transform = filters.row_transform(2, 20, False)
    transform.band[:] = [np.cos(3 * np.pi * places), np.ones(20)]
    amplitudes = np.zeros((2, 20))
    amplitudes[0, 3] = 0.5 * transform.count
    amplitudes[1, 0] = transform.count
    assert transform.waves() == pytest.approx(amplitudes, abs=1e-12)
