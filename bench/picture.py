"""Pictures of reports: drawn as their TOML files say, and written only once they are whole.

A figure of a report's `contents` that has `panels` is drawn from the first table of its `data`:
curves of columns over another one, side by side or in facets; `draw` says which keys there are.
"""

import itertools
from collections.abc import Mapping, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

from bench.files import Row
from gen.runtime import figure as figures
from gen.runtime.files import make_folder, write

# For colour-blind readers: Okabe and Ito's colours, and three more.
COLOURS = (
    *("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00"),
    *("#56B4E9", "#000000", "#888888", "#6B3D0A", "#4B2E83"),
)
# Looks of curves, which markers tell apart on paper too.
STYLES = tuple(
    {"color": c, "marker": m} for c, m in zip(COLOURS, "os^DvPx*<>", strict=True)
)
DPI = 150
# Colours of a picture, and of one with a colour bar: far fewer bytes, so that forty can be kept.
PALETTE, GRADED = 64, 256


def new_figure(width: float = 6.4, height: float = 4.8) -> Any:
    """Make an empty figure [inches] whose curves have our colours."""
    figure = figures.new_figure(width, height)
    from cycler import cycler
    from matplotlib import rcParams

    rcParams["axes.prop_cycle"] = cycler(color=COLOURS)
    return figure


def save(figure: Any, path: Path) -> Path:
    """Write a figure as PNG."""
    from PIL import Image

    drawn, compact = BytesIO(), BytesIO()
    figure.savefig(drawn, dpi=DPI, format="png")
    graded = any(axis.get_label() == "<colorbar>" for axis in figure.axes)
    colours = GRADED if graded else PALETTE
    few = Image.open(drawn).convert("RGB").quantize(colours, dither=Image.Dither.NONE)
    few.save(compact, format="PNG", optimize=True)
    make_folder(path.parent)
    write(path, compact.getvalue(), "picture")
    return path


def drawn(
    contents: Sequence[Mapping[str, Any]], tables: Mapping[str, Sequence[Row]]
) -> dict[str, Any]:
    """Draw the figures that a report's file describes, of the tables that there are, by name."""
    found = {}
    for entry in contents:
        stem = Path(entry.get("data", [""])[0]).stem
        if "panels" in entry and tables.get(stem):
            found[Path(entry["figure"]).stem] = draw(entry, list(tables[stem]))
    return found


def draw(said: Mapping[str, Any], rows: Sequence[Row]) -> Any:
    """Draw one figure of a report: its panels in `down` rows, those of a facet below each other.

    `facet` is a format that tells the columns of panels apart, filled in with a row; `size` is
    the width and height of a panel [inches], `legend` "figure", "each" for the lowest panel of
    each facet, or the number of the panel that names the curves.
    """
    facets = _split(rows, said.get("facet", ""))
    panels, (width, height) = said["panels"], said.get("size", (3.7, 3.6))
    down = len(panels) if "facet" in said else said.get("down", 1)
    across = len(facets) if "facet" in said else len(panels) // down
    figure = new_figure(width * across, height * down)
    axes = figure.subplots(down, across, squeeze=False, **said.get("shared", {}))
    for place, (title, own) in enumerate(facets.items()):
        column = axes[:, place] if "facet" in said else axes.flat
        for axis, panel in zip(column, panels, strict=True):
            draw_panel(axis, {**said.get("all", {}), **panel}, own)
        if title:
            column[0].set_title(title)
    if said.get("legend") == "figure":
        figure.legend(
            *axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=4
        )
    elif said.get("legend") == "each":
        for axis in axes[-1]:
            axis.legend(fontsize="x-small")
    elif "legend" in said:
        axes.flat[said["legend"]].legend(fontsize="small")
    return figure


def _split(rows: Sequence[Row], form: str) -> dict[str, list[Row]]:
    """Return the rows by the text that a format makes of each."""
    found: dict[str, list[Row]] = {}
    for row in rows:
        found.setdefault(form.format(**row), []).append(row)
    return found


def draw_panel(axis: Any, panel: Mapping[str, Any], rows: Sequence[Row]) -> None:
    """Draw columns over another one, a curve for each label.

    The keys of a panel: `x` and `y`, columns, where rows without one are left out; `label`, the
    name of a curve, filled in with a row of it; `dashed`, a further column as a dashed line;
    `dots`, pairs of columns as hollow dots; `look`, properties of the curves; `marks`, levels
    of horizontal lines by name; `ticks`, whether only values of x have ticks; `none`, the text
    for a missing value; `words`, whether values of x are texts; `axes`, what matplotlib's
    `Axes.set` takes. With `colour`, a column, rows are dots of that colour; with `bins` instead of
    y, how often x has which value.
    """
    x, y = panel["x"], panel.get("y", panel["x"])
    none = panel.get("none", "")
    known = [
        {name: none if value in {None, ""} else value for name, value in row.items()}
        for row in rows
        if not {row[x], row[y]} & {None, ""}
    ]
    if "bins" in panel:
        axis.hist(
            [row[x] for row in known],
            panel["bins"],
            color=COLOURS[0],
            edgecolor="w",
            lw=0.5,
        )
    elif "colour" in panel:
        at, height, colour = (
            [row[name] for row in known] for name in (x, y, panel["colour"])
        )
        dots = axis.scatter(at, height, s=2, c=colour, rasterized=True)
        axis.figure.colorbar(dots, ax=axis, label=panel["colour"])
    else:
        _draw_curves(axis, panel, known)
    for name, level in panel.get("marks", {}).items():
        axis.axhline(level, color="0.4", ls=":")
        place = {"xycoords": ("axes fraction", "data"), "ha": "right", "va": "bottom"}
        axis.annotate(name, (0.99, level), fontsize=8, color="0.3", **place)
    axis.set(  # limits, of which the upper one may be missing, are lists
        **{
            name: [*v, None][:2] if isinstance(v, list) else v
            for name, v in panel["axes"].items()
        }
    )
    for scale, ruler in (("xscale", axis.xaxis), ("yscale", axis.yaxis)):
        if panel["axes"].get(scale) == "log" and f"{scale[0]}lim" not in panel["axes"]:
            figures.log_axis(ruler)
    if panel.get("ticks"):
        values = sorted({row[x] for row in rows})
        axis.set_xticks(values, [str(each) for each in values])
        axis.minorticks_off()


def _draw_curves(axis: Any, panel: Mapping[str, Any], rows: Sequence[Row]) -> None:
    """Draw a curve for each label of a panel's rows."""
    x, y, curves = panel["x"], panel["y"], _split(rows, panel.get("label", ""))
    for (name, own), style in zip(curves.items(), itertools.cycle(STYLES), strict=False):
        places = [str(row[x]) if panel.get("words") else row[x] for row in own]
        axis.plot(
            places,
            [row[y] for row in own],
            label=name,
            **{**style, **panel.get("look", {})},
        )
        if "dashed" in panel:
            line = {"color": style["color"], "ls": "--", "lw": 1}
            axis.plot(places, [row[panel["dashed"]] for row in own], **line)
        for (abscissa, ordinate), marker in zip(
            panel.get("dots", ()), "os^", strict=False
        ):
            there, value = ([row[name] for row in own] for name in (abscissa, ordinate))
            axis.plot(there, value, marker, mfc="none", color=style["color"])
