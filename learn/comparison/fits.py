"""Fits of a search: their data, one fit that serves many candidates, and finished fits on disk.

A fit with the largest number of estimators contains all smaller ones: its first k trees are the
model with k trees, to the last bit (`tests/learn/comparison/test_fits.py`). One kernel matrix
serves every alpha of kernel ridge.

No fit is done twice, whatever interrupts a search: each model and target has one file of lines
(JSON), to which the master appends a line when a fit has come back.

`learn.comparison.search` decides which fits are made; their scores decide the winners of the
paper's Tables 3 and 4.
"""

import json
import math
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, replace
from pathlib import Path
from time import perf_counter
from typing import Annotated, Any, NamedTuple, Self

import numpy as np
from pydantic import ConfigDict, Field
from sklearn.metrics import r2_score

from gen.arrays import Indices, Values
from gen.runtime import documents, files
from gen.runtime.errors import InputError
from learn import kernel_ridge
from learn.comparison.folder import Count, Seconds, require_same
from learn.comparison.grid import SettingValues, Task
from learn.features.sets import Scaling
from learn.models import (
    EVERY,
    POPULATION,
    REMARK_LENGTH,
    STEP,
    Model,
    check_memory,
    pipeline,
    remarks,
)
from learn.split import FOLDS, Folds

LEAST_SCORE = -1e20
"""R2 below which a fit has diverged: a score like this would spoil means and tables."""


@dataclass(frozen=True, eq=False)
class Training:
    """Training and test rows of one target, with the choices that all fits have in common."""

    inputs: Values  # of the n training rows, (n, d)
    target: Values  # as the models see it, divided by `scaling`, (n,)
    folds: Folds  # of each training row, (n,)
    test_inputs: Values  # of the m test rows, which no search sees, (m, d)
    test_target: Values  # not scaled, (m,)
    normalisation: str = "l2"  # see `learn.models.pipeline`
    seed: int = 0  # of the models' random draws
    scaling: Scaling = field(default_factory=Scaling)
    groups: Indices | None = None  # surfaces of the training rows, (n,)

    def seen_by(self, model: str) -> Self:
        """Return the training as a model sees it.

        Parameters
        ----------
        model : str
            Name of the model.

        Returns
        -------
        Training
            The mean over surfaces sees unscaled targets, and the surface of each row. All other
            models see the scaled targets, and no surfaces.
        """
        if model != POPULATION.name:
            return replace(self, groups=None)
        return replace(self, target=self.scaling.restored(self.target), scaling=Scaling())

    def unfitted(self, model: str, settings: SettingValues, *, tuned: bool) -> Any:
        """Return the unfitted pipeline of a model.

        Parameters
        ----------
        model : str
            Name of the model.
        settings : dict
            Values by setting, on top of the baseline's.
        tuned : bool
            Whether the settings that all candidates of a search share are added.

        Returns
        -------
        Pipeline
            A pipeline of scikit-learn; see `learn.models.pipeline`.
        """
        return pipeline(
            EVERY[model],
            settings,
            normalisation=self.normalisation,
            seed=self.seed,
            tuned=tuned,
        )

    def fit_arguments(self, rows: Indices | slice = slice(None)) -> dict[str, Indices]:
        """Return the named arguments of a pipeline's `fit` beside inputs and target.

        Parameters
        ----------
        rows : ndarray or slice
            Training rows that are fitted.

        Returns
        -------
        dict
            The surface of each row, shape (k,), if the training has surfaces; else empty.
        """
        if self.groups is None:
            return {}
        return {f"{STEP}__surfaces": self.groups[rows]}

    @property
    def rows(self) -> int:
        """Number of training rows."""
        return self.target.size

    def first(self, rows: int) -> Self:
        """Return the same training with its first rows only.

        Parameters
        ----------
        rows : int
            Number of training rows that are kept at most. All test rows are kept.

        Returns
        -------
        Training
            The smaller training.
        """
        groups = None if self.groups is None else self.groups[:rows]
        return replace(
            self,
            inputs=self.inputs[:rows],
            target=self.target[:rows],
            folds=self.folds[:rows],
            groups=groups,
        )


class Place(NamedTuple):
    """Identity of a trial within its file."""

    candidate: str  # name of its canonical settings
    fold: int  # left out of the training
    rows: int  # for training at most


class Trial(documents.Document):
    """The score of one candidate on one fold, a line of the file."""

    model_config = ConfigDict(frozen=True)

    candidate: str  # its canonical settings, as `learn.comparison.grid.key` writes them
    fold: Annotated[int, Field(ge=0, lt=FOLDS)]  # left out of the training
    rows: Count  # for training at most
    # None if the fit failed or diverged.
    r2: Annotated[float, Field(ge=LEAST_SCORE, le=1)] | None
    failure: str = ""  # why there is no score
    remark: str = ""  # the fit's warnings
    # Of fit and scoring, shared evenly by the candidates of one fit.
    seconds: Seconds = 0.0

    @property
    def place(self) -> Place:
        """Candidate, fold and number of rows, which identify the trial."""
        return Place(self.candidate, self.fold, self.rows)


