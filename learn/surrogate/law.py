"""Contact laws that a surrogate predicts.

A law describes one surface, or the mean over the surfaces of a population with the band of a
further surface. Its numbers and its files are those of `gen.law`. The band of a population is the
scatter of the predictions between its surfaces. It does not contain the errors of the surrogate,
and a note says so.

A mean gap that the surrogate has not learnt follows from the force: it is (z_max - mean z) - Delta
plus the mean displacement. The mean displacement is linear in the pressures. For a given patch it
is nearly F / (E* L) times a number that depends on where the patch is loaded, and the coarse
contact solve gives this number.

A surrogate that has learnt Delta has the law at pressures by inversion. Delta is the point at which
the curve of the pressure reaches the given one. Area and mean gap are the values of their curves at
this point. The interval of Delta is between the points at which the upper and the lower end of the
pressure's interval reach the given pressure. Area and mean gap are between the ends of their own
intervals at these two points. This holds whenever both intervals hold. It is wider than an interval
made for given pressures, because the errors of area and force are correlated. For a population the
curves of each surface are inverted, and the band is that of the results.

A surrogate that has learnt pressures has the law of each surface at these. A surrogate of a scene's
own features has the law of a new surface of given parameters at the loads that it has learnt. Bands
are the intervals at a learnt load. The table over the load that was not learnt lists the same
contacts; for one surface it has no band.
"""

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from bem.problem import Boundary
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
    trend,
)
from gen.law.layer import check_layer, compliance_in_law, with_compression
from gen.law.order import ARGUMENTS, Load
from gen.law.surfaces import LawInput, LawSurface, LawSurfaces, read_law_surfaces
from gen.material import Bodies
from gen.quantities import CLOSURE, DELTA, MEAN_GAP, PRESSURE, STIFFNESS
from gen.runtime.errors import InputError
from gen.runtime.terminal import RunProgress
from gen.scene import Scene
from learn.features import SurfaceFeatures, Undefined
from learn.features.scene import shown
from learn.surrogate.inversion import at_arguments, at_pressures
from learn.surrogate.law_bodies import bodies_of_parameters, bodies_of_surfaces
from learn.surrogate.law_points import (
    LoadedPatch,
    has_mean_gap,
    of_interface,
    points_of,
)
from learn.surrogate.level import level_note, level_of
from learn.surrogate.model import OnSurface, Surrogate

BEYOND = (1.15, 1.4, 2.0, 3.0)
"""Further Deltas, over the largest one of the table. Some surfaces need them to reach a pressure
that the mean over the surfaces reaches within the table."""

CORRECTED = 0.01
"""Largest change by which a curve is made monotone without a warning, over its largest value."""

PREDICTED_BAND = (
    "the band is the scatter of the predictions between surfaces: the errors of the"
    " surrogate come on top of it"
)
"""Note of a law of a population."""

COARSE_GAP = (
    "warning: the mean gap of bodies that yield is a coarse estimate: fit a surrogate"
    " with --target area,force,mean_gap"
)
"""Warning of a law of bodies that yield whose surrogate has not learnt the mean gap."""

NO_GAP = (
    "the mean gap is left out, because it follows from the force on half-spaces only: fit a"
    " surrogate with --target area,force,mean_gap"
)
"""Note of a law of layered bodies whose surrogate has not learnt the mean gap."""


@dataclass(frozen=True, eq=False)
class PredictedSurface:
    """A surface of a law, with the surrogate that predicts it."""

    patch: LawSurface
    on_surface: OnSurface


@dataclass(frozen=True, eq=False)
class DefinedSurfaces:
    """The surfaces of a law whose statistics are all defined, one or more."""

    surfaces: list[PredictedSurface]
    remarks: list[str]  # a warning that surfaces were left out, or nothing


@dataclass(frozen=True, eq=False)
class LawSettings:
    """The settings that all predictions of a law share."""

    order: Order
    bodies: Bodies  # E* and hardness [MPa]
    interval_level: float  # coverage of the intervals of one surface, between 0 and 1


