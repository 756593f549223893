"""What the solver's tolerance does to the end product: a surrogate learnt from its areas.

The same rows of the paper preset are solved at several tolerances, in turn. Inputs do not depend on
the tolerance, areas do: kernel ridge is fitted to each tolerance's areas with settings chosen once,
and judged on areas solved tightly. Times are processor times of rows as a database has them:
surface, statistics, solve.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bench.databases import generated
from bench.surrogates.fitting import Fitted, Parts, fit, parted, read, request_for
from bench.surrogates.tolerance_labels import DEFAULT, MEASURED, TIGHT, solve_all
from gen.database import Reader
from gen.runtime.errors import InputError
from learn.dataset import Dataset
from learn.metrics import Scores, scores
from learn.request import Request

Values = NDArray[np.float64]

TOLERANCES = (1e-1, 3e-2, 1e-2, 1e-3, 1e-4, 1e-5, DEFAULT, 1e-8)

FEATURES = ("paper", "hybrid")


@dataclass(frozen=True)
class Row:
    """One tolerance with one feature set.

    Attributes
    ----------
    tolerance : of the solver, relative
    features : of kernel ridge
    trained, judged : numbers of rows
    seconds : processor time of the whole database at that tolerance [s]
    ratio : that over the one at the default tolerance
    label_nmae, label_nmaxe : error of the areas themselves, all rows [%]
    label_force : mean relative error of the forces [%]
    right : share of the rows with the exact number of contact nodes [%]
    nmse, nmae, nmaxe, r2 : scores on test rows solved tightly [%]
    own_nmae, own_r2 : scores on test rows solved at the same tolerance, all that one has who does
        not solve tightly [%]
    """

    tolerance: float
    features: str
    trained: int
    judged: int
    seconds: float
    ratio: float
    label_nmae: float
    label_nmaxe: float
    label_force: float
    right: float
    nmse: float
    nmae: float
    nmaxe: float
    r2: float
    own_nmae: float
    own_r2: float


def tolerance(
    folder: Path,
    rows: int,
    *,
    tolerances: Sequence[float] = TOLERANCES,
    area_max: float = 16.56,
    remark: Callable[[str], None] = lambda line: None,
) -> list[Row]:
    """Measure database times and test errors at several tolerances.

    Parameters
    ----------
    folder : its `databases` holds what is solved
    rows : of the paper preset
    tolerances : of the solver; the default's is added, since times are over its
    area_max : largest area, solved tightly, in training and tests [%]
    remark : told how far it is

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
    true = generated(folder / "databases", "tight", _tight(rows))
    labels = solve_all(folder / "databases", wanted, rows, remark)
    with Reader(true) as reader:
        exact = np.stack([reader.column(name)[:rows] for name in MEASURED], axis=1)
    measured = {TIGHT: exact} | {each: labels[each].values for each in wanted}
    seconds = {each: float(np.nanmean(labels[each].seconds[:rows])) * rows for each in wanted}
    found: list[Row] = []
    for features in FEATURES:
        request = request_for(true, "kernel-ridge", features, area_max)
        data = read(request, rows)
        for row in _judged(request, data, measured, remark):
            time = seconds.get(row.tolerance, np.nan)
            found.append(replace(row, seconds=time, ratio=time / seconds[DEFAULT]))
    return found


def _judged(
    request: Request, data: Dataset, measured: dict[float, Values], remark: Callable[[str], None]
) -> Iterator[Row]:
    """Fit and judge one feature set at every tolerance; the true areas come first."""
    parts, settings = parted(data), None
    remark(f"{request.features} features: {parts.train.size} rows train")
    exact = measured[TIGHT][data.rows]
    for tolerance, values in measured.items():
        own = _relabelled(values[:, 0], parts)
        fitted = fit(request, own.train, own.calibration, own.folds, settings)
        settings = fitted.settings  # chosen once, on the true areas
        own_judged = _scores(fitted, own.test)
        yield Row(
            tolerance,
            request.features,
            parts.train.size,
            parts.test.size,
            np.nan,
            np.nan,
            *_label_errors(values[data.rows], exact),
            **vars(_scores(fitted, parts.test)),
            own_nmae=own_judged.nmae,
            own_r2=own_judged.r2,
        )


def _tight(rows: int) -> str:
    """Return the scene of the areas that count as true."""
    return f"samples = {rows}\n[contact]\nrtol = {TIGHT:g}\n"


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


def _scores(fitted: Fitted, rows: Dataset) -> Scores:
    return scores(rows.target, fitted.predict(rows))


def _label_errors(values: Values, exact: Values) -> tuple[float, float, float, float]:
    """Return errors of areas and forces, and the share of exact contact counts [%]."""
    known = np.isfinite(values[:, 0])
    (area, force, nodes), (true_area, true_force, true_nodes) = values[known].T, exact[known].T
    judged = scores(true_area, area)
    off = np.abs(force / true_force - 1)
    return judged.nmae, judged.nmaxe, 100 * float(off.mean()), 100 * (nodes == true_nodes).mean()
