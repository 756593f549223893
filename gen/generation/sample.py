"""Computation of the rows of a database: surface, statistics and contact, one after another.

A user's function gives further outputs of each contact; a scene records its source and its outputs.
"""

import itertools
import math
import socket
import time
from collections.abc import Mapping
from contextlib import suppress
from numbers import Real
from typing import Any, TypeVar

import numpy as np

import bem
from gen.arrays import Columns, Heights, Values
from gen.generation.plan import (
    OPPOSITE,
    Parameters,
    parameters,
    planned_columns,
    surface_random,
)
from gen.quantities import stored_quantities
from gen.runtime.errors import InputError, SourceError
from gen.runtime.farm import Overtime, time_limit
from gen.runtime.memory import too_little_for_solve
from gen.runtime.user_code import load_function, source_errors
from gen.scene import Scene, Store, columns_for
from gen.schema import DONE_REASONS, Reason, Status
from gen.statistics import describe, rms_slope

Load = TypeVar("Load", float, Values)  # one load, or an array of some
Output = tuple[float, str | None]  # a value of a user's function, and its unit if given
EFFORT = ("iterations", "convolutions", "residual")  # of a solve, converged or not


def compute_rows(
    scene: Scene, start: int, stop: int, rank: int = 0, limit: float | None = None
) -> Columns:
    """Generate, describe and solve the samples start to stop - 1, and return all their columns.

    A statistic that the surface does not define is NaN, with a reason, and the row is done. A
    sample that cannot be solved becomes a failed row; every other exception is a bug. A surface or
    a contact that takes longer than `limit` [s] leaves its rows pending.
    """
    plan = parameters(scene, start, stop)
    rows: Columns = {
        column.name: np.full(
            column.shape(stop - start, scene.grid.shape), column.fill, column.dtype
        )
        for column in columns_for(scene)
    }
    rows |= planned_columns(scene, plan)
    rows["rank"][:] = rank
    rows["host"][:] = socket.gethostname().encode()[:64]
    edges = np.flatnonzero(np.diff(plan.surface, prepend=-1, append=-1))
    try:
        for first, last in itertools.pairwise(edges.tolist()):
            heights = _make_surface(scene, plan, rows, first, last, limit)
            if heights is None:
                continue
            for row in range(first, last):
                began = time.perf_counter()
                try:
                    with time_limit(limit):
                        reason = _solve(scene, heights, plan, rows, row)
                except Overtime:
                    continue
                rows["solve_seconds"][row] = time.perf_counter() - began
                if (
                    reason is not Reason.NONE
                ):  # a statistic that lacks is the least of all reasons
                    rows["reason"][row] = reason
                done = rows["reason"][row] in DONE_REASONS
                rows["status"][row] = Status.DONE if done else Status.FAILED
    except MemoryError:
        raise too_little_for_solve(scene.grid.shape) from None
    return rows


def surface_of(scene: Scene, plan: Parameters, row: int) -> Heights:
    """Make the surface of one row of a plan, of two rough bodies the sum of both heights [um].

    The second body is drawn as it faces the first, so neither is turned over.
    """
    number, drawn, table = int(plan.surface[row]), plan.parameters_of(row), scene.surface
    try:
        heights = table.heights(scene.grid, number, drawn, surface_random(scene, number))
        if table.against is None:
            return heights
        streams = surface_random(scene, number), surface_random(scene, number, OPPOSITE)
        heights = heights + table.opposite_heights(scene.grid, number, drawn, *streams)
    except ArithmeticError as error:
        raise InputError(
            f"surface {number} cannot be made in double precision ({type(error).__name__}): give"
            " other parameters"
        ) from error
    heights -= heights.min()
    return heights


def surface_numbered(scene: Scene, number: int) -> Heights:
    """Make the surface of an index, as rows of the scene's database have it [um]."""
    row = number * scene.samples_per_surface
    return surface_of(scene, parameters(scene, row, row + 1), 0)


def solve_contact(
    scene: Scene,
    heights: Heights,
    delta: float | None = None,
    hardness: float | None = None,
    *,
    pressure: float | None = None,
    force: float | None = None,
) -> bem.Contact:
    """Solve the contact of a surface at one load [um, MPa or uN], with the scene's settings.

    A scene that draws its hardness needs that of the sample [MPa]. `bem.solve` may raise.
    """
    settings = settings_of(scene, hardness)
    return bem.solve(
        heights, scene.grid.sides, delta, pressure=pressure, force=force, **settings
    )


def settings_of(scene: Scene, hardness: float | None) -> dict[str, Any]:
    """Return the arguments of `bem.solve` that are not the surface, its sides and the load."""
    given = scene.contact
    if hardness is None and given.hardness_limits is not None:
        if given.draws_hardness:
            raise ValueError(
                "every sample of this scene has a hardness of its own: give it"
            )
        hardness = given.hardness_limits[0]
    names = (
        "modulus",
        "poisson",
        "kernel",
        "far_field",
        "boundary",
        "rtol",
        "max_iterations",
    )
    settings = {name: getattr(given, name) for name in names}
    # The ranks of a run share the processor already: one thread.
    return settings | {"spacing": scene.grid.spacing, "hardness": hardness, "threads": 1}