def law_of_surfaces(surrogate: Surrogate, order: Order) -> Law:
    """Predict the law of one surface, or of a population.

    The preparation of files is printed on standard error.

    Parameters
    ----------
    surrogate : Surrogate
        A surrogate of surfaces.
    order : Order
        The request. E*, hardness or loads that it lacks are taken from the scenes or the training.

    Returns
    -------
    Law
        The law of all surfaces whose statistics are defined. The band of one surface is the
        surrogate's interval, that of a population the scatter between its surfaces.

    Raises
    ------
    InputError
        If the surrogate has not learnt what the order needs, or was trained on another boundary or
        other bodies; if a surface cannot be read or none has all statistics; if a coarse solve
        fails or a prediction is not finite; if the calibration does not reach the level; or if the
        law does not reach a pressure.
    """
    loads = order.loads()
    kind = _learnt_load(surrogate, order, loads)
    if order.boundary not in {None, surrogate.boundary}:
        raise InputError(
            f"--boundary {order.boundary}: the surrogate was trained on patches with a"
            f" {surrogate.boundary} one: leave that out, or fit one to a database of"
            " this boundary"
        )
    law_surfaces = read_law_surfaces(order, only=surrogate.boundary)
    defined = _defined_surfaces(surrogate, law_surfaces.surfaces)
    surfaces = defined.surfaces
    law_surfaces = _without_undefined(law_surfaces, surfaces)
    remarks = list(defined.remarks)
    if len(surfaces) == 1:
        # The band is the surrogate's interval, whose largest level may be below the usual one.
        interval_level = level_of(surrogate, order.level)
        remarks += _level_remarks(surrogate, order, interval_level)
        order = replace(order, level=interval_level)
    else:
        # The band is the scatter between surfaces, which may have any coverage. Intervals of single
        # surfaces are not in the law; they are computed at a level that the calibration reaches.
        interval_level = min(order.coverage, surrogate.largest_level)
        remarks.append(PREDICTED_BAND)
    bodies = bodies_of_surfaces(surrogate, order, law_surfaces)
    check_layer(order, bodies)
    settings = LawSettings(order=order, bodies=bodies, interval_level=interval_level)
    tables = _tables_of_surfaces(surfaces, loads, kind, settings)
    tables = replace(tables, remarks=[*remarks, *tables.remarks])
    # A law of a population does not use this description of the band.
    band_of_one_surface = f"{100 * order.coverage:g} % conformal interval"
    making = _making(surrogate, band_of_one_surface)
    return law_of(order, law_surfaces, bodies, tables, making)


def _tables_of_surfaces(
    surfaces: Sequence[PredictedSurface],
    loads: Mapping[Load, Values],
    kind: Load,
    settings: LawSettings,
) -> Tables:
    """Tabulate the predictions for surfaces over Delta and over pressure.

    `loads` are the loads of the order by kind, and `kind` is the kind of load for which the
    surrogate predicts. If the order has no loads of this kind, they span the loads of the training.
    Raises InputError if a coarse solve fails, a prediction is not finite, a stiffness that the
    order needs cannot be given, or the law has no force or does not reach a pressure of the order.
    """
    surrogate = surfaces[0].on_surface.surrogate
    if kind == "pressure":
        pressures = loads.get("pressure")
        if pressures is None:
            pressures = _trained_pressures(surrogate, settings.bodies)
        # An order may give the pressure 0. A surrogate predicts loads above 0 only.
        return _tables_by_pressure(surfaces, pressures[pressures > 0], settings)
    deltas = loads.get("delta")
    if deltas is None:
        low, high = surrogate.card["delta"]
        deltas = np.unique(np.linspace(float(low), float(high), STEPS))
    return _tables_by_delta(surfaces, deltas, loads.get("pressure"), settings)


