"""Dense linear algebra for few nodes that may touch: an active set with exact solves."""

import numpy as np

from bem.arrays import Nodes, Values
from bem.factor import CONTACT_SETS, routines
from bem.influence import InfluenceMatrix
from bem.iterate import STEP, Iterate, YieldingIterate
from bem.sections import on_one_blas_thread

# Largest number of nodes that may touch for which dense linear algebra alone is faster than
# convolutions (`pytest bench -k few_candidates`).
FEW_NODES = 250

# Times that yielded nodes may be released again.
RELEASES = 20

# Share by which the pressure of a node that is released falls, so that it is not at the hardness.
RELIEF = 1e-12


@on_one_blas_thread()
def solve_directly(
    matrix: InfluenceMatrix,
    nodes: Nodes,
    interference: Values,
    *,
    rtol: float,
    max_iterations: int,
    load: float | None = None,
    hardness: float = np.inf,
) -> tuple[Iterate, bool]:
    """Find p >= 0 with w = H p - u - d >= 0 and p w = 0 by an active set with exact solves.

    Where the hardness P is exceeded the yielded set grows from one solution to the next, until
    p <= P, and w <= 0 where p = P.

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
    hardness : float
        Largest pressure P, in the unit of p.

    Returns
    -------
    iterate : Iterate
        Pressure and residual in the unit of u, with shift d. A contact set counts as an iteration
        and as an application of H.
    converged : bool
        False if the contact sets cycle or their matrix is singular.
    """
    entries = matrix.between(nodes, nodes)
    # Fewer than half of the nodes that may touch do so, and the higher half is the cheaper start.
    middle = np.sort(interference)[len(interference) // 2]
    contact = np.flatnonzero(interference >= middle)
    most_sets = min(CONTACT_SETS, max_iterations)
    iterate, solved = _exchange_contact(entries, interference, contact, load, most_sets)
    if solved and iterate.pressure.max(initial=0.0) > hardness:
        bounds = rtol, max_iterations
        iterate, solved = _let_yield(entries, interference, iterate, load, hardness, bounds)
    if not solved:
        return iterate, False
    highest = float(interference.max()) + iterate.shift
    return iterate, iterate.violation() <= rtol * highest


def _exchange_contact(
    entries: Values, interference: Values, contact: Nodes, load: float | None, most_sets: int
) -> tuple[Iterate, bool]:
    """Solve on contact sets until one stands; False if a matrix is singular."""
    iterate = Iterate.from_zero(interference)
    while contact.size and iterate.effort.iterations < most_sets:
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
    return iterate, True


def _let_yield(
    entries: Values,
    interference: Values,
    elastic: Iterate,
    load: float | None,
    hardness: float,
    bounds: tuple[float, int],
) -> tuple[YieldingIterate, bool]:
    """Let the yielded set grow from the elastic solution until no pressure exceeds the hardness.

    With exact solves no node has to be released on a free patch; rounding, and concentrated
    forces, may ask for it all the same.
    """
    rtol, max_iterations = bounds
    iterate, releases = YieldingIterate.above(elastic, hardness), RELEASES
    if load is None:  # nodes that penetrate under the hardness on all nodes yield for certain
        everywhere = np.full(interference.size, hardness)
        iterate.pressure[interference > _displacement(entries, everywhere)] = hardness
    while iterate.effort.iterations < max_iterations:
        iterate.join()
        rest = np.flatnonzero(~iterate.yielded)
        loads = np.where(iterate.yielded, hardness, 0.0)
        left = None if load is None else load - float(loads.sum())
        if left is not None and not (rest.size and left > 0):
            return iterate, False
        known = interference - _displacement(entries, loads)
        contact = np.flatnonzero((iterate.pressure > 0)[rest])
        solved, regular = _exchange_contact(
            entries[rest[:, np.newaxis], rest], known[rest], contact, left, CONTACT_SETS
        )
        if not regular:
            return iterate, False
        iterate.pressure = loads
        iterate.pressure[rest] = solved.pressure
        iterate.shift, iterate.effort = solved.shift, iterate.effort + solved.effort
        iterate.residual = interference + solved.shift - _displacement(entries, iterate.pressure)
        iterate.residual[rest] = solved.residual
        if iterate.excess() > 0:
            continue
        accepted = rtol * (float(interference.max()) + iterate.shift)
        opened = iterate.yielded & (iterate.residual < -accepted)
        if not opened.any() or not releases:
            return iterate, True
        releases -= 1
        iterate.yielded = iterate.yielded & ~opened
        iterate.pressure[opened] *= 1 - RELIEF
    return iterate, False


def _displacement(entries: Values, pressure: Values) -> Values:
    """Compute the displacement without BLAS, whose threads would change its last bits."""
    displacement: Values = np.einsum("ij,j->i", entries, pressure)
    return displacement
