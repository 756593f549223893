"""Computation of the rows of a database: the surface, its statistics, and the contact."""

import itertools
import socket
import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Generic, Literal, NamedTuple, TypeVar

import numpy as np

import bem
from bem.bodies import HALF_SPACE
from bem.coarsening import Coarsening, CoarserMap
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

Load = TypeVar("Load", float, Values)
"""One load, or an array of loads of shape (loads,)."""

EFFORT = ("iterations", "convolutions", "residual")
"""Columns about the solver's work. They have the names of the attributes of `bem.Contact` that fill
them in, whether or not the solver has converged."""

HOST_BYTES = 64
"""Largest number of bytes of a machine's name in the column "host"; a longer name is cut."""

UNSOLVED = (
    ArithmeticError,
    np.linalg.LinAlgError,
    InputError,
    bem.NoSolution,
    bem.NotConverged,
)
"""Exceptions that say that a surface cannot be made, or that a contact is not solved.

They include SourceError, which is an InputError. Where an error of the user's function has to end
the run, an `except SourceError` comes before the one for these.
"""

SETTINGS = (
    "modulus",
    "poisson",
    "kernel",
    "far_field",
    "boundary",
    "rtol",
    "max_iterations",
)
"""Keys of a scene's table [contact] whose values `bem.solve` takes unchanged, by the same names."""


def compute_rows(
    scene: Scene, start: int, stop: int, rank: int = 0, limit: float | None = None
) -> Columns:
    """Make, describe and solve consecutive samples of a scene, and return their rows.

    A row is done if its contact is solved. A statistic that is not defined on its surface is then
    NaN, and the row's reason says so. A row fails, with a reason, if its surface cannot be made or
    its contact has no solution. A row stays pending if its surface or contact takes too long.

    Parameters
    ----------
    scene : Scene
        A completed scene, whose surfaces are ready (`make_ready`).
    start, stop : int
        Numbers of the first row and of the row behind the last one.
    rank : int
        MPI rank of this process, for the column "rank".
    limit : float, optional
        Largest time for a surface, and for each contact [s]; no limit by default.

    Returns
    -------
    dict of str to ndarray, shape (stop - start,) or (stop - start, nx, ny)
        All columns of `gen.scene.columns_for` by their names. Values that were not computed are the
        columns' fill values.

    Raises
    ------
    InputError
        If a contact does not fit into memory.
    SourceError
        If a function of the user's fails, or a map is missing. It is a kind of InputError.
    """
    plan = parameters(scene, start, stop)
    columns = _empty_columns(scene, stop - start) | planned_columns(scene, plan)
    columns["rank"][:] = rank
    columns["host"][:] = socket.gethostname().encode()[:HOST_BYTES]
    samples = _Samples(scene=scene, plan=plan, columns=columns, limit=limit)
    # Positions of the first row of each surface, and the position behind the last row. No surface
    # has the index -1, so both ends are edges.
    edges = np.flatnonzero(np.diff(plan.surface, prepend=-1, append=-1))
    try:
        for first, last in itertools.pairwise(edges.tolist()):
            samples.compute(first, last)
    except MemoryError:
        raise too_little_for_solve(scene.grid.shape) from None
    return columns


def _empty_columns(scene: Scene, rows: int) -> Columns:
    """Return all columns of a scene by their names, with fill values for a number of rows."""
    return {
        column.name: np.full(
            column.shape(rows, scene.grid.shape), column.fill, column.dtype
        )
        for column in columns_for(scene)
    }


