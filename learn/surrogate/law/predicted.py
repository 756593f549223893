"""Laws from a surrogate: predicted over Delta, and inverted at given pressures."""

from collections.abc import Sequence

import numpy as np

from gen.runtime.errors import InputError
from gen.runtime.progress import RunProgress
from learn.arrays import Values
from learn.surrogate.bodies import Bodies
from learn.surrogate.law import inversion
from learn.surrogate.law.curves import Curves, continued, monotone, tabulated
from learn.surrogate.law.points import Points, predicted
from learn.surrogate.law.subjects import Subject
from learn.surrogate.model import OnSurface, Surrogate

BEYOND = (1.15, 1.4, 2.0, 3.0)
"""Further Deltas to predict, over the last one: some surfaces reach a pressure late."""

ESTIMATED_GAP = (
    "warning: the mean gap of bodies that yield is a coarse estimate: fit one with --target"
    " area,force,mean_gap"
)

CORRECTED = 0.01
"""Correction for monotone curves, over the largest value, above which there is a warning."""


def tables(
    surrogate: Surrogate,
    surfaces: Sequence[Subject],
    deltas: Values,
    pressures: Values | None,
    level: float,
    bodies: Bodies,
) -> tuple[Curves, Curves, list[str]]:
    """Predict all surfaces; tabulate against Delta and against pressure.

    Parameters
    ----------
    surrogate : Surrogate
        Surrogate of area and force.
    surfaces : sequence of Subject
        One surface or more.
    deltas : ndarray, shape (k,)
        Ascending displacements above 0 [um].
    pressures : ndarray, shape (m,) or None
        Ascending pressures of 0 or more; None for those at the displacements [MPa].
    level : float
        Coverage of the band.
    bodies : Bodies
        E* and hardness.

    Returns
    -------
    over_delta, over_pressure : Curves
        Tables against Delta and against pressure.
    warnings : list of str
        Warnings, one line each.

    Raises
    ------
    InputError
        For a pressure that the law does not reach.
    """
    parts, whole, corrections = [], [], []
    with RunProgress(len(surfaces), "surfaces") as progress:
        for surface in surfaces:
            on_surface = OnSurface(surrogate, surface.features())
            raw = predicted(on_surface, surface, deltas, level, bodies).from_rest(surface)
            smooth, correction = monotone(raw)
            parts.append(smooth)
            whole.append(_extended(smooth, on_surface, surface, level, bodies))
            corrections.append(correction)
            progress.advance(1, 0)
    over_delta = tabulated("delta_um", np.append(0.0, deltas), parts, level)
    notes = [*_unknown(over_delta), *_corrected(over_delta, corrections)]
    if bodies.hardness is not None and "mean_gap" not in surrogate.learnt:
        notes.append(ESTIMATED_GAP)
    chosen, late = _pressures(over_delta, whole, pressures)
    inverted = [inversion.at_pressures(each, chosen) for each in whole]
    return over_delta, tabulated("pressure_MPa", chosen, inverted, level), [*notes, *late]


def _extended(
    points: Points, on_surface: OnSurface, surface: Subject, level: float, bodies: Bodies
) -> Points:
    """Extend the law to larger displacements, where they can be predicted."""
    further = points.values["delta_um"][-1] * np.array(BEYOND)
    try:
        return continued(points, predicted(on_surface, surface, further, level, bodies))
    except InputError:
        return points


def _unknown(over_delta: Curves) -> list[str]:
    """Warn of displacements outside the training."""
    beyond = sum(share > 0 for share in over_delta.outside)
    if not beyond:
        return []
    many = f"{beyond} of {over_delta.at.size - 1} displacements"
    return [f"warning: {many} are outside the training ranges for one surface or more"]


def _corrected(over_delta: Curves, corrections: Sequence[Points]) -> list[str]:
    """Warn of curves that were far from monotone."""
    worst = 0.0
    for name, curve in over_delta.curves.items():
        change = np.mean([each.values[name] for each in corrections], axis=0)
        worst = max(worst, float(np.abs(change).max()) / (float(np.abs(curve.value).max()) or 1.0))
    if worst <= CORRECTED:
        return []
    return [f"warning: made monotone by up to {100 * worst:.2g} % of the largest value"]


def _pressures(
    over_delta: Curves, whole: Sequence[Points], asked: Values | None
) -> tuple[Values, list[str]]:
    """Return the pressures to tabulate [MPa], and a note where the default ones end early."""
    mean = over_delta.curves["pressure_MPa"].value
    last = f"Delta = {over_delta.at[-1]:.4g} um"
    if not mean[-1] > 0:
        raise InputError("the law has no force at all: nothing to tabulate against pressure")
    reach = min(inversion.reached(each) for each in whole)
    if asked is None:
        usual = np.unique(mean)  # as close as Delta's where it is small
        if usual[-1] <= reach:
            return usual, []
        kept = np.append(usual[usual < reach], reach)
        text = f"the table against pressure ends at {reach:.4g} MPa: not all surfaces reach more"
        return kept, [text]
    if asked[-1] > mean[-1]:
        raise InputError(
            f"--pressure {asked[-1]:.6g}: the law ends at {mean[-1]:.6g} MPa, {last}: give a larger"
            " --delta"
        )
    if asked[-1] > reach:
        raise InputError(
            f"--pressure {asked[-1]:.6g}: a surface reaches {reach:.6g} MPa only near {last}: give"
            " a larger --delta, or smaller pressures"
        )
    return asked, []
