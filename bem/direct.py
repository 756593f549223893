"""Dense linear algebra for few nodes that may touch: an active set with exact solves."""

import numpy as np

from bem.arrays import Nodes, Values
from bem.factor import CONTACT_SETS, routines
from bem.influence import InfluenceMatrix
from bem.iterate import STEP, Iterate
from bem.sections import on_one_blas_thread

# Largest number of nodes that may touch for which dense linear algebra alone is faster than
# convolutions (`pytest bench -k few_candidates`).
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
) -> tuple[Iterate, bool]:
    """Find p >= 0 with w = H p - u - d >= 0 and p w = 0 by an active set with exact solves.

    Parameters
    ----------
    matrix : InfluenceMatrix
        The influence matrix H of the grid.
    nodes : ndarray, shape (m,)
        Flat indices of the nodes that may touch.
    interference : ndarray, shape (m,)
        Interference u [any unit of length].
    rtol : float
        Largest violation accepted, over the displacement of the highest node, max u + d [1].
    max_iterations : int
        Bound on the contact sets, in addition to `CONTACT_SETS`.
    load : float, optional
        Sum of p, from which the displacement d follows; without it d = 0.

    Returns
    -------
    iterate : Iterate
        Pressure and residual in the unit of u, with shift d. A contact set counts as an iteration
        and as an application of H.
    converged : bool
        False if the contact sets cycle or their matrix is singular.
    """
    entries = matrix.between(nodes, nodes)
    iterate = Iterate.from_zero(interference)
    # Fewer than half of the nodes that may touch do so, and the higher half is the cheaper start.
    middle = np.sort(interference)[len(interference) // 2]
    contact = np.flatnonzero(interference >= middle)
    while contact.size and iterate.effort.iterations < min(CONTACT_SETS, max_iterations):
        sides = np.ones((len(contact), 2))
        sides[:, 0] = interference[contact]
        _, pressures, wrong = routines("d").posv(entries[contact[:, np.newaxis], contact], sides)
        if wrong:
            return iterate, False
        plain, uniform = pressures.T
        iterate.shift = 0.0 if load is None else float((load - plain.sum()) / uniform.sum())
        iterate.pressure[:] = 0
        iterate.pressure[contact] = plain + iterate.shift * uniform
        iterate.residual = interference + iterate.shift - _displacement(entries, iterate.pressure)
        iterate.residual[contact] = 0
        iterate.effort += STEP
        following = iterate.contact()
        if np.array_equal(following, contact):
            break
        contact = following
    np.maximum(iterate.pressure, 0, out=iterate.pressure)
    iterate.residual = interference + iterate.shift - _displacement(entries, iterate.pressure)
    highest = float(interference.max()) + iterate.shift
    return iterate, iterate.violation() <= rtol * highest


def _displacement(entries: Values, pressure: Values) -> Values:
    """Compute the displacement without BLAS, whose threads would change its last bits."""
    displacement: Values = np.einsum("ij,j->i", entries, pressure)
    return displacement
