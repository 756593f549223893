"""The picture of a database: one sample's heights and pressure, all areas, all solve times."""

import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gen.database import Reader
from gen.generation.plan import parameters
from gen.generation.sample import load_of, solve_contact, surface_of
from gen.maps.pictures import DECADES, LETTERS, contact_maps, load_text, plot_map
from gen.material import Bodies
from gen.quantities import AREA, DELTA, FORCE, PRESSURE, USUAL, typographic
from gen.runtime.errors import InputError
from gen.runtime.figure import figure_for, log_axis, save
from gen.runtime.terminal import shortened
from gen.scene import Scene, columns_for, parameter_columns
from gen.schema import Status

WIDTH = 11.0  # width of the picture [inches]


def draw_database(file: Path, picture: Path) -> None:
    """Draw the heights and the pressure of the row with the median area, all areas, all times."""
    figure = figure_for(picture, WIDTH, WIDTH)
    with Reader(file) as reader:
        done = np.flatnonzero(reader.column("status") == Status.DONE)
        if not done.size:
            raise InputError(f"{file} has no finished row to draw; run gen run first")
        wanted = {*USUAL, "solve_seconds", "hurst"}
        names = wanted & {column.name for column in reader.columns()}
        columns = {name: reader.column(name)[done] for name in names}
        scene, first = reader.scene, reader.rows.start
    typical = int(np.argsort(columns[AREA.name])[done.size // 2])
    ratio = scene.grid.sides[1] / scene.grid.sides[0]
    heights = [
        min(max(0.4 * WIDTH * ratio, 1.5), 0.6 * WIDTH) + 0.9,
        3.8,
    ]  # titles and labels too
    figure.set_size_inches(WIDTH, sum(heights) + 0.4)
    top, bottom = figure.subfigures(2, 1, height_ratios=heights)
    figure.suptitle(shortened(str(file)), fontsize=11, parse_math=False)
    _draw_sample(top.subplots(1, 2), scene, first + int(done[typical]))
    areas, times = bottom.subplots(1, 2)
    _draw_areas(bottom, areas, columns, scene)
    _draw_times(times, columns)
    save(figure, picture)


def _draw_sample(axes: NDArray[Any], scene: Scene, row: int) -> None:
    """Draw heights and contact pressure of one row side by side."""
    plan = parameters(scene, row, row + 1)
    heights, hardness = surface_of(scene, plan, 0), plan.hardness_of(0)
    boundary = scene.contact.boundary
    load = load_of(scene, heights, float(plan.load[0]))
    contact = solve_contact(scene, heights, hardness=hardness, **load)
    columns = parameter_columns(scene)
    units = {column.name: typographic(column.unit) for column in columns_for(scene)}
    drawn = ", ".join(
        f"{name} = {value:.3g}{'' if unit == '1' else f' {unit}'}"
        for name, value in plan.parameters_of(0).items()
        for unit in [units[columns[name]]]
    )
    surface = f"surface of row {row}{': ' if drawn else ''}{drawn}"
    pressure = (
        f"contact at {load_text(contact, scene.quantity)},"
        f" {Bodies(contact.problem.modulus, hardness).text}"
        f"{'' if boundary == 'free' else f', {boundary} boundary'}:"
        f" {contact.area_percent:.3g} % of {contact.pressure.size} nodes, the median of rows done"
    )
    # A narrow map is centred in its half, so that fewer letters fit into a line above it.
    letters = int(
        LETTERS * min(1.0, 0.4 + 0.6 * scene.grid.sides[0] / scene.grid.sides[1])
    )
    for axis, surface_map in zip(
        axes, contact_maps(contact, surface, pressure), strict=True
    ):
        plot_map(axis, surface_map, letters=letters)


def _draw_areas(
    figure: Any, axis: Any, columns: dict[str, NDArray[Any]], scene: Scene
) -> None:
    """Draw the effective contact area of every row over the load that the scene draws."""
    loads, label = columns[DELTA.name], DELTA.label
    if scene.quantity.startswith("pressure"):
        cells = math.prod((*scene.grid.shape, *scene.grid.spacing))
        loads, label = columns[FORCE.name] / cells, PRESSURE.label
    elif scene.quantity == "force":
        loads, label = columns[FORCE.name], FORCE.label
    coloured = {"c": columns["hurst"], "cmap": "cividis"} if "hurst" in columns else {}
    dots = axis.scatter(loads, columns[AREA.name], s=9, **coloured)
    if coloured:
        figure.colorbar(dots, ax=axis, label="Hurst exponent H")
    axis.set(title=f"{columns['delta'].size} samples", xlabel=label, ylabel=AREA.label)
    axis.set_ylim(bottom=0)
    if loads.min() > 0 and loads.max() > DECADES * loads.min():
        log_axis(axis.xaxis)


def _draw_times(axis: Any, columns: dict[str, NDArray[Any]]) -> None:
    """Draw the time of every solve over the contact area."""
    known = np.isfinite(columns["solve_seconds"])
    milliseconds = 1e3 * columns["solve_seconds"][known]
    if not known.any():
        axis.set(title="no solve time is known")
        return
    axis.plot(columns[AREA.name][known], milliseconds, ".", color="tab:blue", ms=4)
    axis.axhline(milliseconds.mean(), color="tab:red", lw=1, label="mean of this run")
    axis.legend(
        loc="lower right"
    )  # light contacts, which take less time, are on the left
    axis.set(
        title="times of the solves",
        xlabel=AREA.label,
        ylabel="time of the solve [ms]",
    )
    log_axis(axis.yaxis)  # a single solve that waited for the machine flattens nothing