@dataclass(frozen=True, eq=False)
class _Samples:
    """Consecutive samples whose columns are filled in.

    A row is given by its position in the plan and in the columns; 0 is the first sample.
    """

    scene: Scene
    plan: Plan  # planned parameters of the samples
    columns: Columns  # all columns by their names; the methods fill them in
    # Largest time for a surface, and for each contact [s]; None for no limit.
    limit: float | None

    def compute(self, first: int, last: int) -> None:
        """Compute the rows first to last - 1, which share a surface, and fill in their columns."""
        heights = self._make_surface(first, last)
        if heights is None:
            return  # the rows stay pending, or have become failed ones
        for row in range(first, last):
            began = time.perf_counter()
            try:
                with time_limit(self.limit):
                    reason = self._solve(heights, row)
            except Overtime:
                continue  # the row stays pending
            self.columns["solve_seconds"][row] = time.perf_counter() - began
            # The column has the surface's reason already, which is NONE or NO_STATISTICS. A
            # contact that has failed replaces it; a contact that is solved does not.
            if reason is not Reason.NONE:
                self.columns["reason"][row] = reason
            done = self.columns["reason"][row] in DONE_REASONS
            self.columns["status"][row] = Status.DONE if done else Status.FAILED

    def _make_surface(self, first: int, last: int) -> Heights | None:
        """Make the surface of the rows first to last - 1, and return its heights [um].

        The columns of its statistics and its time are filled in, and the reason NO_STATISTICS if a
        statistic is undefined. The result is None in two cases: if the surface takes too long, its
        rows stay pending; if it cannot be made or described, its rows become failed ones.
        """
        rows = slice(first, last)
        began = time.perf_counter()
        try:
            with time_limit(self.limit):
                heights = surface_of(self.scene, self.plan, first)
                description = describe(heights, self.scene.grid.spacing)
        except Overtime:
            return None  # the rows stay pending
        except SourceError:
            raise  # the user's function or a map is wrong, which ends the run
        except (ArithmeticError, InputError):  # numbers are beyond the range of floats
            self.columns["reason"][rows] = Reason.ARITHMETIC
            self.columns["status"][rows] = Status.FAILED
            return None
        for name, value in description.values.items():
            self.columns[name][rows] = value
        if description.reason:
            self.columns["reason"][rows] = Reason.NO_STATISTICS
        if self.scene.store.wants("heights"):
            self.columns["heights"][rows] = heights
        # The rows share the time of their surface equally.
        elapsed = time.perf_counter() - began
        self.columns["surface_seconds"][rows] = elapsed / (last - first)
        return heights

    def _solve(self, heights: Heights, row: int) -> Reason:
        """Solve the contact of a row on a surface with these heights [um], and fill in its columns.

        Return why the row fails, or NONE if it is done. A SourceError of the user's function for
        outputs is raised.
        """
        scene = self.scene
        try:
            hardness = self.plan.hardness_of(row)
            settings = settings_of(scene, hardness, self.plan.layer_of(row))
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
        """Fill in the columns of `EFFORT` for a contact, whether or not it has converged."""
        for name in EFFORT:
            self.columns[name][row] = getattr(contact, name)

    def _fill_results(self, contact: bem.Contact, row: int) -> Reason:
        """Fill in the quantities of a solved contact, and the outputs of the user's function.

        Return NOT_FINITE if an output is infinite or NaN, otherwise NONE. Raises a SourceError or
        an ArithmeticError of the function, and an ArithmeticError of a quantity that needs another
        solve.
        """
        store = self.scene.store
        outputs = {}
        if store.function:
            # Called before any column is filled in, so that a row whose function fails keeps no
            # results.
            outputs = outputs_for_row(store, contact, self.plan.first + row)
        filled = {"heights"}  # filled in with the surface
        if self.scene.quantity == "delta":
            filled.add("delta")  # filled in with the plan
        for quantity in stored_quantities():
            if quantity.name in self.columns and quantity.name not in filled:
                self.columns[quantity.name][row] = quantity.of(contact)
        for name, value in outputs.items():
            self.columns[name][row] = value
        if np.isfinite(list(outputs.values())).all():
            return Reason.NONE
        return Reason.NOT_FINITE


def _reason_without_solution(scene: Scene) -> Reason:
    """Return the reason of a row for whose contact `bem.solve` has raised NoSolution.

    The scene's settings tell it, because each of them allows only one cause: with a hardness, a
    load that the hardness does not bear; on a free patch, a Delta beyond the one that a compliant
    far field can have; on a patch without edges, a Delta beyond full contact.
    """
    if scene.contact.hardness_limits is not None:
        return Reason.BEYOND_HARDNESS
    if scene.contact.boundary == "free":
        return Reason.NO_SOLUTION
    return Reason.FULL_CONTACT


