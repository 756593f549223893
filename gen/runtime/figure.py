"""Empty figures and the files they end in; the home of matplotlib in `gen` and `learn`."""

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
"""File of the current folder that matplotlib would read first."""


def use_shipped_settings() -> None:
    """Make this process and those that it starts draw with the settings that matplotlib ships.

    Matplotlib takes settings from the environment, the user's home and the current folder, which
    may hold a stranger's files. It reads them once, when it is imported. In a folder with such a
    file it is therefore imported now, from the root folder. The environment is changed.
    """
    os.environ["MATPLOTLIBRC"] = os.devnull
    os.environ.pop("MPLBACKEND", None)
    if not SETTINGS.exists():
        return
    current = os.open(".", os.O_RDONLY)
    os.chdir("/")
    try:
        with suppress(ImportError):  # only pictures need it
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
        Dots per inch; by default those of matplotlib.

    Returns
    -------
    matplotlib.figure.Figure
        A figure that lays its axes out so that no text overlaps.
    """
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), dpi=dpi, layout="constrained")


def figure_for(picture: Path | None, width: float, height: float) -> Any:
    """Make the empty figure of a picture that a command may draw.

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
        A figure of 110 dots per inch; None without a picture.

    Raises
    ------
    InputError
        If the suffix is none of `SUFFIXES`.
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
        The x or y axis of axes whose lines are drawn.
    """
    from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter

    getattr(axis.axes, f"set_{axis.axis_name}scale")("log")
    axis.axes.autoscale_view()
    low, high = sorted(axis.get_view_interval())
    if high >= 1000 * low:
        return
    if high < 5 * low:
        axis.set_major_locator(MaxNLocator(4))
    else:
        axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axis.set_major_formatter("{x:g}")
    axis.set_minor_formatter(NullFormatter())


def parity_axes(axis: Any, truth: Any) -> None:
    """Set the limits of a panel of predictions over true values, and draw the line of agreement.

    Both axes are logarithmic if the true values are above 0 and span more than a decade.

    Parameters
    ----------
    axis : matplotlib.axes.Axes
        An empty panel.
    truth : ndarray, shape (rows,)
        True values, in the unit of the target.
    """
    low = float(truth.min())
    high = float(truth.max())
    decades = low > 0 and high > 10 * low
    if decades:
        limits = (low / 2, 2 * high)
    else:
        margin = 0.05 * (high - low) or 1.0
        limits = (low - margin, high + margin)
    axis.plot(limits, limits, color="0.3", lw=1, zorder=3)
    axis.set(xlim=limits, ylim=limits)
    if decades:
        axis.set(xscale="log", yscale="log")


def draw_parity(
    axis: Any, truth: Any, predicted: Any, *, label: str = "", **style: Any
) -> None:
    """Draw predictions over true values as dots.

    Dots beyond the limits of the predictions stand on the limit, and the label counts them.

    Parameters
    ----------
    axis : matplotlib.axes.Axes
        A panel with `parity_axes`.
    truth, predicted : ndarray, shape (rows,)
        True values and predictions, in the unit of the target.
    label : str
        Text of the legend.
    **style : object
        Further arguments of `Axes.plot`.
    """
    low, high = axis.get_ylim()
    beyond = int(((predicted < low) | (predicted > high)).sum())
    if beyond:
        label = f"{label}\n{beyond:,} beyond the axes".strip()
    axis.plot(truth, predicted.clip(low, high), label=label, clip_on=False, **style)


def save(figure: Any, path: Path, *, dpi: float | str = "figure") -> Path:
    """Draw a figure in memory, then write the file as by `files.write`.

    Characters of the figure's texts that are not `printable` are replaced in the figure.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        The figure.
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
        If the file cannot be written, or is no picture.
    """
    from matplotlib.text import Text

    for text in figure.findobj(Text):  # names of files may hold bytes that are no UTF-8
        lines = [printable(line) for line in text.get_text().split("\n")]
        content = "\n".join(lines)
        if content != text.get_text():
            text.set_text(content)
    drawing = BytesIO()
    figure.savefig(drawing, dpi=dpi, format=path.suffix[1:].lower())
    write(path, drawing.getvalue(), "picture")
    return path
