"""Contact laws that a surrogate predicts.

A law is that of one surface, or the mean over the surfaces of a population with the band of a
further one, with the numbers and writers of `gen.law`. That band is the scatter of the predictions
between surfaces: errors of the surrogate are not in it, and a note says so.

Where no surrogate was trained on the mean gap, it follows from the force: it is (z_max - mean z) -
Delta plus the mean displacement. The latter is linear in the pressures and, for a given patch,
nearly F / (E* L) times a number that depends on the place of the load, and that comes from the
coarse contact solve.

A surrogate that has learnt Delta has the law at pressures by inversion. Delta is the point at which
the curve of the pressure reaches the given one; area and mean gap are the values of their curves
there. The interval of Delta is between the points at which the upper and the lower end of the
pressure's interval reach it, and area and mean gap lie between the ends of their own intervals at
these two. This holds whenever both intervals do; it is wider than an interval made for given
pressures, because the errors of area and force are correlated. For a population the curves of each
surface are inverted, and the band is that of the results.

A surrogate that has learnt pressures has the law of each surface at these, and a scene's surrogate
that of a new surface of given parameters at the loads that it has learnt. Bands are the intervals
at such a load. The other table is that of the same contacts, without a band for one surface.
"""

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial

import numpy as np
from scipy.interpolate import PchipInterpolator

from bem.derived.stiffness import without_patch
from gen.arrays import Values
from gen.law import Law, Order
from gen.law.contact_law import STEPS, Making, Tables, law_of, mean_at_rest
from gen.law.curves import (
    Curves,
    Monotone,
    Points,
    continued,
    monotone,
    risen,
    slopes,
    tabulated,
    texts_at,
    trend,
)
from gen.law.order import ARGUMENTS, Load
from gen.law.surfaces import LawInput, LawSurface, LawSurfaces, read_law_surfaces
from gen.material import Bodies
from gen.quantities import (
    ALSO,
    AREA,
    CLOSURE,
    DELTA,
    FORCE,
    MEAN_GAP,
    PRESSURE,
    STIFFNESS,
    UNLOADING,
)
from gen.runtime.errors import InputError
from gen.runtime.terminal import RunProgress
from gen.scene import Scene
from learn.features import SurfaceFeatures, Undefined
from learn.features.scene import shown
from learn.surrogate.level import level_note, level_of
from learn.surrogate.model import OnSurface, Prediction, Surrogate

BEYOND = (
    1.15,
    1.4,
    2.0,
    3.0,
)  # further Deltas, over the last: some surfaces reach a pressure late
CORRECTED = (
    0.01  # correction for monotone curves, over the largest value, from which on we warn
)
FINE = 20  # steps into which an interval of Delta is divided to invert the cubic in it
PREDICTED_BAND = (
    "the band is the scatter of the predictions between surfaces: the errors of the surrogate come"
    " on top of it"
)
ROUNDING = 1e-12  # relative distance beyond the last pressure that counts as the last one


