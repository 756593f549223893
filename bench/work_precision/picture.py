"""Work-precision diagrams: error on x, cost on y, both logarithmic, a curve a solver."""

import itertools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from statistics import fmean
from typing import Any

from bench.picture import new_figure
from bench.style import STYLES
from bench.work_precision.measurement import Point

TITLES = {
    "tolerance": "Tolerance: 1e-1 (right) to 1e-12 (left), both kernels",
    "grid": "Grid: both kernels, nodes a side as labelled, against the default's finest grid",
    "precision": "Precision: single for search directions (mixed), or double throughout",
    "peers": "Other solvers at tolerances of their own; no error in a force that was given",
    "hardness": "Bodies that yield, hardness over E* as named; others at tolerances of their own",
}

ERRORS = {
    "force_error": "relative error of the force [1]",
    "area_error_percent": "error of the area [% of the exact area]",
    "pressure_error": "relative error of the pressure, L2 [1]",
}
COSTS = {"seconds": "wall time a solve [s]", "convolutions": "applications of H"}

# An axis whose ends are no further apart than this has room for numbers between the powers of ten.
SHORT_AXIS = 500


@dataclass(frozen=True)
class Mark:
    """Where the points of one solver at one setting stand in the diagrams: their means.

    Attributes
    ----------
    label : of the setting
    values : by the names of `ERRORS` and `COSTS`; what is not known, or was given, is left out
    """

    label: str
    values: dict[str, float]


def draw(points: Sequence[Point]) -> Any:
    """Draw a row of diagrams for each study and cost, over three kinds of error."""
    studies = [name for name in TITLES if any(point.study == name for point in points)]
    drawn = {
        study: curves(study, [point for point in points if point.study == study])
        for study in studies
    }
    costs = {study: _compared_costs(drawn[study]) for study in studies}
    heights = [1.4 + 2.0 * len(costs[study]) for study in studies]
    figure = new_figure(11, sum(heights))
    parts = figure.subfigures(len(studies), 1, squeeze=False, height_ratios=heights)[:, 0]
    for letter, part, study in zip("abcdef", parts, studies, strict=False):
        part.suptitle(f"({letter}) {TITLES[study]}", x=0.01, ha="left", fontweight="bold")
        _draw_study(part, study, drawn[study], costs[study])
    return figure


def curves(study: str, points: Iterable[Point]) -> dict[str, list[Mark]]:
    """Marks of each curve, by its name: means over the study's cases on a grid.

    A setting at which a case is missing has no mark: its mean would be that of other cases. Nor
    has the grid that is its own reference, whose error is none of the grid's.
    """
    by_grid = study == "grid"
    cases: dict[tuple[int, float | None], set[str]] = {}
    groups: dict[str, dict[float, list[Point]]] = {}
    for point in points:
        if by_grid and point.nodes == point.reference_nodes:
            continue
        setting = point.nodes if by_grid else point.rtol
        cases.setdefault((point.nodes, point.hardness), set()).add(point.case)
        groups.setdefault(_name(point), {}).setdefault(setting, []).append(point)
    return {
        name: [
            _mean(str(setting) if by_grid else f"{setting:.0e}", group)
            for setting, group in settings.items()
            if {point.case for point in group} == cases[group[0].nodes, group[0].hardness]
        ]
        for name, settings in groups.items()
    }


def _name(point: Point) -> str:
    """What tells a curve from the others of its study."""
    if point.study in {"tolerance", "grid"}:
        return point.kernel
    if point.study == "precision":
        return f"{point.precision}, {point.nodes} × {point.nodes} nodes"
    if point.hardness is not None:
        return f"{point.solver}, {point.hardness:g}"
    return point.solver


def _mean(label: str, points: Sequence[Point]) -> Mark:
    values = {}
    for name in (*ERRORS, *COSTS):
        known = [getattr(point, name) for point in points]
        if None not in known:
            values[name] = fmean(known)
    return Mark(label, values)


def _compared_costs(drawn: dict[str, list[Mark]]) -> list[str]:
    """The costs by which curves can be told apart: one that only one of many knows is not drawn."""
    wanted = min(len(drawn), 2)
    return [
        cost
        for cost in COSTS
        if sum(any(cost in mark.values for mark in marks) for marks in drawn.values()) >= wanted
    ]


def _draw_study(part: Any, study: str, drawn: dict[str, list[Mark]], costs: list[str]) -> None:
    axes = part.subplots(len(costs), len(ERRORS), sharex="col", sharey="row", squeeze=False)
    for row, cost in zip(axes, costs, strict=True):
        for axis, error in zip(row, ERRORS, strict=True):
            for style, (name, marks) in zip(itertools.cycle(STYLES), drawn.items(), strict=False):
                _draw_curve(axis, name, _known(marks, error, cost), style)
                if study == "grid":
                    _write_labels(axis, marks, error, cost)
            axis.margins(x=0.1, y=0.12)
            axis.grid(visible=True, which="major", color="0.9")
    every = [mark for marks in drawn.values() for mark in marks]
    for column, (error, label) in zip(axes.T, ERRORS.items(), strict=True):
        _scale(column[0].xaxis, [x for x, _ in _known(every, error, costs[0])])
        column[-1].set_xlabel(label)
    for row, cost in zip(axes, costs, strict=True):
        _scale(row[0].yaxis, [y for _, y in _known(every, "pressure_error", cost)])
        row[0].set_ylabel(COSTS[cost])
    part.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=4)


def _known(marks: Iterable[Mark], error: str, cost: str) -> list[tuple[float, float]]:
    """Where the marks stand that have both."""
    return [
        (mark.values[error], mark.values[cost])
        for mark in marks
        if error in mark.values and cost in mark.values
    ]


def _draw_curve(
    axis: Any, name: str, places: Sequence[tuple[float, float]], style: dict[str, str]
) -> None:
    x, y = [place[0] for place in places], [place[1] for place in places]
    axis.plot(x, y, label=name, markersize=4, **style)


def _write_labels(axis: Any, marks: Sequence[Mark], error: str, cost: str) -> None:
    for mark in marks:
        where = mark.values[error], mark.values[cost]
        axis.annotate(mark.label, where, (5, 3), textcoords="offset points", fontsize=7)


def _scale(axis: Any, values: Sequence[float]) -> None:
    """Logarithmic, with a place for 0 where there is one, and plain numbers on a short axis."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    positive = [value for value in values if value > 0]
    if not positive:
        return
    # Errors stand on x: only they can be 0.
    set_scale = getattr(axis.axes, f"set_{axis.axis_name}scale")
    if len(positive) < len(values):
        floor = 10.0 ** math.floor(math.log10(min(positive)))
        set_scale("symlog", linthresh=floor, linscale=0.5)
        axis.axes.set_xlim(-0.4 * floor, 2 * max(positive))
        return
    set_scale("log")
    if max(positive) / min(positive) < SHORT_AXIS:
        axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_formatter(NullFormatter())
