"""The picture of a database: one sample's heights and pressure, all areas, all solve times."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gen.database import Reader
from gen.generation.plan import parameters
from gen.generation.sample import load_of, solve_contact, surface_of
from gen.maps import contact_maps, draw_map
from gen.runtime.errors import InputError
from gen.runtime.figure import new_figure, require_picture_name, save
from gen.runtime.terminal import shortened
from gen.scene import Scene
from gen.schema import Status, columns_for

LETTERS = 50
"""Letters in a line above a map that fills its half of the picture."""


def draw_database(file: Path, picture: Path) -> None:
    """Draw one sample's heights and pressure, all areas, and all solve times.

    The sample is the done row with the median area; its fields are computed again.

    Parameters
    ----------
    file : Path
        Database to read.
    picture : Path
        Picture to write; its suffix gives the format (.png, .svg or .pdf).

    Raises
    ------
    InputError
        If the database cannot be read or has no done row, matplotlib is not installed, or the
        picture cannot be written.
    """
    require_picture_name(picture)
    figure = new_figure(11, 8.2, dpi=110)
    with Reader(file) as reader:
        done = np.flatnonzero(reader.column("status") == Status.DONE)
        if not done.size:
            raise InputError(f"{file} has no finished row to draw; run gen run first")
        columns = {
            name: reader.column(name)[done] for name in ("delta", "area_percent", "solve_seconds")
        }
        if "hurst" in (column.name for column in reader.columns()):
            columns["hurst"] = reader.column("hurst")[done]
        scene, first = reader.scene, reader.rows.start
    typical = int(np.argsort(columns["area_percent"])[done.size // 2])
    axes = figure.subplots(2, 2)
    figure.suptitle(shortened(str(file)), fontsize=11, parse_math=False)
    _draw_sample(axes[0], scene, first + int(done[typical]))
    _draw_areas(figure, axes[1][0], columns)
    _draw_times(axes[1][1], columns)
    save(figure, picture)


def _draw_sample(axes: NDArray[Any], scene: Scene, row: int) -> None:
    """Draw heights and contact pressure of one row side by side."""
    plan = parameters(scene, row, row + 1)
    heights, hardness = surface_of(scene, plan, 0), plan.hardness_of(0)
    boundary = scene.contact.boundary
    load = load_of(scene, heights, float(plan.load[0]))
    contact = solve_contact(scene, heights, hardness=hardness, **load)
    units = {column.name: column.unit.replace("um", "µm") for column in columns_for(scene)}
    drawn = ", ".join(
        f"{name} = {value:.3g}{'' if units[name] == '1' else f' {units[name]}'}"
        for name, value in plan.parameters_of(0).items()
    )
    surface = f"surface of row {row}{': ' if drawn else ''}{drawn}"
    pressure = (
        f"contact at Δ = {contact.delta:.3g} µm, E* = {contact.problem.modulus:g} MPa"
        f"{'' if hardness is None else f', hardness {hardness:.3g} MPa'}"
        f"{'' if boundary == 'free' else f', {boundary} boundary'}:"
        f" {contact.area_percent:.3g} % of {contact.pressure.size} nodes, the median of rows done"
    )
    for axis, surface_map in zip(axes, contact_maps(contact, surface, pressure), strict=True):
        draw_map(axis, surface_map, letters=_letters(scene.sides))


def _letters(sides: tuple[float, float]) -> int:
    """Return the letters that fit into a line above a map; a narrow one is centred in its half."""
    return int(LETTERS * min(1.0, 0.4 + 0.6 * sides[0] / sides[1]))


def _draw_areas(figure: Any, axis: Any, columns: dict[str, NDArray[Any]]) -> None:
    """Draw the effective contact area of every row over its far-field displacement."""
    coloured = {"c": columns["hurst"], "cmap": "cividis"} if "hurst" in columns else {}
    dots = axis.scatter(columns["delta"], columns["area_percent"], s=9, **coloured)
    if coloured:
        figure.colorbar(dots, ax=axis, label="Hurst exponent H")
    axis.set(
        title=f"{columns['delta'].size} samples",
        xlabel="far-field displacement Δ [µm]",
        ylabel="effective contact area [%]",
    )
    axis.set_ylim(bottom=0)


def _draw_times(axis: Any, columns: dict[str, NDArray[Any]]) -> None:
    """Draw the time of every solve over the contact area."""
    known = np.isfinite(columns["solve_seconds"])
    milliseconds = 1e3 * columns["solve_seconds"][known]
    if not known.any():
        axis.set(title="no solve time is known")
        return
    axis.plot(columns["area_percent"][known], milliseconds, ".", color="tab:blue", ms=4)
    axis.axhline(milliseconds.mean(), color="tab:red", lw=1)
    axis.set(
        title=f"{milliseconds.mean():.1f} ms a solve on average",
        xlabel="effective contact area [%]",
        ylabel="time of the solve [ms]",
    )
    # A single solve that waited for the machine must not flatten the rest of the picture.
    top = 1.3 * np.quantile(milliseconds, 0.99)
    axis.set_ylim(0, top)
    if slower := np.count_nonzero(milliseconds > top):
        note = f"{slower} above, up to {milliseconds.max():.3g} ms"
        axis.text(0.98, 0.97, note, ha="right", va="top", transform=axis.transAxes)
