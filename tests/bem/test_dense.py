"""The factor of a few nodes' matrix, against the matrix written out."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import bem
from bem import dense
from bem.dense import ContactFactor
from bem.influence import InfluenceMatrix, Kernel
from bench.references import dense as reference
from bench.references.surfaces import surface

SHAPE = (7, 9)
MATRIX = InfluenceMatrix(SHAPE, "uniform-pressure", 1.0)

some_nodes = st.lists(st.integers(0, 62), min_size=1, max_size=63, unique=True)


def written_out(kernel: Kernel = "uniform-pressure", aspect: float = 1.0) -> np.ndarray:
    return reference.influence_matrix(SHAPE, kernel, aspect).reshape(63, 63)


@settings(max_examples=80)
@given(
    seed=st.integers(0, 2**32 - 1),
    nodes=some_nodes,
    shift=st.floats(-0.9, 2.0),
    hardness=st.sampled_from([np.inf, 0.5, 0.1, 0.01]),
)
def test_it_solves_the_complementarity_on_its_nodes(seed, nodes, shift, hardness):
    """White noise is harder than any asperity, from next to no contact to all nodes yielded."""
    field = np.random.default_rng(seed).uniform(-1, 1, 63) + shift
    picked = np.array(nodes)
    if field[picked].max() <= 0:
        field -= field[picked].min() - 0.1
    picked = picked[np.argsort(-field[picked])]
    factor = ContactFactor(MATRIX.among, picked, hardness)
    solution = factor.solve(field, None)
    if not solution.settled:  # then iterations take over
        assert hardness < np.inf
        return
    pressure, kept = solution.pressure, factor.nodes
    gap = written_out()[np.ix_(kept, kept)] @ pressure - field[kept]
    yielded = pressure >= hardness
    assert pressure.min() >= 0
    assert pressure.max() <= hardness
    assert np.abs(gap[(pressure > 0) & ~yielded]).max(initial=0.0) < 1e-12
    assert gap[~yielded].min(initial=0.0) > -1e-12
    assert gap[yielded].max(initial=0.0) < 1e-12


@pytest.mark.parametrize("load", [1e-3, 0.5, 20.0])
def test_a_load_that_is_given(load):
    """The far field moves until the pressure adds up to the load."""
    heights = np.random.default_rng(5).uniform(-0.2, 0, 63)
    factor = ContactFactor(MATRIX.among, np.arange(63))
    solution = factor.solve(heights, load)
    pressure = np.zeros(63)
    pressure[factor.nodes] = solution.pressure
    gap = written_out() @ pressure - heights - solution.shift
    assert pressure.sum() == pytest.approx(load, rel=1e-12)
    assert np.abs(gap[pressure > 0]).max() < 1e-12
    assert gap[factor.nodes].min() > -1e-12


@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_a_singular_matrix_is_refused(dtype):
    matrix = InfluenceMatrix(SHAPE, "uniform-pressure", 1.0, dtype)
    with pytest.raises(np.linalg.LinAlgError):
        ContactFactor(matrix.among, np.array([3, 7, 40, 7]))


def test_sets_that_cycle_are_left_to_iterations(monkeypatch):
    monkeypatch.setattr(dense.ContactFactor.solve, "__defaults__", (1,))
    heights = surface("self-affine", (9, 9), 1)
    contact = bem.solve(heights, 8.0, 0.7 * float(np.ptp(heights)))
    assert contact.residual <= 1e-6
    assert contact.iterations > 1
