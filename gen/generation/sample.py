"""Computation of the rows of a database: surface, statistics and contact, one after another."""

import itertools
import socket
import time
from dataclasses import dataclass
from typing import Any, Generic, Literal, NamedTuple, TypeVar

import numpy as np

import bem
from gen.arrays import Columns, Heights, Values
from gen.generation.outputs import outputs_for_row
from gen.generation.plan import (
    OPPOSITE,
    Plan,
    parameters,
    planned_columns,
    surface_random,
)
from gen.quantities import stored_quantities
from gen.runtime.errors import InputError, SourceError
from gen.runtime.farm import Overtime, time_limit
from gen.runtime.memory import too_little_for_solve
from gen.scene import Scene, columns_for
from gen.schema import DONE_REASONS, Reason, Status
from gen.statistics import describe, rms_slope

Load = TypeVar("Load", float, Values)  # one load, or an array of loads

EFFORT = ("iterations", "convolutions", "residual")  # of a solve, converged or not
HOST_BYTES = 64  # most bytes of a machine's name in the column `host`

SETTINGS = (
    "modulus",
    "poisson",
    "kernel",
    "far_field",
    "boundary",
    "rtol",
    "max_iterations",
)
"""Keys of a scene's table [contact] that `bem.solve` takes as they are."""


def compute_rows(
    scene: Scene, start: int, stop: int, rank: int = 0, limit: float | None = None
) -> Columns:
    """Generate, describe and solve consecutive samples of a scene.

    A sample without a solution becomes a failed row with a reason. A statistic that the surface
    does not define is NaN; the row is done and has a reason too. A surface or a contact that takes
    too long leaves its rows pending. Every other exception is a bug.

    Parameters
    ----------
    scene : Scene
        A completed scene, whose surfaces are ready (`make_ready`).
    start, stop : int
        Numbers of the first row and of the row behind the last one.
    rank : int
        MPI rank of this process, for the column `rank`.
    limit : float, optional
        Largest time for a surface, and for each contact [s].

    Returns
    -------
    dict of str to ndarray, shape (stop - start,) or (stop - start, nx, ny)
        All columns of `gen.scene.columns_for` by name; fill values where nothing was computed.

    Raises
    ------
    InputError
        If a contact does not fit into memory. A SourceError, which is one, if a function of the
        user's fails.
    """
    plan = parameters(scene, start, stop)
    columns = _empty_columns(scene, stop - start) | planned_columns(scene, plan)
    columns["rank"][:] = rank
    columns["host"][:] = socket.gethostname().encode()[:HOST_BYTES]
    samples = _Samples(scene, plan, columns, limit)
    # Positions of the first row of each surface, and the position behind the last row.
    edges = np.flatnonzero(np.diff(plan.surface, prepend=-1, append=-1))
    try:
        for first, last in itertools.pairwise(edges.tolist()):
            samples.compute(first, last)
    except MemoryError:
        raise too_little_for_solve(scene.grid.shape) from None
    return columns


def _empty_columns(scene: Scene, rows: int) -> Columns:
    """Return the columns of some rows of a scene, full of fill values."""
    return {
        column.name: np.full(
            column.shape(rows, scene.grid.shape), column.fill, column.dtype
        )
        for column in columns_for(scene)
    }


