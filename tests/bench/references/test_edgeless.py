"""The references without edges: their matrices, and the conditions of contact."""

import numpy as np
import pytest

from bench.references.edgeless import Boundary, Patch
from bench.references.surfaces import SURFACES, surface

SIDES = (3.0, 5.0)
BOTH: tuple[Boundary, ...] = ("periodic", "mirror")
SHAPES = [(6, 7), (5, 8), (1, 4), (9, 1), (1, 1)]


@pytest.mark.parametrize("shape", SHAPES)
def test_periodic_matrix_is_a_product_of_transforms(shape):
    pressure = np.random.default_rng(0).random(shape)
    found = Patch(pressure, SIDES, "periodic").matrix @ pressure.reshape(-1)
    axes = [np.fft.fftfreq(nodes, side / nodes) for nodes, side in zip(shape, SIDES, strict=True)]
    wave_numbers = 2 * np.pi * np.hypot.outer(*axes)
    wave_numbers[0, 0] = np.inf
    moved = np.fft.ifft2(np.fft.fft2(pressure) * (2 / wave_numbers)).real
    np.testing.assert_allclose(found.reshape(shape), moved, atol=1e-14)


@pytest.mark.parametrize("ratio", [2.0, None])
@pytest.mark.parametrize("boundary", BOTH)
@pytest.mark.parametrize("kind", SURFACES)
def test_conditions_of_contact_hold(kind, boundary, ratio):
    """The hardness is over the mean pressure."""
    shape = (9, 6)
    load = 0.1 * max(Patch(surface(kind, shape), SIDES, boundary).full_contact_load, 1.0)
    hardness = np.inf if ratio is None else ratio * load / 54
    patch = Patch(surface(kind, shape), SIDES, boundary, hardness)
    pressure = patch.press(load).reshape(-1)
    assert pressure.sum() == pytest.approx(load, rel=1e-11)
    assert 0 <= pressure.min() <= pressure.max() <= hardness
    gap = patch.matrix @ pressure - patch.below
    touching, yielded = pressure > 0, pressure >= hardness
    # Gaps from the displacement on: at most 0 under pressure, at least 0 where nothing yields.
    assert gap[touching].max() <= gap[~yielded].min(initial=np.inf) + 1e-10