class Trials(AbstractContextManager["Trials"]):
    """The finished trials of one model and target, in a file that is held open.

    The file is made if it does not exist, with its folder. A last line that a kill has cut short is
    removed from it.

    Parameters
    ----------
    path : Path
        The file.
    conditions : dict
        Data, split, versions and seeds, which all trials have in common, as JSON has them.

    Attributes
    ----------
    finished : dict
        All trials by their place.

    Raises
    ------
    InputError
        If the file holds trials of other conditions, is damaged or cannot be written.
    """

    def __init__(self, path: Path, conditions: dict[str, object]) -> None:
        self.path = path
        self.finished: dict[Place, Trial] = {}
        header = json.dumps(conditions, sort_keys=True)
        lines = _whole_lines(path) or [header.encode()]
        stored = documents.parse(path, lines[0], documents.Document)
        require_same(path, stored.content(), json.loads(header))
        for number, line in enumerate(lines[1:], start=2):
            trial = documents.parse(f"{path}, line {number}", line, Trial)
            self.finished[trial.place] = trial
        files.make_folder(path.parent)
        files.write(path, b"\n".join([*lines, b""]))
        self._file = path.open("ab")

    def __exit__(self, *_: object) -> None:
        """Close the file."""
        self._file.close()

    def add(self, trials: Sequence[Trial]) -> None:
        """Append the trials of one fit to the file, and flush it.

        Parameters
        ----------
        trials : sequence of Trial
            The trials.

        Raises
        ------
        InputError
            If the file cannot be written, as on a full disk.
        """
        lines = [json.dumps(trial.model_dump(), allow_nan=False) for trial in trials]
        try:
            self._file.write("".join(f"{line}\n" for line in lines).encode())
            self._file.flush()
        except OSError as error:
            raise InputError(f"{self.path} cannot be written: {error.strerror}") from None
        self.finished.update((trial.place, trial) for trial in trials)


def _whole_lines(path: Path) -> list[bytes]:
    """Return the lines of a file that a line end follows, none if there is no such file."""
    if not path.exists():
        return []
    *lines, _ = files.read_bytes(path).split(b"\n")
    return lines


@dataclass(frozen=True)
class FoldScore:
    """The score of a candidate on one fold."""

    r2: float | None  # None if the fit failed or diverged
    failure: str = ""  # why there is no score


def fit(training: Training, task: Task) -> list[Trial]:
    """Fit the candidates of a task, and score each on the fold that was left out.

    Parameters
    ----------
    training : Training
        All training rows.
    task : Task
        The candidates, and the fold.

    Returns
    -------
    list of Trial
        One trial for each candidate. A fit that fails is a result too: its trials have the reason
        instead of a score.

    Raises
    ------
    InputError
        If this machine lacks the memory for the fit.
    """
    training = training.seen_by(task.model)
    inside = np.flatnonzero(training.folds != task.fold)[: task.rows]
    check_memory(task.model, inside.size)
    with remarks() as warnings:
        began = perf_counter()
        try:
            scores = _scores(training, task, inside)
        except (
            Exception
        ) as error:  # whatever a library raises: the candidates have no score
            if len(task.candidates) > 1:
                return _fit_one_by_one(training, task)
            scores = [FoldScore(None, reason(error))]
        seconds = (perf_counter() - began) / len(task.candidates)
    return [
        Trial(
            candidate=name,
            fold=task.fold,
            rows=task.rows,
            r2=score.r2,
            failure=score.failure,
            remark="; ".join(warnings),
            seconds=seconds,
        )
        for name, score in zip(task.candidates, scores, strict=True)
    ]


def _fit_one_by_one(training: Training, task: Task) -> list[Trial]:
    """Fit the candidates of a task alone: a shared fit may fail after candidates that are fine."""
    trials = []
    for name, candidate in task.candidates.items():
        trials += fit(training, replace(task, candidates={name: candidate}))
    return trials


def _scores(training: Training, task: Task, inside: Indices) -> list[FoldScore]:
    """Fit to some training rows, (k,), and score each candidate on the fold that was left out."""
    model = EVERY[task.model]
    candidates = [*task.candidates.values()]
    outside = training.folds == task.fold
    rows = FoldRows(
        training.inputs[inside], training.target[inside], training.inputs[outside]
    )
    shared = "" if task.baseline else model.shared
    common = {name: v for name, v in candidates[0].items() if name != shared}
    unfitted = training.unfitted(task.model, common, tuned=not task.baseline)
    if shared in candidates[0]:
        values = [candidate[shared] for candidate in candidates]
        predictions = shared_predictions(model, unfitted, rows, shared, values)
    else:
        arguments = training.fit_arguments(inside)
        fitted = unfitted.fit(rows.inputs, rows.target, **arguments)
        predictions = [fitted.predict(rows.test_inputs)]
    truth = training.target[outside]
    return [_score(truth, prediction) for prediction in predictions]


