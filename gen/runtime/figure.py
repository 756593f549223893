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

SETTINGS = Path(
    "matplotlibrc"
)  # the file of the current folder that matplotlib reads first


def use_shipped_settings() -> None:
    """Let this process and those that it starts draw with the settings that matplotlib ships.

    Matplotlib takes settings from the environment, the user's home, and the current folder, which
    may hold a stranger's files. It looks there once, when it is imported. In a folder with such a
    file it is therefore imported from elsewhere.
    """
    os.environ["MATPLOTLIBRC"] = os.devnull
    os.environ.pop("MPLBACKEND", None)
    if not SETTINGS.exists():
        return
    here = os.open(".", os.O_RDONLY)
    os.chdir("/")
    try:
        with suppress(ImportError):  # only pictures need it
            import_module("matplotlib")
    finally:
        os.fchdir(here)
        os.close(here)


def new_figure(width: float, height: float, *, dpi: float | None = None) -> Any:
    """Make an empty figure, in inches and with dots per inch."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), dpi=dpi, layout="constrained")


def figure_for(picture: Path | None, width: float, height: float) -> Any:
    """Make the figure [inches] of a picture, None without one, before anything is computed."""
    if picture is None:
        return None
    if picture.suffix.lower() not in SUFFIXES:
        raise InputError(
            f"{picture}: give the name of a picture, ending in .png, .svg or .pdf"
        )
    return new_figure(width, height, dpi=110)


def log_axis(axis: Any) -> None:
    """Make a drawn axis logarithmic, with plain numbers where it spans few decades."""
    from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter

    getattr(axis.axes, f"set_{axis.axis_name}scale")("log")
    axis.axes.autoscale_view()
    low, high = sorted(axis.get_view_interval())
    if high < 1000 * low:
        axis.set_major_locator(
            MaxNLocator(4) if high < 5 * low else LogLocator(subs=(1, 2, 5))
        )
        axis.set_major_formatter("{x:g}")
        axis.set_minor_formatter(NullFormatter())


def parity_axes(axis: Any, truth: Any) -> None:
    """Give an empty panel its axes, logarithmic over decades above 0, and the line of agreement."""
    low, high = float(truth.min()), float(truth.max())
    decades = low > 0 and high > 10 * low
    margin = 0.05 * (high - low) or 1.0
    ends = (low / 2, 2 * high) if decades else (low - margin, high + margin)
    axis.plot(ends, ends, color="0.3", lw=1, zorder=3)
    axis.set(xlim=ends, ylim=ends)
    if decades:
        axis.set(xscale="log", yscale="log")


def draw_parity(
    axis: Any, truth: Any, predicted: Any, *, label: str = "", **style: Any
) -> None:
    """Draw dots on `parity_axes`; those beyond its ends stand there, and the label counts them."""
    low, high = axis.get_ylim()
    beyond = int(((predicted < low) | (predicted > high)).sum())
    said = f"{label}\n{beyond:,} beyond the axes".strip() if beyond else label
    axis.plot(truth, predicted.clip(low, high), label=said, clip_on=False, **style)


def save(figure: Any, path: Path, *, dpi: float | str = "figure") -> Path:
    """Draw a figure in memory, then write the file, whose suffix gives the format, whole or not."""
    from matplotlib.text import Text

    for text in figure.findobj(Text):  # names of files may hold bytes that are no UTF-8
        lines = [printable(line) for line in text.get_text().split("\n")]
        if (content := "\n".join(lines)) != text.get_text():
            text.set_text(content)
    drawn = BytesIO()
    figure.savefig(drawn, dpi=dpi, format=path.suffix[1:].lower())
    write(path, drawn.getvalue(), "picture")
    return path
