"""How far a surrogate of the paper preset may be taken: the paper's section 4.3, and further.

Each case is judged on rows of its own kind. What would mend it is tried, not guessed: some of those
rows are added to the training, others calibrate the intervals anew.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench import databases
from bench.report import remark
from bench.surrogates.cases import Trial, trials
from bench.surrogates.cases import databases as databases_to_test_on
from bench.surrogates.fitting import Fitted, Parts, fit, parted, read, request_for
from gen.runtime.errors import InputError
from learn.dataset import Dataset, joined
from learn.features import SETS
from learn.metrics import scores
from learn.models import models_named
from learn.request import Request

LEVEL = 0.9  # of the intervals whose coverage is counted


@dataclass(frozen=True, eq=False)
class Judged:
    """One case with one model and one feature set: a row as of `judge`, and the areas [%]."""

    row: dict[str, Any]
    truth: NDArray[np.float64]
    prediction: NDArray[np.float64]


def generalisation(
    folder: Path,
    rows: int,
    *,
    models: Sequence[str] = ("kernel-ridge",),
    given: Path | None = None,
    area_max: float = 16.56,
) -> list[Judged]:
    """Train on the paper preset, test elsewhere; the arguments are those of the command.

    Raises
    ------
    InputError
        If a model is unknown, a database is another one, or there are too few rows.
    """
    names, tests = [model.name for model in models_named(list(models))], tests_of(rows)
    paper = databases.of_the_paper(given, folder / "databases", rows)
    tested = databases_to_test_on(folder / "databases", tests)
    found: list[Judged] = []
    for model in names:
        for features in SETS:
            request = request_for(paper, model, features, area_max)
            parts = parted(read(request, rows))
            remark(f"{model}, {features} features: {parts.train.size} rows train")
            found += _judge_all(request, parts, trials(request, parts, tested))
    return found


def tests_of(rows: int) -> int:
    """Return the rows of a database to test on; the paper has 800 for 15,878."""
    if rows < 100:
        raise InputError(f"--rows {rows}: give 100 or more, the paper has 15878")
    return min(800, max(40, rows // 5))


def _judge_all(request: Request, parts: Parts, cases: Iterator[Trial]) -> Iterator[Judged]:
    """Judge all cases with one model and one feature set."""
    home = fit(request, parts.train, parts.calibration, parts.folds)
    reference = home.scores(parts.test).nmae
    for trial in cases:
        fitted, expected = home, reference
        if trial.parts is not parts:
            own = trial.parts
            fitted = fit(request, own.train, own.calibration, own.folds)
            expected = home.scores(trial.judged).nmae
        judged = judge(request, trial, fitted, expected)
        remark(f"  {trial.name}: nMAE {judged.row['nmae']:.2f} %")
        yield judged


def judge(request: Request, trial: Trial, fitted: Fitted, reference: float) -> Judged:
    """Score a surrogate on rows that it has not seen, before and after it is mended.

    The columns, beside names, numbers of rows and scores [%]:

    reference : nMAE of what was trained where it is tested: at home, for other databases; for
        unseen Hurst exponents on the same rows [%].
    flagged, covered : shares of the rows with an input outside the training ranges, and inside
        their interval of 90 %; slack is two standard deviations of the latter, were it right.
    mending, mended_nmae, mended_covered : number of rows of the case's own kind that the surrogate
        was mended with, nMAE [%] and share inside thereafter; 0 and NaN if that was not tried.
    resampled_nmae, grid_nmae : nMAE with the features of every second node, and of the areas solved
        there: that much of the area is the grid's, whatever predicts it. NaN on other grids [%].
    """
    rows = trial.judged
    mended = None if trial.mending is None else _mended(request, trial, fitted, trial.mending)
    coarse, calibrated = trial.resampled, trial.parts.calibration.size
    row = {
        "tested_on": trial.name,
        "model": request.models[0],
        "features": request.features,
        "trained": trial.parts.train.size,
        "judged": rows.size,
        **vars(fitted.scores(rows)),
        "reference": reference,
        "flagged": fitted.flagged(rows),
        "covered": fitted.covered(rows, LEVEL),
        "slack": 2 * float(np.sqrt(LEVEL * (1 - LEVEL) * (1 / rows.size + 1 / calibrated))),
        "mending": 0 if trial.mending is None else trial.mending.size,
        "mended_nmae": np.nan if mended is None else mended.scores(rows).nmae,
        "mended_covered": np.nan if mended is None else mended.covered(rows, LEVEL),
        "resampled_nmae": np.nan if coarse is None else fitted.scores(coarse[0]).nmae,
        "grid_nmae": np.nan if coarse is None else scores(coarse[0].target, coarse[1]).nmae,
    }
    return Judged(row, rows.target, fitted.predict(rows))


def _mended(request: Request, trial: Trial, fitted: Fitted, rows: Dataset) -> Fitted:
    """Fit again with half of some rows in the training, and calibrate on the others."""
    order, parts = np.arange(rows.size), trial.parts
    added, calibration = rows.at(order[: rows.size // 2]), rows.at(order[rows.size // 2 :])
    train = joined([parts.train, added])
    folds = np.append(parts.folds, np.zeros(added.size, dtype=np.int8))
    return fit(request, train, calibration, folds, fitted.settings)
