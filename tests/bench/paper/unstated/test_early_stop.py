"""An iteration that stops early, beside the equilibrium in one solve."""

import numpy as np
import pytest

import bem
from bench.paper.unstated import early_stop
from gen.generation.plan import parameters
from gen.generation.sample import surface_of
from gen.scene import load

MIRCO = load("paper-mirco")


def test_iteration_nears_the_equilibrium_from_below_and_stops_early() -> None:
    (near, far) = early_stop.compare(MIRCO, 1, (0.3, 0.8))
    assert near["ended"] == far["ended"] == 100
    assert 0 < near["force_low"] < 1  # a contraction by far less than 1: about its tolerance
    assert far["force_low"] > 1.5  # slow: many times its tolerance is still missing
    assert far["solves"] > 2 * near["solves"]


def test_iteration_does_not_end_beyond_the_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(early_stop, "STEPS", 5)
    (beyond,) = early_stop.compare(MIRCO, 1, (1.2,))
    assert beyond["ended"] == 0
    assert np.isnan(beyond["force_low"])


def test_iteration_converges_to_the_solution_in_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(early_stop, "TOLERANCE", 1e-7)
    monkeypatch.setattr(early_stop, "ENOUGH", 1e-8)
    heights = surface_of(MIRCO, parameters(MIRCO, 0, 1), 0)
    early, _ = early_stop.iterate(MIRCO, heights, 8.0)
    exact = bem.solve(
        heights,
        1000.0,
        8.0,
        spacing=1000.0 / 129,
        kernel="concentrated-force",
        far_field="compliant",
    )
    assert early.force == pytest.approx(exact.force, rel=1e-6)
