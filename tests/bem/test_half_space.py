"""The operators that the solver applies, against the matrix written out."""

import numpy as np
import pytest

from bem.half_space import HalfSpace
from bench.references import dense


def test_the_compliance_of_the_far_field_is_subtracted() -> None:
    shape, softening = (6, 7), 0.01
    nodes = np.flatnonzero(np.random.default_rng(4).random(shape) < 0.6)
    operators = HalfSpace(shape, "uniform-pressure", 1.0, nodes).through(softening)
    matrix = dense.influence_matrix(shape, "uniform-pressure").reshape(42, 42)[nodes][:, nodes]
    pressure = np.random.default_rng(5).random(nodes.size)
    expected = (matrix - softening) @ pressure
    np.testing.assert_allclose(operators.displace(pressure), expected, rtol=1e-12)
    everywhere = np.arange(nodes.size)
    single = operators.displace_some(everywhere, pressure)
    np.testing.assert_allclose(single, expected, rtol=1e-6)
    assert operators.norm >= np.linalg.eigvalsh(matrix)[-1]


@pytest.mark.parametrize("keep_field", [False, True])
def test_displacements_of_the_whole_grid_are_kept_where_asked_for(keep_field: bool) -> None:
    """The field is a copy, which no later product changes."""
    shape, nodes = (6, 7), np.array([3, 8, 30])
    operators = HalfSpace(shape, "uniform-pressure", 1.0, nodes, keep_field=keep_field)
    matrix = dense.influence_matrix(shape, "uniform-pressure").reshape(42, 42)
    pressure = np.array([1.0, 2.0, 0.5])
    displacement = operators.displace(pressure)
    np.testing.assert_allclose(displacement, (matrix[:, nodes] @ pressure)[nodes], rtol=1e-12)
    if not keep_field:
        assert operators.field is None
        return
    kept = operators.field
    assert kept is not None
    operators.displace_some(np.arange(3), pressure)
    operators.displace(10 * pressure)
    np.testing.assert_allclose(kept.reshape(-1), matrix[:, nodes] @ pressure, rtol=1e-12)
