"""The preconditioner and its circulant, against the inverse of the matrix."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import bem
from bem import preconditioner, vectors
from bem.convolution import Filter
from bem.influence import KERNELS, Kernel
from bem.preconditioner import BLOCK, block_sums, circulant_inverse, half_space_preconditioner
from bem.workers import on_threads
from bench.references import dense
from gen.surface import generate


def relative_error(computed: np.ndarray, expected: np.ndarray) -> float:
    return float(np.abs(computed - expected).max() / np.abs(expected).max())


def matrix_of(operator: Filter) -> np.ndarray:
    """The matrix that a filter stands for, column by column."""
    nodes = operator.shape[0] * operator.shape[1]
    columns = [operator(unit.reshape(operator.shape)).reshape(-1) for unit in np.eye(nodes)]
    return np.array(columns).T


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("shape", [(1, 9), (2, 3), (8, 8), (9, 9), (10, 16)])
def test_circulant_inverse_is_positive_definite_on_any_nodes(
    shape: tuple[int, int], kernel: Kernel
) -> None:
    """Largest and smallest eigenvalue of a part lie between those of the whole."""
    matrix = matrix_of(circulant_inverse(shape, kernel, dtype="float64"))
    assert relative_error(matrix, matrix.T) < 1e-14
    assert np.linalg.eigvalsh(matrix)[0] > 0
    single = matrix_of(circulant_inverse(shape, kernel))
    assert relative_error(single, matrix) < 1e-6


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize(
    ("shape", "periods"), [((1, 12), (16, 16)), ((8, 16), (16, 16)), ((9, 17), (16, 32))]
)
def test_circulant_inverse_belongs_to_the_nearest_circulant(
    shape: tuple[int, int], periods: tuple[int, int], kernel: Kernel
) -> None:
    """In the Frobenius norm that is the mean over a wrapped diagonal (T. Chan 1988)."""
    matrix = dense.influence_view(periods, kernel)
    i, j = np.ogrid[: periods[0], : periods[1]]
    nearest = np.empty((*periods, *periods))
    for k, m in np.ndindex(periods):
        wrapped = (i + k) % periods[0], (j + m) % periods[1], i, j
        nearest[wrapped] = matrix[wrapped].mean()
    nodes = periods[0] * periods[1]
    inverse = np.linalg.inv(nearest.reshape(nodes, nodes)).reshape(*periods, *periods)
    part = inverse[: shape[0], : shape[1], : shape[0], : shape[1]]
    computed = matrix_of(circulant_inverse(shape, kernel, dtype="float64"))
    assert relative_error(computed, part.reshape(computed.shape)) < 1e-12


def restricted_matrix(
    shape: tuple[int, int], kernel: Kernel, aspect: float, nodes: np.ndarray, dtype: str
) -> np.ndarray:
    """The approximate inverse on some nodes, column by column."""
    everywhere = np.arange(shape[0] * shape[1])
    precondition = half_space_preconditioner(
        shape, kernel, aspect, everywhere, dtype
    ).restricted_to(nodes)
    return np.array([precondition(unit) for unit in np.eye(len(nodes))]).T


@settings(max_examples=40)
@given(data=st.data())
def test_it_is_symmetric_and_positive_definite_on_any_nodes(data: st.DataObject) -> None:
    shape = data.draw(st.tuples(st.integers(1, 14), st.integers(1, 14)))
    kernel = data.draw(st.sampled_from(KERNELS))
    aspect = data.draw(st.sampled_from([1.0, 0.25, 5.0])) if kernel == "uniform-pressure" else 1.0
    everywhere = st.integers(0, shape[0] * shape[1] - 1)
    nodes = np.array(sorted(data.draw(st.sets(everywhere, min_size=1))))
    matrix = restricted_matrix(shape, kernel, aspect, nodes, "float64")
    assert relative_error(matrix, matrix.T) < 1e-13
    assert np.linalg.eigvalsh((matrix + matrix.T) / 2)[0] > 0
    single = restricted_matrix(shape, kernel, aspect, nodes, "float32")
    assert relative_error(single, matrix) < 1e-5


@pytest.mark.parametrize("level", [4, 5, 6])
@pytest.mark.parametrize("delta", [15.0, 60.0])
def test_it_is_near_the_inverse_on_rough_contacts_of_any_size(level: int, delta: float) -> None:
    """Eigenvalues of the preconditioned matrix from 0.8 to 6, on 17 to 65 nodes a side."""
    nodes_a_side = 2**level + 1
    heights = generate("diamond-square", nodes_a_side, 0.7, 12.0, np.random.default_rng(3))
    contact = np.flatnonzero(bem.solve(heights, 1000.0, delta).pressure)
    shape = heights.shape
    matrix = dense.influence_matrix(shape, "uniform-pressure").reshape(heights.size, heights.size)
    inverse = restricted_matrix(shape, "uniform-pressure", 1.0, contact, "float64")
    factor = np.linalg.cholesky(matrix[np.ix_(contact, contact)])
    similar = factor.T @ inverse @ factor  # with the eigenvalues of inverse @ matrix
    identity = np.eye(contact.size)
    np.linalg.cholesky(similar - 0.8 * identity)  # LinAlgError if an eigenvalue is below 0.8
    np.linalg.cholesky(6 * identity - similar)  # or above 6


@pytest.mark.parametrize("rows", [(0, 12), (5, 6), (3, 9)])
@pytest.mark.parametrize("size", [1, 30, 2000])
def test_sums_over_blocks_in_pieces_are_those_of_the_whole_list(
    monkeypatch: pytest.MonkeyPatch, size: int, rows: tuple[int, int]
) -> None:
    """Rows of blocks ascend, blocks of a row may alternate; some rows have no node."""
    monkeypatch.setattr("bem.vectors.PIECE", 16)
    monkeypatch.setattr("bem.vectors.SHARED_PIECE", 16)
    random = np.random.default_rng(size)
    row = np.sort(random.integers(*rows, size))
    blocks, values = 9 * row + random.integers(0, 9, size), random.standard_normal(size)
    for weights in (values, None):
        field = np.full((12, 9), np.nan)
        preconditioner._sum_by_rows(field, blocks, weights)
        expected = np.bincount(blocks, weights=weights, minlength=field.size)
        np.testing.assert_array_equal(field.reshape(-1), expected)


@pytest.mark.parametrize("dtype", ["float32", "float64"])
@pytest.mark.parametrize("weighted", [False, True])
def test_sums_over_blocks_have_the_same_bits_in_pieces(
    monkeypatch: pytest.MonkeyPatch, dtype: str, *, weighted: bool
) -> None:
    random = np.random.default_rng(0)
    field, weights = random.standard_normal((2, 40 * BLOCK, 6 * BLOCK)).astype(dtype)
    factors = weights if weighted else None
    whole = block_sums(field, factors)
    blocks = (field * weights if weighted else field).reshape(40, BLOCK, 6, BLOCK)
    np.testing.assert_allclose(whole, blocks.sum(axis=(1, 3)), atol=1e-5)
    monkeypatch.setattr(vectors, "PIECE", 64)
    monkeypatch.setattr(vectors, "SHORT", 128)
    for threads in (1, 3):
        with on_threads(threads):
            np.testing.assert_array_equal(block_sums(field, factors), whole)