def make(surrogate: Surrogate, order: Order) -> Law:
    """Make a law; lines about each file go to standard error.

    The surrogate's E*, hardness and range of Delta stand in for those that are not given.
    InputError is raised for input that cannot be used, or a pressure that the law does not reach.
    """
    kind, asked = _asked(surrogate, order)
    if order.boundary not in {None, surrogate.boundary}:
        raise InputError(
            f"--boundary {order.boundary}: the surrogate was trained on patches with a"
            f" {surrogate.boundary} one: leave that out, or fit one to a database of this boundary"
        )
    loads = order.loads()
    subjects = read_law_surfaces(order, only=surrogate.boundary)
    kept, left_out = _defined(surrogate, subjects.surfaces)
    surfaces = [patch for patch, _ in kept]
    without = {each.name for each in subjects.surfaces} - {each.name for each in surfaces}
    sources = [source for source in subjects.sources if source.name not in without]
    subjects = replace(subjects, surfaces=surfaces, sources=sources)
    level_notes: list[str] = []
    # a population's band is the scatter between surfaces, at any level: its intervals go unused
    level = min(order.coverage, surrogate.largest_level)
    if len(kept) == 1:
        order, level_notes = _with_level(surrogate, order)
        level = order.coverage
    hardness = order.hardness
    if hardness is None and (given := subjects.hardness_ratio()) is not None:
        hardness = given * (order.e_star or surrogate.modulus)
    bodies = surrogate.bodies(order.e_star, hardness)
    low, high = surrogate.card["delta"]
    if kind == "pressure":
        scale = bodies.e_star / math.sqrt(math.prod(surrogate.card["side"]))
        at = np.geomspace(low, high, STEPS) * scale if asked is None else asked[asked > 0]
        points = [_predicted(*each, kind, level, bodies, at, order.also) for each in kept]
        tables = _learnt_tables(subjects.surfaces, points, kind, order, bodies)
    else:
        deltas = loads.get("delta")
        if deltas is None:
            deltas = np.unique(np.linspace(float(low), float(high), STEPS))
        tables = _tables(kept, level, deltas, loads.get("pressure"), order, bodies)
    remarks = [*level_notes, *tables.remarks]
    if len(kept) > 1:
        remarks = [PREDICTED_BAND, *remarks]
    making = Making(
        f"predicted by {surrogate.card['title']}",
        f"{100 * order.coverage:g} % conformal interval",
    )
    tables = replace(tables, remarks=[*left_out, *remarks])
    return law_of(order, subjects, bodies, tables, making)


def of_parameters(
    surrogate: Surrogate, order: Order, numbers: Mapping[str, float]
) -> Law:
    """Make the law of a new surface of some parameters of a scene."""
    load, (kind, at) = surrogate.features.load, _asked(surrogate, order)
    scene = Scene.from_text(str(surrogate.card["scene"]))
    settings = {name: getattr(scene.contact, name) for name in ("kernel", "far_field")}
    patch = LawSurface(
        ", ".join(f"{name} {value:g}" for name, value in numbers.items())
        or "any surface",
        np.zeros(scene.grid.shape),
        scene.grid.sides,
        boundary=surrogate.boundary,
        exact_spacing=scene.grid.spacing,
        settings=settings,
    )
    unit = patch.nominal if load == "force" else 1.0
    if at is None:
        ends = np.linspace(surrogate.low, surrogate.high, STEPS)
        at = shown(surrogate.features.columns, ends)[:, -1] / unit
    at = at[at > 0]
    order, level_notes = _with_level(surrogate, order)
    rows = surrogate.of_numbers({**numbers, load: at * unit})
    answer = surrogate.predict_rows(rows, level=order.coverage)
    hardness = numbers.get("hardness")
    if (limits := surrogate.hardness_limits) is not None and hardness is None:
        hardness = numbers.get("hardness_ratio", limits[0]) * surrogate.modulus
    bodies = Bodies(surrogate.modulus, hardness, has_modulus=True)
    points = _points_at(answer, kind, at, patch, bodies, also=order.also)
    tables = _learnt_tables([patch], [points], kind, order, bodies)
    tables = replace(tables, remarks=[*level_notes, *tables.remarks])
    about = LawInput(f"{order.inputs[0]}: {patch.name}", scene)
    making = Making(
        f"predicted by {surrogate.card['title']}",
        f"{100 * order.coverage:g} % of new surfaces",
    )
    return law_of(order, LawSurfaces([patch], [about]), bodies, tables, making)


def _with_level(surrogate: Surrogate, order: Order) -> tuple[Order, list[str]]:
    """Return an order with a level of intervals that holds, and a note on one nobody asked for."""
    level = level_of(surrogate, order.level)
    note = level_note(surrogate, level, order.level)
    return replace(order, level=level), [note] if note else []