def law_of_parameters(
    surrogate: Surrogate, order: Order, numbers: Mapping[str, float]
) -> Law:
    """Predict the law of a new surface of given parameters of a scene.

    Parameters
    ----------
    surrogate : Surrogate
        A surrogate of a scene's own features, which has learnt Delta, a pressure or a force.
    order : Order
        The request, with the file of the surrogate as its only input. Without loads, those of the
        training are used.
    numbers : mapping of str to float
        Parameters of the scene, and a hardness if the surrogate asks for it, in the scene's units.

    Returns
    -------
    Law
        The law. The band over the loads that the surrogate has learnt is its interval for a new
        surface.

    Raises
    ------
    InputError
        If the surrogate has not learnt what the order needs, a number is missing, unknown or not
        allowed, or the calibration does not reach the level of the intervals.
    """
    loads = order.loads()
    kind = _learnt_load(surrogate, order, loads)
    scene = Scene.from_text(str(surrogate.card["scene"]))
    patch = _patch_of_scene(surrogate, scene, numbers)
    learns_force = surrogate.features.load == "force"
    # Loads of the law are pressures for a surrogate that has learnt forces: the learnt load is the
    # load of the law times the nominal area [um2]. Other surrogates have learnt the load itself.
    learnt_per_load = patch.nominal if learns_force else 1.0
    law_loads = loads.get(kind)
    if law_loads is None:
        # Steps from the smallest to the largest features of the training, of which the load is the
        # last one. Steps of a logarithm are at equal ratios.
        steps = np.linspace(surrogate.low, surrogate.high, STEPS)
        learnt_loads = shown(surrogate.features.columns, steps)[:, -1]
        law_loads = learnt_loads / learnt_per_load
    # An order may give the pressure 0. A surrogate predicts loads above 0 only.
    law_loads = law_loads[law_loads > 0]
    interval_level = level_of(surrogate, order.level)
    level_remarks = _level_remarks(surrogate, order, interval_level)
    order = replace(order, level=interval_level)
    load_name = surrogate.features.load
    rows = surrogate.of_numbers({**numbers, load_name: law_loads * learnt_per_load})
    answer = surrogate.predict_rows(rows, level=interval_level)
    bodies = bodies_of_parameters(surrogate, numbers)
    check_layer(order, bodies)
    loaded = LoadedPatch(patch=patch, bodies=bodies, kind=kind, loads=law_loads)
    points = points_of(loaded, answer, order.also)
    settings = LawSettings(order=order, bodies=bodies, interval_level=interval_level)
    tables = _tables_over_learnt_loads([patch], [points], kind, settings)
    tables = replace(tables, remarks=[*level_remarks, *tables.remarks])
    about = LawInput(f"{order.inputs[0]}: {patch.name}", scene)
    making = _making(surrogate, f"{100 * order.coverage:g} % of new surfaces")
    return law_of(order, LawSurfaces([patch], [about]), bodies, tables, making)


def _making(surrogate: Surrogate, band: str) -> Making:
    """Return the texts of a law on its method and on its band.

    The method is "predicted by" and the title of the surrogate. `band` describes the band of one
    surface, as "90 % conformal interval".
    """
    return Making(method=f"predicted by {surrogate.card['title']}", band=band)


def _learnt_load(
    surrogate: Surrogate, order: Order, loads: Mapping[Load, Values]
) -> Load:
    """Return the kind of the law's loads for which the surrogate predicts: "delta" or "pressure".

    It is "pressure" for a surrogate that has learnt forces, too. `loads` are the loads of the order
    by kind. Raises InputError if the surrogate has not learnt a load or a target that the law
    needs, or if the order gives loads that the surrogate cannot answer for.
    """
    load = surrogate.features.load
    kind: Load = "delta" if load == "delta" else "pressure"
    result = "force" if kind == "delta" else "delta"
    needed = {"area", result}
    has_load = load in {"delta", "pressure", "force"}
    if not has_load or not needed <= surrogate.learnt.keys():
        targets = ",".join(sorted(needed))
        raise InputError(
            "a law needs a surrogate with --load delta or pressure, and --target"
            f" {targets}; this one has --load {load}, and {', '.join(surrogate.learnt)}:"
            " fit it anew"
        )
    for name in order.also:
        if name not in surrogate.learnt:
            targets = ",".join([*surrogate.learnt, name])
            raise InputError(
                f"--also {name}: was not learnt: fit one with --target {targets}"
            )
    # A surrogate that has learnt the Deltas of a surface has pressures by inversion.
    is_invertible = kind == "delta" and not surrogate.features.of_scene
    if loads.keys() - {kind} and not is_invertible:
        raise InputError(
            f"the surrogate has learnt what a {load} leads to: give --{kind} instead"
        )
    return kind


