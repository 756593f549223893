"""Dense algebra on few nodes: against the matrix written out, and against iterations."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import bem
from bem import factor, first_contact, half_space, influence
from bem.factor import ContactFactor
from bem.half_space import HalfSpace
from bem.influence import KERNELS, InfluenceMatrix, Kernel
from bem.iterate import Iterate
from bem.problem import FAR_FIELDS, FarField
from bench.references import dense
from gen.surface import generate

SHAPE = (7, 9)
ROUGH = generate("diamond-square", 129, 0.65, 12.5, np.random.default_rng(4))
SIDE = 1000.0

some_nodes = st.lists(st.integers(0, 62), min_size=1, max_size=63, unique=True)


def written_out(kernel: Kernel = "uniform-pressure", aspect: float = 1.0) -> np.ndarray:
    return dense.influence_matrix(SHAPE, kernel, aspect).reshape(63, 63)


@given(
    nodes=some_nodes,
    loaded=some_nodes,
    kernel=st.sampled_from(KERNELS),
    dtype=st.sampled_from(["float64", "float32"]),
)
def test_entries_are_those_of_the_matrix(
    nodes: list[int], loaded: list[int], kernel: Kernel, dtype: str
) -> None:
    rtol = 1e-14 if dtype == "float64" else 1e-7
    matrix = InfluenceMatrix(SHAPE, kernel, 1.0, dtype)
    rows, columns = np.array(nodes), np.array(loaded)
    expected = written_out(kernel)
    np.testing.assert_allclose(
        matrix.between(rows, columns), expected[np.ix_(rows, columns)], rtol=rtol
    )
    lower = np.tril(matrix.among(rows))
    np.testing.assert_allclose(lower, np.tril(expected[np.ix_(rows, rows)]), rtol=rtol)


@pytest.mark.parametrize("mirrored", [0, 2**20])
def test_entries_of_oblong_cells_and_of_many_nodes(
    monkeypatch: pytest.MonkeyPatch, mirrored: int
) -> None:
    """More nodes than are gathered at a time, in any order; as on small grids and on large ones."""
    monkeypatch.setattr(influence, "MIRRORED_NODES", mirrored)
    nodes = np.random.default_rng(1).permutation(63 * 4)
    matrix = InfluenceMatrix((14, 18), "uniform-pressure", 2.5).among(nodes)
    expected = dense.influence_matrix((14, 18), "uniform-pressure", 2.5).reshape(252, 252)
    np.testing.assert_allclose(np.tril(matrix), np.tril(expected[np.ix_(nodes, nodes)]), rtol=1e-14)


@settings(max_examples=80)
@given(seed=st.integers(0, 2**32 - 1), nodes=some_nodes, shift=st.floats(-0.9, 2.0))
def test_it_solves_the_complementarity_on_its_nodes(
    seed: int, nodes: list[int], shift: float
) -> None:
    """White noise, from next to no contact to all nodes: far worse than any asperity."""
    picked = np.array(nodes)
    interference = np.random.default_rng(seed).uniform(-1, 1, len(picked)) + shift
    if interference.max() <= 0:
        interference -= interference.min() - 0.1
    picked = picked[np.argsort(-interference)]
    interference = np.sort(interference)[::-1].copy()
    matrix = written_out()[np.ix_(picked, picked)]
    found = ContactFactor(InfluenceMatrix(SHAPE, "uniform-pressure", 1.0), picked)
    pressure, sets = found.solve(interference)
    assert pressure.min() >= 0
    assert 1 <= sets <= 20
    gap = matrix @ pressure - interference
    assert np.abs(gap[pressure > 0]).max(initial=0.0) < 1e-12
    assert gap.min() > -1e-12  # what pulled once always pulls: no node's pressure pulls on another
    change = found.correct(matrix @ pressure, np.inf)
    np.testing.assert_allclose(change, pressure, rtol=0, atol=1e-11)


@pytest.mark.parametrize("dtype", ["float64", "float32"])
@pytest.mark.parametrize("softening", [0.0, -0.3, 1e-3])
def test_a_correction_puts_back_what_penetrates(
    monkeypatch: pytest.MonkeyPatch, dtype: str, softening: float
) -> None:
    """From wrong interferences to the right ones: nodes that were taken out are needed again."""
    monkeypatch.setattr(factor, "MANY", 1.0)  # however many pull, no new factor leaves them out
    nodes = np.arange(63)
    heights = np.random.default_rng(8).uniform(-0.2, 0, 63)
    matrix = written_out() - softening
    found = ContactFactor(InfluenceMatrix(SHAPE, "uniform-pressure", 1.0, dtype), nodes)
    few, _ = found.solve(heights + 0.3, first_contact.far_field_law(softening, 0.0))
    right = matrix @ np.full(63, 0.05)  # under which every node carries load
    pressure = few
    for _ in range(6):
        left = right - matrix @ pressure
        law = first_contact.far_field_law(softening, 0.0)
        pressure = pressure + found.correct(left, 1e-13, law)
    assert np.count_nonzero(few) < 63
    assert np.abs(right - matrix @ pressure).max() < 1e-12


@pytest.mark.parametrize("load", [1e-3, 0.5, 20.0])
def test_a_load_that_is_given(load: float) -> None:
    """The far field moves until the pressure adds up to the load."""
    heights = np.random.default_rng(5).uniform(-0.2, 0, 63)
    found = ContactFactor(InfluenceMatrix(SHAPE, "uniform-pressure", 1.0), np.arange(63))
    pressure, _ = found.solve(heights, first_contact.far_field_law(0.0, 0.0, load))
    gap = written_out() @ pressure - heights
    moved = gap[pressure > 0].mean()
    assert pressure.sum() == pytest.approx(load, rel=1e-12)
    assert np.abs(gap[pressure > 0] - moved).max() < 1e-12
    assert gap[found.kept].min() > moved - 1e-12


@pytest.mark.parametrize("softening", [-0.3, 1e-3])
def test_a_far_field_that_gives_way(softening: float) -> None:
    """H - s 1 1^T: the law of the far field instead of a matrix that is nearly singular."""
    nodes = np.arange(63)
    heights = np.random.default_rng(5).uniform(-0.2, 0, 63)
    common = 1.0 - min(softening, 0)
    matrix = written_out() - softening
    found = ContactFactor(InfluenceMatrix(SHAPE, "uniform-pressure", 1.0), nodes)
    law = first_contact.far_field_law(softening, common)
    pressure, _ = found.solve(heights, law)
    gap = matrix @ pressure - (heights + common)
    assert 0 < np.count_nonzero(pressure) < 63
    assert np.abs(gap[pressure > 0]).max() < 1e-15 * abs(softening) * 63 + 1e-12
    assert gap[found.kept].min() > -1e-15 * abs(softening) * 63 - 1e-12


def test_a_far_field_that_gives_way_too_much_has_no_pressure() -> None:
    nodes = np.arange(63)
    found = ContactFactor(InfluenceMatrix(SHAPE, "uniform-pressure", 1.0), nodes)
    with pytest.raises(np.linalg.LinAlgError):
        found.solve(np.ones(63), first_contact.far_field_law(10.0, 0.0))


@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_a_singular_matrix_is_refused(dtype: str) -> None:
    nodes = np.array([3, 7, 40, 7])
    with pytest.raises(np.linalg.LinAlgError):
        ContactFactor(InfluenceMatrix(SHAPE, "uniform-pressure", 1.0, dtype), nodes)


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("delta", [6.0, 8.0, 10.0, 12.0, 15.0])
@pytest.mark.parametrize("rtol", [1e-4, 2e-7, 1e-12])
def test_few_nodes_in_contact_are_what_iterations_find(
    monkeypatch: pytest.MonkeyPatch, kernel: Kernel, delta: float, rtol: float
) -> None:
    found = bem.solve(ROUGH, SIDE, delta, kernel=kernel, rtol=rtol)
    monkeypatch.setattr(half_space, "FEW_PER_ROOT", 0.0)
    expected = bem.solve(ROUGH, SIDE, delta, kernel=kernel, rtol=1e-12)
    assert found.residual <= rtol
    assert abs(found.contact_nodes - expected.contact_nodes) <= (0 if rtol < 1e-6 else 5)
    assert found.force == pytest.approx(expected.force, rel=10 * rtol)


def pressed(load: str, delta: float, **settings: Any) -> bem.Contact:
    """At a displacement, or under the force that it takes."""
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
    """Where dense algebra goes wrong, iterations mend it: only the count gives that away."""
    direct = pressed(load, delta, kernel=kernel, far_field=far_field)
    monkeypatch.setattr(half_space, "FEW_PER_ROOT", 0.0)
    iterated = pressed(load, delta, kernel=kernel, far_field=far_field)
    assert direct.convolutions <= 0.7 * iterated.convolutions


def settled(lost: int, most_sets: int = 50) -> tuple[Iterate, Iterate]:
    """A start without some nodes of the contact, and what became of it."""
    contact = bem.solve(ROUGH, SIDE, 12.0, rtol=1e-12)
    nodes = np.arange(ROUGH.size)
    interference = ((ROUGH - ROUGH.max()) / 12.0 + 1).reshape(-1)
    operators = HalfSpace(ROUGH.shape, "uniform-pressure", 1.0, nodes)
    pressure = contact.pressure.reshape(-1) * (contact.problem.spacing[0] / 12.0)
    touching = np.flatnonzero(pressure)
    pressure[touching[:: max(len(touching) // lost, 1)] if lost else []] = 0
    # Wrong outside of the contact that is left, so that nothing there asks to be taken along.
    residual = np.where(pressure > 0, 0.5, -1.0)
    start = Iterate(pressure.copy(), residual)
    before = Iterate(pressure, residual)
    first_contact.settle_few(operators, interference, start, 1e-12, most_sets)
    return before, start


@pytest.mark.parametrize("lost", [0, 1, 20, 100])
def test_nodes_that_were_lost_are_found_again(lost: int) -> None:
    _, found = settled(lost)
    assert found.exact
    assert found.violation() <= 1e-12


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
    """Nodes that were lost need another factor, and that has to do with the sets that are left."""
    needed = settled(20)[1].effort.iterations
    assert needed > 2
    for bound in range(1, needed):
        assert 0 < settled(20, bound)[1].effort.iterations <= bound


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("delta", [1e-45, 1e-14, 1e-12, 1e-6])
def test_a_plateau_high_above_the_rest(delta: float, capfd: pytest.CaptureFixture[str]) -> None:
    """Depths over Delta that single precision cannot hold, let alone tell apart."""
    heights = np.random.default_rng(2).uniform(-1, -0.5, (65, 65))
    heights[20:37, 20:37] = 0
    contact = bem.solve(heights, SIDE, delta, far_field="compliant")
    assert contact.contact_nodes == 17 * 17
    assert "".join(capfd.readouterr()) == ""
