"""The factor of a few nodes' matrix, against the matrix written out."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bem import factor, first_contact
from bem.factor import ContactFactor
from bem.influence import InfluenceMatrix, Kernel
from bench.references import dense

SHAPE = (7, 9)

some_nodes = st.lists(st.integers(0, 62), min_size=1, max_size=63, unique=True)


def written_out(kernel: Kernel = "uniform-pressure", aspect: float = 1.0) -> np.ndarray:
    return dense.influence_matrix(SHAPE, kernel, aspect).reshape(63, 63)


@settings(max_examples=80)
@given(seed=st.integers(0, 2**32 - 1), nodes=some_nodes, shift=st.floats(-0.9, 2.0))
def test_it_solves_the_complementarity_on_its_nodes(
    seed: int, nodes: list[int], shift: float
) -> None:
    """White noise is harder than any asperity, from next to no contact to all nodes."""
    picked = np.array(nodes)
    interference = np.random.default_rng(seed).uniform(-1, 1, len(picked)) + shift
    if interference.max() <= 0:
        interference -= interference.min() - 0.1
    picked = picked[np.argsort(-interference)]
    interference = np.sort(interference)[::-1].copy()
    matrix = written_out()[np.ix_(picked, picked)]
    factorised = ContactFactor(InfluenceMatrix(SHAPE, "uniform-pressure", 1.0), picked)
    pressure, sets = factorised.solve(interference)
    assert pressure.min() >= 0
    assert 1 <= sets <= 20
    gap = matrix @ pressure - interference
    assert np.abs(gap[pressure > 0]).max(initial=0.0) < 1e-12
    assert gap.min() > -1e-12  # removed nodes never penetrate again
    change = factorised.correct(matrix @ pressure, np.inf)
    np.testing.assert_allclose(change, pressure, rtol=0, atol=1e-11)


@pytest.mark.parametrize("dtype", ["float64", "float32"])
@pytest.mark.parametrize("softening", [0.0, -0.3, 1e-3])
def test_a_correction_returns_nodes_that_penetrate(
    monkeypatch: pytest.MonkeyPatch, dtype: str, softening: float
) -> None:
    """From wrong interferences to the right ones: removed nodes are needed again."""
    monkeypatch.setattr(factor, "MANY", 1.0)  # no new factor, however many nodes are under tension
    nodes = np.arange(63)
    heights = np.random.default_rng(8).uniform(-0.2, 0, 63)
    matrix = written_out() - softening
    factorised = ContactFactor(InfluenceMatrix(SHAPE, "uniform-pressure", 1.0, dtype), nodes)
    few, _ = factorised.solve(heights + 0.3, first_contact.far_field_law(softening, 0.0))
    right = matrix @ np.full(63, 0.05)  # under which every node carries load
    pressure = few
    for _ in range(6):
        left = right - matrix @ pressure
        law = first_contact.far_field_law(softening, 0.0)
        pressure = pressure + factorised.correct(left, 1e-13, law)
    assert np.count_nonzero(few) < 63
    assert np.abs(right - matrix @ pressure).max() < 1e-12


@pytest.mark.parametrize("load", [1e-3, 0.5, 20.0])
def test_a_load_that_is_given(load: float) -> None:
    """The far field moves until the pressure adds up to the load."""
    heights = np.random.default_rng(5).uniform(-0.2, 0, 63)
    factorised = ContactFactor(InfluenceMatrix(SHAPE, "uniform-pressure", 1.0), np.arange(63))
    pressure, _ = factorised.solve(heights, first_contact.far_field_law(0.0, 0.0, load))
    gap = written_out() @ pressure - heights
    displacement = gap[pressure > 0].mean()
    assert pressure.sum() == pytest.approx(load, rel=1e-12)
    assert np.abs(gap[pressure > 0] - displacement).max() < 1e-12
    assert gap[factorised.kept].min() > displacement - 1e-12


@pytest.mark.parametrize("softening", [-0.3, 1e-3])
def test_a_compliant_far_field(softening: float) -> None:
    """H - s 1 1^T: the law of the far field instead of a matrix that is nearly singular."""
    nodes = np.arange(63)
    heights = np.random.default_rng(5).uniform(-0.2, 0, 63)
    common = 1.0 - min(softening, 0)
    matrix = written_out() - softening
    factorised = ContactFactor(InfluenceMatrix(SHAPE, "uniform-pressure", 1.0), nodes)
    law = first_contact.far_field_law(softening, common)
    pressure, _ = factorised.solve(heights, law)
    gap = matrix @ pressure - (heights + common)
    assert 0 < np.count_nonzero(pressure) < 63
    assert np.abs(gap[pressure > 0]).max() < 1e-15 * abs(softening) * 63 + 1e-12
    assert gap[factorised.kept].min() > -1e-15 * abs(softening) * 63 - 1e-12


def test_a_far_field_that_is_too_compliant_has_no_pressure() -> None:
    nodes = np.arange(63)
    factorised = ContactFactor(InfluenceMatrix(SHAPE, "uniform-pressure", 1.0), nodes)
    with pytest.raises(np.linalg.LinAlgError):
        factorised.solve(np.ones(63), first_contact.far_field_law(10.0, 0.0))


@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_a_singular_matrix_is_refused(dtype: str) -> None:
    nodes = np.array([3, 7, 40, 7])
    with pytest.raises(np.linalg.LinAlgError):
        ContactFactor(InfluenceMatrix(SHAPE, "uniform-pressure", 1.0, dtype), nodes)
