"""Iterates: energy and scale are those of the plain expressions, however long vectors are."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from bem import iterate, vectors
from bem.arrays import Values
from bem.iterate import Iterate, inner, rescale
from bem.workers import on_threads

RIGID = cast("Any", SimpleNamespace(load=None))  # all that `rescale` asks of operators


def some_iterate(size: int) -> tuple[Iterate, Values]:
    """Return an iterate whose residual is that of the influence matrix 2 I, and the interference.

    About half of the nodes are under pressure.
    """
    random = np.random.default_rng(size)
    interference = random.random(size) + 0.1
    pressure = np.maximum(random.standard_normal(size), 0)
    pressure[0] = 0.3
    return Iterate(pressure, interference - 2 * pressure), interference


@pytest.mark.parametrize("size", [1, 15, 16, 17, 100])
def test_passes_of_long_iterates_are_the_plain_expressions(
    monkeypatch: pytest.MonkeyPatch, size: int
) -> None:
    """To the last bit, on any number of threads; the interference stays as it is."""
    for name, entries in {"PIECE": 8, "SHORT": 16, "SHARED": 10, "SHARED_PIECE": 4}.items():
        monkeypatch.setattr(vectors, name, entries)
    monkeypatch.setattr(iterate, "LONG", 16)
    for threads in (1, 2):
        start, interference = some_iterate(size)
        pressure, residual = start.pressure.copy(), start.residual.copy()
        given = interference.copy()
        with on_threads(threads):
            energy = start.energy(interference)
            rescale(RIGID, interference, start)
            expected = -inner(pressure, given + residual) / 2
            factor = inner(pressure, given) / inner(pressure, given - residual)
        assert energy == expected
        assert energy == pytest.approx(pressure @ pressure - pressure @ given, rel=1e-13)
        np.testing.assert_array_equal(start.pressure, factor * pressure)
        np.testing.assert_array_equal(start.residual, given - factor * (given - residual))
        np.testing.assert_array_equal(interference, given)
        assert start.pressure @ start.residual == pytest.approx(0, abs=1e-13)  # the least energy


def test_an_iterate_without_pressure_is_not_scaled() -> None:
    interference = np.ones(3)
    start = Iterate.from_zero(interference)
    rescale(RIGID, interference, start)
    np.testing.assert_array_equal(start.residual, interference)
    assert not start.pressure.any()