def _asked(surrogate: Surrogate, order: Order) -> tuple[Load, Values | None]:
    """Return the kind of the loads that a surrogate has learnt, and the loads asked for, (k,)."""
    load = surrogate.features.load
    loads = order.loads()
    kind: Load = "delta" if load == "delta" else "pressure"
    needed = {"area", "force" if kind == "delta" else "delta"}
    if (
        load not in {"delta", "pressure", "force"}
        or not needed <= surrogate.learnt.keys()
    ):
        targets = ",".join(sorted(needed))
        raise InputError(
            f"a law needs a surrogate with --load delta or pressure, and --target {targets}; this"
            f" one has --load {load}, and {', '.join(surrogate.learnt)}: fit it anew"
        )
    for name in order.also:
        if name not in surrogate.learnt:
            targets = ",".join([*surrogate.learnt, name])
            raise InputError(
                f"--also {name}: was not learnt: fit one with --target {targets}"
            )
    inverted = kind == "delta" and not surrogate.features.of_scene
    if loads.keys() - {kind} and not inverted:
        raise InputError(
            f"the surrogate has learnt what a {load} leads to: give --{kind} instead"
        )
    return kind, loads.get(kind)


def _learnt_tables(
    patches: Sequence[LawSurface],
    points: Sequence[Points],
    kind: Load,
    order: Order,
    bodies: Bodies,
) -> Tables:
    """Tabulate surfaces at learnt loads, and the same contacts against the other quantity."""
    smooth = [monotone(each) for each in points]
    pairs = zip(smooth, patches, strict=True)
    parts = [_with_stiffness(each.points, patch, order, bodies) for each, patch in pairs]
    gap, made = MEAN_GAP.in_laws, dict[Load, Curves]()
    rest = {gap: 0.0}
    if gap in parts[0].values:  # at first touch, but for what a free patch gives way
        first = [p.values[gap][0] + p.values[DELTA.in_laws][0] for p in parts]
        rest = {gap: float(np.mean(first))}
    for load, argument in ARGUMENTS.items():
        own = list(parts)
        if load != kind:
            bare = [replace(each, low={}, high={}) for each in own]
            own = [each.chosen(risen(each.values[argument])) for each in bare]
        if load == "delta" or load != kind:
            own = [each.from_rest(rest) for each in own]
        over = own[0].values[argument]
        if load != kind and len(own) > 1:
            over = np.linspace(0.0, min(each.values[argument][-1] for each in own), STEPS)
            own = [read_at(each, argument, over) for each in own]
        made[load] = tabulated(argument, over, own, order.coverage, rest)
    alone = [f"only the table over {kind} has a band"] if len(parts) == 1 else []
    remarks = [*_corrected(made[kind], smooth), *alone]
    return Tables(made["delta"], made["pressure"], remarks)


def _points_at(
    answer: Prediction,
    kind: Load,
    at: Values,
    patch: LawSurface,
    bodies: Bodies,
    surface: SurfaceFeatures | None = None,
    also: Sequence[str] = (),
) -> Points:
    """Return the points of a law at ascending loads, (k,), from the answers at these.

    A Delta of answers rises with the closure: what the patch gives way is that of the pressure. A
    mean gap that was not learnt follows from the force at the Deltas on a surface.
    """
    behind, parts = patch.patch_compliance(bodies.e_star), []
    for ends in (answer.values, answer.low, answer.high):
        pressure = ends["force"] / patch.nominal if kind == "delta" else at
        closure = np.maximum(
            (at if kind == "delta" else ends["delta"]) - behind * pressure, 0.0
        )
        if kind == "pressure":
            closure = np.maximum.accumulate(closure)
        point = {AREA.in_laws: ends["area"]}
        point[PRESSURE.in_laws] = pressure
        point[CLOSURE.in_laws] = closure
        point[DELTA.in_laws] = at if kind == "delta" else closure + behind * at
        point[FORCE.in_laws] = (
            ends["force"] if kind == "delta" else pressure * patch.nominal
        )
        if MEAN_GAP.name in ends:
            point[MEAN_GAP.in_laws] = ends[MEAN_GAP.name]
        elif kind == "delta" and surface is not None:  # it rises with the force
            gap = _mean_gap(surface, at, ends["force"] / bodies.e_star, bodies)
            point[MEAN_GAP.in_laws] = gap
        if STIFFNESS.name in ends:
            point[STIFFNESS.in_laws] = ends[STIFFNESS.name] / patch.nominal
        elif UNLOADING.name in ends:
            point[STIFFNESS.in_laws] = _of_interface(
                ends[UNLOADING.name] / patch.nominal, behind
            )
        for name in also:
            point[ALSO[name].in_laws] = ends[name]
        parts.append(point)
    values, low, high = parts
    # Without an interval: the load, and at a given Delta the closure, which falls with the force.
    without = (DELTA, CLOSURE) if kind == "delta" else (PRESSURE, FORCE)
    for quantity in without:
        del low[quantity.in_laws], high[quantity.in_laws]
    return Points(values, low, high, answer.reasons)


