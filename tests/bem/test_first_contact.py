"""Dense algebra on the first contact set, against iterations that take more convolutions."""

from typing import Any

import numpy as np
import pytest

import bem
from bem import first_contact, half_space
from bem.factor import ContactFactor
from bem.half_space import HalfSpace
from bem.influence import KERNELS, Kernel
from bem.iterate import Iterate
from bem.problem import FAR_FIELDS, FarField
from gen.surface import generate

ROUGH = generate("diamond-square", 129, 0.65, 12.5, np.random.default_rng(4))
SIDE = 1000.0


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("delta", [6.0, 8.0, 10.0, 12.0, 15.0])
@pytest.mark.parametrize("rtol", [1e-4, 2e-7, 1e-12])
def test_few_nodes_in_contact_are_those_of_iterations(
    monkeypatch: pytest.MonkeyPatch, kernel: Kernel, delta: float, rtol: float
) -> None:
    contact = bem.solve(ROUGH, SIDE, delta, kernel=kernel, rtol=rtol)
    monkeypatch.setattr(half_space, "FEW_PER_ROOT", 0.0)
    expected = bem.solve(ROUGH, SIDE, delta, kernel=kernel, rtol=1e-12)
    assert contact.residual <= rtol
    assert abs(contact.contact_nodes - expected.contact_nodes) <= (0 if rtol < 1e-6 else 5)
    assert contact.force == pytest.approx(expected.force, rel=10 * rtol)


def at_load(load: str, delta: float, **settings: Any) -> bem.Contact:
    """Solve at a displacement, or under the force that belongs to it."""
    if load == "delta":
        return bem.solve(ROUGH, SIDE, delta, **settings)
    force = bem.solve(ROUGH, SIDE, delta, **settings).force
    return bem.solve(ROUGH, SIDE, force=force, **settings)


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("far_field", FAR_FIELDS)
@pytest.mark.parametrize("load", ["delta", "force"])
@pytest.mark.parametrize("delta", [6.0, 8.0])
def test_they_take_few_convolutions(
    monkeypatch: pytest.MonkeyPatch, kernel: Kernel, far_field: FarField, load: str, delta: float
) -> None:
    """Iterations correct errors of dense algebra, so that only the count reveals them."""
    direct = at_load(load, delta, kernel=kernel, far_field=far_field)
    monkeypatch.setattr(half_space, "FEW_PER_ROOT", 0.0)
    iterated = at_load(load, delta, kernel=kernel, far_field=far_field)
    assert direct.convolutions <= 0.7 * iterated.convolutions


def settled(lost: int, most_sets: int = 50) -> tuple[Iterate, Iterate]:
    """Settle a start that lacks some contact nodes; return it before and after."""
    contact = bem.solve(ROUGH, SIDE, 12.0, rtol=1e-12)
    nodes = np.arange(ROUGH.size)
    interference = ((ROUGH - ROUGH.max()) / 12.0 + 1).reshape(-1)
    operators = HalfSpace(ROUGH.shape, "uniform-pressure", 1.0, nodes)
    pressure = contact.pressure.reshape(-1) * (contact.problem.spacing[0] / 12.0)
    touching = np.flatnonzero(pressure)
    pressure[touching[:: max(len(touching) // lost, 1)] if lost else []] = 0
    # Wrong outside the remaining contact, so that no node there is added.
    residual = np.where(pressure > 0, 0.5, -1.0)
    start = Iterate(pressure.copy(), residual)
    before = Iterate(pressure, residual)
    first_contact.settle_few(operators, interference, start, 1e-12, most_sets)
    return before, start


@pytest.mark.parametrize("lost", [0, 1, 20, 100])
def test_missing_contact_nodes_return(lost: int) -> None:
    _, iterate = settled(lost)
    assert iterate.exact
    assert iterate.violation() <= 1e-12


def test_many_nodes_and_singular_matrices_are_left_as_they_were(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def singular(self: HalfSpace, nodes: np.ndarray) -> ContactFactor:
        raise np.linalg.LinAlgError

    with monkeypatch.context() as patch:
        patch.setattr(HalfSpace, "factor", singular)
        before, after = settled(3)
        assert np.array_equal(after.pressure, before.pressure)
        assert bem.solve(ROUGH, SIDE, 12.0).residual <= 1e-6
    monkeypatch.setattr(half_space, "FEW_PER_ROOT", 1.0)
    before, after = settled(3)
    assert np.array_equal(after.pressure, before.pressure)
    assert not after.exact


def test_an_answer_that_is_worse_is_not_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    original = ContactFactor.solve

    def thrice(self: ContactFactor, *given: Any) -> tuple[np.ndarray, int]:
        pressure, sets = original(self, *given)
        return 3 * pressure, sets

    monkeypatch.setattr(ContactFactor, "solve", thrice)
    monkeypatch.setattr(ContactFactor, "correct", lambda self, residual, *_: 0 * residual)
    before, after = settled(3)
    assert np.array_equal(after.pressure, before.pressure)
    assert np.array_equal(after.residual, before.residual)
    assert not after.exact
    assert after.effort.iterations > 0
    assert after.effort.convolutions > 0
    contact = bem.solve(ROUGH, SIDE, 12.0)
    assert contact.residual <= contact.problem.rtol


def test_later_factors_share_the_bound_on_contact_sets() -> None:
    """Missing nodes need another factor, which may try only the remaining contact sets."""
    needed = settled(20)[1].effort.iterations
    assert needed > 2
    for bound in range(1, needed):
        assert 0 < settled(20, bound)[1].effort.iterations <= bound


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("delta", [1e-45, 1e-14, 1e-12, 1e-6])
def test_a_plateau_high_above_the_rest(delta: float, capfd: pytest.CaptureFixture[str]) -> None:
    """Single precision cannot hold the depths over Delta."""
    heights = np.random.default_rng(2).uniform(-1, -0.5, (65, 65))
    heights[20:37, 20:37] = 0
    contact = bem.solve(heights, SIDE, delta, far_field="compliant")
    assert contact.contact_nodes == 17 * 17
    assert "".join(capfd.readouterr()) == ""
