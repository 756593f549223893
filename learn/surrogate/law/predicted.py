"""Laws from a surrogate: predicted over Delta, and inverted at given pressures."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from bem.derived.stiffness import without_patch
from gen.law.curves import Curves, continued, monotone, slopes, tabulated
from gen.law.points import STIFFNESS, Points
from gen.law.subjects import LawSurface
from gen.material import Bodies
from gen.runtime.errors import InputError
from gen.runtime.terminal import RunProgress
from learn.arrays import Values
from learn.features import SurfaceFeatures, Undefined
from learn.surrogate.law import inversion
from learn.surrogate.model import OnSurface, Surrogate

BEYOND = (1.15, 1.4, 2.0, 3.0)
"""Further Deltas to predict, over the last one: some surfaces reach a pressure late."""

ESTIMATED_GAP = (
    "warning: the mean gap of bodies that yield is a coarse estimate: fit one with --target"
    " area,force,mean_gap"
)

STIFFNESSES = {"stiffness", "interface_stiffness"}
"""Targets that give the stiffness of the interface."""

YIELDING_STIFFNESS = (
    "the conductance of bodies that yield follows from their stiffness of unloading, which is no"
    " slope of the force: fit a surrogate with --target area,force,stiffness, or solve the law"
)

CORRECTED = 0.01
"""Correction for monotone curves, over the largest value, above which there is a warning."""


def defined(
    surrogate: Surrogate, surfaces: Sequence[LawSurface]
) -> tuple[Sequence[LawSurface], list[str]]:
    """Leave out surfaces that lack statistics which the surrogate needs.

    Parameters
    ----------
    surrogate : Surrogate
        Surrogate of area and force.
    surfaces : sequence of LawSurface
        One surface or more.

    Returns
    -------
    surfaces : sequence of LawSurface
        The other surfaces.
    warnings : list of str
        One line if any were left out.

    Raises
    ------
    InputError
        If no surface is left.
    """
    kept, faults = [], []
    for surface in surfaces:
        try:
            _features(surface).require_statistics(surrogate.features)
        except Undefined as fault:
            faults.append(fault)
        else:
            kept.append(surface)
    if not kept:
        raise faults[0]
    if not faults:
        return surfaces, []
    many = f"{len(faults)} of {len(surfaces)} surfaces were left out"
    return kept, [f"warning: {many}, the first: {faults[0]}"]


def tables(
    surrogate: Surrogate,
    surfaces: Sequence[LawSurface],
    deltas: Values,
    pressures: Values | None,
    level: float,
    bodies: Bodies,
    *,
    stiffness: bool = False,
) -> tuple[Curves, Curves, list[str]]:
    """Predict all surfaces; tabulate against Delta and against pressure.

    Parameters
    ----------
    surrogate : Surrogate
        Surrogate of area and force.
    surfaces : sequence of LawSurface
        One surface or more.
    deltas : ndarray, shape (k,)
        Ascending displacements above 0 [um].
    pressures : ndarray, shape (m,) or None
        Ascending pressures of 0 or more; None for those at the displacements [MPa].
    level : float
        Coverage of the band.
    bodies : Bodies
        E* and hardness.
    stiffness : bool
        Whether the stiffness is asked for. If the surrogate has not learnt it, it is the slope of
        the force of elastic bodies.

    Returns
    -------
    over_delta, over_pressure : Curves
        Tables against Delta and against pressure.
    warnings : list of str
        Warnings, one line each.

    Raises
    ------
    InputError
        For a pressure that the law does not reach, and for the stiffness of bodies that yield if
        the surrogate has not learnt it.
    """
    learnt = STIFFNESSES & surrogate.learnt.keys()
    if stiffness and bodies.hardness is not None and not learnt:
        raise InputError(YIELDING_STIFFNESS)
    parts, whole, corrections = [], [], []
    with RunProgress(len(surfaces), "surfaces") as progress:
        for surface in surfaces:
            on_surface = OnSurface(surrogate, _features(surface))
            raw = predicted_points(on_surface, surface, deltas, level, bodies).from_rest(surface)
            smooth, correction = monotone(raw)
            extended = _extended(smooth, on_surface, surface, level, bodies)
            if stiffness and not learnt:
                smooth, extended = (_with_stiffness(p, surface, bodies) for p in (smooth, extended))
            parts.append(smooth)
            whole.append(extended)
            corrections.append(correction)
            progress.advance(1, 0)
    rest = float(np.mean([surface.gap_at_rest for surface in surfaces]))
    over_delta = tabulated("delta_um", np.append(0.0, deltas), parts, level, rest)
    notes = [*_unknown(over_delta), *_corrected(over_delta, corrections)]
    if bodies.hardness is not None and "mean_gap" not in surrogate.learnt:
        notes.append(ESTIMATED_GAP)
    chosen, late = _pressures(over_delta, whole, pressures)
    inverted = [inversion.at_pressures(each, chosen) for each in whole]
    return over_delta, tabulated("pressure_MPa", chosen, inverted, level, rest), [*notes, *late]


def predicted_points(
    on_surface: OnSurface, subject: LawSurface, deltas: Values, level: float, bodies: Bodies
) -> Points:
    """Predict the law of one surface.

    Parameters
    ----------
    on_surface : OnSurface
        The surrogate on the surface.
    subject : LawSurface
        The surface.
    deltas : ndarray, shape (k,)
        Ascending displacements above 0 [um].
    level : float
        Coverage of the intervals.
    bodies : Bodies
        E* and hardness.

    Raises
    ------
    InputError
        If a prediction is not finite.
    """
    e_star, hardness = bodies.e_star, bodies.hardness
    answer = on_surface.predict(deltas, e_star=e_star, hardness=hardness, level=level)
    for name, predictions in answer.values.items():
        if not np.isfinite(predictions).all():
            place = int(np.argmin(np.isfinite(predictions)))
            raise InputError(
                f"{subject.name}: the surrogate has no finite {name} at Delta ="
                f" {deltas[place]:.4g} um: no law can be made of it"
            )
    parts: list[dict[str, Values]] = []
    for ends in (answer.values, answer.low, answer.high):
        gap = ends.get("mean_gap")
        if gap is None:  # which rises with the force
            gap = _mean_gap(on_surface, deltas, ends["force"] / e_star, bodies)
        learnt = STIFFNESSES & ends.keys()
        found = {STIFFNESS: _learnt_stiffness(ends, subject, bodies)} if learnt else {}
        parts.append(
            {
                **found,
                "area_percent": ends["area"],
                "force_uN": ends["force"],
                "mean_gap_um": gap,
                "pressure_MPa": ends["force"] / subject.nominal,
            }
        )
    values, low, high = parts
    behind = subject.patch_compliance(e_star)
    closure = np.maximum(deltas - behind * values["pressure_MPa"], 0.0)
    return Points({"delta_um": deltas, **values, "closure_um": closure}, low, high, answer.reasons)


def _mean_gap(on_surface: OnSurface, deltas: Values, force: Values, bodies: Bodies) -> Values:
    """Return the mean gap from forces over E*, (k,) [um]."""
    surface = on_surface.surface
    heights = surface.heights
    rest = float(heights.max()) - float(heights.mean())
    coarse = [surface.coarse_means(float(delta), bodies.hardness_ratio) for delta in deltas]
    compliance, yielded = np.array(coarse).reshape(-1, 2).T
    free = surface.boundary == "free"
    mean = compliance * force / surface.length if free else 0.0  # displacement
    return np.asarray(np.maximum(rest - deltas + mean + yielded, 0.0))


def _features(subject: LawSurface) -> SurfaceFeatures:
    """Return a surface as one whose features can be computed."""
    heights, sides, spacing = subject.heights, subject.sides, subject.spacing
    return SurfaceFeatures(heights, sides, spacing, subject.name, subject.boundary)


def _learnt_stiffness(ends: dict[str, Values], subject: LawSurface, bodies: Bodies) -> Values:
    """Return the stiffness of the interface per nominal area from what was learnt [MPa / um]."""
    if "interface_stiffness" in ends:
        return ends["interface_stiffness"] / subject.nominal
    return _of_interface(ends["stiffness"] / subject.nominal, subject, bodies)


def _with_stiffness(points: Points, subject: LawSurface, bodies: Bodies) -> Points:
    """Add the stiffness of the interface, the slope of the pressure of elastic bodies.

    The compliance of the half-space behind a free patch is taken out of it.
    """
    rising = slopes(points.values["delta_um"], points.values["pressure_MPa"], 0.0)
    found = _of_interface(rising, subject, bodies)
    return replace(points, values={**points.values, STIFFNESS: found})


def _of_interface(stiffness: Values, subject: LawSurface, bodies: Bodies) -> Values:
    """Take the patch's compliance out of stiffnesses per nominal area, (k,) [MPa / um]."""
    behind = subject.patch_compliance(bodies.e_star)
    patch = 1 / behind if behind else np.inf
    return np.array([without_patch(each, patch) for each in stiffness])


