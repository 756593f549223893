"""Draw a database: heights and pressure of one row, areas and solve times of all rows."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bem import Contact
from gen.database import Reader
from gen.generation.plan import parameters
from gen.generation.sample import absolute_load, solve_contact, surface_of
from gen.maps.contact_pictures import DECADES, contact_maps, load_text
from gen.maps.pictures import plot_map
from gen.material import Bodies
from gen.quantities import AREA, DELTA, FORCE, PRESSURE, USUAL, typographic
from gen.runtime.errors import InputError
from gen.runtime.figure import figure_for, log_axis, save
from gen.runtime.terminal import shortened
from gen.scene import Scene, columns_for, parameter_columns
from gen.schema import Status

WIDTH = 7.0
"""Width of the picture [inches]: its letters are legible where a phone shows it 400 pixels wide."""

DPI = 160
"""Resolution of the picture [dots per inch]."""

LINE = 36
"""Number of letters in a line of a title above a map that fills its half of the picture."""

COLUMNS = frozenset((*USUAL, "solve_seconds", "hurst"))
"""Columns that are drawn if a database has them."""


@dataclass(frozen=True, eq=False)
class _PlottedDatabase:
    """The columns and the row of a database that are drawn."""

    scene: Scene
    # Values of the done rows by the names of the columns, each of shape (rows,).
    columns: dict[str, NDArray[Any]]
    median_row: int  # number of the done row with the median area


def plot_database(file: Path, picture: Path) -> None:
    """Draw surface and pressure of the done row with the median area, and areas and solve times.

    The surface of the row is generated again, and its contact is solved again. The areas and the
    solve times of all done rows are drawn.

    Parameters
    ----------
    file : Path
        The database.
    picture : Path
        The picture to write, whose suffix gives the format.

    Raises
    ------
    InputError
        If the database has no row that is done, or the picture cannot be written.
    """
    # The height is a placeholder: it depends on the database, which is read after this check.
    figure = figure_for(picture, width=WIDTH, height=WIDTH)
    database = _read(file)
    upper_height = _height_of_maps(database.scene)
    lower_height = 2.8
    title_height = 0.3  # [inches], as the other two heights
    figure.set_size_inches(WIDTH, upper_height + lower_height + title_height)
    top, bottom = figure.subfigures(2, 1, height_ratios=[upper_height, lower_height])
    figure.suptitle(shortened(str(file)), fontsize=10, parse_math=False)
    _plot_row(top.subplots(1, 2), database.scene, database.median_row)
    areas, times = bottom.subplots(1, 2)
    _plot_areas(bottom, areas, database)
    _plot_times(times, database.columns)
    save(figure, picture, dpi=DPI)


def _read(file: Path) -> _PlottedDatabase:
    """Read the parts of a database that are drawn; InputError if no row is done."""
    with Reader(file) as reader:
        # Positions of the done rows in the file.
        done = np.flatnonzero(reader.column("status") == Status.DONE)
        if not done.size:
            raise InputError(f"{file} has no finished row to draw; run gen run first")
        names = COLUMNS & {column.name for column in reader.columns()}
        columns = {name: reader.column(name)[done] for name in names}
        by_area = np.argsort(columns[AREA.name])
        median_position = int(done[by_area[done.size // 2]])
        # A database that is a part of a scene may begin with a later row than row 0.
        median_row = reader.rows.start + median_position
        return _PlottedDatabase(
            scene=reader.scene, columns=columns, median_row=median_row
        )


def _height_of_maps(scene: Scene) -> float:
    """Return the height of the upper half of the picture, with both maps and their labels [inches].

    Maps keep the proportions of the patch unless it is very long or very narrow.
    """
    side_x, side_y = scene.grid.sides
    map_height = 0.35 * WIDTH * side_y / side_x
    label_height = 1.1
    return min(max(map_height, 1.5), 0.6 * WIDTH) + label_height


def _plot_row(axes: NDArray[Any], scene: Scene, row: int) -> None:
    """Generate the surface of a row, solve its contact, and draw heights and pressure.

    `axes` are the two panels of the maps, shape (2,).
    """
    plan = parameters(scene, row, row + 1)  # of this row alone, at position 0
    heights = surface_of(scene, plan, 0)
    load = absolute_load(scene, heights, float(plan.load[0]))
    hardness = plan.hardness_of(0)
    contact = solve_contact(
        scene,
        heights,
        hardness=hardness,
        layer=plan.layer_of(0),
        **{load.kind: load.value},
    )
    surface_title = _title_of_surface(scene, row, plan.parameters_of(0))
    contact_title = _title_of_contact(scene, contact)
    # A narrow map is centred in its half of the picture. Its title begins at its left side, so that
    # fewer letters fit into a line: at least 0.4 of those above a square map.
    side_x, side_y = scene.grid.sides
    letters = int(LINE * min(1.0, 0.4 + 0.6 * side_x / side_y))
    maps = contact_maps(contact, surface_title, contact_title)
    for axis, surface_map in zip(axes, maps, strict=True):
        plot_map(axis, surface_map, letters=letters)


def _title_of_surface(scene: Scene, row: int, values: Mapping[str, float]) -> str:
    """Return the title of the map of heights of a row.

    `values` are the parameters of the surface by their keys in the scene; they are written with the
    units of their columns.
    """
    columns = parameter_columns(scene)
    units = {column.name: typographic(column.unit) for column in columns_for(scene)}
    assignments = []
    for name, value in values.items():
        assignment = f"{name} = {value:.3g}"
        unit = units[columns[name]]
        if unit != "1":
            assignment += f" {unit}"
        assignments.append(assignment)
    title = f"surface of row {row}"
    if assignments:
        title += f": {', '.join(assignments)}"
    return title


def _title_of_contact(scene: Scene, contact: Contact) -> str:
    """Return the title of the map of pressures: the load, the bodies, the boundary, the area."""
    problem = contact.problem
    bodies = Bodies(e_star=problem.modulus, hardness=problem.hardness)
    boundary = ""
    if problem.boundary != "free":
        boundary = f", {problem.boundary} boundary"
    return (
        f"contact at {load_text(contact, scene.quantity)}, {bodies.text}{boundary}:"
        f" {contact.area_percent:.3g} % of {contact.pressure.size} nodes, the median of rows done"
    )


def _plot_areas(figure: Any, axis: Any, database: _PlottedDatabase) -> None:
    """Draw the contact area of every done row over its load, coloured by the Hurst exponent if any.

    The load is a pressure or a force if the scene gives one, otherwise Delta.
    """
    scene = database.scene
    columns = database.columns
    loads = columns[DELTA.name]
    label = DELTA.label
    if scene.quantity.startswith("pressure"):
        patch = math.prod((*scene.grid.shape, *scene.grid.spacing))  # area [um2]
        loads = columns[FORCE.name] / patch  # [MPa]
        label = PRESSURE.label
    elif scene.quantity == "force":
        loads = columns[FORCE.name]
        label = FORCE.label
    areas = columns[AREA.name]
    if "hurst" in columns:
        dots = axis.scatter(loads, areas, s=9, c=columns["hurst"], cmap="cividis")
        figure.colorbar(dots, ax=axis, label="Hurst exponent H")
    else:
        axis.scatter(loads, areas, s=9)
    axis.set(title=f"{loads.size} samples", xlabel=label, ylabel=AREA.label)
    axis.set_ylim(bottom=0)
    if loads.min() > 0 and loads.max() > DECADES * loads.min():
        log_axis(axis.xaxis)


def _plot_times(axis: Any, columns: Mapping[str, NDArray[Any]]) -> None:
    """Draw the time of every solve over the contact area, and the mean time as a line.

    `columns` are the values of the done rows. A row without a measured time is left out.
    """
    measured = np.isfinite(columns["solve_seconds"])
    if not measured.any():
        axis.set(title="no solve time is known")
        return
    milliseconds = 1e3 * columns["solve_seconds"][measured]
    axis.plot(columns[AREA.name][measured], milliseconds, ".", color="tab:blue", ms=4)
    axis.axhline(milliseconds.mean(), color="tab:red", lw=1, label="mean of this run")
    # Light contacts, which take less time, leave room at the lower right.
    axis.legend(loc="lower right")
    axis.set(
        title="times of the solves",
        xlabel=AREA.label,
        ylabel="time of the solve [ms]",
    )
    # On a logarithmic axis a single solve that waited for the machine does not flatten the others.
    log_axis(axis.yaxis)