def _defined(
    surrogate: Surrogate, surfaces: Sequence[LawSurface]
) -> tuple[list[tuple[LawSurface, OnSurface]], list[str]]:
    """Apply the surrogate to surfaces with all statistics; also return a line if any lack some."""
    kept, faults = [], []
    for each in surfaces:
        own = SurfaceFeatures(
            each.heights, each.sides, each.spacing, each.name, each.boundary
        )
        if reason := own.description.reason:
            faults.append(Undefined(f"{each.name}: statistics undefined: {reason}"))
        else:
            kept.append((each, OnSurface(surrogate, own)))
    if not kept:
        raise faults[0]
    many = f"{len(faults)} of {len(surfaces)} surfaces were left out"
    return kept, [f"warning: {many}, the first: {faults[0]}"] if faults else []


def _tables(
    surfaces: Sequence[tuple[LawSurface, OnSurface]],
    level: float,
    deltas: Values,
    pressures: Values | None,
    order: Order,
    bodies: Bodies,
) -> Tables:
    """Predict all surfaces with intervals of a level, and tabulate them.

    Lines of warnings come with the tables.
    """
    rests = [patch.at_rest() for patch, _ in surfaces]
    parts: list[Points] = []
    whole: list[Points] = []
    smoothed: list[Monotone] = []
    with RunProgress(len(surfaces), "surfaces") as progress:
        for (patch, on_surface), rest in zip(surfaces, rests, strict=True):
            predicted = partial(
                _predicted, patch, on_surface, "delta", level, bodies, also=order.also
            )
            smooth = monotone(predicted(deltas).from_rest(rest))
            extended = smooth.points
            with suppress(
                InputError
            ):  # larger displacements, where they can be predicted
                extended = continued(
                    smooth.points, predicted(deltas[-1] * np.array(BEYOND))
                )
            parts.append(_with_stiffness(smooth.points, patch, order, bodies))
            whole.append(_with_stiffness(extended, patch, order, bodies))
            smoothed.append(smooth)
            progress.advance(1)
    rest = mean_at_rest(rests)
    over_delta = tabulated(
        DELTA.in_laws, np.append(0.0, deltas), parts, order.coverage, rest
    )
    notes = _corrected(over_delta, smoothed)
    if beyond := sum(share > 0 for share in over_delta.outside):
        many = f"{beyond} of {over_delta.at.size - 1} displacements"
        line = f"warning: {many} are outside the training ranges for one surface or more"
        if over_delta.flagged.any():
            line += "; outside, neither closure nor stiffness is given (-)"
        notes.insert(0, line)
    if (
        bodies.hardness is not None
        and MEAN_GAP.name not in surfaces[0][1].surrogate.learnt
    ):
        notes.append(
            "warning: the mean gap of bodies that yield is a coarse estimate: fit one with --target"
            " area,force,mean_gap"
        )
    chosen, late = _pressures(over_delta, whole, pressures)
    inverted = [at_pressures(each, chosen) for each in whole]
    over_pressure = tabulated(PRESSURE.in_laws, chosen, inverted, order.coverage, rest)
    return Tables(over_delta, over_pressure, [*notes, *late])


def _predicted(
    patch: LawSurface,
    on_surface: OnSurface,
    kind: Load,
    level: float,
    bodies: Bodies,
    at: Values,
    also: Sequence[str] = (),
) -> Points:
    """Predict the law of one surface at ascending loads above 0, (k,)."""
    e_star, hardness = bodies.e_star, bodies.hardness
    answer = on_surface.predict(at, e_star=e_star, hardness=hardness, level=level)
    for name, predictions in answer.values.items():
        if not np.isfinite(predictions).all():
            load = at[np.argmin(np.isfinite(predictions))]
            where = f"Delta = {load:.4g} um" if kind == "delta" else f"{load:.4g} MPa"
            raise InputError(
                f"{patch.name}: the surrogate has no finite {name} at {where}: no law can be made"
                " of it"
            )
    return _points_at(answer, kind, at, patch, bodies, on_surface.surface, also)


