"""Waves and bounds in turn, against the solver whose contact sets it replaces where these cycle."""

from dataclasses import replace

import numpy as np
import pytest

import bem
from bem.edgeless_patch import Patch, reduced_load
from bem.iterate import Iterate
from bem.spacing import Boundary
from bem.splitting import split
from gen.surface import generate

ROUGH = generate("diamond-square", 33, 0.7, 12.0, np.random.default_rng(0))[:24, :32]


def start_of(patch: Patch, seed: int) -> Iterate:
    """Return a start that has nothing to do with the solution."""
    pressure = np.random.default_rng(seed).uniform(0, 5, patch.below.size)
    return Iterate(pressure, patch.below - patch.operators.displace(pressure))


@pytest.mark.parametrize("boundary", ["periodic", "mirror"])
@pytest.mark.parametrize("load", [{"delta": 10.0}, {"pressure": 0.02}])
@pytest.mark.parametrize("hardness", [None, 0.05])
@pytest.mark.parametrize("aspect", [0.2, 1.0])
def test_it_finds_what_contact_sets_find(
    boundary: Boundary, load: dict[str, float], hardness: float | None, aspect: float
) -> None:
    contact = bem.solve(
        ROUGH, 1.0, **load, spacing=(30.0, 30.0 * aspect), boundary=boundary, hardness=hardness
    )
    problem = contact.problem
    length = problem.delta or float(np.ptp(ROUGH))
    patch = Patch.of(problem, length, keep_displacement=False)
    total = None if problem.delta else reduced_load(problem) / length
    iterate, converged = split(patch, total, start_of(patch, 1), 1e-9)
    assert converged
    pressure = iterate.pressure.reshape(ROUGH.shape) * length / 30.0
    np.testing.assert_allclose(pressure, contact.pressure, atol=1e-4 * contact.largest_pressure)
    np.testing.assert_array_equal(pressure > 0, contact.pressure > 0)
    if total is not None:
        assert iterate.pressure.sum() == pytest.approx(total, rel=1e-12)
        assert iterate.shift * length == pytest.approx(contact.delta, rel=1e-6)


def test_it_ends_after_four_passes_an_iteration() -> None:
    contact = bem.solve(ROUGH, 1.0, 10.0, spacing=30.0, boundary="mirror")
    problem = replace(contact.problem, max_iterations=5)
    patch = Patch.of(problem, 10.0, keep_displacement=False)
    iterate, converged = split(patch, None, start_of(patch, 2), 1e-12)
    assert not converged
    assert iterate.effort.convolutions == 22
