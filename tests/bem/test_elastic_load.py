"""Elastic contact of a patch without edges under a load: all methods find the same contact."""

from typing import Any

import numpy as np
import pytest

import bem
from bem import elastic_load, interface
from bem.spacing import Boundary

EDGELESS: list[Boundary] = ["periodic", "mirror"]


def rough(shape: tuple[int, int]) -> np.ndarray:
    """Return heights that are smooth over some cells."""
    random = np.random.default_rng(shape)
    waves = np.fft.rfft2(random.standard_normal(shape))
    orders = np.hypot.outer(np.fft.fftfreq(shape[0]), np.fft.rfftfreq(shape[1]))
    return np.asarray(np.fft.irfft2(waves / (0.05 + orders) ** 2, s=shape)) / 100


@pytest.mark.parametrize("boundary", EDGELESS)
@pytest.mark.parametrize("pressure", [0.0005, 0.002, 0.005])
@pytest.mark.parametrize("shape", [(40, 44), (57, 30)])
def test_dense_algebra_finds_what_iterations_find(
    shape: tuple[int, int], pressure: float, boundary: Boundary, monkeypatch: pytest.MonkeyPatch
) -> None:
    settings: dict[str, Any] = {"spacing": 1.0, "boundary": boundary, "pressure": pressure}
    heights = rough(shape)
    monkeypatch.setattr(elastic_load, "few_nodes", lambda _: 500)
    monkeypatch.setattr(interface, "few_nodes", lambda _: 500)
    dense = bem.solve(heights, 1.0, rtol=1e-11, **settings)
    monkeypatch.setattr(elastic_load, "few_nodes", lambda _: 0)
    iterated = bem.solve(heights, 1.0, rtol=1e-11, **settings)
    assert iterated.convolutions > dense.convolutions
    assert dense.residual <= 1e-11
    assert dense.delta == pytest.approx(iterated.delta, rel=1e-10)
    largest = iterated.largest_pressure
    np.testing.assert_allclose(dense.pressure, iterated.pressure, atol=1e-9 * largest)


@pytest.mark.parametrize("boundary", EDGELESS)
def test_a_ladder_has_the_contacts_of_single_solves(boundary: Boundary) -> None:
    heights, pressures = rough((40, 44)), [0.003, 0.02, 0.1, 0.5]
    contacts = bem.ladder(heights, 1.0, pressures=pressures, spacing=1.0, boundary=boundary)
    for pressure, contact in zip(pressures, contacts, strict=True):
        alone = bem.solve(heights, 1.0, pressure=pressure, spacing=1.0, boundary=boundary)
        assert contact.contact_nodes == alone.contact_nodes
        assert contact.delta == pytest.approx(alone.delta, rel=1e-6)
