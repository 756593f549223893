"""Filters by complex transforms of half the length, against those by real transforms."""

from concurrent.futures import ThreadPoolExecutor
from functools import partial

import numpy as np
import pytest

import bem
from bem import paired_filter
from bem.convolution import Filter
from bem.paired_filter import PairedFilter, pairs_up
from bem.workers import on_threads


def even_spectrum(shape: tuple[int, int]) -> np.ndarray:
    """Return a random spectrum that is even in both directions."""
    random = np.random.default_rng(shape)
    spectrum = random.uniform(1, 2, (shape[0], shape[1] // 2 + 1))
    spectrum[1:] = spectrum[1:] + spectrum[1:][::-1]
    return spectrum


def random_field(shape: tuple[int, int], dtype: str) -> np.ndarray:
    return np.random.default_rng(shape).standard_normal(shape).astype(dtype)


SHAPES = [(1, 2), (1, 8), (2, 4), (5, 2), (5, 8), (7, 10), (8, 6), (33, 130), (64, 64), (96, 54)]


@pytest.mark.parametrize("batch", [1, 2**12, 2**18])
@pytest.mark.parametrize("dtype", ["float64", "float32"])
@pytest.mark.parametrize("shape", SHAPES)
def test_pairs_filter_as_real_transforms_do(
    monkeypatch: pytest.MonkeyPatch, shape: tuple[int, int], dtype: str, batch: int
) -> None:
    monkeypatch.setattr(paired_filter, "BATCH_BYTES", batch)
    spectrum, field = even_spectrum(shape), random_field(shape, dtype)
    plain = Filter(shape, spectrum, dtype, across=shape[1])
    paired = PairedFilter(spectrum, dtype)
    assert (paired.shape, paired.largest) == (plain.shape, plain.largest)
    for scale in (1, -3):
        expected, found = plain(scale * field), paired(scale * field)
        assert found.dtype == expected.dtype
        accepted = 20 * np.finfo(dtype).eps * np.abs(expected).max()
        np.testing.assert_allclose(found, expected, rtol=0, atol=accepted)


@pytest.mark.parametrize("shape", [(30, 24), (65, 50)])
def test_threads_change_no_bit(monkeypatch: pytest.MonkeyPatch, shape: tuple[int, int]) -> None:
    """One filter on 1, 3 and 2 threads in turn; rows in pieces change only rounding."""
    spectrum, field = even_spectrum(shape), random_field(shape, "float32")
    monkeypatch.setattr(paired_filter, "BATCH_BYTES", 2**10)
    whole = PairedFilter(spectrum, "float32")(field)
    monkeypatch.setattr(paired_filter, "SHARED_ENTRIES", 0)
    monkeypatch.setattr(paired_filter, "SHARED_ROWS", 8)
    shared, found = PairedFilter(spectrum, "float32"), []
    for threads in (1, 3, 2):
        with on_threads(threads):
            found.append([shared(field), shared(field)])
    for one in found:
        np.testing.assert_array_equal(one, found[0])
    np.testing.assert_allclose(found[0][0], whole, rtol=0, atol=2e-6 * np.abs(whole).max())


def test_an_interrupted_transform_leaves_nothing_behind(monkeypatch: pytest.MonkeyPatch) -> None:
    shape = 64, 40
    operator, field = PairedFilter(even_spectrum(shape)), random_field(shape, "float64")
    expected = operator(field)

    def interrupt(_: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(paired_filter._Batch, "filter", interrupt)
        with pytest.raises(KeyboardInterrupt):
            operator(1e9 * field)
    np.testing.assert_array_equal(operator(field), expected)


def test_its_memory_is_counted() -> None:
    operator = PairedFilter(even_spectrum((256, 256)), "float32")
    batches = operator._lists[0]
    assert len(batches) > 1
    held = [operator.field, operator._waves.base, *batches[0].buffers]
    held += [table for batch in batches for table in (batch._own, batch._across)]
    total = sum(array.nbytes for array in held)
    assert total <= operator.bytes <= total + 60 * 1024


@pytest.mark.parametrize("load", [0.003, 0.3, 1.5, 8.0])
def test_contacts_are_those_of_real_transforms(
    monkeypatch: pytest.MonkeyPatch, load: float
) -> None:
    """Whole solves of periodic patches, with filters that no other test has kept."""

    def solved(least: int) -> bem.Contact:
        monkeypatch.setattr(paired_filter, "LEAST_ENTRIES", least)
        with ThreadPoolExecutor(1) as fresh:
            heights = np.random.default_rng(7).normal(size=(48, 60)).cumsum(0).cumsum(1) / 300
            heights -= np.linspace(heights[0], heights[-1], len(heights))
            press = partial(bem.solve, heights, (48.0, 60.0), boundary="periodic", rtol=1e-9)
            return fresh.submit(press, pressure=load).result()

    paired, real = solved(0), solved(2**30)
    np.testing.assert_array_equal(paired.pressure > 0, real.pressure > 0)
    scale = real.pressure.max()
    np.testing.assert_allclose(paired.pressure, real.pressure, rtol=0, atol=1e-7 * scale)
    assert paired.delta == pytest.approx(real.delta, rel=1e-8)


def test_odd_rows_and_small_or_huge_fields_are_left_to_real_transforms() -> None:
    assert pairs_up((128, 128))
    assert pairs_up((99, 128))
    assert not pairs_up((128, 99))
    assert not pairs_up((32, 32))
    assert not pairs_up((2048, 2048))
