"""Pictures of reports: drawn as their TOML files describe them, and written as PNG files.

A figure of a report's `contents` that has `panels` is drawn from the first table of its `data`:
columns over another column, in panels side by side or in facets. `draw` and `draw_panel` list the
keys.
"""

import itertools
from collections.abc import Mapping, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

from bench.files import Row
from gen.runtime import figure as figures
from gen.runtime.files import make_folder, write

COLOURS = (
    "#0072B2",
    "#D55E00",
    "#009E73",
    "#CC79A7",
    "#E69F00",
    "#56B4E9",
    "#000000",
    "#888888",
    "#6B3D0A",
    "#4B2E83",
)
"""Colours that colour-blind readers tell apart: Okabe and Ito's palette, and three more."""

MARKERS = "os^DvPx*<>"
"""Markers of curves, one for each colour, which tell curves apart in print without colours."""

STYLES = tuple(
    {"color": colour, "marker": marker}
    for colour, marker in zip(COLOURS, MARKERS, strict=True)
)
"""Colour and marker of each curve of a panel, in the order of the curves."""

DPI = 150
"""Resolution of a picture [pixels per inch]."""

PALETTE = 64
"""Number of colours of a PNG file without a colour bar. A small number makes the file small."""

GRADED = 256
"""Number of colours of a PNG file with a colour bar."""


def new_figure(width: float = 6.4, height: float = 4.8) -> Any:
    """Make an empty figure whose curves have the colours `COLOURS`.

    This also sets matplotlib's cycle of colours for all later figures of the process.

    Parameters
    ----------
    width, height : float
        Size of the figure [inch].

    Returns
    -------
    matplotlib.figure.Figure
    """
    figure = figures.new_figure(width, height)
    from cycler import cycler
    from matplotlib import rcParams

    rcParams["axes.prop_cycle"] = cycler(color=COLOURS)
    return figure


def save(figure: Any, path: Path) -> Path:
    """Write a figure as a PNG file of few colours, into a folder that is made if it is missing.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        The figure.
    path : Path
        The file.

    Returns
    -------
    Path
        The written file.
    """
    from PIL import Image

    drawn = BytesIO()
    figure.savefig(drawn, dpi=DPI, format="png")
    # Matplotlib gives this label to the axes of a colour bar.
    has_colour_bar = any(axis.get_label() == "<colorbar>" for axis in figure.axes)
    colours = GRADED if has_colour_bar else PALETTE
    image = Image.open(drawn).convert("RGB")
    compact = BytesIO()
    image.quantize(colours, dither=Image.Dither.NONE).save(
        compact, format="PNG", optimize=True
    )
    make_folder(path.parent)
    write(path, compact.getvalue(), "picture")
    return path


def draw_figures(
    contents: Sequence[Mapping[str, Any]], tables: Mapping[str, Sequence[Row]]
) -> dict[str, Any]:
    """Draw the figures that a report's TOML file describes.

    Parameters
    ----------
    contents : sequence of mappings
        Entries `contents` of the TOML file.
    tables : mapping
        Rows of the tables by the names of their files without ending.

    Returns
    -------
    dict
        Matplotlib's figures by the names of their files without ending. An entry without `panels`
        is left out: it is a table, words, or a picture that the report draws itself. Figures whose
        table is missing or has no rows are left out, too.
    """
    drawn = {}
    for entry in contents:
        if "panels" not in entry:
            continue
        table_name = Path(entry["data"][0]).stem
        rows = tables.get(table_name)
        if rows:
            drawn[Path(entry["figure"]).stem] = draw(entry, rows)
    return drawn