def _defined_surfaces(
    surrogate: Surrogate, surfaces: Sequence[LawSurface]
) -> DefinedSurfaces:
    """Apply a surrogate to the surfaces whose statistics are all defined.

    Raises `Undefined` with the reason of the first surface if no surface has all statistics.
    """
    defined: list[PredictedSurface] = []
    faults: list[Undefined] = []
    for patch in surfaces:
        features = SurfaceFeatures(
            heights=patch.heights,
            sides=patch.sides,
            spacing=patch.spacing,
            name=patch.name,
            boundary=patch.boundary,
        )
        reason = features.description.reason
        if reason:
            faults.append(Undefined(f"{patch.name}: statistics undefined: {reason}"))
        else:
            on_surface = OnSurface(surrogate=surrogate, surface=features)
            defined.append(PredictedSurface(patch=patch, on_surface=on_surface))
    if not defined:
        raise faults[0]
    remarks: list[str] = []
    if faults:
        remarks.append(
            f"warning: {len(faults)} of {len(surfaces)} surfaces were left out, the"
            f" first: {faults[0]}"
        )
    return DefinedSurfaces(surfaces=defined, remarks=remarks)


def _without_undefined(
    law_surfaces: LawSurfaces, surfaces: Sequence[PredictedSurface]
) -> LawSurfaces:
    """Return the surfaces of a law and their sources without the surfaces that are left out.

    `surfaces` are the surfaces to keep. A source is dropped if it has the name of a surface that is
    left out. Sources that are scenes are never dropped, because they have no name of a surface.
    """
    kept = [surface.patch for surface in surfaces]
    names_left_out = {patch.name for patch in law_surfaces.surfaces}
    names_left_out -= {patch.name for patch in kept}
    sources = [
        source for source in law_surfaces.sources if source.name not in names_left_out
    ]
    return replace(law_surfaces, surfaces=kept, sources=sources)


def _level_remarks(surrogate: Surrogate, order: Order, level: float) -> list[str]:
    """Return a list of one note on a level of intervals that is below the usual one.

    The list is empty if the order names the level, or if `level` is not below the usual one.
    """
    note = level_note(surrogate, level, order.level)
    return [note] if note else []


def _trained_pressures(surrogate: Surrogate, bodies: Bodies) -> Values:
    """Return `STEPS` pressures [MPa] over the range of the training, at equal ratios."""
    # In cards of surrogates by pressure, "delta" has the smallest and largest p L / E* [um].
    low, high = surrogate.card["delta"]
    length = math.sqrt(math.prod(surrogate.card["side"]))
    return np.geomspace(low, high, STEPS) * (bodies.e_star / length)


def _patch_of_scene(
    surrogate: Surrogate, scene: Scene, numbers: Mapping[str, float]
) -> LawSurface:
    """Return a flat patch with the grid of a scene, named after the parameters in `numbers`.

    The flat heights take the place of a rough surface: the law only needs lengths, boundary and
    compliance of the patch.
    """
    name = ", ".join(f"{name} {value:g}" for name, value in numbers.items())
    contact = scene.contact
    return LawSurface(
        name=name or "any surface",
        heights=np.zeros(scene.grid.shape),
        sides=scene.grid.sides,
        boundary=surrogate.boundary,
        exact_spacing=scene.grid.spacing,
        settings={"kernel": contact.kernel, "far_field": contact.far_field},
    )


def _tables_by_pressure(
    surfaces: Sequence[PredictedSurface], pressures: Values, settings: LawSettings
) -> Tables:
    """Predict all surfaces at learnt pressures, (k,) [MPa], and tabulate them over both loads."""
    points = [
        _predicted(surface, "pressure", pressures, settings) for surface in surfaces
    ]
    patches = [surface.patch for surface in surfaces]
    return _tables_over_learnt_loads(patches, points, "pressure", settings)


def _tables_over_learnt_loads(
    patches: Sequence[LawSurface],
    points: Sequence[Points],
    kind: Load,
    settings: LawSettings,
) -> Tables:
    """Tabulate contacts over the loads that the surrogate has learnt, and over the other loads.

    `points` has the points of each patch under the learnt loads, and `kind` is the kind of the
    learnt loads. Raises InputError if a stiffness is needed of bodies that yield, and not learnt.
    """
    smoothed = [monotone(of_surface) for of_surface in points]
    parts = [
        _completed(smooth.points, patch, settings)
        for smooth, patch in zip(smoothed, patches, strict=True)
    ]
    boundary = patches[0].boundary
    at_rest = _gap_at_rest([smooth.points for smooth in smoothed], boundary)
    tables: dict[Load, Curves] = {}
    for load in ARGUMENTS:
        if load == kind:
            tables[load] = _table_over_learnt(parts, load, at_rest, settings)
        else:
            tables[load] = _table_over_other(parts, load, at_rest, settings)
    remarks = _monotony_warnings(tables[kind], smoothed)
    if len(parts) == 1:
        remarks.append(f"only the table over {kind} has a band")
    return Tables(
        over_delta=tables["delta"], over_pressure=tables["pressure"], remarks=remarks
    )