def reason(error: Exception) -> str:
    """Return why a fit has failed.

    Parameters
    ----------
    error : Exception
        What a library has raised.

    Returns
    -------
    str
        The error's text in one line of limited length, or its type if it has no text.
    """
    return " ".join(str(error).split())[:REMARK_LENGTH] or type(error).__name__


def _score(truth: Values, prediction: Values) -> FoldScore:
    """Return R2 of a prediction, both (m,), or why there is none."""
    if not np.isfinite(prediction).all():
        return FoldScore(None, "prediction not finite")
    with np.errstate(over="ignore"):  # squares of diverged predictions
        r2 = float(r2_score(truth, prediction))
    if LEAST_SCORE <= r2 < math.inf:
        return FoldScore(r2)
    return FoldScore(None, "prediction diverged")


@dataclass(frozen=True, eq=False)
class FoldRows:
    """Rows of one fit: n to train on, and m to predict."""

    inputs: Values  # shape (n, d)
    target: Values  # shape (n,)
    test_inputs: Values  # shape (m, d)


def shared_predictions(
    model: Model, unfitted: Any, rows: FoldRows, name: str, values: Sequence[Any]
) -> list[Values]:
    """Predict with every value of a setting, all of which one fit serves.

    Parameters
    ----------
    model : Model
        The model.
    unfitted : Pipeline
        Unfitted pipeline of scikit-learn with all other settings. Its steps are fitted in place.
    rows : FoldRows
        Rows to train on and to predict.
    name : str
        Name of the setting: the number of estimators, or alpha of kernel ridge.
    values : sequence
        Values of the setting.

    Returns
    -------
    list of ndarray, shape (m,)
        Predictions with each value.
    """
    scaling = unfitted.named_steps["scaling"]
    estimator = unfitted.named_steps[STEP]
    inputs = rows.inputs
    test_inputs = rows.test_inputs
    if scaling != "passthrough":
        inputs = scaling.fit_transform(inputs)
        test_inputs = scaling.transform(test_inputs)
    if model.name == "kernel-ridge":
        settings = estimator.get_params()
        del settings[name]
        return kernel_ridge.predictions(
            inputs, rows.target, test_inputs, settings, values
        )
    estimator.set_params(**{name: max(values)}).fit(inputs, rows.target)
    predict_first = FIRST_TREES[model.name]
    return predict_first(estimator, test_inputs, values)


def _first_of_xgboost(
    estimator: Any, inputs: Values, numbers: Sequence[int]
) -> list[Values]:
    """Predict with each number of the first trees of XGBoost, (m,) each."""
    return [estimator.predict(inputs, iteration_range=(0, number)) for number in numbers]


def _first_of_boosting(
    estimator: Any, inputs: Values, numbers: Sequence[int]
) -> list[Values]:
    """Predict with each number of the first trees of gradient boosting, (m,) each."""
    stages = [prediction.copy() for prediction in estimator.staged_predict(inputs)]
    return [stages[number - 1] for number in numbers]


def _first_of_forest(
    estimator: Any, inputs: Values, numbers: Sequence[int]
) -> list[Values]:
    """Predict with each number of the first trees of a random forest, (m,) each.

    Predictions are added up in the forest's own order, so that the means are equal to the bit.
    """
    sums = np.cumsum(_of_trees(estimator, inputs), axis=0)
    return [sums[number - 1] / number for number in numbers]


def _first_of_adaboost(
    estimator: Any, inputs: Values, numbers: Sequence[int]
) -> list[Values]:
    """Predict with each number of the first trees of AdaBoost, (m,) each.

    Predictions are weighted medians, as `AdaBoostRegressor.predict` takes them. The library's own
    `staged_predict` computes every tree again for every stage. Where boosting ended early, larger
    numbers are one model.
    """
    of_trees = _of_trees(estimator, inputs)
    rows = np.arange(len(inputs))
    predictions = []
    for number in numbers:
        first = np.transpose(of_trees[:number])
        order = np.argsort(first, axis=1)
        share = np.cumsum(estimator.estimator_weights_[order], axis=1)
        middle = (share >= 0.5 * share[:, -1:]).argmax(axis=1)
        predictions.append(first[rows, order[rows, middle]])
    return predictions


def _of_trees(estimator: Any, inputs: Values) -> list[Values]:
    """Return the predictions of all trees of an ensemble of scikit-learn, (m,) each."""
    single = np.asarray(inputs, dtype=np.float32)  # precision of the trees' thresholds
    return [tree.predict(single, check_input=False) for tree in estimator.estimators_]


FIRST_TREES: dict[str, Callable[[Any, Values, Sequence[int]], list[Values]]] = {
    "adaboost": _first_of_adaboost,
    "gradient-boost": _first_of_boosting,
    "random-forest": _first_of_forest,
    "xgboost": _first_of_xgboost,
}
"""Functions of the ensembles of which one fit serves all numbers of trees, by model."""
