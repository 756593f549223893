"""The first contact set: by steps that each leave less of it, then by dense algebra if it is small.

Projected steps from no pressure at all keep more nodes in contact than the solution does, and next
to none of its nodes is lost on the way. So the contact of a few of them is a set to take nodes out
of, which dense algebra does exactly, where the nodes are few.
"""

from contextlib import suppress
from dataclasses import replace

import numpy as np

from bem.factor import CONTACT_SETS, ContactFactor, FarFieldLaw
from bem.iterate import Iterate, Nodes, Operators, Values, inner
from bem.sections import on_one_blas_thread

# Entry k: a step k is not taken where the contact is this share of what is few already; the last is
# for all later ones. The first steps leave far fewer nodes, later ones hardly, and dense algebra
# costs their cube (`pytest bench -k few_in_contact`).
ENOUGH = (0.25, 0.5, 0.5, 0.7)

# Nodes that are next to touch are taken along, as many as this share of the contact.
MARGIN = 0.08

# Exact residuals that may follow; and the penetration outside from which another factor is asked
# for at once: below, rounding may be to blame, which the factor at hand corrects first.
RENEWALS = 5
OUTSIDE = 1e-5


def take_first_steps(
    operators: Operators, interference: Values, iterate: Iterate, steps: int
) -> None:
    """Preconditioned steps cut off at zero, each scaled to the least energy on its ray.

    They find most of what is out of contact for one convolution each.
    """
    for step in range(steps):
        contact = iterate.contact()
        if len(contact) <= ENOUGH[min(step, len(ENOUGH) - 1)] * operators.few_nodes:
            return
        pressure = iterate.pressure.copy()
        precondition = operators.approximate_inverse(contact)
        pressure[contact] += precondition(iterate.residual[contact])
        loaded = np.flatnonzero(pressure > 0)
        if not loaded.size:
            return
        values = pressure[loaded]
        image = operators.displace_some(loaded, values)
        scale = inner(interference[loaded], values) / inner(values, image[loaded])
        iterate.convolutions += 1
        if not scale > 0:
            return
        iterate.pressure[:] = 0
        iterate.pressure[loaded] = scale * values
        iterate.residual = interference - scale * image
        iterate.exact = False


def settle_few(
    operators: Operators, interference: Values, iterate: Iterate, rtol: float, most_sets: int
) -> None:
    """Solve on the nodes in contact by dense algebra if they are few; else leave them as they are.

    Parameters
    ----------
    operators, interference, rtol : see `bem.active_set.solve_complementarity`
    iterate : improved in place, its residual then exact
    most_sets : bound on the contact sets, which count as iterations
    """
    contact = iterate.contact()
    if not 0 < len(contact) <= operators.few_nodes or most_sets < 1:
        return
    before = replace(iterate, pressure=iterate.pressure.copy(), residual=iterate.residual.copy())
    contact = np.append(contact, _next_to_touch(iterate, contact))
    # Nearly singular matrices, and depths beyond single precision, are left to iterations.
    with suppress(np.linalg.LinAlgError, FloatingPointError), np.errstate(over="raise"):
        _settle(operators, interference, iterate, contact, rtol, most_sets)
    if not iterate.violation() <= before.violation():
        iterate.pressure, iterate.residual = before.pressure, before.residual
        iterate.exact, iterate.moved = before.exact, before.moved


@on_one_blas_thread()
def _settle(
    operators: Operators,
    interference: Values,
    iterate: Iterate,
    contact: Nodes,
    rtol: float,
    most_sets: int,
) -> None:
    """Factorise, press, look at all nodes; again with those outside that penetrate, or correct."""
    factor, last = None, iterate.iterations + most_sets
    for _ in range(RENEWALS):
        if factor is None:
            if len(contact) > operators.few_nodes or iterate.iterations >= last:
                return
            tolerated = max(rtol, OUTSIDE)
            contact = contact[np.lexsort((-iterate.residual[contact], -iterate.pressure[contact]))]
            factor = operators.factor(contact)
            most_sets = min(last - iterate.iterations, CONTACT_SETS)
            pressure, sets = _pressed(factor, interference[contact], operators, most_sets)
            iterate.pressure[:] = 0
            iterate.iterations += sets
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


def _pressed(
    factor: ContactFactor, interference: Values, operators: Operators, most_sets: int
) -> tuple[Values, int]:
    """Pressure of the factor's nodes alone, and the contact sets that it took."""
    # What the displacements have in common is the far field's, where that gives way.
    common = float(interference.max()) if operators.softening else 0.0
    law = far_field_law(operators.softening, common, operators.load)
    return factor.press(interference - common, law, most_sets)


def far_field_law(softening: float, common: float, load: float | None = None) -> FarFieldLaw | None:
    """How a far field answers, for `ContactFactor`; None for a rigid one.

    Parameters
    ----------
    softening : see `bem.iterate.Operators`
    common : displacement that all nodes have in common, besides what they are pressed by
    load : sum of the pressure, if it is given
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
    """The nodes outside of the contact whose gap is the least."""
    gap = -iterate.residual
    gap[contact] = np.inf
    many = min(int(np.ceil(MARGIN * len(contact))), gap.size - len(contact))
    nodes: Nodes = np.argpartition(gap, many)[:many] if many < gap.size else np.flatnonzero(gap)
    return nodes