def _mean_gap(
    surface: SurfaceFeatures, deltas: Values, force: Values, bodies: Bodies
) -> Values:
    """Return mean gaps [um] at displacements [um] with forces over E* [um2], all of shape (k,)."""
    rest = float(surface.heights.max()) - float(surface.heights.mean())
    coarse = [surface.means(float(delta), bodies.hardness_ratio) for delta in deltas]
    compliance, yielded = np.array(coarse).reshape(-1, 2).T  # the fields of CoarseMeans
    mean_displacement = compliance * force / surface.length  # [um]
    return np.asarray(np.maximum(rest - deltas + mean_displacement + yielded, 0.0))


def _with_stiffness(
    points: Points, subject: LawSurface, order: Order, bodies: Bodies
) -> Points:
    """Add the stiffness of the interface, if it is asked for and was not learnt."""
    asked = order.stiffness or order.conductivities is not None
    if not asked or STIFFNESS.in_laws in points.values:
        return points
    if bodies.hardness is not None:
        raise InputError(
            "the conductance of bodies that yield follows from their stiffness of unloading, which"
            " is no slope of the force: fit a surrogate with --target area,force,stiffness, or"
            " solve the law"
        )
    rising = slopes(points.values[DELTA.in_laws], points.values[PRESSURE.in_laws], 0.0)
    found = _of_interface(rising, subject.patch_compliance(bodies.e_star))
    return replace(points, values={**points.values, STIFFNESS.in_laws: found})


def _of_interface(stiffness: Values, behind: float) -> Values:
    """Take what the patch gives way [um / MPa] out of stiffnesses, (k,) [MPa / um]."""
    return np.array(
        [without_patch(each, 1 / behind) if behind else each for each in stiffness]
    )


def _corrected(over_delta: Curves, smoothed: Sequence[Monotone]) -> list[str]:
    """Warn of curves that were far from monotone."""
    lines = []
    for name in (
        over_delta.curves.keys() & smoothed[0].corrections.keys()
    ):  # slopes are not corrected
        change = np.mean([each.corrections[name] for each in smoothed], axis=0)
        largest = np.nanmax(np.abs(over_delta.curves[name].value), initial=0.0) or 1.0
        if np.abs(change).max() > CORRECTED * largest:
            fell, rising = (
                ("rose", "falling") if trend(name) == "falls" else ("fell", "rising")
            )
            lines.append(
                f"warning: the surrogate's curve of {name} {fell} with the load; shown is the"
                f" nearest {rising} one"
            )
    return sorted(lines)


def _pressures(
    over_delta: Curves, whole: Sequence[Points], asked: Values | None
) -> tuple[Values, list[str]]:
    """Return the pressures to tabulate [MPa], and a note where the default ones end early."""
    mean = over_delta.curves[PRESSURE.in_laws].value
    if not mean[-1] > 0:
        raise InputError(
            "the law has no force at all: nothing to tabulate against pressure"
        )
    reach = min(float(each.values[PRESSURE.in_laws].max()) for each in whole)
    if asked is None:
        usual = np.unique(mean)  # as close as Delta's where it is small
        if usual[-1] <= reach:
            return usual, []
        kept = np.append(usual[usual < reach], reach)
        text = f"the table against pressure ends at {reach:.4g} MPa: not all surfaces reach more"
        return kept, [text]
    if asked[-1] > (end := min(mean[-1], reach)):
        raise InputError(
            f"--pressure {asked[-1]:.6g}: not all surfaces reach more than {end:.6g} MPa near"
            f" Delta = {over_delta.at[-1]:.4g} um: give a larger --delta, or smaller pressures"
        )
    return asked, []


