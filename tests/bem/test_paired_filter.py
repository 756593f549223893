"""Filters by complex transforms of half the length, against those by real transforms."""

import numpy as np
import pytest

from bem import paired_filter
from bem.convolution import Filter
from bem.paired_filter import PairedFilter, pairs_up
from bem.workers import on_threads


def even_spectrum(shape: tuple[int, int]) -> np.ndarray:
    """A spectrum without any symmetry but that of a real kernel that is even both ways."""
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
    """Nor do the pieces that rows are transformed in, but for rounding."""
    spectrum, field = even_spectrum(shape), random_field(shape, "float32")
    monkeypatch.setattr(paired_filter, "BATCH_BYTES", 2**10)
    whole = PairedFilter(spectrum, "float32")(field)
    monkeypatch.setattr(paired_filter, "SHARED_ENTRIES", 0)
    monkeypatch.setattr(paired_filter, "SHARED_ROWS", 8)
    found = []
    for threads in (1, 3, 2):
        with on_threads(threads):
            shared = PairedFilter(spectrum, "float32")
            found.append([shared(field), shared(field)])
    for one in found:
        np.testing.assert_array_equal(one, found[0])
    np.testing.assert_allclose(found[0][0], whole, rtol=0, atol=2e-6 * np.abs(whole).max())


def test_memory_is_counted() -> None:
    """Two fields, factors for three more, and the buffers of a batch."""
    filtered = PairedFilter(even_spectrum((256, 256)), "float32")
    assert 5 <= filtered.bytes / filtered.field.nbytes <= 8


def test_odd_rows_and_small_or_huge_fields_are_left_to_real_transforms() -> None:
    assert pairs_up((128, 128))
    assert pairs_up((99, 128))
    assert not pairs_up((128, 99))
    assert not pairs_up((32, 32))
    assert not pairs_up((2048, 2048))
