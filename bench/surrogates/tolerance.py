"""The effect of the solver's tolerance on a surrogate that learns from its areas.

The same rows of the paper preset are solved at several tolerances, in turn. Inputs do not depend on
the tolerance, areas do: kernel ridge is fitted to each tolerance's areas with settings chosen once,
and judged on areas solved tightly. Times are processor times of rows as a database has them:
surface, statistics, solve.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import takewhile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.databases import generated
from bench.picture import STYLES, draw_curves, new_figure
from bench.report import Report, remark
from bench.surrogates.fitting import Parts, fit, parted, read, request_for
from bench.surrogates.tolerance_labels import DEFAULT, MEASURED, TIGHT, solve_all
from bench.template import rendered
from gen.arrays import Values
from gen.database import Reader
from gen.runtime.errors import InputError
from learn.dataset import Dataset
from learn.metrics import scores
from learn.request import Request
from learn.surrogate.break_even import time_of

Row = dict[str, Any]  # one tolerance with one feature set


TOLERANCES = (1e-1, 3e-2, 1e-2, 1e-3, 1e-4, 1e-5, DEFAULT, 1e-8)

FEATURES = ("paper", "hybrid")
GOOD = 1.02  # test errors count as the tight labels' up to this ratio


def tolerance(
    folder: Path,
    rows: int,
    *,
    tolerances: Sequence[float] = TOLERANCES,
    area_max: float = 16.56,
) -> list[Row]:
    """Measure database times and test errors at several tolerances, as the command asks for them.

    The default tolerance is added, since times are over its.

    Raises
    ------
    InputError
        If there are too few rows, or a tolerance is none.
    KeyboardInterrupt
        After a signal: the same command goes on.
    """
    wanted = sorted({*tolerances, DEFAULT}, reverse=True)
    if rows < 100:
        raise InputError(f"--rows {rows}: give 100 or more, the paper has 15878")
    if not all(TIGHT < each < 1 for each in wanted):
        raise InputError(f"--tolerances: give numbers above {TIGHT:g} and below 1")
    scene = f"samples = {rows}\n[contact]\nrtol = {TIGHT:g}\n"
    true = generated(folder / "databases", "tight", scene)
    labels = solve_all(folder / "databases", wanted, rows)
    with Reader(true) as reader:
        exact = np.stack([reader.column(name)[:rows] for name in MEASURED], axis=1)
    measured = {TIGHT: exact} | {each: labels[each][:, :-1] for each in wanted}
    seconds = {each: float(np.nanmean(labels[each][:rows, -1])) * rows for each in wanted}
    seconds[TIGHT] = math.nan
    found: list[Row] = []
    for features in FEATURES:
        request = request_for(true, "kernel-ridge", features, area_max)
        found += _judged(request, read(request, rows), measured, seconds)
    return found


def _judged(
    request: Request, data: Dataset, measured: dict[float, Values], seconds: dict[float, float]
) -> Iterator[Row]:
    """Fit and judge one feature set at every tolerance; the true areas come first.

    Beside names, numbers of rows and scores on test rows that are solved tightly [%], a row has the
    processor time of the whole database [s], also over that at the default tolerance; the errors of
    the areas and forces learnt, of all rows; and scores on test rows solved at the same tolerance,
    all that one has who does not solve tightly.
    """
    parts, settings = parted(data), None
    remark(f"{request.features} features: {parts.train.size} rows train")
    exact = measured[TIGHT][data.rows]
    for tolerance, values in measured.items():
        own = _relabelled(values[:, 0], parts)
        fitted = fit(request, own.train, own.calibration, own.folds, settings)
        settings = fitted.settings  # chosen once, on the true areas
        own_scores = fitted.scores(own.test)
        yield {
            "tolerance": tolerance,
            "features": request.features,
            "trained": parts.train.size,
            "judged": parts.test.size,
            "seconds": seconds[tolerance],
            "ratio": seconds[tolerance] / seconds[DEFAULT],
            **_label_errors(values[data.rows], exact),
            **vars(fitted.scores(parts.test)),
            "own_nmae": own_scores.nmae,
            "own_r2": own_scores.r2,
        }


def _relabelled(areas: Values, parts: Parts) -> Parts:
    """Return the same rows with other areas of the database, those that failed there left out."""

    def other(rows: Dataset) -> tuple[Dataset, NDArray[np.bool_]]:
        area = areas[rows.rows]
        kept = np.isfinite(area)
        changed = replace(rows, target=np.where(kept, area, 0.0) / rows.scale)
        return changed.at(np.flatnonzero(kept)), kept

    (train, kept), (calibration, _), (test, _) = map(
        other, (parts.train, parts.calibration, parts.test)
    )
    return Parts(train, calibration, test, parts.folds[kept])


def _label_errors(values: Values, exact: Values) -> Row:
    """Return errors of areas and forces, and the share of exact contact counts [%]."""
    known = np.isfinite(values[:, 0])
    (area, force, nodes), (true_area, true_force, true_nodes) = values[known].T, exact[known].T
    judged = scores(true_area, area)
    return {
        "label_nmae": judged.nmae,
        "label_nmaxe": judged.nmaxe,
        "label_force": 100 * float(np.abs(force / true_force - 1).mean()),
        "right": 100 * (nodes == true_nodes).mean(),
    }


def report(rows: Sequence[Row]) -> Report:
    """Make a report of what was measured."""
    return Report(
        {"tolerance": rows},
        pictures={"tolerance": _picture(rows)},
        text=advice(rows),
        text_name="tolerance",
    )


def advice(rows: Sequence[Row]) -> str:
    """Describe the measurement, and advise a tolerance."""
    names = list(dict.fromkeys(row["features"] for row in rows))
    found = {
        name: (_at(rows, name, TIGHT), _at(rows, name, DEFAULT), choice(rows, name))
        for name in names
    }
    safest = min(chosen["tolerance"] for _, _, chosen in found.values())
    usual, loose = (_at(rows, names[0], each) for each in (DEFAULT, safest))
    said = {"trained": rows[0]["trained"], "judged": rows[0]["judged"], "found": found}
    said |= {"tight": TIGHT, "default": DEFAULT, "good": GOOD, "usual": usual, "loose": loose}
    said |= {"gain": 100 * (1 - loose["ratio"]), "time": time_of}
    return rendered("surrogates/tolerance.txt.jinja", said).rstrip()


def choice(rows: Sequence[Row], features: str) -> Row:
    """Return the loosest tolerance that is as good as the tight one, as are all between them."""
    limit = GOOD * _at(rows, features, TIGHT)["nmae"]
    mine = sorted(_of(rows, features), key=lambda row: row["tolerance"])
    return [mine[0], *takewhile(lambda row: row["nmae"] <= limit, mine)][-1]


def _of(rows: Sequence[Row], features: str) -> list[Row]:
    """Return the measured tolerances of a feature set."""
    return [row for row in rows if row["features"] == features and row["tolerance"] != TIGHT]


def _at(rows: Sequence[Row], features: str, tolerance: float) -> Row:
    return next(r for r in rows if (r["features"], r["tolerance"]) == (features, tolerance))


def _picture(rows: Sequence[Row]) -> Any:
    """Draw errors over the time of the database, and over the tolerance."""
    figure = new_figure(11, 5)
    left, right = figure.subplots(1, 2, sharey=True)
    measured = [row for row in rows if row["tolerance"] != TIGHT]
    names = list(dict.fromkeys(row["features"] for row in rows))
    labels = _of(rows, names[0])
    floor = min((row["label_nmae"] for row in labels if row["label_nmae"] > 0), default=1.0) / 4
    errors = [max(row["label_nmae"], floor) for row in labels]
    for axis, quantity in ((left, "seconds"), (right, "tolerance")):
        draw_curves(axis, measured, quantity, "nmae", by="features", label="{} features".format)
        for name, style in zip(names, STYLES, strict=False):
            axis.axhline(_at(rows, name, TIGHT)["nmae"], color=style["color"], ls="--", lw=1)
        places = [row[quantity] for row in labels]
        axis.plot(places, errors, "kx-", lw=1, label="the areas themselves")
        axis.grid(visible=True, which="major", color="0.9")
    beside = {"textcoords": "offset points", "ha": "right", "va": "top", "fontsize": 8}
    for row, error in zip(labels, errors, strict=True):
        text = f"{row['tolerance']:g}" + ("" if row["label_nmae"] else ":\nexact")
        left.annotate(text, (row["seconds"], error), (-6, -3), **beside)
    left.margins(x=0.1)
    left.set_ylim(floor / 4, 2 * max(row["nmae"] for row in rows))
    left.set(
        yscale="log",
        xlabel="processor time of the database [s]",
        ylabel="nMAE [%]",
        title="(a) error over time; tolerances at the crosses",
    )
    right.set(xscale="log", xlabel="tolerance of the solver", title="(b) error over the tolerance")
    right.invert_xaxis()
    right.axvline(DEFAULT, color="0.5", ls=":", label="default tolerance")
    right.legend(fontsize=9, loc="lower left")
    return figure