def _gap_at_rest(parts: Sequence[Points], boundary: Boundary) -> dict[str, float]:
    """Return the mean gap at first touch [um], by its name in laws, as the mean over the surfaces.

    Without edges it is the sum of gap and closure, also at the first load. On a free patch it is
    taken to be the sum of gap and Delta at the first load, which is not exact. It is 0 if the
    points have no mean gap.
    """
    gap = MEAN_GAP.in_laws
    if gap not in parts[0].values:
        return {gap: 0.0}
    approach = CLOSURE.in_laws
    if boundary == "free":
        approach = DELTA.in_laws
    first = [part.values[gap][0] + part.values[approach][0] for part in parts]
    return {gap: float(np.mean(first))}


def _table_over_learnt(
    parts: Sequence[Points],
    load: Load,
    at_rest: Mapping[str, float],
    settings: LawSettings,
) -> Curves:
    """Tabulate points over the loads that the surrogate has learnt, which all surfaces share.

    A table over Delta begins at first touch.
    """
    argument = ARGUMENTS[load]
    if load == "delta":
        parts = [part.from_rest(at_rest) for part in parts]
    arguments = parts[0].values[argument]
    return tabulated(argument, arguments, parts, settings.order.coverage, at_rest)


def _table_over_other(
    parts: Sequence[Points],
    load: Load,
    at_rest: Mapping[str, float],
    settings: LawSettings,
) -> Curves:
    """Tabulate points from first touch over a quantity that the surrogate predicts.

    Points at which the quantity does not rise, and all intervals, are left out. The surfaces of a
    population have different values of the quantity. They are interpolated to `STEPS` arguments up
    to the largest one that all surfaces reach.
    """
    argument = ARGUMENTS[load]
    rising: list[Points] = []
    for part in parts:
        without_intervals = replace(part, low={}, high={})
        places = risen(part.values[argument])
        rising_points = without_intervals.chosen(places)
        rising.append(rising_points.from_rest(at_rest))
    arguments = rising[0].values[argument]
    if len(rising) > 1:
        shared_end = min(part.values[argument][-1] for part in rising)
        arguments = np.linspace(0.0, shared_end, STEPS)
        rising = [at_arguments(part, argument, arguments) for part in rising]
    return tabulated(argument, arguments, rising, settings.order.coverage, at_rest)


def _predicted(
    surface: PredictedSurface, kind: Load, loads: Values, settings: LawSettings
) -> Points:
    """Predict the law of one surface at ascending loads above 0, (k,), with intervals.

    Raises InputError if a prediction is not finite.
    """
    bodies = settings.bodies
    rows = surface.on_surface.rows(loads, bodies)
    answer = surface.on_surface.surrogate.predict_rows(
        rows, e_star=bodies.e_star, level=settings.interval_level
    )
    for name, predictions in answer.values.items():
        is_finite = np.isfinite(predictions)
        if not is_finite.all():
            # The first load without a finite prediction.
            load = loads[np.argmin(is_finite)]
            where = f"Delta = {load:.4g} um" if kind == "delta" else f"{load:.4g} MPa"
            raise InputError(
                f"{surface.patch.name}: the surrogate has no finite {name} at {where}:"
                " no law can be made of it"
            )
    loaded = LoadedPatch(
        patch=surface.patch,
        bodies=bodies,
        kind=kind,
        loads=loads,
        surface=surface.on_surface.surface,
    )
    return points_of(loaded, answer, settings.order.also)


@dataclass(frozen=True, eq=False)
class SurfaceLaw:
    """The law of one surface over Delta."""

    smoothed: Monotone  # points from first touch at the Deltas of the table
    points: Points  # the same points, with a stiffness if the order needs one
    # The points, and further ones at larger Deltas if these can be predicted.
    extended: Points


