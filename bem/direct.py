"""Few nodes that may touch: the contact set by dense linear algebra, to the last digits."""

import numpy as np

from bem.factor import CONTACT_SETS, routines
from bem.influence import InfluenceMatrix
from bem.iterate import Iterate, Nodes, Values
from bem.sections import on_one_blas_thread

# Up to so many nodes that may touch, dense linear algebra alone is faster than with convolutions
# (`pytest bench -k few_candidates`).
FEW_NODES = 250


@on_one_blas_thread()
def solve_directly(
    matrix: InfluenceMatrix,
    nodes: Nodes,
    interference: Values,
    *,
    rtol: float,
    max_iterations: int,
    load: float | None = None,
) -> tuple[Iterate, float, bool]:
    """Find p >= 0 with w = H p - u - d >= 0 and p w = 0: an active set with exact solves.

    Parameters
    ----------
    matrix : H
    nodes : (m,) flat indices of the nodes that may touch
    interference : (m,) u [any length]
    rtol : largest violation accepted, over the displacement of the highest node, max u + d
    max_iterations : bound on the contact sets, besides `CONTACT_SETS`
    load : sum of p that decides the displacement d; without it d = 0

    Returns
    -------
    (iterate, d, converged) : pressure and residual in the unit of u. A contact set counts as an
        iteration and as an application of H. Not converged if the sets cycle or are singular
    """
    entries = matrix.between(nodes, nodes)
    iterate, moved = Iterate(np.zeros_like(interference), interference.copy()), 0.0
    # Less than half of the nodes that may touch do so: the higher half is the cheaper start.
    middle = np.sort(interference)[len(interference) // 2]
    contact = np.flatnonzero(interference >= middle)
    while contact.size and iterate.iterations < min(CONTACT_SETS, max_iterations):
        sides = np.ones((len(contact), 2))
        sides[:, 0] = interference[contact]
        _, pressures, wrong = routines("d").posv(entries[contact[:, np.newaxis], contact], sides)
        if wrong:
            return iterate, moved, False
        plain, uniform = pressures.T
        moved = 0.0 if load is None else float((load - plain.sum()) / uniform.sum())
        iterate.pressure[:] = 0
        iterate.pressure[contact] = plain + moved * uniform
        iterate.residual = interference + moved - _displacement(entries, iterate.pressure)
        iterate.residual[contact] = 0
        iterate.iterations += 1
        iterate.convolutions += 1
        following = iterate.contact()
        if np.array_equal(following, contact):
            break
        contact = following
    np.maximum(iterate.pressure, 0, out=iterate.pressure)
    iterate.residual = interference + moved - _displacement(entries, iterate.pressure)
    return iterate, moved, iterate.violation() <= rtol * (float(interference.max()) + moved)


def _displacement(entries: Values, pressure: Values) -> Values:
    """Without BLAS, whose threads would change its last bits."""
    displacement: Values = np.einsum("ij,j->i", entries, pressure)
    return displacement