@dataclass(frozen=True, eq=False)
class _Samples:
    """Consecutive samples that are being computed; rows are counted from the first of them."""

    scene: Scene
    plan: Plan
    columns: Columns  # filled in row by row
    limit: float | None  # largest time for a surface, and for each contact [s]

    def compute(self, first: int, last: int) -> None:
        """Compute the rows first to last - 1, which share a surface, and fill in their columns."""
        heights = self._make_surface(first, last)
        if heights is None:
            return
        for row in range(first, last):
            began = time.perf_counter()
            try:
                with time_limit(self.limit):
                    reason = self._solve(heights, row)
            except Overtime:
                continue
            self.columns["solve_seconds"][row] = time.perf_counter() - began
            # A missing statistic, the reason of all rows of the surface, replaces no other reason.
            if reason is not Reason.NONE:
                self.columns["reason"][row] = reason
            done = self.columns["reason"][row] in DONE_REASONS
            self.columns["status"][row] = Status.DONE if done else Status.FAILED

    def _make_surface(self, first: int, last: int) -> Heights | None:
        """Make the surface of the rows first to last - 1, and fill in its columns.

        Return its heights [um]; None if it takes too long, or its numbers are beyond all floats.
        """
        rows = slice(first, last)
        began = time.perf_counter()
        try:
            with time_limit(self.limit):
                heights = surface_of(self.scene, self.plan, first)
                description = describe(heights, self.scene.grid.spacing)
        except Overtime:
            return None
        except SourceError:
            raise
        except (ArithmeticError, InputError):  # beyond the range of numbers
            self.columns["reason"][rows] = Reason.ARITHMETIC
            self.columns["status"][rows] = Status.FAILED
            return None
        for name, value in description.values.items():
            self.columns[name][rows] = value
        if description.reason:
            self.columns["reason"][rows] = Reason.NO_STATISTICS
        if self.scene.store.wants("heights"):
            self.columns["heights"][rows] = heights
        elapsed = time.perf_counter() - began
        self.columns["surface_seconds"][rows] = elapsed / (last - first)
        return heights

    def _solve(self, heights: Heights, row: int) -> Reason:
        """Solve the contact of a row, and fill in its columns; return why it failed, or NONE."""
        scene = self.scene
        try:
            settings = settings_of(scene, self.plan.hardness_of(row))
            load = absolute_load(scene, heights, float(self.plan.load[row]))
            settings[load.kind] = load.value
            contact = bem.solve(heights, scene.grid.sides, **settings)
            self._fill_effort(contact, row)
            if not np.isfinite(contact.force):
                return Reason.NOT_FINITE
            return self._fill_results(contact, row)
        except bem.NotConverged as failure:
            self._fill_effort(failure.contact, row)
            return Reason.NOT_CONVERGED
        except bem.NoSolution:
            return _reason_without_solution(scene)
        except (ArithmeticError, np.linalg.LinAlgError):
            return Reason.ARITHMETIC

    def _fill_effort(self, contact: bem.Contact, row: int) -> None:
        """Fill in how much work the solver did for a contact, converged or not."""
        for name in EFFORT:
            self.columns[name][row] = getattr(contact, name)

    def _fill_results(self, contact: bem.Contact, row: int) -> Reason:
        """Fill in the quantities of a solved contact, and what a user's function returns for it.

        Return NOT_FINITE if an output is infinite or NaN, otherwise NONE. Errors of the function
        and of quantities that need a solve of their own (ArithmeticError) are raised.
        """
        store = self.scene.store
        outputs = {}
        if store.function:
            outputs = outputs_for_row(store, contact, self.plan.first + row)
        filled = {"heights"}  # by the surface
        if self.scene.quantity == "delta":
            filled.add("delta")  # by the plan
        for quantity in stored_quantities():
            if quantity.name in self.columns and quantity.name not in filled:
                self.columns[quantity.name][row] = quantity.of(contact)
        for name, value in outputs.items():
            self.columns[name][row] = value
        finite = np.isfinite(list(outputs.values())).all()
        return Reason.NONE if finite else Reason.NOT_FINITE


def _reason_without_solution(scene: Scene) -> Reason:
    """Return why a contact of a scene has no solution."""
    if scene.contact.hardness_limits is not None:
        return Reason.BEYOND_HARDNESS
    if scene.contact.boundary == "free":
        return Reason.NO_SOLUTION
    return Reason.FULL_CONTACT


def surface_of(scene: Scene, plan: Plan, row: int) -> Heights:
    """Make the surface of one row of a plan.

    If the scene has two rough bodies, it is the sum of both heights. The second body is drawn as it
    faces the first, so neither is turned over.

    Parameters
    ----------
    scene : Scene
        A completed scene, whose surfaces are ready (`make_ready`).
    plan : Plan
        Parameters of some of its rows.
    row : int
        Position of the row in the plan.

    Returns
    -------
    ndarray, shape (nx, ny)
        Heights above the lowest node [um].

    Raises
    ------
    InputError
        If the numbers are beyond all floats, or a map is missing. A SourceError, which is one, if
        the user's generator fails.
    """
    number = int(plan.surface[row])
    drawn = plan.parameters_of(row)
    table = scene.surface
    try:
        heights = table.heights(scene.grid, number, drawn, surface_random(scene, number))
        if table.against is None:
            return heights
        heights = heights + table.opposite_heights(
            scene.grid,
            number,
            drawn,
            surface_random(scene, number),
            surface_random(scene, number, OPPOSITE),
        )
    except ArithmeticError as error:
        raise InputError(
            f"surface {number} cannot be made in double precision ({type(error).__name__}): give"
            " other parameters"
        ) from error
    heights -= heights.min()
    return heights