def load_of(scene: Scene, heights: Heights, load: Load) -> dict[str, Load]:
    """Turn a load, or an array of some, in the scene's quantity into what `solve_contact` takes."""
    match scene.quantity:
        case "delta/height_rms":
            return {"delta": load * float(heights.std())}
        case "pressure/(E* slope_rms)":
            slope = rms_slope(heights, scene.grid.spacing)
            return {"pressure": load * scene.contact.e_star * slope}
    return {scene.quantity: load}


def _make_surface(
    scene: Scene,
    plan: Parameters,
    rows: Columns,
    first: int,
    last: int,
    limit: float | None,
) -> Heights | None:
    """Make and describe the surface of the rows first to last - 1; None if there is none."""
    began = time.perf_counter()
    try:
        with time_limit(limit):
            heights = surface_of(scene, plan, first)
            description = describe(heights, scene.grid.spacing)
    except Overtime:
        return None
    except SourceError:
        raise
    except (ArithmeticError, InputError):  # beyond the range of numbers
        rows["reason"][first:last] = Reason.ARITHMETIC
        rows["status"][first:last] = Status.FAILED
        return None
    for name, value in description.values.items():
        rows[name][first:last] = value
    if description.reason:
        rows["reason"][first:last] = Reason.NO_STATISTICS
    if scene.store.wants("heights"):
        rows["heights"][first:last] = heights
    rows["surface_seconds"][first:last] = (time.perf_counter() - began) / (last - first)
    return heights


def _solve(
    scene: Scene, heights: Heights, plan: Parameters, rows: Columns, row: int
) -> Reason:
    """Solve one contact problem and fill in its row; return the reason if that is impossible."""
    try:
        given = settings_of(scene, plan.hardness_of(row))
        given |= load_of(scene, heights, float(plan.load[row]))
        contact = bem.solve(heights, scene.grid.sides, **given)
        for name in EFFORT:
            rows[name][row] = getattr(contact, name)
        if not np.isfinite(contact.force):
            return Reason.NOT_FINITE
        store = scene.store
        outputs = outputs_of(store, contact, plan.first + row) if store.function else {}
        for quantity in stored_quantities():
            planned = (
                quantity.name == scene.quantity == "delta"
            )  # which the plan has filled in
            if quantity.name in rows and quantity.name != "heights" and not planned:
                rows[quantity.name][row] = quantity.of(contact)
        for name, value in outputs.items():
            rows[name][row] = value
        return (
            Reason.NONE
            if np.isfinite(list(outputs.values())).all()
            else Reason.NOT_FINITE
        )
    except bem.NotConverged as failure:
        for name in EFFORT:
            rows[name][row] = getattr(failure.contact, name)
        return Reason.NOT_CONVERGED
    except bem.NoSolution:
        elastic = (
            Reason.FULL_CONTACT
            if scene.contact.boundary != "free"
            else Reason.NO_SOLUTION
        )
        return (
            elastic if scene.contact.hardness_limits is None else Reason.BEYOND_HARDNESS
        )
    except (ArithmeticError, np.linalg.LinAlgError):
        return Reason.ARITHMETIC


def outputs_of(store: Store, contact: bem.Contact, row: int) -> dict[str, float]:
    """Call the user's function for a contact; a SourceError says what its outputs had to be."""
    expected = store.outputs or {}
    found = called(store, contact, row)
    place = f"{store.function}, row {row}: "
    if found.keys() != expected.keys():
        returned, wanted = (
            ", ".join(sorted(names)[:12]) or "nothing" for names in (found, expected)
        )
        raise SourceError(f"{place}returned {returned}; the database has {wanted}")
    for name, (value, unit) in found.items():
        least, most = store.bounds(name)
        if unit not in {None, expected[name]}:
            raise SourceError(
                f"{place}{name} is in {unit!r}; the database has {expected[name]!r}"
            )
        if value < least or value > most:
            raise SourceError(
                f"{place}{name} is {value:g}; its bounds in the scene are {least:g} and {most:g}"
            )
    return {name: value for name, (value, _) in found.items()}


def called(store: Store, contact: bem.Contact, row: int) -> dict[Any, Output]:
    """Call the user's function for a contact, whose arrays cannot be changed."""
    contact.pressure.setflags(write=False)
    place = f"{store.function}, row {row}"
    with source_errors(place):
        returned = load_function(str(store.function), store.source)(contact)
        if not isinstance(returned, Mapping):
            kind = type(returned).__name__
            raise SourceError(
                f"{place}: returned a {kind}, not a dictionary of numbers by names"
            )
        found = {}
        for name in returned:
            given = returned[name]
            value, unit = (
                given if isinstance(given, tuple) and len(given) == 2 else (given, None)
            )
            if isinstance(value, np.ndarray | np.generic) and value.ndim == 0:
                value = value.item()
            if not isinstance(name, str):
                raise SourceError(f"{place}: the name {name!r} is not a text")
            if not isinstance(value, Real) or not isinstance(unit, str | None):
                raise SourceError(
                    f"{place}: {name} is {str(given)[:60]!r}, not a number, or one and its unit"
                )
            with suppress(OverflowError):  # a whole number of hundreds of digits
                found[name] = float(value), unit
        return dict.fromkeys(returned, (math.inf, None)) | found
