"""Filters by cosine transforms, against periodic filters of the field and its mirror images."""

import numpy as np
import pytest

from bem.cosine import CosineFilter
from bem.spectrum import spectral_filter


def mirrored(field: np.ndarray) -> np.ndarray:
    """Continue a field by its mirror images along both axes."""
    rows = np.concatenate([field, field[::-1]])
    return np.concatenate([rows, rows[:, ::-1]], axis=1)


@pytest.mark.parametrize("aspect", [1.0, 0.3, 5.0])
@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (8, 1), (2, 3), (8, 8), (9, 9), (7, 12)])
def test_it_is_the_periodic_filter_of_the_mirrored_field(
    shape: tuple[int, int], aspect: float
) -> None:
    pressure = np.random.default_rng(shape).standard_normal(shape)
    once = spectral_filter(shape, "mirror", aspect)
    assert isinstance(once, CosineFilter)
    images = spectral_filter((2 * shape[0], 2 * shape[1]), "periodic", aspect)(mirrored(pressure))
    tolerance = 1e-13 * (np.abs(images).max() + 1)
    np.testing.assert_allclose(mirrored(once(pressure)), images, rtol=0, atol=tolerance)


@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_a_spectrum_of_ones_changes_nothing_but_the_precision(dtype: str) -> None:
    field = np.random.default_rng(0).standard_normal((6, 5))
    operator = CosineFilter(np.ones((6, 5)), dtype)
    same = operator(field)
    assert same.dtype == dtype
    assert not np.shares_memory(same, operator.field)
    np.testing.assert_allclose(same, field, rtol=0, atol=10 * np.finfo(dtype).eps)
    assert operator.bytes == 2 * field.astype(dtype).nbytes
