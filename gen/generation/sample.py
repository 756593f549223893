"""Computation of the rows of a database: surface, statistics and contact, one after another."""

import itertools
import socket
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

import bem
from gen.arrays import Columns, Heights
from gen.generation.functions import outputs_of
from gen.generation.plan import (
    Parameters,
    opposite_random,
    parameters,
    planned_columns,
    surface_random,
)
from gen.material import plane_strain_modulus
from gen.runtime.errors import InputError, SourceError
from gen.runtime.memory import too_little_for_solve
from gen.runtime.signals import Overtime, at_most
from gen.scene import Scene
from gen.scene.columns import columns_for
from gen.schema import DONE_REASONS, Reason, Status
from gen.statistics import describe, rms_slope

EFFORT = ("iterations", "convolutions", "residual")
"""Columns of the cost and the residual of a solve, converged or not."""

ANSWERS = ("area_percent", "force", "contact_nodes")
"""Columns of every database that are results of `bem.solve` under the same name."""

OPTIONAL_ANSWERS = frozenset(
    (
        *("yielded_percent", "mean_gap", "largest_pressure", "perimeter", "pressure"),
        *("stiffness", "interface_stiffness", "continuum_area_percent"),
    )
)
"""Optional columns that are results of `bem.solve` under the same name."""

FURTHER_ANSWERS: dict[str, Callable[[bem.Contact], float]] = {
    "contact_spots": lambda contact: contact.spots.number,
    "largest_spot_percent": lambda contact: 100 * contact.spots.largest_share,
    "contact_connects": lambda contact: _sides(contact.spots.contact_connects),
    "gap_connects": lambda contact: _sides(contact.spots.gap_connects),
    "hydraulic_aperture_x": lambda contact: contact.flow(0).aperture,
    "hydraulic_aperture_y": lambda contact: contact.flow(1).aperture,
}
"""Optional columns that follow from the spots of a contact, or from the flow through its gap."""


UNSOLVED = (
    *(ArithmeticError, np.linalg.LinAlgError, InputError),
    *(bem.NoSolution, bem.NotConverged),
)
"""Exceptions of samples that have no solution."""