def surface_of(scene: Scene, plan: Plan, row: int) -> Heights:
    """Return the surface of one row of a plan, on the grid on which its contact is solved.

    If the scene has two rough bodies, the heights of both are added. The second body is generated
    as it faces the first one, so neither of them is turned over here.

    Parameters
    ----------
    scene : Scene
        A completed scene, whose surfaces are ready (`make_ready`).
    plan : Plan
        Parameters of some of its rows.
    row : int
        Position of the row in the plan; 0 is its first row.

    Returns
    -------
    ndarray, shape (nx, ny)
        Heights above the lowest node [um].

    Raises
    ------
    InputError
        If the surface cannot be made in double precision.
    SourceError
        If a map is missing, or the user's generator fails. It is a kind of InputError.
    """
    surface = made_surface_of(scene, plan, row)
    return on_grid_of_contacts(scene, surface).heights


def made_surface_of(scene: Scene, plan: Plan, row: int) -> Heights:
    """Make the surface of one row of a plan, on the grid on which the scene's surfaces are made.

    Parameters
    ----------
    scene : Scene
        A completed scene, whose surfaces are ready (`make_ready`).
    plan : Plan
        Parameters of some of its rows.
    row : int
        Position of the row in the plan; 0 is its first row.

    Returns
    -------
    ndarray, shape of `Scene.made_grid`
        Heights above the lowest node [um].

    Raises
    ------
    InputError
        If the surface cannot be made in double precision.
    SourceError
        If a map is missing, or the user's generator fails. It is a kind of InputError.
    """
    number = int(plan.surface[row])  # index of the surface
    drawn = plan.parameters_of(row)
    table = scene.surface
    grid = scene.made_grid
    try:
        heights = table.heights(grid, number, drawn, surface_random(scene, number))
        if table.against is None:
            return heights
        # The second surface may depend on the first one, whose generator it gets in its first
        # state.
        heights = heights + table.opposite_heights(
            grid,
            number,
            drawn,
            first=surface_random(scene, number),
            random=surface_random(scene, number, OPPOSITE),
        )
    except ArithmeticError as error:
        raise InputError(
            f"surface {number} cannot be made in double precision ({type(error).__name__}): give"
            " other parameters"
        ) from error
    heights -= heights.min()
    return heights


def on_grid_of_contacts(
    scene: Scene, heights: Heights, body: bem.Body = HALF_SPACE
) -> CoarserMap:
    """Return a surface on the grid on which the contacts of a scene are solved.

    Parameters
    ----------
    scene : Scene
        The scene. Its grid has fewer nodes than its surfaces if a trial has found fewer for the
        accuracy of the scene.
    heights : ndarray, shape of `Scene.made_grid`
        Heights of the surface as it is made [um].
    body : bem.Body
        The body by which slopes are weighted, by default a half-space.

    Returns
    -------
    CoarserMap
        Heights above the lowest node, shape of `Scene.grid` [um], and the share of the weighted
        mean square slope that this grid lacks. If both grids are the same, `heights` is returned
        as it is.
    """
    shape = scene.grid.shape
    if heights.shape == shape:
        return CoarserMap(heights, 0.0)
    spacing_x, spacing_y = scene.made_grid.spacing
    coarsening = Coarsening(
        heights, scene.contact.boundary, spacing_y / spacing_x, body.reduced(spacing_x)
    )
    coarser = coarsening.on(shape)
    return CoarserMap(coarser.heights - coarser.heights.min(), coarser.dropped)


def surface_numbered(scene: Scene, number: int) -> Heights:
    """Make the surface with an index, which is the one that a database of the scene has.

    Parameters
    ----------
    scene : Scene
        A completed scene, whose surfaces are ready (`make_ready`).
    number : int
        Index of the surface. It may be beyond the surfaces of the scene's samples.

    Returns
    -------
    ndarray, shape (nx, ny)
        Heights above the lowest node [um].

    Raises
    ------
    InputError
        If the surface cannot be made in double precision.
    SourceError
        If a map is missing, or the user's generator fails. It is a kind of InputError.
    """
    first_row = number * scene.samples_per_surface
    plan = parameters(scene, first_row, first_row + 1)
    return surface_of(scene, plan, row=0)


