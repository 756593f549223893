"""Iterates: energy and scale are those of the plain expressions, however long vectors are."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from bem import iterate, vectors
from bem.iterate import Iterate, rescale
from bem.workers import on_threads

RIGID = cast("Any", SimpleNamespace(load=None))  # all that `rescale` asks of operators


def some_iterate(size: int) -> tuple[Iterate, Any]:
    """An iterate with an interference that some pressure of the matrix 2 I leaves a residual of."""
    random = np.random.default_rng(size)
    interference = random.random(size) + 0.1
    pressure = np.maximum(random.standard_normal(size), 0) + 0.1
    return Iterate(pressure, interference - 2 * pressure), interference


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("size", [1, 15, 16, 17, 100])
def test_passes_of_long_iterates_are_the_plain_expressions(
    monkeypatch: pytest.MonkeyPatch, size: int, threads: int
) -> None:
    for name, entries in {"PIECE": 8, "SHORT": 16, "SHARED": 10, "SHARED_PIECE": 4}.items():
        monkeypatch.setattr(vectors, name, entries)
    monkeypatch.setattr(iterate, "LONG", 16)
    start, interference = some_iterate(size)
    pressure, image = start.pressure.copy(), interference - start.residual
    with on_threads(threads):
        energy = start.energy(interference)
        rescale(RIGID, interference, start)
    assert energy == pytest.approx(pressure @ image / 2 - pressure @ interference, rel=1e-13)
    factor = (pressure @ interference) / (pressure @ image)
    np.testing.assert_allclose(start.pressure, factor * pressure, rtol=1e-14)
    np.testing.assert_allclose(start.residual, interference - factor * image, atol=1e-14)
    assert start.pressure @ start.residual == pytest.approx(0, abs=1e-13)  # the least energy


def test_an_iterate_without_pressure_is_not_scaled() -> None:
    interference = np.ones(3)
    start = Iterate.from_zero(interference)
    rescale(RIGID, interference, start)
    np.testing.assert_array_equal(start.residual, interference)
    assert not start.pressure.any()
