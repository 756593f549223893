"""Figures and maps, and what a database holds; the home of matplotlib in this package."""

from __future__ import annotations

import textwrap
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gen.database import Reader
from gen.generation.plan import parameters
from gen.generation.sample import solve_contact, surface_of
from gen.runtime.errors import InputError
from gen.runtime.output import write
from gen.scene import Scene
from gen.schema import Status

if TYPE_CHECKING:
    from bem import Contact

Values = NDArray[np.float64]

LETTERS = 110
"""Of a title that fits into a line."""
MOST = 99
"""Percentile at which a colour scale ends where few values would take most of it."""


def draw_database(file: Path, picture: Path) -> None:
    """Draw one sample's heights and pressure, all areas, and all solve times.

    The sample is the done row with the median area; its fields are computed again.

    Parameters
    ----------
    file : the database
    picture : the image to write, its ending says the format (png, svg, pdf)

    Raises
    ------
    InputError
        If the database cannot be read or has no done row, matplotlib is not installed, or the
        picture cannot be written.
    """
    figure = new_figure(picture)
    with Reader(file) as reader:
        done = np.flatnonzero(reader.column("status") == Status.DONE)
        if not done.size:
            raise InputError(f"{file} has no finished row to draw; run gen run first")
        columns = {
            name: reader.column(name)[done]
            for name in ("delta", "area_percent", "hurst", "solve_seconds")
        }
        scene, first = reader.scene, reader.rows.start
    typical = int(np.argsort(columns["area_percent"])[done.size // 2])
    axes = figure.subplots(2, 2)
    figure.suptitle(shortened(str(file)), fontsize=11, parse_math=False)
    _draw_sample(axes[0], scene, first + int(done[typical]))
    _draw_areas(figure, axes[1][0], columns)
    _draw_times(axes[1][1], columns)
    save(figure, picture)


def new_figure(picture: Path) -> Any:
    """An empty figure for a picture; refused before anything is computed for it.

    Raises
    ------
    InputError
        If matplotlib is not installed, or the name is not that of a picture
    """
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise InputError("drawing needs matplotlib: install the extra 'plot'") from None
    if picture.suffix.lower() not in {".png", ".svg", ".pdf"}:
        raise InputError(f"{picture}: give the name of a picture, ending in .png, .svg or .pdf")
    return Figure(figsize=(11, 8.2), dpi=110, layout="constrained")


def shortened(name: str) -> str:
    """A file's name that fits into a line."""
    return name if len(name) <= LETTERS else f"{name[: LETTERS // 3]} ... {name[-LETTERS // 2 :]}"


def save(figure: Any, picture: Path) -> None:
    """Draw in memory, then write the picture whole."""
    drawn = BytesIO()
    figure.savefig(drawn, format=picture.suffix[1:].lower())
    write(picture, drawn.getvalue(), "picture")


@dataclass(frozen=True, eq=False)
class Map:
    """A field over a surface, as it is to be drawn.

    Attributes
    ----------
    field : (nx, ny), masked where there is nothing to draw
    spacing : along x and y [um]
    title : of the map
    quantity, unit : that the field holds
    colours : name of a colour map
    """

    field: Values
    spacing: tuple[float, float]
    title: str
    quantity: str
    unit: str
    colours: str


def maps_of(contact: Contact, heights: str, spots: str) -> tuple[Map, Map]:
    """Heights and contact pressure of a contact, under these titles."""
    problem = contact.problem
    pressure = np.ma.masked_equal(contact.pressure, 0)
    return (
        Map(problem.heights, problem.spacing, heights, "height", "µm", "viridis"),
        Map(pressure, problem.spacing, spots, "pressure", "MPa", "inferno_r"),
    )


def draw_map(axis: Any, drawn: Map, letters: int) -> None:
    """Draw a field with colours that a few outliers do not set.

    Parameters
    ----------
    axis : to draw into
    drawn : the field, its title and colours
    letters : that fit into a line of the title
    """
    nx, ny = drawn.field.shape
    width, length = drawn.spacing[0] * (nx - 1), drawn.spacing[1] * (ny - 1)
    (low, high), extend, said = _scale(np.ma.compressed(drawn.field), drawn.unit)
    image = axis.imshow(
        drawn.field.T,
        origin="lower",
        extent=(0.0, width, 0.0, length),
        cmap=drawn.colours,
        vmin=low,
        vmax=high,
    )
    axis.set_facecolor("0.93")
    # As high as the map, and about as wide for tall and oblong ones.
    thickness = 0.045 * min(max(np.sqrt(length / width), 1 / 3), 3.0)
    beside = axis.inset_axes((1 + thickness, 0.0, thickness, 1.0))
    label = f"{drawn.quantity} [{drawn.unit}]"
    axis.figure.colorbar(image, cax=beside, label=label, extend=extend)
    lines = [*textwrap.wrap(drawn.title, letters), *textwrap.wrap(said, letters)]
    axis.set_title("\n".join(lines), loc="left", fontsize=10, parse_math=False)
    axis.set(xlabel="x [µm]", ylabel="y [µm]")


def _scale(values: Values, unit: str) -> tuple[tuple[float, float], str, str]:
    """Limits of a colour scale, its open ends, and what to say about them.

    The scale takes in all values, unless those beyond a percentile would take more than half of
    the room that the others have.
    """
    if not values.size:
        return (0.0, 1.0), "neither", ""
    low, high = float(values.min()), float(values.max())
    first, last = (float(each) for each in np.percentile(values, [100 - MOST, MOST]))
    room = 0.5 * (last - first)
    below, above = low < first - room, high > last + room
    extend = ("both" if above else "min") if below else ("max" if above else "neither")
    said = []
    if below:
        said.append(f"from the {100 - MOST}st percentile (smallest {low:.4g} {unit})")
    if above:
        said.append(f"to the {MOST}th percentile (largest {high:.4g} {unit})")
    limits = first if below else low, last if above else high
    return limits, extend, f"colours {' '.join(said)}" if said else ""


def _draw_sample(axes: NDArray[Any], scene: Scene, row: int) -> None:
    """Heights and contact pressure of one row, side by side."""
    plan = parameters(scene, row, row + 1)
    contact = solve_contact(scene, surface_of(scene, plan, 0), float(plan.delta[0]))
    surface = f"surface of row {row}: H = {plan.hurst[0]:.2f}, σ₀ = {plan.sigma0[0]:.1f} µm"
    spots = (
        f"contact at Δ = {plan.delta[0]:.1f} µm, E* = {contact.problem.modulus:g} MPa:"
        f" {contact.area_percent:.3g} % of {contact.pressure.size} nodes, the median of rows done"
    )
    for axis, drawn in zip(axes, maps_of(contact, surface, spots), strict=True):
        draw_map(axis, drawn, letters=50)


def _draw_areas(figure: Any, axis: Any, columns: dict[str, NDArray[Any]]) -> None:
    """Effective contact area of every row against its displacement."""
    dots = axis.scatter(
        columns["delta"], columns["area_percent"], c=columns["hurst"], s=9, cmap="cividis"
    )
    figure.colorbar(dots, ax=axis, label="Hurst exponent H")
    axis.set(
        title=f"{columns['delta'].size} samples",
        xlabel="far-field displacement Δ [µm]",
        ylabel="effective contact area [%]",
    )
    axis.set_ylim(bottom=0)


def _draw_times(axis: Any, columns: dict[str, NDArray[Any]]) -> None:
    """Time of every solve against the area."""
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
    # One solve that waited for the machine must not flatten all others.
    axis.set_ylim(0, 1.3 * np.quantile(milliseconds, 0.99))