def compute_rows(
    scene: Scene, start: int, stop: int, rank: int = 0, limit: float | None = None
) -> Columns:
    """Generate, describe and solve the samples start to stop - 1, and return all their columns.

    A surface is generated and described once for all its samples. A statistic that the surface
    does not define is NaN, with the reason, and the row is done. A sample that cannot be solved
    becomes a failed row with its reason; every other exception is a bug and passes through. A
    surface or a contact that takes longer than `limit` [s] leaves its rows pending.
    """
    plan = parameters(scene, start, stop)
    rows: Columns = {
        column.name: np.full(column.shape(stop - start, scene.shape), column.fill, column.dtype)
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
                    with at_most(limit):
                        reason = _solve(scene, heights, plan, rows, row)
                except Overtime:
                    continue
                rows["solve_seconds"][row] = time.perf_counter() - began
                if reason is not Reason.NONE:  # a statistic that lacks is the least of all reasons
                    rows["reason"][row] = reason
                done = rows["reason"][row] in DONE_REASONS
                rows["status"][row] = Status.DONE if done else Status.FAILED
    except MemoryError:
        raise too_little_for_solve(scene.shape) from None
    return rows


def finished_parts(start: int, rows: Columns) -> Iterator[tuple[int, int, Columns]]:
    """Yield first row, one past the last, and columns of every longest run of finished rows."""
    finished = rows["status"] != Status.PENDING
    edges = np.flatnonzero(np.diff(finished, prepend=False, append=False)).tolist()
    for first, last in zip(edges[::2], edges[1::2], strict=True):
        part = {name: values[first:last] for name, values in rows.items()}
        yield start + first, start + last, part


def surface_of(scene: Scene, plan: Parameters, row: int) -> Heights:
    """Make the surface of one row of a plan: heights of the scene's shape [um].

    Of two rough bodies it is the composite surface, the sum of both heights. The second one is
    drawn as it faces the first, so neither is turned over.
    """
    number, drawn, table = int(plan.surface[row]), plan.parameters_of(row), scene.surface
    try:
        heights = table.heights(scene.grid, number, drawn, surface_random(scene, number))
        if table.against is None:
            return heights
        streams = surface_random(scene, number), opposite_random(scene, number)
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
    """Solve the contact of a surface at one load, with the scene's settings.

    The load is `delta` [um], `pressure` [MPa] or `force` [uN]. A scene that draws its hardness
    needs that of the sample [MPa]. The exceptions of `bem.solve` pass through.
    """
    settings = scene.contact
    if hardness is None and settings.hardness_limits is not None:
        if settings.draws_hardness:
            raise ValueError("every sample of this scene has a hardness of its own: give it")
        hardness = settings.hardness_limits[0]
    return bem.solve(
        heights,
        scene.sides,
        delta,
        pressure=pressure,
        force=force,
        spacing=scene.spacing,
        modulus=settings.modulus,
        poisson=settings.poisson,
        kernel=settings.kernel,
        far_field=settings.far_field,
        boundary=settings.boundary,
        hardness=hardness,
        rtol=settings.rtol,
        max_iterations=settings.max_iterations,
        threads=1,  # the ranks of a run share the processor already
    )


def load_of(scene: Scene, heights: Heights, load: float) -> dict[str, float]:
    """Turn a load in the scene's quantity into an argument of `solve_contact`."""
    match scene.quantity:
        case "delta/height_rms":
            return {"delta": load * float(heights.std())}
        case "pressure/(E* slope_rms)":
            modulus = plane_strain_modulus(scene.contact.modulus, scene.contact.poisson)
            return {"pressure": load * modulus * rms_slope(heights, scene.spacing)}
    return {scene.quantity: load}


def _make_surface(
    scene: Scene, plan: Parameters, rows: Columns, first: int, last: int, limit: float | None
) -> Heights | None:
    """Make and describe the surface of the rows first to last - 1; None if there is none."""
    began = time.perf_counter()
    try:
        with at_most(limit):
            heights = surface_of(scene, plan, first)
            description = describe(heights, scene.spacing)
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
    if scene.store.heights:
        rows["heights"][first:last] = heights
    rows["surface_seconds"][first:last] = (time.perf_counter() - began) / (last - first)
    return heights


def _solve(scene: Scene, heights: Heights, plan: Parameters, rows: Columns, row: int) -> Reason:
    """Solve one contact problem and fill in its row; return the reason if that is impossible."""
    try:
        load = load_of(scene, heights, float(plan.load[row]))
        contact = solve_contact(scene, heights, hardness=plan.hardness_of(row), **load)
        for name in EFFORT:
            rows[name][row] = getattr(contact, name)
        if not np.isfinite(contact.force):
            return Reason.NOT_FINITE
        outputs = {}
        if scene.store.function is not None:
            outputs = outputs_of(scene.store, contact, plan.first + row)
        for name, value in (_answers(scene, contact) | outputs).items():
            rows[name][row] = value
        return Reason.NONE if np.isfinite(list(outputs.values())).all() else Reason.NOT_FINITE
    except bem.NotConverged as failure:
        for name in EFFORT:
            rows[name][row] = getattr(failure.contact, name)
        return Reason.NOT_CONVERGED
    except bem.NoSolution:
        elastic = Reason.FULL_CONTACT if scene.edgeless else Reason.NO_SOLUTION
        return elastic if scene.contact.hardness_limits is None else Reason.BEYOND_HARDNESS
    except (ArithmeticError, np.linalg.LinAlgError):
        return Reason.ARITHMETIC


def _answers(scene: Scene, contact: bem.Contact) -> dict[str, Any]:
    """Return what a scene's database holds of a contact beside effort and outputs."""
    wanted = scene.optional_columns
    names = {*ANSWERS, *(OPTIONAL_ANSWERS & wanted)} | ({"delta"} - {scene.quantity})
    further = {name: FURTHER_ANSWERS[name](contact) for name in FURTHER_ANSWERS.keys() & wanted}
    return {name: getattr(contact, name) for name in names} | further


def _sides(connects: tuple[bool, bool]) -> int:
    """Return the code of the sides that something connects: 1 along x, 2 along y, 3 both."""
    return connects[0] + 2 * connects[1]


def first_contact(scene: Scene, rows: int) -> tuple[int, bem.Contact] | None:
    """Solve the first of a scene's first rows that has a solution; None if none of them has."""
    plan = parameters(scene, 0, rows)
    for row in range(rows):
        try:
            heights = surface_of(scene, plan, row)
            load = load_of(scene, heights, float(plan.load[row]))
            return row, solve_contact(scene, heights, hardness=plan.hardness_of(row), **load)
        except SourceError:
            raise
        except UNSOLVED:
            continue
    return None
