"""The reference for bodies that yield: its limits, and that it certifies its solution."""

import numpy as np
import pytest

from bem.influence import KERNELS, Kernel
from bench.references import dense, yielding
from bench.references.surfaces import SURFACES, surface

SHAPE = (9, 7)


def press(kind: str, hardness: float, delta: float = 0.6, kernel: Kernel = "uniform-pressure"):
    heights = surface(kind, SHAPE, seed=3)
    return heights, *yielding.press(heights, delta, hardness, kernel)


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("kind", SURFACES)
def test_a_hardness_above_all_pressures_gives_the_elastic_solution(
    kind: str, kernel: Kernel
) -> None:
    heights, pressure, _ = press(kind, 1e3, kernel=kernel)
    elastic, _ = dense.press(heights, 0.6, kernel)
    np.testing.assert_allclose(pressure, 0.6 * elastic, atol=1e-9)


@pytest.mark.parametrize("kind", SURFACES)
def test_a_vanishing_hardness_gives_the_bearing_area(kind: str) -> None:
    heights, pressure, gap = press(kind, 1e-9)
    bearing = heights > heights.max() - 0.6
    np.testing.assert_array_equal(pressure, np.where(bearing, 1e-9, 0.0))
    np.testing.assert_allclose(-gap, heights - heights.max() + 0.6, atol=1e-7)


@pytest.mark.parametrize("share", [0.9, 0.5, 0.1])
@pytest.mark.parametrize("kind", SURFACES)
def test_conditions_of_contact_hold(kind: str, share: float) -> None:
    elastic = press(kind, 1e3)[1].max()
    _, pressure, gap = press(kind, share * elastic)
    yielded = pressure == share * elastic
    assert yielded.any()
    assert (pressure >= 0).all()
    assert pressure.max() <= share * elastic
    assert gap[pressure == 0].min(initial=0.0) >= -1e-11
    assert gap[yielded].max() <= 1e-11
    assert np.abs(gap[(pressure > 0) & ~yielded]).max(initial=0.0) < 1e-11


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("kind", SURFACES)
def test_growing_the_yielded_set_is_least_squares(kind: str, kernel: Kernel) -> None:
    heights = surface(kind, SHAPE, seed=4)
    for hardness in (0.02, 0.1, 0.4):
        expected, _ = yielding.press(heights, 1.5, hardness, kernel)
        found, _ = yielding.press(heights, 1.5, hardness, kernel, 1.0, yielding.by_growth)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)


def test_a_solution_that_breaks_them_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dense, "cho_solve", lambda _factor, values: values)
    with pytest.raises(ArithmeticError, match="dense solve: "):
        press("white noise", 0.3, 2.0)
