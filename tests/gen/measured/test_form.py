"""A polynomial is taken out to rounding, whatever is missing; the rest is the least-squares one."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gen.measured import form
from gen.measured.form import fitted_polynomial, number_of_terms

SHAPES = [(30, 41), (41, 30), (21, 21), (100, 22)]


def polynomial(shape: tuple[int, int], degree: int, random: np.random.Generator) -> np.ndarray:
    """A random polynomial of a total degree on a map, with coefficients of any sign."""
    x, y = np.meshgrid(*(np.linspace(-1, 2, nodes) for nodes in shape), indexing="ij")
    heights = np.zeros(shape)
    for i in range(degree + 1):
        for j in range(degree + 1 - i):
            heights += random.normal() * x**i * y**j
    return heights


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("degree", [1, 2, 3, 6, 10, 20])
@pytest.mark.parametrize("holes", [False, True])
def test_a_polynomial_is_its_own_fit(shape: tuple[int, int], degree: int, holes: bool) -> None:
    random = np.random.default_rng(degree)
    heights = polynomial(shape, degree, random)
    measured = ~(holes & (random.random(shape) < 0.1))
    fit = fitted_polynomial(np.where(measured, heights, np.nan), degree)
    np.testing.assert_allclose(fit[measured], heights[measured], atol=1e-12 * np.ptp(heights))


@given(st.integers(0, 2**32 - 1), st.integers(1, 5))
def test_what_is_left_is_orthogonal_to_polynomials(seed: int, degree: int) -> None:
    random = np.random.default_rng(seed)
    heights = np.where(random.random((14, 17)) < 0.2, np.nan, random.normal(size=(14, 17)))
    measured = ~np.isnan(heights)
    rest = (heights - fitted_polynomial(heights, degree))[measured]
    other = polynomial((14, 17), degree, random)[measured]
    assert abs(rest @ other) < 1e-11 * np.linalg.norm(rest) * np.linalg.norm(other)
    above = polynomial((14, 17), degree + 1, random)
    assert np.abs(above - fitted_polynomial(above, degree)).max() > 1e-6


def test_the_fit_does_not_depend_on_the_nodes_taken_together(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    heights = np.random.default_rng(0).normal(size=(50, 20))
    expected = fitted_polynomial(heights, 4)
    monkeypatch.setattr(form, "BLOCK", 60)
    np.testing.assert_allclose(fitted_polynomial(heights, 4), expected, atol=1e-13)


def test_terms_are_counted() -> None:
    assert [number_of_terms(degree) for degree in (0, 1, 2, 3)] == [1, 3, 6, 10]
