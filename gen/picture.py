"""Draw what a database holds; the home of matplotlib in this package."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gen.database import Reader
from gen.errors import InputError
from gen.plan import parameters
from gen.sample import solve_contact, surface_of
from gen.scene import Scene
from gen.schema import Status


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
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise InputError("drawing needs matplotlib: install the extra 'plot'") from None
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
    figure = Figure(figsize=(11, 8.2), layout="constrained")
    axes = figure.subplots(2, 2)
    _draw_sample(figure, axes[0], scene, int(done[typical]))
    _draw_areas(figure, axes[1][0], columns)
    _draw_times(axes[1][1], columns)
    if picture.is_dir() or not picture.suffix:
        raise InputError(f"{picture}: give the name of a picture, ending in .png, .svg or .pdf")
    try:
        figure.savefig(picture, dpi=110)
    except (OSError, ValueError) as error:
        raise InputError(f"{picture} cannot be written: {error}") from None


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
    milliseconds = 1e3 * columns["solve_seconds"]
    axis.plot(columns["area_percent"], milliseconds, ".", color="tab:blue", ms=4)
    axis.axhline(milliseconds.mean(), color="tab:red", lw=1)
    axis.set(
        title=f"{milliseconds.mean():.1f} ms a solve on average",
        xlabel="effective contact area [%]",
        ylabel="time of the solve [ms]",
    )
    # One solve that waited for the machine must not flatten all others.
    axis.set_ylim(0, 1.3 * np.quantile(milliseconds, 0.99))