def _tables_by_delta(
    surfaces: Sequence[PredictedSurface],
    deltas: Values,
    pressures: Values | None,
    settings: LawSettings,
) -> Tables:
    """Predict all surfaces at learnt Deltas, and tabulate them over both loads.

    `deltas` are ascending and above 0, (k,) [um]. `pressures` are ascending, (m,) [MPa]; None for
    the mean pressures at the Deltas (`_shared_pressures`). Shows progress on standard error. Raises
    InputError if a coarse solve fails, a prediction is not finite, a stiffness that the order needs
    cannot be given, the law has no force, or a pressure is not reached.
    """
    coverage = settings.order.coverage
    laws: list[SurfaceLaw] = []
    first_touches = [surface.patch.at_rest() for surface in surfaces]
    with RunProgress(len(surfaces), "surfaces") as progress:
        for surface, first_touch in zip(surfaces, first_touches, strict=True):
            laws.append(_law_of_surface(surface, deltas, first_touch, settings))
            progress.advance(rows=1)
    at_rest = mean_at_rest(first_touches)
    over_delta = tabulated(
        against=DELTA.in_laws,
        at=np.append(0.0, deltas),
        parts=[law.points for law in laws],
        level=coverage,
        at_rest=at_rest,
    )
    remarks = _training_warnings(over_delta)
    remarks += _monotony_warnings(over_delta, [law.smoothed for law in laws])
    remarks += _gap_warnings(surfaces[0], settings.bodies)
    extended = [law.extended for law in laws]
    if pressures is None:
        shared = _shared_pressures(over_delta, extended)
        pressures = shared.pressures
        remarks += shared.remarks
    else:
        _require_reached(pressures, over_delta, extended)
    over_pressure = tabulated(
        against=PRESSURE.in_laws,
        at=pressures,
        parts=[at_pressures(part, pressures) for part in extended],
        level=coverage,
        at_rest=at_rest,
    )
    return Tables(over_delta=over_delta, over_pressure=over_pressure, remarks=remarks)


def _law_of_surface(
    surface: PredictedSurface,
    deltas: Values,
    first_touch: Mapping[str, float],
    settings: LawSettings,
) -> SurfaceLaw:
    """Predict the law of one surface at Deltas, (k,) [um], and if possible at larger ones.

    `first_touch` are the values at first touch by names in laws.
    """
    predicted = _predicted(surface, "delta", deltas, settings)
    smoothed = monotone(predicted.from_rest(first_touch))
    extended = smoothed.points
    # A coarse solve may fail at the larger displacements, or a prediction may not be finite.
    with suppress(InputError):
        larger = deltas[-1] * np.array(BEYOND)
        at_larger = _predicted(surface, "delta", larger, settings)
        extended = continued(smoothed.points, at_larger)
    return SurfaceLaw(
        smoothed=smoothed,
        points=_completed(smoothed.points, surface.patch, settings),
        extended=_completed(extended, surface.patch, settings),
    )


def _completed(points: Points, patch: LawSurface, settings: LawSettings) -> Points:
    """Add the stiffness that the order needs, and the compression of a layer if the law has it.

    Raises InputError if bodies that yield need a stiffness that was not learnt.
    """
    stiff = _with_stiffness(points, patch, settings)
    return with_compression(stiff, compliance_in_law(settings.order, settings.bodies))


def _with_stiffness(points: Points, patch: LawSurface, settings: LawSettings) -> Points:
    """Add the stiffness of the interface, if the order needs it and it was not learnt.

    It is the slope of the pressure over Delta without the compliance of the patch. Raises
    InputError for bodies that yield: their stiffness is that of unloading.
    """
    order = settings.order
    needs_stiffness = order.stiffness or order.conductivities is not None
    if not needs_stiffness or STIFFNESS.in_laws in points.values:
        return points
    if settings.bodies.hardness is not None:
        raise InputError(
            "the conductance of bodies that yield follows from their stiffness of"
            " unloading, which is no slope of the force: fit a surrogate with --target"
            " area,force,stiffness, or solve the law"
        )
    slope = slopes(points.values[DELTA.in_laws], points.values[PRESSURE.in_laws], 0.0)
    compliance = patch.patch_compliance(settings.bodies)
    stiffness = of_interface(slope, compliance)
    return replace(points, values={**points.values, STIFFNESS.in_laws: stiffness})


def _training_warnings(over_delta: Curves) -> list[str]:
    """Warn that displacements are outside the training; an empty list if none is."""
    number = np.count_nonzero(over_delta.outside)
    if not number:
        return []
    warning = (
        f"warning: {number} of {over_delta.at.size - 1} displacements are outside the"
        " training ranges for one surface or more"
    )
    if over_delta.flagged.any():
        warning += "; outside, neither closure nor stiffness is given (-)"
    return [warning]


