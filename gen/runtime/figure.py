"""Make empty figures, set up their axes, and save them as pictures by matplotlib."""

import os
from contextlib import suppress
from importlib import import_module
from io import BytesIO
from pathlib import Path
from typing import Any

from gen.runtime.errors import InputError
from gen.runtime.files import write
from gen.runtime.terminal import printable

SUFFIXES = (".png", ".svg", ".pdf")

SETTINGS = Path("matplotlibrc")
"""Settings in the current folder, which matplotlib prefers to all others."""


def use_shipped_settings() -> None:
    """Let this process, and those that it starts, draw with the settings that matplotlib ships.

    Otherwise matplotlib would read settings from the environment, the user's home and the current
    folder, which may hold a stranger's files. It reads them when it is imported. This function
    therefore changes environment variables; if the current folder has such a file, it also imports
    matplotlib from the root folder.
    """
    os.environ["MATPLOTLIBRC"] = os.devnull
    os.environ.pop("MPLBACKEND", None)
    if not SETTINGS.exists():
        return
    current = os.open(".", os.O_RDONLY)
    os.chdir("/")
    try:
        with suppress(ImportError):  # only commands that draw pictures need matplotlib
            import_module("matplotlib")
    finally:
        os.fchdir(current)
        os.close(current)


def new_figure(width: float, height: float, *, dpi: float | None = None) -> Any:
    """Make an empty figure.

    Parameters
    ----------
    width, height : float
        Size [inches].
    dpi : float, optional
        Dots per inch; by default 100, as matplotlib sets them.

    Returns
    -------
    matplotlib.figure.Figure
        A figure that arranges its axes so that no text overlaps.
    """
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), dpi=dpi, layout="constrained")


def figure_for(picture: Path | None, width: float, height: float) -> Any:
    """Make the empty figure of a picture if the user wants one.

    Commands call this before they compute anything, so that a wrong name or a missing matplotlib
    ends them at once.

    Parameters
    ----------
    picture : Path or None
        The file, whose suffix gives the format; None if the user wants no picture.
    width, height : float
        Size [inches].

    Returns
    -------
    matplotlib.figure.Figure or None
        A figure of 110 dots per inch; None if `picture` is None.

    Raises
    ------
    InputError
        If the suffix is not one of `SUFFIXES`.
    ModuleNotFoundError
        If matplotlib is not installed.
    """
    if picture is None:
        return None
    if picture.suffix.lower() not in SUFFIXES:
        raise InputError(
            f"{picture}: give the name of a picture, ending in .png, .svg or .pdf"
        )
    return new_figure(width, height, dpi=110)


def log_axis(axis: Any) -> None:
    """Make an axis logarithmic, with plain numbers as labels if it spans less than three decades.

    Parameters
    ----------
    axis : matplotlib.axis.Axis
        The x or y axis of a panel whose lines and dots have been drawn.
    """
    from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter

    set_scale = getattr(axis.axes, f"set_{axis.axis_name}scale")
    set_scale("log")
    axis.axes.autoscale_view()
    low, high = sorted(axis.get_view_interval())
    if high >= 1000 * low:  # powers of ten, as matplotlib labels them, are enough
        return
    if high < 5 * low:  # 1, 2 and 5 times powers of ten would be too few labels
        axis.set_major_locator(MaxNLocator(4))
    else:
        axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axis.set_major_formatter("{x:g}")
    axis.set_minor_formatter(NullFormatter())


def parity_axes(axis: Any, truth: Any) -> None:
    """Set up a panel of predictions over true values, and draw the line where both are equal.

    Both axes get the range of the true values, with a margin. They are logarithmic if the true
    values are above 0 and span more than a decade.

    Parameters
    ----------
    axis : matplotlib.axes.Axes
        An empty panel.
    truth : ndarray, shape (rows,)
        True values, in the unit of the target.
    """
    low = float(truth.min())
    high = float(truth.max())
    is_logarithmic = low > 0 and high > 10 * low
    if is_logarithmic:
        limits = (low / 2, 2 * high)
    else:
        margin = 0.05 * (high - low) or 1.0  # 1 if all true values are equal
        limits = (low - margin, high + margin)
    axis.plot(limits, limits, color="0.3", lw=1, zorder=3)
    axis.set(xlim=limits, ylim=limits)
    if is_logarithmic:
        axis.set(xscale="log", yscale="log")


def draw_parity(
    axis: Any, truth: Any, predicted: Any, *, label: str = "", **style: Any
) -> None:
    """Draw predictions over true values as dots.

    A prediction beyond the limits of the panel is drawn at the limit. The legend tells how many
    there are.

    Parameters
    ----------
    axis : matplotlib.axes.Axes
        A panel that `parity_axes` has set up.
    truth, predicted : ndarray, shape (rows,)
        True values and predictions, in the unit of the target.
    label : str
        Text of the legend.
    **style : object
        Further arguments of `Axes.plot`, such as the marker.
    """
    low, high = axis.get_ylim()
    beyond = int(((predicted < low) | (predicted > high)).sum())
    if beyond:
        label = f"{label}\n{beyond:,} beyond the axes".strip()
    axis.plot(truth, predicted.clip(low, high), label=label, clip_on=False, **style)


def save(figure: Any, path: Path, *, dpi: float | str = "figure") -> Path:
    """Draw a figure in memory, then write the file as by `files.write`.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        The figure. Characters of its texts that are not `printable` are replaced by "?" in it.
    path : Path
        The file, whose suffix gives the format.
    dpi : float or "figure"
        Dots per inch; by default those of the figure.

    Returns
    -------
    Path
        The same path.

    Raises
    ------
    InputError
        If the file cannot be written, or an existing file is not a picture.
    """
    from matplotlib.text import Text

    # Texts have names of files, which may contain bytes that are not UTF-8.
    for text in figure.findobj(Text):
        lines = [printable(line) for line in text.get_text().split("\n")]
        content = "\n".join(lines)
        if content != text.get_text():
            text.set_text(content)
    drawing = BytesIO()
    figure.savefig(drawing, dpi=dpi, format=path.suffix[1:].lower())
    write(path, drawing.getvalue(), "picture")
    return path
