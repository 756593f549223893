"""Draw what a database holds; the home of matplotlib in this package."""

from __future__ import annotations

from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gen.database import Reader
from gen.errors import InputError
from gen.output import write
from gen.plan import parameters
from gen.sample import solve_contact, surface_of
from gen.scene import Scene
from gen.schema import Status

if TYPE_CHECKING:
    from bem import Contact


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
        scene = reader.scene
    typical = int(np.argsort(columns["area_percent"])[done.size // 2])
    axes = figure.subplots(2, 2)
    _draw_sample(figure, axes[0], scene, int(done[typical]))
    _draw_areas(figure, axes[1][0], columns)
    _draw_times(axes[1][1], columns)
    _save(figure, picture)


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
    return Figure(figsize=(11, 8.2), layout="constrained")


def draw_contacts(figure: Any, contacts: Sequence[Contact], load: str, picture: Path) -> None:
    """Draw a surface, its contact spots and a section under the last load; of several, the law.

    Parameters
    ----------
    figure : from `new_figure`
    contacts : of one surface, one or more
    load : "delta", "force" or "pressure", what was given
    picture : the image to write
    """
    rows = [["heights", "spots"], ["section", "section"]]
    if len(contacts) > 1:
        rows.append(["area", "other"])
    axes = figure.subplot_mosaic(rows)
    last = contacts[-1]
    _draw_fields(figure, (axes["heights"], axes["spots"]), last)
    _draw_section(axes["section"], last)
    if len(contacts) > 1:
        _draw_law(axes["area"], axes["other"], contacts, load)
    _save(figure, picture)


def _save(figure: Any, picture: Path) -> None:
    """Draw in memory, then write the picture whole."""
    drawn = BytesIO()
    figure.savefig(drawn, dpi=110, format=picture.suffix[1:].lower())
    write(picture, drawn.getvalue(), "picture")


def _draw_fields(figure: Any, axes: Sequence[Any], contact: Contact) -> None:
    """Heights and contact pressure, side by side."""
    problem = contact.problem
    nx, ny = contact.pressure.shape
    extent = (0.0, problem.spacing[0] * (nx - 1), 0.0, problem.spacing[1] * (ny - 1))
    pressure = np.ma.masked_equal(contact.pressure, 0)
    area = f"contact at Δ = {contact.delta:.4g} µm: {contact.area_percent:.3g} % of the nodes"
    for axis, field, title, unit, colours in (
        (axes[0], problem.heights, "heights", "height [µm]", "viridis"),
        (axes[1], pressure, area, "pressure [MPa]", "inferno_r"),
    ):
        image = axis.imshow(field.T, origin="lower", extent=extent, cmap=colours)
        figure.colorbar(image, ax=axis, label=unit)
        axis.set(title=title, xlabel="x [µm]", ylabel="y [µm]")


def _draw_section(axis: Any, contact: Contact) -> None:
    """Both bodies along x, through the node under the largest pressure."""
    problem = contact.problem
    column = int(np.unravel_index(int(contact.pressure.argmax()), contact.pressure.shape)[1])
    x = problem.spacing[0] * np.arange(contact.pressure.shape[0])
    # The half-space's surface rests at 0, the rough body comes down from above.
    deformed = -contact.displacement[:, column]
    rough = deformed + contact.gap[:, column]
    axis.fill_between(x, rough, rough.max(), color="0.8", label="rough body")
    axis.fill_between(x, deformed.min(), deformed, color="tab:blue", alpha=0.4, label="half-space")
    touching = np.ma.masked_where(contact.pressure[:, column] == 0, deformed)
    axis.plot(x, touching, ".", ms=3, color="tab:red", label="in contact")
    axis.axhline(0, color="k", lw=0.6, ls=":")
    title = f"section at y = {problem.spacing[1] * column:.4g} µm, heights stretched"
    axis.set(title=title, xlabel="x [µm]", ylabel="z [µm]", xlim=(x[0], x[-1]))
    axis.legend(loc="upper right", fontsize="small")


def _draw_law(area: Any, other: Any, contacts: Sequence[Contact], load: str) -> None:
    """Area, and force or displacement, against the load that was given."""
    cells = contacts[0].pressure.size * np.prod(contacts[0].problem.spacing)
    quantities = {
        "delta": ([contact.delta for contact in contacts], "displacement Δ [µm]"),
        "force": ([contact.force for contact in contacts], "normal force [µN]"),
        "pressure": ([contact.force / cells for contact in contacts], "mean pressure [MPa]"),
    }
    given, answer = quantities[load], quantities["force" if load == "delta" else "delta"]
    area.plot(given[0], [contact.area_percent for contact in contacts], ".-")
    area.set(xlabel=given[1], ylabel="contact area [%]")
    other.plot(given[0], answer[0], ".-", color="tab:orange")
    other.set(xlabel=given[1], ylabel=answer[1])
    for axis in (area, other):
        axis.set_ylim(bottom=0)
        axis.grid(alpha=0.3)


def _draw_sample(figure: Any, axes: NDArray[Any], scene: Scene, row: int) -> None:
    """Heights and contact pressure of one row, side by side."""
    plan = parameters(scene, row, row + 1)
    heights = surface_of(scene, plan, 0)
    contact = solve_contact(scene, heights, float(plan.delta[0]))
    pressure = np.ma.masked_equal(contact.pressure, 0)
    texts = (
        f"surface of row {row}: H = {plan.hurst[0]:.2f}, σ₀ = {plan.sigma0[0]:.1f} µm",
        f"contact at Δ = {plan.delta[0]:.1f} µm: {contact.area_percent:.1f} % of the nodes",
    )
    modulus = contact.problem.modulus
    units = ("height [µm]", f"pressure [MPa], E* = {modulus:g} MPa")
    extent = (0.0, scene.surface.side, 0.0, scene.surface.side)
    for axis, field, text, unit, colours in zip(
        axes, (heights, pressure), texts, units, ("viridis", "inferno_r"), strict=True
    ):
        image = axis.imshow(field.T, origin="lower", extent=extent, cmap=colours)
        figure.colorbar(image, ax=axis, label=unit)
        axis.set(title=text, xlabel="x [µm]", ylabel="y [µm]")


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