def _gap_warnings(surface: PredictedSurface, bodies: Bodies) -> list[str]:
    """Warn of a mean gap that is coarse or left out, unless it was learnt; at most one line."""
    if MEAN_GAP.name in surface.on_surface.surrogate.learnt:
        return []
    if not has_mean_gap(surface.patch, bodies):
        return [NO_GAP]
    if bodies.hardness is None:
        return []
    return [COARSE_GAP]


def _monotony_warnings(table: Curves, smoothed: Sequence[Monotone]) -> list[str]:
    """Return a warning for each curve of a table that was far from monotone before its correction.

    `smoothed` are the monotone points of each surface, with their corrections. A curve has a
    warning if its mean correction over the surfaces exceeds `CORRECTED` somewhere.
    """
    warnings: list[str] = []
    # The conductance and a stiffness from a slope are not corrected.
    for name in table.curves.keys() & smoothed[0].corrections.keys():
        corrections = [of_surface.corrections[name] for of_surface in smoothed]
        change = np.abs(np.mean(corrections, axis=0)).max()
        largest = np.nanmax(np.abs(table.curves[name].value), initial=0.0)
        # A curve that is 0 everywhere has no size to compare with; 1 takes its place.
        if change > CORRECTED * (largest or 1.0):
            warnings.append(_monotony_warning(name))
    return sorted(warnings)


def _monotony_warning(name: str) -> str:
    """Warn that the predicted curve of a quantity, by its name in laws, was not monotone."""
    if trend(name) == "falls":
        fault = "rose with the load; shown is the nearest falling one"
    else:
        fault = "fell with the load; shown is the nearest rising one"
    return f"warning: the surrogate's curve of {name} {fault}"


@dataclass(frozen=True, eq=False)
class SharedPressures:
    """Pressures that all surfaces of a law reach."""

    pressures: Values  # (m,), ascending [MPa]
    remarks: list[str]  # a note if the pressures end early, or nothing


def _shared_pressures(over_delta: Curves, extended: Sequence[Points]) -> SharedPressures:
    """Return the pressures of the mean curve of a table over Delta, ascending [MPa].

    If they exceed the largest pressure that all surfaces reach, they are cut there, this pressure
    is the last one, and a remark says so. `extended` are the points of each surface. Raises
    InputError if the law has no force.
    """
    mean_pressures = np.unique(_mean_pressures(over_delta))
    largest = _largest_shared_pressure(extended)
    if mean_pressures[-1] <= largest:
        return SharedPressures(pressures=mean_pressures, remarks=[])
    remark = (
        f"the table against pressure ends at {largest:.4g} MPa: not all surfaces reach"
        " more"
    )
    below_largest = mean_pressures[mean_pressures < largest]
    pressures = np.append(below_largest, largest)
    return SharedPressures(pressures=pressures, remarks=[remark])


def _require_reached(
    pressures: Values, over_delta: Curves, extended: Sequence[Points]
) -> None:
    """Refuse ascending pressures, (m,) [MPa], if the last one is not reached.

    Both the mean pressure of the table over Delta and the pressure of each surface have to reach
    it. `extended` are the points of each surface. A law without a force is refused too.
    """
    last_mean = _mean_pressures(over_delta)[-1]
    largest = min(last_mean, _largest_shared_pressure(extended))
    if pressures[-1] > largest:
        raise InputError(
            f"--pressure {pressures[-1]:.6g}: not all surfaces reach more than {largest:.6g}"
            f" MPa near Delta = {over_delta.at[-1]:.4g} um: give a larger --delta, or"
            " smaller pressures"
        )


def _mean_pressures(over_delta: Curves) -> Values:
    """Return the pressures of the mean curve of a table over Delta, (k,) [MPa].

    Raises InputError if the last pressure is not above 0: the law has no force.
    """
    mean = over_delta.curves[PRESSURE.in_laws].value
    if not mean[-1] > 0:  # True for NaN, too
        raise InputError(
            "the law has no force at all: nothing to tabulate against pressure"
        )
    return mean


def _largest_shared_pressure(extended: Sequence[Points]) -> float:
    """Return the largest pressure that all surfaces reach [MPa], by the points of each surface."""
    return min(float(points.values[PRESSURE.in_laws].max()) for points in extended)
