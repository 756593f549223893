"""What the solver's tolerance does to the end product: a surrogate learnt from its areas.

The same rows of the paper preset are solved at several tolerances, in turn. Inputs do not depend on
the tolerance, areas do: kernel ridge is fitted to each tolerance's areas with settings chosen once,
and judged on areas solved tightly. Times are processor times of rows as a database has them:
surface, statistics, solve.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bench.surrogates.databases import generated
from bench.surrogates.fitting import Fitted, Parts, fit, parted, read, request_for
from bench.surrogates.tolerance_labels import DEFAULT, MEASURED, TIGHT, Solved, solve_all
from gen.database import Reader
from gen.runtime.errors import InputError
from learn.dataset import Dataset
from learn.metrics import scores

Values = NDArray[np.float64]

TOLERANCES = (1e-1, 3e-2, 1e-2, 1e-3, 1e-4, 1e-5, DEFAULT, 1e-8)

FEATURES = ("paper", "hybrid")

EXACT = (0.0, 0.0, 0.0, 100.0)
"""What `_label_errors` would say of the true areas."""


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
    true = generated(folder / "databases", "tight", _tight(rows), remark)
    solved = Solved(folder / "databases" / "tolerances.npz", wanted, rows)
    solve_all(solved, remark)
    found: list[Row] = []
    for features in FEATURES:
        request = request_for(true, "kernel-ridge", features, area_max)
        data = read(request, rows)
        parts = parted(data)
        remark(f"{features} features: {parts.train.size} rows train")
        exact = fit(request, parts.train, parts.calibration, parts.folds)
        found.append(_row(solved, TIGHT, data, parts, exact))
        for each in wanted:
            other = _relabelled(solved, each, parts)
            fitted = fit(request, other.train, other.calibration, other.folds, exact.settings)
            found.append(_row(solved, each, data, parts, fitted))
    return found


def _tight(rows: int) -> str:
    """Scene of the areas that count as true."""
    return f"samples = {rows}\n[contact]\nrtol = {TIGHT:g}\n"


def _labels(solved: Solved, tolerance: float, rows: Dataset) -> Values:
    """(n, 3) `MEASURED` of a dataset's rows at a tolerance."""
    return np.asarray(solved.values[solved.tolerances.index(tolerance), rows.rows])


def _relabelled(solved: Solved, tolerance: float, parts: Parts) -> Parts:
    """The same rows with the areas of another tolerance, those that failed there left out."""

    def other(rows: Dataset) -> tuple[Dataset, NDArray[np.bool_]]:
        area = _labels(solved, tolerance, rows)[:, 0]
        kept = np.isfinite(area)
        changed = replace(rows, target=np.where(kept, area, 0.0) / rows.scale)
        return changed.at(np.flatnonzero(kept)), kept

    (train, kept), (calibration, _), (test, _) = map(
        other, (parts.train, parts.calibration, parts.test)
    )
    return Parts(train, calibration, test, parts.folds[kept])


def _row(solved: Solved, tolerance: float, data: Dataset, parts: Parts, fitted: Fitted) -> Row:
    """Judge a fit; the tight one has labels without error, and no time of its own."""
    seconds = {
        each: float(np.nanmean(solved.seconds[place])) * solved.rows
        for place, each in enumerate(solved.tolerances)
    }
    time = seconds.get(tolerance, np.nan)
    judged = scores(parts.test.target, fitted.predict(parts.test))
    errors, own = EXACT, judged
    if tolerance in seconds:
        errors = _label_errors(solved, tolerance, data)
        test = _relabelled(solved, tolerance, parts).test
        own = scores(test.target, fitted.predict(test))
    return Row(
        tolerance,
        data.features,
        parts.train.size,
        parts.test.size,
        time,
        time / seconds[DEFAULT],
        *errors,
        **vars(judged),
        own_nmae=own.nmae,
        own_r2=own.r2,
    )


def _label_errors(
    solved: Solved, tolerance: float, data: Dataset
) -> tuple[float, float, float, float]:
    """Errors of areas and forces, and the share of exact contact counts [%]."""
    area, force, nodes = _labels(solved, tolerance, data).T
    known = np.isfinite(area)
    true = data.target * data.scale
    found = scores(true[known], area[known])
    with Reader(Path(data.source["database"])) as reader:
        true_force, true_nodes = (reader.column(name)[data.rows] for name in MEASURED[1:])
    off = np.abs(force[known] / true_force[known] - 1)
    right = float((nodes[known] == true_nodes[known]).mean())
    return found.nmae, found.nmaxe, 100 * float(off.mean()), 100 * right
