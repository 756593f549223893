"""Computation of the rows of a database: surface, statistics and contact, one after another."""

import itertools
import socket
import time
from collections.abc import Iterator

import numpy as np

import bem
from gen.arrays import Columns, Heights
from gen.generation.plan import Parameters, parameters, planned_columns, surface_random
from gen.runtime.errors import InputError
from gen.runtime.memory import too_little_for_solve
from gen.runtime.overtime import Overtime, at_most
from gen.scene import Scene
from gen.schema import Reason, Status, columns_for
from gen.statistics import Description, describe
from gen.surface import generate, without_last_nodes

ANSWERS = ("area_percent", "force", "contact_nodes")
"""Columns of every database that are results of `bem.solve` under the same name."""

OPTIONAL_ANSWERS = frozenset(
    ("yielded_percent", "mean_gap", "largest_pressure", "perimeter", "pressure")
)
"""Optional columns that are results of `bem.solve` under the same name."""


def compute_rows(
    scene: Scene, start: int, stop: int, rank: int = 0, limit: float | None = None
) -> Columns:
    """Generate, describe and solve the samples start to stop - 1.

    A surface is generated and described once for all its samples. A sample that cannot be solved
    becomes a failed row with its reason; every other exception is a bug and passes through.

    Parameters
    ----------
    scene : Scene
        Description of the samples.
    start, stop : int
        First row, and one past the last.
    rank : int
        MPI rank of this process, for the record.
    limit : float or None
        Wall-clock time allowed for a surface, and for each contact on it [s]; a sample that takes
        longer is left pending. None for no limit.

    Returns
    -------
    Columns
        Every column of `gen.schema.columns_for(scene)`, with stop - start rows.

    Raises
    ------
    InputError
        If memory runs out: that is not the sample's fault, so no row has failed.
    """
    try:
        return _computed(scene, start, stop, rank, limit)
    except MemoryError:
        raise too_little_for_solve(scene.shape) from None


def _computed(scene: Scene, start: int, stop: int, rank: int, limit: float | None) -> Columns:
    """Compute the rows start to stop - 1 without handling a lack of memory."""
    plan = parameters(scene, start, stop)
    rows = _pending_rows(scene, stop - start)
    rows |= planned_columns(scene, plan)
    rows["rank"][:] = rank
    rows["host"][:] = socket.gethostname().encode()[:64]
    edges = np.flatnonzero(np.diff(plan.surface, prepend=-1, append=-1))
    for first, last in itertools.pairwise(edges.tolist()):
        _compute_surface(scene, plan, rows, first, last, limit)
    return rows


def finished_parts(start: int, rows: Columns) -> Iterator[tuple[int, int, Columns]]:
    """Cut pending rows out of the result of `compute_rows`.

    Parameters
    ----------
    start : int
        Number of the first row.
    rows : Columns
        Every column of the rows.

    Yields
    ------
    tuple of int, int and Columns
        First row, one past the last, and the columns of every longest run of finished rows.
    """
    finished = rows["status"] != Status.PENDING
    edges = np.flatnonzero(np.diff(finished, prepend=False, append=False)).tolist()
    for first, last in zip(edges[::2], edges[1::2], strict=True):
        part = {name: values[first:last] for name, values in rows.items()}
        yield start + first, start + last, part


def surface_of(scene: Scene, plan: Parameters, row: int) -> Heights:
    """Generate the surface of one row of a plan: heights (n, n) [um]."""
    heights = generate(
        scene.surface.generator,
        scene.surface.nodes,
        float(plan.hurst[row]),
        float(plan.sigma0[row]),
        surface_random(scene, plan.surface[row]),
    )
    return heights if scene.contact.boundary == "free" else without_last_nodes(heights)


