"""Influence coefficients against their closed forms in 40 digits."""

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bem import influence
from bem.bodies import HALF_SPACE, KERNELS, REDUCED
from bem.influence import InfluenceMatrix, influence_coefficients
from bench.references import dense

FARTHEST = 2049  # cells

SHAPE = (7, 9)
some_nodes = st.lists(st.integers(0, 62), min_size=1, max_size=63, unique=True)

NEAR = [(i, j) for i in range(5) for j in range(5)]
"""All offsets where the closed form is used, and the first ones beyond."""

FAR = [
    *[
        (2, 2),
        (2, 3),
        (15, 5),
        (15, 6),
        (16, 0),
        (127, 11),
        (127, 16),
        (128, 0),
        (90, 91),
    ],
    *[
        (512, 0),
        (512, 1),
        (1024, 1024),
        (2048, 64),
        (FARTHEST, 0),
        (0, FARTHEST),
        (1448, 1449),
    ],
]
"""Offsets on either side of the distances at which the rule of integration changes, and beyond."""


@pytest.fixture(scope="module")
def largest_table():
    return influence_coefficients((FARTHEST + 1, FARTHEST + 1))


def random_offsets(count, farthest):
    """Offsets in every direction, as many at every order of magnitude of the distance."""
    random = np.random.default_rng(2025)
    distance = np.maximum(farthest ** random.random(count), 2)
    angle = random.uniform(0, np.pi / 2, count)
    along, across = distance * np.cos(angle), distance * np.sin(angle)
    return [(int(i), int(j)) for i, j in zip(along, across, strict=True)]


def love(i, j, aspect=1.0):
    """Displacement at (i, aspect j) under unit pressure on a cell of sides 1 and aspect."""
    with mpmath.workdps(40):
        half = mpmath.mpf(1) / 2
        total = mpmath.mpf(0)
        for sign_x in (1, -1):
            for sign_y in (1, -1):
                x, y = i + sign_x * half, aspect * (j + sign_y * half)
                corner = x * mpmath.asinh(y / abs(x)) + y * mpmath.asinh(x / abs(y))
                total += sign_x * sign_y * corner
        return total / mpmath.pi


@pytest.mark.parametrize("offsets", [NEAR, FAR, random_offsets(500, FARTHEST)])
def test_uniform_pressure_is_loves_closed_form(largest_table, offsets):
    for i, j in offsets:
        assert float(abs(largest_table[i, j] / love(i, j) - 1)) < 1e-13, (i, j)


@pytest.mark.parametrize("aspect", [2.0, 0.5, 7.3, 1 / 64])
def test_oblong_cells_follow_loves_closed_form(aspect):
    table = influence_coefficients((257, 257), aspect=aspect)
    strips = [pair for i in range(0, 257, 8) for pair in [(i, 0), (0, i), (i, 2), (2, i)]]
    for i, j in [*NEAR, *strips, *random_offsets(200, 256)]:
        assert float(abs(table[i, j] / love(i, j, aspect) - 1)) < 1e-12, (i, j)


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("shape", [(1, 9), (33, 70), (300, 7)])
def test_oblong_grids_transpose_and_nest(kernel, shape):
    """A coefficient depends on its offset, not on the grid it was tabulated for."""
    table = influence_coefficients(shape, REDUCED[kernel])
    np.testing.assert_array_equal(
        table, influence_coefficients(shape[::-1], REDUCED[kernel]).T
    )
    square = influence_coefficients((300, 300), REDUCED[kernel])
    np.testing.assert_array_equal(table, square[: shape[0], : shape[1]])


def test_concentrated_force_is_mircos_formula():
    """u = F / (pi E* a) asin(a / r) with F = p g^2 and a = g / 2, here with g = E* = p = 1."""
    table = influence_coefficients((600, 600), REDUCED["concentrated-force"])
    np.testing.assert_array_equal(table, table.T)
    with mpmath.workdps(40):
        radius = mpmath.mpf(1) / 2
        for i, j in [*NEAR[1:], *random_offsets(200, 599)]:
            exact = mpmath.asin(radius / mpmath.hypot(i, j)) / (mpmath.pi * radius)
            assert float(abs(table[i, j] / exact - 1)) < 1e-13, (i, j)


@given(
    nodes=some_nodes,
    loaded=some_nodes,
    kernel=st.sampled_from(KERNELS),
    dtype=st.sampled_from(["float64", "float32"]),
)
def test_entries_are_those_of_the_matrix(nodes, loaded, kernel, dtype):
    rtol = 1e-14 if dtype == "float64" else 1e-7
    matrix = InfluenceMatrix(SHAPE, REDUCED[kernel], 1.0, dtype)
    rows, columns = np.array(nodes), np.array(loaded)
    expected = dense.influence_matrix(SHAPE, kernel).reshape(63, 63)
    np.testing.assert_allclose(
        matrix.between(rows, columns), expected[np.ix_(rows, columns)], rtol=rtol
    )
    lower = np.tril(matrix.among(rows))
    np.testing.assert_allclose(lower, np.tril(expected[np.ix_(rows, rows)]), rtol=rtol)


@pytest.mark.parametrize("mirrored", [0, 2**20])
def test_entries_of_oblong_cells_and_of_many_nodes(monkeypatch, mirrored):
    """More nodes than are gathered at a time, in any order; as on small grids and on large ones."""
    monkeypatch.setattr(influence, "MIRRORED_NODES", mirrored)
    nodes = np.random.default_rng(1).permutation(63 * 4)
    matrix = InfluenceMatrix((14, 18), HALF_SPACE, 2.5).among(nodes)
    expected = dense.influence_matrix((14, 18), "uniform-pressure", 2.5).reshape(252, 252)
    np.testing.assert_allclose(
        np.tril(matrix), np.tril(expected[np.ix_(nodes, nodes)]), rtol=1e-14
    )
