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
    matrix: Values,
    interference: Values,
    *,
    rtol: float,
    max_iterations: int,
    load: float | None = None,
) -> tuple[Iterate, float, bool]:
    """Find p >= 0 with w = H p - u - d >= 0 and p w = 0: an active set with exact solves.

    Parameters
    ----------
    matrix : (m, m) H
    interference : (m,) u [any length]
    rtol : largest violation accepted, over the displacement of the highest node, max u + d
    max_iterations : bound on the contact sets, besides `CONTACT_SETS`
    load : sum of p that decides the displacement d; without it d = 0

    Returns
    -------
    (iterate, d, converged) : pressure and residual in the unit of u. A contact set counts as an
        iteration and as an application of H. Not converged if the sets cycle or are singular
    """
    iterate, moved = Iterate(np.zeros_like(interference), interference.copy()), 0.0
    # Less than half of the nodes that may touch do so: the higher half is the cheaper start.
    middle = np.sort(interference)[len(interference) // 2]
    contact = np.flatnonzero(interference >= middle)
    while contact.size and iterate.iterations < min(CONTACT_SETS, max_iterations):
        sides = np.ones((len(contact), 2))
        sides[:, 0] = interference[contact]
        try:
            plain, uniform = np.linalg.solve(matrix[contact[:, np.newaxis], contact], sides).T
        except np.linalg.LinAlgError:
            return iterate, moved, False
        moved = 0.0 if load is None else float((load - plain.sum()) / uniform.sum())
        iterate.pressure[:] = 0
        iterate.pressure[contact] = plain + moved * uniform
        iterate.residual = interference + moved - np.einsum("ij,j->i", matrix, iterate.pressure)
        iterate.residual[contact] = 0
        iterate.iterations += 1
        iterate.convolutions += 1
        following = iterate.contact()
        if np.array_equal(following, contact):
            break
        contact = following
    np.maximum(iterate.pressure, 0, out=iterate.pressure)
    iterate.residual = interference + moved - np.einsum("ij,j->i", matrix, iterate.pressure)
    return iterate, moved, iterate.violation() <= rtol * (float(interference.max()) + moved)