def surface_numbered(scene: Scene, number: int) -> Heights:
    """Make the surface of an index, as the rows of a database have it.

    Parameters
    ----------
    scene : Scene
        A completed scene, whose surfaces are ready (`make_ready`).
    number : int
        Index of the surface, which may be beyond the scene's samples.

    Returns
    -------
    ndarray, shape (nx, ny)
        Heights above the lowest node [um].

    Raises
    ------
    InputError
        As `surface_of`.
    """
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

    Parameters
    ----------
    scene : Scene
        The scene.
    heights : ndarray, shape (nx, ny)
        Heights of the surface [um].
    delta, pressure, force : float, optional
        The load: far-field displacement [um], nominal pressure [MPa] or force [uN]; one of them.
    hardness : float, optional
        Hardness of the sample [MPa]; needed if every sample has its own, and the scene's otherwise.

    Returns
    -------
    bem.Contact
        The solved contact.

    Raises
    ------
    bem.NoSolution
        If no contact has this load.
    bem.NotConverged
        If the solver needs more iterations than the scene allows.
    ValueError
        If the hardness is needed, or the loads are not one.
    """
    settings = settings_of(scene, hardness)
    return bem.solve(
        heights, scene.grid.sides, delta, pressure=pressure, force=force, **settings
    )


def settings_of(scene: Scene, hardness: float | None) -> dict[str, Any]:
    """Return the arguments of `bem.solve` that are not the surface, its sides and the load.

    Parameters
    ----------
    scene : Scene
        The scene.
    hardness : float or None
        Hardness of the sample [MPa]; None for elastic bodies, and for the hardness that all samples
        of the scene have.

    Returns
    -------
    dict of str
        Keyword arguments.

    Raises
    ------
    ValueError
        If every sample has a hardness of its own, and none is given.
    """
    contact = scene.contact
    if hardness is None and contact.hardness_limits is not None:
        if contact.draws_hardness:
            raise ValueError(
                "every sample of this scene has a hardness of its own: give it"
            )
        hardness = contact.hardness_limits[0]
    settings = {name: getattr(contact, name) for name in SETTINGS}
    settings["spacing"] = scene.grid.spacing
    settings["hardness"] = hardness
    settings["threads"] = 1  # the ranks of a run share the processor already
    return settings


class AbsoluteLoad(NamedTuple, Generic[Load]):
    """A load, or an array of loads, as `solve_contact` takes it."""

    kind: Literal["delta", "pressure", "force"]  # name of the argument
    value: Load  # far-field displacement [um], nominal pressure [MPa] or force [uN]


def absolute_load(scene: Scene, heights: Heights, load: Load) -> AbsoluteLoad[Load]:
    """Turn a load in the scene's quantity, perhaps relative to the surface, into an absolute load.

    Parameters
    ----------
    scene : Scene
        The scene.
    heights : ndarray, shape (nx, ny)
        Heights of the surface [um].
    load : float or ndarray, shape (loads,)
        Load in the scene's quantity, one of `gen.scene.tables.UNITS`.

    Returns
    -------
    AbsoluteLoad
        The load with the name of the argument of `solve_contact`.
    """
    match scene.quantity:
        case "delta/height_rms":
            return AbsoluteLoad("delta", load * float(heights.std()))
        case "pressure/(E* slope_rms)":
            slope = rms_slope(heights, scene.grid.spacing)
            return AbsoluteLoad("pressure", load * scene.contact.e_star * slope)
        case "delta" | "pressure" | "force" as kind:
            return AbsoluteLoad(kind, load)