def draw(entry: Mapping[str, Any], rows: Sequence[Row]) -> Any:
    """Draw one figure of a report.

    Parameters
    ----------
    entry : mapping
        The figure's entry in the TOML file. Its keys are:

        - `panels`: the panels, each with the keys of `draw_panel`;
        - `all`: keys that all panels share;
        - `size`: width and height of a panel [inch];
        - `down`: the number of rows of panels, 1 if it is missing;
        - `facet`: a format, as "{boundary} edges", that each row fills in. Rows that give the same
          text are shown in one column of panels, below this text as a title. `down` is not used
          then;
        - `shared`: which axes the panels share, as the keywords of `Figure.subplots`;
        - `legend`: where the curves are named: "figure" for below the panels, "each" for the
          lowest panel of each column, or the number of a panel, counted from 0 row by row.
    rows : sequence of Row
        One row of the table or more.

    Returns
    -------
    matplotlib.figure.Figure
    """
    panels = entry["panels"]
    has_facets = "facet" in entry
    # Without facets the empty format puts all rows into one facet without a title.
    facets = _rows_by_text(rows, entry.get("facet", ""))
    if has_facets:
        down = len(panels)
        across = len(facets)
    else:
        down = entry.get("down", 1)
        across = len(panels) // down
    width, height = entry.get("size", (3.7, 3.6))
    figure = new_figure(width * across, height * down)
    axes = figure.subplots(down, across, squeeze=False, **entry.get("shared", {}))
    shared_keys = entry.get("all", {})
    for place, (title, rows_of_facet) in enumerate(facets.items()):
        axes_of_facet = axes[:, place] if has_facets else axes.flat
        for axis, panel in zip(axes_of_facet, panels, strict=True):
            draw_panel(axis, {**shared_keys, **panel}, rows_of_facet)
        if title:
            axes_of_facet[0].set_title(title)
    if "legend" in entry:
        _draw_legend(figure, axes, entry["legend"])
    return figure


def _draw_legend(figure: Any, axes: Any, place: Any) -> None:
    """Draw the legend of a figure, which names its curves.

    `place` is "figure" for one legend below all panels, "each" for one in each panel of the last
    row, or the number of the panel with the legend. `axes` has the panels, shape (down, across).
    """
    if place == "figure":
        # All panels have the same curves.
        handles, labels = axes[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=4)
    elif place == "each":
        for axis in axes[-1]:
            axis.legend(fontsize="x-small")
    else:
        axes.flat[place].legend(fontsize="small")


def _rows_by_text(rows: Sequence[Row], form: str) -> dict[str, list[Row]]:
    """Group rows by the text that they give when their values are filled into a format.

    The groups are in the order of their first rows.
    """
    groups: dict[str, list[Row]] = {}
    for row in rows:
        text = form.format(**row)
        groups.setdefault(text, []).append(row)
    return groups


def draw_panel(axis: Any, panel: Mapping[str, Any], rows: Sequence[Row]) -> None:
    """Draw columns over another column into a panel: curves, dots or a histogram.

    Rows whose x or y is missing are left out. Missing values of other columns become the text of
    the key `none`.

    Parameters
    ----------
    axis : matplotlib.axes.Axes
        The panel.
    panel : mapping
        The panel's entry in the TOML file. Its keys are:

        - `x`, `y`: names of the columns;
        - `axes`: properties of the axes, as the keywords of `Axes.set`. A list of one number is a
          lower limit;
        - `label`: a format, as "{nodes} nodes", that each row fills in. Rows that give the same
          text are one curve, and the text is its name;
        - `look`: properties of the curves, as the keywords of `Axes.plot`;
        - `dashed`: name of another column, drawn over x as a dashed line for each curve;
        - `dots`: pairs of names of columns (abscissa, ordinate), drawn as hollow dots for each
          curve;
        - `dots_label`: what the hollow dots are, for the legend;
        - `words`: true if the values of x are categories instead of numbers;
        - `colour`: name of a column. Each row is drawn as a dot in the colour of its value, instead
          of curves;
        - `bins`: the bins of a histogram of x, which is drawn instead of curves; `y` is not used;
        - `marks`: levels of horizontal lines by their names;
        - `ticks`: true if x has ticks only at the values of its column;
        - `none`: the text that replaces a missing value; empty without this key.
    rows : sequence of Row
        The rows of the table.
    """
    drawable = _drawable(panel, rows)
    if "bins" in panel:
        values = [row[panel["x"]] for row in drawable]
        axis.hist(values, panel["bins"], color=COLOURS[0], edgecolor="w", lw=0.5)
    elif "colour" in panel:
        _draw_dots(axis, panel, drawable)
    else:
        _draw_curves(axis, panel, drawable)
    _draw_marks(axis, panel)
    _set_axes(axis, panel["axes"])
    if panel.get("ticks"):
        values = sorted({row[panel["x"]] for row in rows})
        axis.set_xticks(values, [str(value) for value in values])
        axis.minorticks_off()