def _extended(
    points: Points, on_surface: OnSurface, surface: LawSurface, level: float, bodies: Bodies
) -> Points:
    """Extend the law to larger displacements, where they can be predicted."""
    further = points.values["delta_um"][-1] * np.array(BEYOND)
    try:
        return continued(points, predicted_points(on_surface, surface, further, level, bodies))
    except InputError:
        return points


def _unknown(over_delta: Curves) -> list[str]:
    """Warn of displacements outside the training."""
    beyond = sum(share > 0 for share in over_delta.outside)
    if not beyond:
        return []
    many = f"{beyond} of {over_delta.at.size - 1} displacements"
    line = f"warning: {many} are outside the training ranges for one surface or more"
    if over_delta.flagged.any():
        line += "; outside, neither closure nor stiffness is given (-)"
    return [line]


def _corrected(over_delta: Curves, corrections: Sequence[Points]) -> list[str]:
    """Warn of curves that were far from monotone."""
    lines = []
    for name in set(over_delta.names) & corrections[0].values.keys():  # slopes are not corrected
        change = np.mean([each.values[name] for each in corrections], axis=0)
        largest = np.nanmax(np.abs(over_delta.curves[name].value)) or 1.0
        if np.abs(change).max() > CORRECTED * largest:
            fell, rising = ("rose", "falling") if name == "mean_gap_um" else ("fell", "rising")
            lines.append(
                f"warning: the surrogate's curve of {name} {fell} with the load; shown is the"
                f" nearest {rising} one"
            )
    return sorted(lines)


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
