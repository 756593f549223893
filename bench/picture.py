"""Pictures of reports: made, and written under their names only once they are whole."""

import itertools
from collections.abc import Callable, Mapping, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

from gen.runtime import figure as figures
from gen.runtime.files import make_folder, write

# For colour-blind readers: Okabe and Ito's colours, and three more.
COLOURS = (
    *("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00"),
    *("#56B4E9", "#000000", "#888888", "#6B3D0A", "#4B2E83"),
)
# Looks of curves, which markers tell apart on paper too.
STYLES = tuple({"color": c, "marker": m} for c, m in zip(COLOURS, "os^DvPx*<>", strict=True))
DPI = 150
PALETTE = 256  # colours of a picture: far fewer bytes, so that a page of forty can be kept and sent


def new_figure(width: float = 6.4, height: float = 4.8) -> Any:
    """Make an empty figure [inches] whose curves have our colours."""
    figure = figures.new_figure(width, height)
    from cycler import cycler
    from matplotlib import rcParams

    rcParams["axes.prop_cycle"] = cycler(color=COLOURS)
    return figure


def draw_curves(
    panel: Any,
    rows: Sequence[Mapping[str, Any]],
    x: str,
    y: str,
    *,
    by: str,
    label: Callable[[Any], str] = str,
    **look: Any,
) -> None:
    """Draw one column of a table over another: a curve for each value of a third one.

    Parameters
    ----------
    panel : axes
        Where to draw.
    rows : sequence of mappings
        Values by the names of the columns.
    x, y, by : str
        Columns of the abscissa, of the ordinate, and of what tells the curves apart.
    label : callable
        Names a curve by its value of `by`.
    look : dict
        Properties of all curves, instead of those of `STYLES`.
    """
    values = dict.fromkeys(row[by] for row in rows)
    for value, style in zip(values, itertools.cycle(STYLES), strict=False):
        own = [row for row in rows if row[by] == value]
        places, heights = [row[x] for row in own], [row[y] for row in own]
        panel.plot(places, heights, label=label(value), **{**style, **look})


def save(figure: Any, path: Path) -> Path:
    """Write a figure as PNG."""
    from PIL import Image

    drawn, compact = BytesIO(), BytesIO()
    figure.savefig(drawn, dpi=DPI, format="png")
    few = Image.open(drawn).convert("RGB").quantize(PALETTE, dither=Image.Dither.NONE)
    few.save(compact, format="PNG", optimize=True)
    make_folder(path.parent)
    write(path, compact.getvalue(), "picture")
    return path