def _drawable(panel: Mapping[str, Any], rows: Sequence[Row]) -> list[Row]:
    """Return the rows that have x and y; missing values of other columns become the text `none`."""
    x = panel["x"]
    y = panel.get("y", x)  # a histogram has no y
    replacement = panel.get("none", "")
    missing = {None, ""}
    drawable = []
    for row in rows:
        if {row[x], row[y]} & missing:
            continue
        replaced = {name: replacement for name in row if row[name] in missing}
        drawable.append({**row, **replaced})
    return drawable


def _draw_dots(axis: Any, panel: Mapping[str, Any], rows: Sequence[Row]) -> None:
    """Draw a dot for each row in the colour of its value in column `colour`, and a colour bar."""
    colour = panel["colour"]
    dots = axis.scatter(
        [row[panel["x"]] for row in rows],
        [row[panel["y"]] for row in rows],
        s=2,
        c=[row[colour] for row in rows],
        rasterized=True,
    )
    axis.figure.colorbar(dots, ax=axis, label=colour)


def _draw_marks(axis: Any, panel: Mapping[str, Any]) -> None:
    """Draw the horizontal lines of a panel, with their names at the right."""
    for name, level in panel.get("marks", {}).items():
        axis.axhline(level, color="0.4", ls=":")
        axis.annotate(
            name,
            (0.99, level),
            xycoords=("axes fraction", "data"),
            ha="right",
            va="bottom",
            fontsize=8,
            color="0.3",
        )


def _set_axes(axis: Any, properties: Mapping[str, Any]) -> None:
    """Set the properties of a panel's axes, which are the keywords of `Axes.set`."""
    values = dict(properties)
    for name, value in properties.items():
        # TOML has no null: a list of one number is a lower limit without an upper one.
        if isinstance(value, list) and len(value) == 1:
            values[name] = [*value, None]
    axis.set(**values)
    # `log_axis` chooses the labels of a logarithmic axis by the span of the drawn values. Where the
    # TOML file sets the limits, matplotlib's labels by the limits are kept.
    for direction in ("x", "y"):
        is_logarithmic = properties.get(f"{direction}scale") == "log"
        if is_logarithmic and f"{direction}lim" not in properties:
            figures.log_axis(getattr(axis, f"{direction}axis"))


def _draw_curves(axis: Any, panel: Mapping[str, Any], rows: Sequence[Row]) -> None:
    """Draw a curve for each label of a panel's rows."""
    curves = _rows_by_text(rows, panel.get("label", ""))
    styles = itertools.cycle(STYLES)  # never ends: zip ends with the curves
    for (name, rows_of_curve), style in zip(curves.items(), styles, strict=False):
        _draw_curve(axis, panel, rows_of_curve, name, style)
    if "dots_label" in panel:
        # No point is drawn: only the legend shows this dot.
        axis.plot([], [], "o", mfc="none", color="0.3", label=panel["dots_label"])


def _draw_curve(
    axis: Any,
    panel: Mapping[str, Any],
    rows: Sequence[Row],
    name: str,
    style: Mapping[str, str],
) -> None:
    """Draw one curve of a panel, with its dashed line and hollow dots.

    `name` is the label of the curve. `style` is one of `STYLES`; the key `look` of the panel
    overrides it.
    """

    def column(column_name: str) -> list[Any]:
        """Return the values of a column, one for each row."""
        return [row[column_name] for row in rows]

    x = column(panel["x"])
    if panel.get("words"):
        x = [str(value) for value in x]
    look = {**style, **panel.get("look", {})}
    axis.plot(x, column(panel["y"]), label=name, **look)
    colour = style["color"]
    if "dashed" in panel:
        axis.plot(x, column(panel["dashed"]), color=colour, ls="--", lw=1)
    # Circles for the first pair of columns, then squares, then triangles.
    for (abscissa, ordinate), marker in zip(panel.get("dots", ()), "os^", strict=False):
        axis.plot(column(abscissa), column(ordinate), marker, mfc="none", color=colour)
