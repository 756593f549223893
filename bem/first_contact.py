"""The first contact set: by projected steps, then by dense algebra if the set is small.

Projected steps from no pressure keep more nodes in contact than the solution does and lose next to
none of the solution's nodes. After a few steps the contact set is therefore a set to remove nodes
from, and dense algebra does this exactly where the nodes are few.
"""

from contextlib import suppress
from dataclasses import replace

import numpy as np

from bem.arrays import Nodes, Values
from bem.factor import CONTACT_SETS, ContactFactor, FarFieldLaw
from bem.iterate import CONVOLUTION, Effort, Iterate, Operators, inner
from bem.sections import on_one_blas_thread
from bem.vectors import clear, combined, put, take, where

# Shares of `few_nodes`: step k is skipped if the contact set is no larger than entry k (the last
# entry serves all later steps). The first steps remove many nodes, later steps hardly any, and the
# cost of dense algebra grows with the cube of their number (`pytest bench -k few_in_contact`).
ENOUGH = (0.25, 0.5, 0.5, 0.7)

# Nodes outside with the smallest gaps, as a share of the contact set, that are factorised with it:
# the set may lack a few nodes, and a second factor would cost more.
MARGIN = 0.08

# Exact residuals that are computed at most before iterations take over.
RENEWALS = 5

# Penetration outside [Delta] above which a larger set is factorised at once. Below it rounding may
# be the cause, which the present factor corrects first.
OUTSIDE = 1e-5


def take_first_steps(
    operators: Operators, interference: Values, iterate: Iterate, steps: range
) -> None:
    """Take preconditioned steps, cut off at zero and scaled to the least energy.

    They find most of the nodes out of contact for one convolution a step.

    Parameters
    ----------
    operators : Operators
        The influence matrix.
    interference : ndarray, shape (m,)
        Interference u [unit of displacement].
    iterate : Iterate
        Pressure and residual, improved in place.
    steps : range
        Numbers of the steps, the first of a solve being 0.
    """
    for step in steps:
        contact = iterate.contact()
        if len(contact) <= ENOUGH[min(step, len(ENOUGH) - 1)] * operators.few_nodes:
            return
        precondition = operators.approximate_inverse(contact)
        stepped = precondition(take(iterate.residual, contact))
        combined(np.add, take(iterate.pressure, contact), stepped, stepped)
        under = where(lambda piece: stepped[piece] > 0, stepped.size)  # noqa: B023  called at once
        if not under.size:
            return
        loaded, values = take(contact, under), take(stepped, under)
        image = operators.image_of(loaded, values)
        stiffness = inner(values, image.on_nodes(np.empty(values.size)))
        scale = inner(take(interference, loaded), values) / stiffness
        iterate.effort += CONVOLUTION
        if not scale > 0:
            return
        values *= scale
        clear(iterate.pressure)
        put(values, loaded, iterate.pressure)
        iterate.residual = interference.copy()
        image.add_to(iterate.residual, -scale)
        iterate.exact = False


def settle_few(
    operators: Operators, interference: Values, iterate: Iterate, rtol: float, most_sets: int
) -> None:
    """Solve by dense algebra if few nodes are in contact; else leave the iterate unchanged.

    Parameters
    ----------
    operators : Operators
        The influence matrix.
    interference : ndarray, shape (m,)
        Interference u [unit of displacement].
    iterate : Iterate
        Pressure and residual, improved in place; the residual is then exact.
    rtol : float
        Largest violation accepted [unit of displacement].
    most_sets : int
        Bound on the contact sets, which count as iterations.
    """
    contact = iterate.contact()
    if not 0 < len(contact) <= operators.few_nodes or most_sets < 1:
        return
    before = replace(iterate, pressure=iterate.pressure.copy(), residual=iterate.residual.copy())
    contact = np.append(contact, _next_to_touch(iterate, contact))
    # Iterations solve nearly singular matrices and depths beyond single precision.
    with suppress(np.linalg.LinAlgError, FloatingPointError), np.errstate(over="raise"):
        _settle(operators, interference, iterate, contact, rtol, most_sets)
    if not iterate.violation() <= before.violation():
        iterate.pressure, iterate.residual = before.pressure, before.residual
        iterate.exact, iterate.shift = before.exact, before.shift


@on_one_blas_thread()
def _settle(
    operators: Operators,
    interference: Values,
    iterate: Iterate,
    contact: Nodes,
    rtol: float,
    most_sets: int,
) -> None:
    """Solve on the candidate set, then check all nodes.

    If nodes outside penetrate, enlarge the set and factorise again; otherwise correct the rounding.
    """
    factor, last = None, iterate.effort.iterations + most_sets
    for _ in range(RENEWALS):
        if factor is None:
            if len(contact) > operators.few_nodes or iterate.effort.iterations >= last:
                return
            tolerated = max(rtol, OUTSIDE)
            contact = contact[np.lexsort((-iterate.residual[contact], -iterate.pressure[contact]))]
            factor = operators.factor(contact)
            most_sets = min(last - iterate.effort.iterations, CONTACT_SETS)
            pressure, sets = _solve_on(factor, interference[contact], operators, most_sets)
            iterate.pressure[:] = 0
            iterate.effort += Effort(iterations=sets)
        else:
            tolerated = rtol
            law = far_field_law(operators.softening, 0.0, None if operators.load is None else 0.0)
            pressure = iterate.pressure[contact]
            pressure += factor.correct(iterate.residual[contact], rtol, law)
        iterate.pressure[contact] = np.maximum(pressure, 0)
        iterate.renew(operators, interference)
        if iterate.violation() <= rtol:
            return
        outside = iterate.residual > tolerated
        outside[contact[factor.kept]] = False
        if outside.any():
            contact, factor = np.flatnonzero(outside | (iterate.pressure > 0)), None


def _solve_on(
    factor: ContactFactor, interference: Values, operators: Operators, most_sets: int
) -> tuple[Values, int]:
    """Return the pressure on the factor's nodes alone, and the number of contact sets tried."""
    # On a compliant far field, the displacement that all nodes share belongs to the far field.
    common = float(interference.max()) if operators.softening else 0.0
    law = far_field_law(operators.softening, common, operators.load)
    return factor.solve(interference - common, law, most_sets)


def far_field_law(softening: float, common: float, load: float | None = None) -> FarFieldLaw | None:
    """Return the displacement of the far field as a function of the pressure, for `ContactFactor`.

    Parameters
    ----------
    softening : float
        Compliance of the far field, 0 for a rigid one.
    common : float
        Displacement that all nodes share, in addition to their interference.
    load : float, optional
        Sum of the pressure, if it is given.

    Returns
    -------
    FarFieldLaw or None
        None for a rigid far field at a given displacement.
    """
    if load is not None:
        return lambda plain, uniform: (load - plain) / uniform if uniform > 0 else np.nan
    if not softening:
        return None

    def displacement(plain: float, uniform: float) -> float:
        stiffness = 1 - softening * uniform
        return (common + softening * plain) / stiffness if stiffness > 0 else np.nan

    return displacement


def _next_to_touch(iterate: Iterate, contact: Nodes) -> Nodes:
    """Return the nodes outside the contact set with the smallest gaps."""
    gap = -iterate.residual
    gap[contact] = np.inf
    many = min(int(np.ceil(MARGIN * len(contact))), gap.size - len(contact))
    nodes: Nodes = np.argpartition(gap, many)[:many] if many < gap.size else np.flatnonzero(gap)
    return nodes