def solve_contact(
    scene: Scene, heights: Heights, delta: float, hardness: float | None = None
) -> bem.Contact:
    """Solve the contact of a surface at one displacement, with the scene's settings.

    Parameters
    ----------
    scene : Scene
        Description of the samples.
    heights : ndarray, shape (n, n)
        Heights of the surface [um].
    delta : float
        Far-field displacement [um].
    hardness : float or None
        Hardness of the softer body [MPa]. None takes the scene's, which must not be a range.

    Returns
    -------
    bem.Contact
        The solution; the exceptions of `bem.solve` pass through.

    Raises
    ------
    ValueError
        If no hardness is given and every sample of the scene has one of its own.
    """
    settings = scene.contact
    if hardness is None and settings.hardness_limits is not None:
        if settings.draws_hardness:
            raise ValueError("every sample of this scene has a hardness of its own: give it")
        hardness = settings.hardness_limits[0]
    return bem.solve(
        heights,
        scene.surface.side,
        delta,
        spacing=scene.spacing,
        modulus=settings.modulus,
        poisson=settings.poisson,
        kernel=settings.kernel,
        far_field=settings.far_field,
        boundary=settings.boundary,
        hardness=hardness,
        rtol=settings.rtol,
        max_iterations=settings.max_iterations,
    )


def _pending_rows(scene: Scene, count: int) -> Columns:
    """Make rows in which every column has its fill value."""
    return {
        column.name: np.full(column.shape(count, scene.nodes), column.fill, dtype=column.dtype)
        for column in columns_for(scene)
    }


def _compute_surface(
    scene: Scene, plan: Parameters, rows: Columns, first: int, last: int, limit: float | None
) -> None:
    """Fill in the rows first to last - 1 of a block, which share one surface."""
    began = time.perf_counter()
    try:
        with at_most(limit):
            described = _described(scene, plan, first)
    except Overtime:
        return
    if described is None:
        rows["reason"][first:last] = Reason.ARITHMETIC
        rows["status"][first:last] = Status.FAILED
        return
    heights, description = described
    for name, value in description.values.items():
        rows[name][first:last] = value
    if scene.store.heights:
        rows["heights"][first:last] = heights
    rows["surface_seconds"][first:last] = (time.perf_counter() - began) / (last - first)
    for row in range(first, last):
        began = time.perf_counter()
        try:
            with at_most(limit):
                reason = _solve(scene, heights, plan, rows, row)
        except Overtime:
            continue
        rows["solve_seconds"][row] = time.perf_counter() - began
        if reason is Reason.NONE and description.reason:
            reason = Reason.NO_STATISTICS
        rows["reason"][row] = reason
        rows["status"][row] = Status.DONE if reason is Reason.NONE else Status.FAILED


def _described(scene: Scene, plan: Parameters, row: int) -> tuple[Heights, Description] | None:
    """Generate and describe a row's surface; return None if that leaves the range of numbers."""
    try:
        heights = surface_of(scene, plan, row)
        return heights, describe(heights, scene.spacing)
    except (ArithmeticError, InputError):
        return None


def _solve(scene: Scene, heights: Heights, plan: Parameters, rows: Columns, row: int) -> Reason:
    """Solve one contact problem and fill in its row; return the reason if that is impossible."""
    try:
        contact = solve_contact(scene, heights, float(plan.delta[row]), plan.hardness_of(row))
    except bem.NotConverged as failure:
        _record_effort(failure.contact, rows, row)
        return Reason.NOT_CONVERGED
    except bem.NoSolution:
        return _without_solution(scene)
    except (ArithmeticError, np.linalg.LinAlgError):
        return Reason.ARITHMETIC
    _record_effort(contact, rows, row)
    if not np.isfinite(contact.force):
        return Reason.NOT_FINITE
    for name in (*ANSWERS, *(OPTIONAL_ANSWERS & scene.optional_columns)):
        rows[name][row] = getattr(contact, name)
    return Reason.NONE


def _without_solution(scene: Scene) -> Reason:
    """Return the reason why a contact of the scene may have no equilibrium."""
    if scene.contact.hardness_limits is not None:
        return Reason.BEYOND_HARDNESS
    if scene.contact.boundary != "free":
        return Reason.FULL_CONTACT
    return Reason.NO_SOLUTION


def _record_effort(contact: bem.Contact, rows: Columns, row: int) -> None:
    """Store the cost and the residual of a solve, converged or not."""
    for name in ("iterations", "convolutions", "residual"):
        rows[name][row] = getattr(contact, name)
