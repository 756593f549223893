"""How far a surrogate of the paper preset may be taken: the paper's section 4.3, and further.

Each case is judged on rows of its own kind. What would mend it is tried, not guessed: some of those
rows are added to the training, others calibrate the intervals anew.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bench import databases
from bench.surrogates.cases import Trial, trials
from bench.surrogates.cases import databases as databases_to_test_on
from bench.surrogates.fitting import Fitted, Parts, fit, joined, parted, read, request_for
from gen.runtime.errors import InputError
from learn.dataset import Dataset
from learn.features import SETS
from learn.metrics import scores
from learn.models import models_named
from learn.request import Request

Values = NDArray[np.float64]

LEVEL = 0.9
"""Of the intervals whose coverage is counted."""


@dataclass(frozen=True)
class Row:
    """One case with one model and one feature set.

    Attributes
    ----------
    tested_on : name of the case
    model, features : what was tested
    trained, judged : numbers of rows
    nmse, nmae, nmaxe, r2 : scores on the rows that judge [%]
    reference : nMAE of what was trained where it is tested: at home, for other databases; for
        unseen Hurst exponents on the same rows [%]
    flagged : share of the rows with an input outside the training ranges
    covered : share of the rows inside their interval of 90 %
    slack : two standard deviations of that share, were the intervals right
    mending : rows of the case's own kind that the surrogate was mended with, half of them in the
        training and half to calibrate; 0 if that was not tried
    mended_nmae, mended_covered : nMAE [%] and share inside thereafter, NaN if not tried
    resampled_nmae : nMAE with the features of every second node, NaN on other grids [%]
    grid_nmae : nMAE of the areas solved at every second node, NaN on other grids [%]: that much
        of the area is the grid's, whatever predicts it
    """

    tested_on: str
    model: str
    features: str
    trained: int
    judged: int
    nmse: float
    nmae: float
    nmaxe: float
    r2: float
    reference: float
    flagged: float
    covered: float
    slack: float
    mending: int
    mended_nmae: float
    mended_covered: float
    resampled_nmae: float
    grid_nmae: float

    @property
    def ratio(self) -> float:
        """nMAE over the reference."""
        return self.nmae / self.reference


@dataclass(frozen=True, eq=False)
class Judged:
    """A row, and the areas that it is about [%].

    Attributes
    ----------
    row : scores
    truth, prediction : (n,) areas
    """

    row: Row
    truth: Values
    prediction: Values


def generalisation(
    folder: Path,
    rows: int,
    *,
    models: Sequence[str] = ("kernel-ridge",),
    given: Path | None = None,
    area_max: float = 16.56,
    remark: Callable[[str], None] = lambda line: None,
) -> list[Judged]:
    """Train on the paper preset, test elsewhere.

    Parameters
    ----------
    folder : its `databases` holds what is generated
    rows : of the paper preset that are used; databases to test on have a fifth, 40 to 800
    models : names
    given : database of the preset, None to generate one
    area_max : largest area, in training and tests [%]; 16.56 is the paper's range
    remark : told how far it is

    Raises
    ------
    InputError
        If a model is unknown, a database is another one, or there are too few rows.
    """
    names, tests = [model.name for model in models_named(list(models))], tests_of(rows)
    paper = databases.of_the_paper(given, folder / "databases", rows)
    tested = databases_to_test_on(folder / "databases", tests, remark)
    found: list[Judged] = []
    for model in names:
        for features in SETS:
            request = request_for(paper, model, features, area_max)
            parts = parted(read(request, rows))
            remark(f"{model}, {features} features: {parts.train.size} rows train")
            cases = trials(parts, tested, model, features, area_max)
            found += _judge_all(request, parts, cases, remark)
    return found


def tests_of(rows: int) -> int:
    """Rows of a database to test on; the paper has 800 for 15,878."""
    if rows < 100:
        raise InputError(f"--rows {rows}: give 100 or more, the paper has 15878")
    return min(800, max(40, rows // 5))


def _judge_all(
    request: Request, parts: Parts, cases: Iterator[Trial], remark: Callable[[str], None]
) -> Iterator[Judged]:
    """Judge all cases with one model and one feature set."""
    home = fit(request, parts.train, parts.calibration, parts.folds)
    reference = _error(home, parts.test)
    for trial in cases:
        fitted, expected = home, reference
        if trial.parts is not parts:
            own = trial.parts
            fitted = fit(request, own.train, own.calibration, own.folds)
            expected = _error(home, trial.judged)
        judged = _judge(request, trial, fitted, expected)
        remark(f"  {trial.name}: nMAE {judged.row.nmae:.2f} %")
        yield judged


def _judge(request: Request, trial: Trial, fitted: Fitted, reference: float) -> Judged:
    """Score a surrogate on rows that it has not seen, before and after it is mended."""
    rows, calibrated = trial.judged, trial.parts.calibration.size
    prediction = fitted.predict(rows)
    mended = _mended(request, trial, fitted)
    row = Row(
        tested_on=trial.name,
        model=request.models[0],
        features=request.features,
        trained=trial.parts.train.size,
        judged=rows.size,
        **vars(scores(rows.target, prediction)),
        reference=reference,
        flagged=float(fitted.flagged(rows).mean()),
        covered=float(fitted.covered(rows, LEVEL).mean()),
        slack=2 * float(np.sqrt(LEVEL * (1 - LEVEL) * (1 / rows.size + 1 / calibrated))),
        mending=0 if trial.mending is None else trial.mending.size,
        resampled_nmae=np.nan if trial.resampled is None else _error(fitted, trial.resampled),
        grid_nmae=np.nan
        if trial.resampled is None or trial.coarse_areas is None
        else scores(trial.resampled.target, trial.coarse_areas).nmae,
        mended_nmae=np.nan if mended is None else _error(mended, rows),
        mended_covered=np.nan if mended is None else float(mended.covered(rows, LEVEL).mean()),
    )
    return Judged(row, rows.target, prediction)


def _mended(request: Request, trial: Trial, fitted: Fitted) -> Fitted | None:
    """Fit again with rows of the case in the training, and calibrate on others of them."""
    if trial.mending is None:
        return None
    half = trial.mending.size // 2
    order = np.arange(trial.mending.size)
    added, calibration = trial.mending.at(order[:half]), trial.mending.at(order[half:])
    train = joined(trial.parts.train, added)
    folds = np.append(trial.parts.folds, np.zeros(added.size, dtype=np.int8))
    return fit(request, train, calibration, folds, fitted.settings)


def _error(fitted: Fitted, rows: Dataset) -> float:
    """NMAE on some rows [%]."""
    return scores(rows.target, fitted.predict(rows)).nmae
