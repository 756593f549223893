"""Few nodes that may touch: the contact set by dense linear algebra, to the last digits."""

import numpy as np
from numpy.typing import NDArray

from bem.influence import Kernel, influence_coefficients
from bem.solver import Iterate

Values = NDArray[np.float64]
Nodes = NDArray[np.intp]

# Up to so many nodes a dense solve is faster than convolutions (`pytest bench -k few_candidates`),
# and so many contact sets are tried before the solution is left to them.
FEW_NODES = 250
CONTACT_SETS = 20


def influence_matrix(nodes: Nodes, shape: tuple[int, int], kernel: Kernel, aspect: float) -> Values:
    """Influence of every node of a list on every other.

    Parameters
    ----------
    nodes : (m,) flat indices into a grid of (nx, ny) nodes
    shape, kernel, aspect : see `bem.influence.influence_coefficients`

    Returns
    -------
    (m, m) displacement at one from unit pressure on the other [first side of a cell / E*]
    """
    row, column = np.divmod(nodes, shape[1])
    table = influence_coefficients(shape, kernel, aspect)
    places = np.abs(row[:, np.newaxis] - row)
    places *= table.shape[1]
    places += np.abs(column[:, np.newaxis] - column)
    matrix: Values = table.reshape(-1).take(places)
    return matrix


def solve_directly(
    matrix: Values, interference: Values, *, rtol: float, max_iterations: int
) -> tuple[Iterate, bool]:
    """Find p >= 0 with w = H p - u >= 0 and p w = 0: a primal-dual active set with exact solves.

    Parameters
    ----------
    matrix : (m, m) H
    interference : (m,) u, at most 1
    rtol : largest violation accepted
    max_iterations : bound on the contact sets, besides `CONTACT_SETS`

    Returns
    -------
    (iterate, converged) : a contact set counts as an iteration and as an application of H; not
        converged if the sets of a nearly singular matrix cycle
    """
    iterate = Iterate(np.zeros_like(interference), interference.copy())
    # Less than half of the nodes that may touch do so: the higher half is the cheaper start.
    contact = np.flatnonzero(interference >= np.median(interference))
    while iterate.iterations < min(CONTACT_SETS, max_iterations):
        iterate.pressure[:] = 0
        iterate.pressure[contact] = np.linalg.solve(
            matrix[np.ix_(contact, contact)], interference[contact]
        )
        iterate.residual = interference - np.einsum("ij,j->i", matrix, iterate.pressure)
        iterate.residual[contact] = 0
        iterate.iterations += 1
        iterate.convolutions += 1
        following = iterate.contact()
        if np.array_equal(following, contact):
            break
        contact = following
    np.maximum(iterate.pressure, 0, out=iterate.pressure)
    iterate.residual = interference - np.einsum("ij,j->i", matrix, iterate.pressure)
    return iterate, iterate.violation() <= rtol