def solve_contact(
    scene: Scene,
    heights: Heights,
    delta: float | None = None,
    hardness: float | None = None,
    *,
    pressure: float | None = None,
    force: float | None = None,
    layer: Mapping[str, float] | None = None,
) -> bem.Contact:
    """Solve the contact of a surface at one load, with the scene's settings.

    Parameters
    ----------
    scene : Scene
        The scene.
    heights : ndarray, shape (nx, ny)
        Heights of the surface [um].
    delta, pressure, force : float, optional
        The load: far-field displacement [um], nominal pressure [MPa] or force [uN]. Exactly one of
        them is given.
    hardness : float, optional
        Hardness of the softer body [MPa]. By default it is that of the scene, or the bodies are
        elastic if the scene has none. It is required if the scene draws a hardness for each sample.
    layer : mapping of str to float, optional
        Drawn numbers of the layer, as `Plan.layer_of` returns them. They are required if the scene
        draws them for each sample.

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
        If a required hardness or layer is missing, or not exactly one load is given.
    """
    settings = settings_of(scene, hardness, layer)
    return bem.solve(
        heights, scene.grid.sides, delta, pressure=pressure, force=force, **settings
    )


def settings_of(
    scene: Scene, hardness: float | None, layer: Mapping[str, float] | None = None
) -> dict[str, Any]:
    """Return all arguments of `bem.solve` but the heights, the sides and the load.

    Parameters
    ----------
    scene : Scene
        The scene.
    hardness : float or None
        Hardness of the softer body [MPa]. If it is None, the hardness is that of the scene, or the
        bodies are elastic if the scene has none.
    layer : mapping of str to float, optional
        Drawn numbers of the layer, as `Plan.layer_of` returns them. They are required if the scene
        draws them for each sample.

    Returns
    -------
    dict of str to object
        Values of the keyword arguments by their names.

    Raises
    ------
    ValueError
        If `hardness` or `layer` is None, but the scene draws it for each sample.
    """
    contact = scene.contact
    if hardness is None and contact.hardness_limits is not None:
        if contact.draws_hardness:
            raise ValueError(
                "every sample of this scene has a hardness of its own: give it"
            )
        hardness = contact.hardness_limits[0]
    settings = {name: getattr(contact, name) for name in SETTINGS}
    if contact.layer is not None:
        if layer is None and contact.layer.drawn:
            raise ValueError("every sample of this scene has a layer of its own: give it")
        settings["body"] = contact.body(layer or {})
        del settings["modulus"], settings["poisson"]
    settings["spacing"] = scene.grid.spacing
    settings["hardness"] = hardness
    settings["threads"] = 1  # more threads would compete with the other ranks of a run
    return settings


class AbsoluteLoad(NamedTuple, Generic[Load]):
    """A load, or an array of loads, in one of the quantities that `solve_contact` takes."""

    kind: Literal["delta", "pressure", "force"]  # name of the argument of `solve_contact`
    value: Load  # far-field displacement [um], nominal pressure [MPa] or force [uN]


def absolute_load(scene: Scene, heights: Heights, load: Load) -> AbsoluteLoad[Load]:
    """Turn a load in the scene's quantity into a displacement, a pressure or a force.

    A scene can give its loads relative to the roughness of each surface. Such a load is multiplied
    by the rms height, or by E* and the rms slope.

    Parameters
    ----------
    scene : Scene
        The scene.
    heights : ndarray, shape (nx, ny)
        Heights of the surface [um].
    load : float or ndarray, shape (loads,)
        Load in the scene's quantity, whose unit is in `gen.scene.tables.UNITS`.

    Returns
    -------
    AbsoluteLoad
        The load, in the form of `load`, with the name of the argument that it is.
    """
    match scene.quantity:
        case "delta/height_rms":
            return AbsoluteLoad(kind="delta", value=load * float(heights.std()))
        case "pressure/(E* slope_rms)":
            slope = rms_slope(heights, scene.grid.spacing)
            pressure = load * scene.contact.e_star * slope
            return AbsoluteLoad(kind="pressure", value=pressure)
        case "delta" | "pressure" | "force" as kind:
            return AbsoluteLoad(kind=kind, value=load)