def at_pressures(points: Points, pressures: Values) -> Points:
    """Evaluate the law of one surface at ascending pressures that it reaches, (m,) [MPa].

    The points are monotone, from first touch on. Where an end of an interval lies beyond the law or
    outside the training, the interval is NaN and the reason says so.
    """
    deltas = points.values[DELTA.in_laws]
    at = _inverse(deltas, points.values[PRESSURE.in_laws], pressures, first=True)
    arguments = {quantity.in_laws for quantity in (DELTA, PRESSURE, FORCE)}
    known = [name for name in points.values if name not in arguments]
    values = {DELTA.in_laws: at} | {
        name: _read(deltas, points.values[name], at) for name in known
    }
    reasons = _reasons(points, at)
    if not points.low:
        return Points(values, reasons=reasons)
    least = most = np.full_like(at, np.nan)  # beyond the law
    if np.isfinite(points.high[PRESSURE.in_laws]).all():
        least = np.minimum(
            _inverse(deltas, points.high[PRESSURE.in_laws], pressures, first=True), at
        )
    if np.isfinite(points.low[PRESSURE.in_laws]).all():
        most = np.maximum(
            _inverse(deltas, points.low[PRESSURE.in_laws], pressures, first=False), at
        )
    low, high = {DELTA.in_laws: least}, {DELTA.in_laws: most}
    for name in points.low.keys() & {*known}:
        one, other = (most, least) if trend(name) == "falls" else (least, most)
        low[name] = _read(deltas, points.low[name], one)
        high[name] = _read(deltas, points.high[name], other)
    unknown = np.isnan(least) | np.isnan(most)
    said = []
    ends = zip(_reasons(points, least), _reasons(points, most), unknown, strict=True)
    for lower, upper, nowhere in ends:
        end = "beyond the last displacement" if nowhere else lower or upper
        said.append(
            f"its interval ends {end if nowhere else f'where {end}'}" if end else ""
        )
    return Points(values, low, high, reasons, tuple(said))


def read_at(points: Points, argument: str, over: Values) -> Points:
    """Read the points of one surface at other arguments, (m,)."""
    place = np.searchsorted(points.values[argument], over).clip(
        0, len(points.reasons) - 1
    )
    return points.changed(
        lambda _, each: _read(points.values[argument], each, over),
        texts_at(points.reasons, place),
    )


def _inverse(deltas: Values, reach: Values, pressures: Values, *, first: bool) -> Values:
    """Return the Delta at which a rising pressure reaches given ones, (m,); NaN beyond its end.

    The curve is given by pressures `reach` at `deltas`, each (k,) [MPa, um]. Of a level stretch it
    is the beginning if `first`, else the end. No pressure is at first touch.
    """
    shares = np.arange(FINE) / FINE
    fine = np.append(
        (deltas[:-1, None] + np.diff(deltas)[:, None] * shares).ravel(), deltas[-1]
    )
    curve = np.maximum.accumulate(PchipInterpolator(deltas, reach)(fine))
    rises = np.diff(curve) > 0
    kept = np.concatenate([[True], rises] if first else [rises, [True]])
    end = curve[-1]
    asked = np.where(
        pressures <= end * (1 + ROUNDING), np.minimum(pressures, end), pressures
    )
    deltas_at = np.interp(asked, curve[kept], fine[kept], right=np.nan)
    return np.where(pressures > 0, deltas_at, 0.0)


def _read(deltas: Values, values: Values, at: Values) -> Values:
    """Interpolate between points, (m,); NaN at NaN, and next to an interval without an end."""
    if np.isfinite(values).all():
        return PchipInterpolator(deltas, values)(at)
    with np.errstate(invalid="ignore"):
        return np.interp(at, deltas, values)


def _reasons(points: Points, at: Values) -> tuple[str, ...]:
    """Return why Deltas between points lie outside the training: because a neighbour does."""
    deltas = points.values[DELTA.in_laws]
    above = np.searchsorted(deltas, at).clip(0, deltas.size - 1)
    below = np.where(deltas[above] == at, above, (above - 1).clip(0))
    return tuple(
        points.reasons[one] or points.reasons[other]
        for one, other in zip(below, above, strict=True)
    )
