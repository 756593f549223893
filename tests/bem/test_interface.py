"""The influence matrix of a patch without edges, and its approximate inverse on any set."""

import numpy as np
import pytest

import bem
from bem.interface import Interface, InterfaceMatrix
from bem.spacing import Boundary
from bem.spectrum import spectral_filter
from gen.surface import generate

EDGELESS: list[Boundary] = ["periodic", "mirror"]


def matrix_of(shape: tuple[int, int], boundary: Boundary, aspect: float) -> np.ndarray:
    """The influence matrix of all nodes, column by column."""
    operator = spectral_filter(shape, boundary, aspect)
    units = np.eye(shape[0] * shape[1]).reshape(-1, *shape)
    return np.array([operator(unit).reshape(-1) for unit in units]).T


def approximate_inverse(interface: Interface, nodes: np.ndarray) -> np.ndarray:
    precondition = interface.approximate_inverse(nodes)
    return np.array([precondition(unit) for unit in np.eye(len(nodes))]).T


@pytest.mark.parametrize("boundary", EDGELESS)
@pytest.mark.parametrize(("shape", "aspect"), [((1, 9), 1.0), ((8, 8), 1.0), ((7, 10), 0.3)])
def test_it_is_the_matrix_of_its_nodes(
    shape: tuple[int, int], aspect: float, boundary: Boundary
) -> None:
    random = np.random.default_rng(1)
    matrix = matrix_of(shape, boundary, aspect)
    nodes = np.flatnonzero(random.random(matrix.shape[0]) < 0.6)
    some = np.flatnonzero(random.random(nodes.size) < 0.6)
    assert np.linalg.eigvalsh(matrix[np.ix_(nodes, nodes)])[0] > 0
    interface = Interface(shape, boundary, aspect, nodes, keep_field=True)
    pressure = random.standard_normal(nodes.size)
    expected = matrix[:, nodes] @ pressure
    np.testing.assert_allclose(interface.displace(pressure), expected[nodes], atol=1e-12)
    assert interface.field is not None
    np.testing.assert_allclose(interface.field.reshape(-1), expected, atol=1e-12)
    part = matrix[np.ix_(nodes, nodes[some])] @ pressure[some]
    np.testing.assert_allclose(interface.displace_some(some, pressure[some]), part, atol=1e-5)
    among = interface.among(some).displace(pressure[some])
    np.testing.assert_allclose(among, part[some], atol=1e-12)
    with pytest.raises(np.linalg.LinAlgError, match="left to iterations"):
        interface.factor(some)


@pytest.mark.parametrize("boundary", EDGELESS)
@pytest.mark.parametrize(("shape", "aspect"), [((1, 9), 1.0), ((8, 8), 1.0), ((13, 10), 0.3)])
def test_its_entries_are_those_of_its_transforms(
    shape: tuple[int, int], aspect: float, boundary: Boundary
) -> None:
    matrix = matrix_of(shape, boundary, aspect)
    nodes = np.random.default_rng(2).permutation(matrix.shape[0])[: 2 * matrix.shape[0] // 3]
    lower = InterfaceMatrix(shape, boundary, aspect).among(nodes)
    expected = np.tril(matrix[np.ix_(nodes, nodes)])
    np.testing.assert_allclose(np.tril(lower), expected, atol=1e-12)
    inverse = np.linalg.pinv(matrix, rcond=1e-10)  # uniform fields have no inverse
    lower = InterfaceMatrix(shape, boundary, aspect, inverse=True).among(nodes)
    expected = np.tril(inverse[np.ix_(nodes, nodes)])
    np.testing.assert_allclose(np.tril(lower), expected, atol=1e-11)


@pytest.mark.parametrize("boundary", EDGELESS)
@pytest.mark.parametrize("percent", [5, 25, 60, 97, 100])
@pytest.mark.parametrize(("shape", "least", "most"), [((32, 32), 0.95, 2.0), ((21, 26), 0.0, 4.0)])
def test_the_approximate_inverse_is_near_the_inverse_whatever_the_contact(
    shape: tuple[int, int], least: float, most: float, percent: float, boundary: Boundary
) -> None:
    """On rough surfaces, eigenvalues of M H are between 1 and 2 where sides are whole blocks."""
    heights = generate("diamond-square", 33, 0.7, 12.0, np.random.default_rng(3))
    heights = heights[: shape[0], : shape[1]]
    full = float(-spectral_filter(shape, boundary)(heights).min())
    contact = np.arange(heights.size)
    for pressure in np.geomspace(1e-3, 1e3, 60) * full if percent < 100 else []:
        solved = bem.solve(heights, 1.0, spacing=1.0, pressure=pressure, boundary=boundary)
        contact = np.flatnonzero(solved.pressure)
        if solved.area_percent >= percent:
            break
    inverse = approximate_inverse(Interface(shape, boundary, 1.0), contact)
    assert np.abs(inverse - inverse.T).max() < 1e-5 * np.abs(inverse).max()
    matrix = matrix_of(shape, boundary, 1.0)[np.ix_(contact, contact)]
    values, vectors = np.linalg.eigh((inverse + inverse.T) / 2)
    assert values[0] > 0
    root = vectors * np.sqrt(values)
    eigenvalues = np.linalg.eigvalsh(root.T @ matrix @ root)
    if len(contact) == heights.size:  # a uniform pressure displaces nothing
        assert eigenvalues[0] == pytest.approx(0, abs=1e-5)
        eigenvalues = eigenvalues[1:]
    assert eigenvalues[0] > least
    assert eigenvalues[-1] < most
