"""Fits of a search: their rows, fits that serve many candidates, and finished fits on disk.

A fit with the largest number of trees serves candidates with fewer trees: its first k trees are the
model with k trees, to the last bit (`tests/learn/comparison/test_fits.py`). One kernel matrix
serves every alpha of kernel ridge.

No fit is done twice, whatever interrupts a search: each model and target has a file with a line of
JSON for each trial, to which the master appends the trials of a fit when they arrive.

`learn.comparison.search` decides which fits are made; their scores decide the winners of the
paper's Tables 3 and 4.
"""

import json
import math
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, replace
from pathlib import Path
from time import process_time
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

EPOCHS = ("max_iter", "max_fun")
"""Settings of a candidate that limit its training: the numbers of epochs and of evaluations."""

LEAST_SCORE = -1e20
"""Smallest R2 of a trial. A fit with a smaller one, which would spoil means, counts as diverged."""


@dataclass(frozen=True, eq=False)
class Training:
    """n training rows and m test rows of one target, with the options that all fits share."""

    inputs: Values  # (n, d), features of the training rows
    target: Values  # (n,), targets of the training rows, scaled by `scaling`
    folds: Folds  # (n,), fold of each training row
    test_inputs: Values  # (m, d), features of the test rows, which no search sees
    test_target: Values  # (m,), targets of the test rows, in the target's unit
    normalisation: str = "l2"  # scaling of the features; see `learn.models.pipeline`
    seed: int = 0  # seed of the models' random draws
    scaling: Scaling = field(default_factory=Scaling)  # scaling of the target
    # (n,), number of the surface of each training row; None if the model does not need it
    groups: Indices | None = None

    def seen_by(self, model: str) -> Self:
        """Return the training as a model sees it.

        The mean of a population sees targets in their unit, and the surface of each row: `groups`
        are kept, and `scaling` changes nothing. All other models see scaled targets, and no
        surfaces: `groups` are None.

        Parameters
        ----------
        model : str
            Name of the model.

        Returns
        -------
        Training
            The training for fits of this model.
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
            Values by setting, on top of the settings of the baseline.
        tuned : bool
            True to set those settings too that all candidates of a search share (`Model.tuned`).

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
        """Return the keyword arguments for the `fit` of a pipeline, besides inputs and target.

        Parameters
        ----------
        rows : ndarray, shape (k,), or slice
            Positions of the training rows that are fitted; all rows by default.

        Returns
        -------
        dict of str to ndarray, shape (k,)
            The surface of each of these rows, if the training has `groups`; otherwise empty.
        """
        if self.groups is None:
            return {}
        return {f"{STEP}__surfaces": self.groups[rows]}

    @property
    def rows(self) -> int:
        """Number of training rows."""
        return self.target.size

    def first(self, rows: int) -> Self:
        """Return a training with the first training rows only, and all test rows.

        Parameters
        ----------
        rows : int
            Largest number of training rows that are kept.

        Returns
        -------
        Training
            The smaller training.
        """
        groups = self.groups
        if groups is not None:
            groups = groups[:rows]
        return replace(
            self,
            inputs=self.inputs[:rows],
            target=self.target[:rows],
            folds=self.folds[:rows],
            groups=groups,
        )


class Place(NamedTuple):
    """The key of a trial: no two trials of a file have equal keys."""

    candidate: str  # name of the candidate, from `learn.comparison.grid.key`
    fold: int  # fold that was left out of the training, and predicted
    rows: int  # largest number of training rows


class Trial(documents.Document):
    """The score of one candidate on one fold, which is a line of the file."""

    model_config = ConfigDict(frozen=True)

    candidate: str  # name of the candidate, from `learn.comparison.grid.key`
    # fold that was left out of the training, and predicted
    fold: Annotated[int, Field(ge=0, lt=FOLDS)]
    rows: Count  # largest number of training rows
    # R2 on the fold; None if the fit failed or diverged
    r2: Annotated[float, Field(ge=LEAST_SCORE, le=1)] | None
    failure: str = ""  # why there is no score; "" if there is one
    remark: str = ""  # warnings of the fit
    # processor time of fit and scoring over the number of candidates that the fit serves [s]
    seconds: Seconds = 0.0

    @property
    def place(self) -> Place:
        """Key of the trial."""
        return Place(candidate=self.candidate, fold=self.fold, rows=self.rows)


class Trials(AbstractContextManager["Trials"]):
    """The finished trials of one model and target, in a file that stays open for more.

    The file and its folder are made if they do not exist. The first line of the file has the
    conditions, every other line a trial. A last line without an end, which a killed process left,
    is removed. Leaving the context closes the file.

    Parameters
    ----------
    path : Path
        The file.
    conditions : dict
        Data, split, versions and seeds that all trials have in common, of types that JSON has.

    Attributes
    ----------
    finished : dict of Place to Trial
        All trials in the file.

    Raises
    ------
    InputError
        If the file has trials of other conditions, is damaged or cannot be written.
    """

    def __init__(self, path: Path, conditions: dict[str, object]) -> None:
        self.path = path
        self.finished: dict[Place, Trial] = {}
        header = json.dumps(conditions, sort_keys=True)
        # A new file has the line of the conditions only.
        lines = _whole_lines(path) or [header.encode()]
        stored = documents.parse(path, lines[0], documents.Document)
        # By way of JSON, tuples become lists as in the file.
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
        """Add the trials of one fit to `finished` and to the file, which is flushed.

        Parameters
        ----------
        trials : sequence of Trial
            One trial for each candidate of the fit.

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
    """Return the complete lines of a file, without line ends; an empty list if there is no file."""
    if not path.exists():
        return []
    # Whatever follows the last line end is not a complete line.
    *lines, _ = files.read_bytes(path).split(b"\n")
    return lines


@dataclass(frozen=True)
class FoldScore:
    """The score of a candidate on one fold, or the reason why there is none."""

    r2: float | None  # None if the fit failed or diverged
    failure: str = ""  # why there is no score; "" if there is one


def fit(training: Training, task: Task) -> list[Trial]:
    """Fit the candidates of a task, and score each of them on the fold that is left out.

    If the fit that serves several candidates fails, each candidate is fitted by itself. A fit to a
    share of the training rows has the same share of the epochs (`EPOCHS`).

    Parameters
    ----------
    training : Training
        All training rows.
    task : Task
        Candidates, fold and largest number of rows.

    Returns
    -------
    list of Trial
        One trial for each candidate, in the order of the task. The trial of a candidate whose fit
        failed has the reason in place of a score.

    Raises
    ------
    InputError
        If this machine lacks the memory for the fit.
    """
    training = training.seen_by(task.model)
    # Positions of the rows that are fitted.
    inside = np.flatnonzero(training.folds != task.fold)[: task.rows]
    check_memory(task.model, inside.size)
    with remarks() as warnings:
        began = process_time()
        try:
            scores = _scores(training, task, inside)
        # Libraries raise errors of any type. A candidate whose fit failed has no score.
        except Exception as error:
            if len(task.candidates) > 1:
                # Only one of the candidates may be at fault.
                return _fit_one_by_one(training, task)
            scores = [FoldScore(r2=None, failure=reason(error))]
        seconds = (process_time() - began) / len(task.candidates)
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
    """Fit each candidate of a task by itself, and return a trial for each."""
    trials = []
    for name, candidate in task.candidates.items():
        trials += fit(training, replace(task, candidates={name: candidate}))
    return trials


def _scores(training: Training, task: Task, inside: Indices) -> list[FoldScore]:
    """Fit a task, and return the score of each of its candidates on the fold that is left out.

    `inside` are the positions of the training rows that are fitted, (k,).
    """
    model = EVERY[task.model]
    candidates = [*task.candidates.values()]
    outside = training.folds == task.fold
    rows = FoldRows(
        inputs=training.inputs[inside],
        target=training.target[inside],
        test_inputs=training.inputs[outside],
    )
    # The setting for whose values one fit is enough; "", which no setting is called, without one.
    shared = ""
    if not task.baseline:  # A baseline is the only candidate of its fit.
        shared = model.shared
    # All settings but this one are equal for the candidates of a task.
    common = {name: value for name, value in candidates[0].items() if name != shared}
    if task.rows < training.rows:
        common = _with_fewer_epochs(common, task.rows / training.rows)
    unfitted = training.unfitted(task.model, common, tuned=not task.baseline)
    if shared in candidates[0]:
        values = [candidate[shared] for candidate in candidates]
        predictions = shared_predictions(model, unfitted, rows, shared, values)
    else:
        # There is one candidate, because candidates of a task differ in the shared setting only.
        arguments = training.fit_arguments(inside)
        fitted = unfitted.fit(rows.inputs, rows.target, **arguments)
        predictions = [fitted.predict(rows.test_inputs)]
    truth = training.target[outside]
    return [_score(truth, prediction) for prediction in predictions]


def _with_fewer_epochs(settings: SettingValues, share: float) -> SettingValues:
    """Return settings with a share of their `EPOCHS`, which is above 0 and at most 1."""
    limits = {
        name: math.ceil(share * settings[name]) for name in EPOCHS if name in settings
    }
    return {**settings, **limits}


def reason(error: Exception) -> str:
    """Return the reason why a fit has failed.

    Parameters
    ----------
    error : Exception
        The error of a library.

    Returns
    -------
    str
        The first `REMARK_LENGTH` letters of the error's text, in one line; the name of its type if
        it has no text.
    """
    in_one_line = " ".join(str(error).split())
    return in_one_line[:REMARK_LENGTH] or type(error).__name__


def _score(truth: Values, prediction: Values) -> FoldScore:
    """Return R2 of predicted targets, (m,), against true ones, (m,), or why there is no score."""
    if not np.isfinite(prediction).all():
        return FoldScore(r2=None, failure="prediction not finite")
    # Squares of predictions that diverged may overflow.
    with np.errstate(over="ignore"):
        r2 = float(r2_score(truth, prediction))
    if LEAST_SCORE <= r2 < math.inf:  # False for NaN, too
        return FoldScore(r2=r2)
    return FoldScore(r2=None, failure="prediction diverged")


@dataclass(frozen=True, eq=False)
class FoldRows:
    """The rows of a fit: n rows to train on, and m rows to predict."""

    inputs: Values  # (n, d), features of the training rows
    target: Values  # (n,), scaled targets of the training rows
    test_inputs: Values  # (m, d), features of the rows to predict


def shared_predictions(
    model: Model, unfitted: Any, rows: FoldRows, name: str, values: Sequence[Any]
) -> list[Values]:
    """Predict rows with several values of a setting, for which one fit is enough.

    Parameters
    ----------
    model : Model
        The model.
    unfitted : Pipeline
        Unfitted pipeline of scikit-learn with all other settings. Its steps may be fitted in place.
    rows : FoldRows
        Rows to train on and to predict.
    name : str
        Name of the setting: "n_estimators", or "alpha" of kernel ridge.
    values : sequence
        Values of the setting.

    Returns
    -------
    list of ndarray, shape (m,)
        Predictions with each value, in the order of `values`.
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
    # The first trees of the fit with the largest number are the models with fewer trees.
    estimator.set_params(**{name: max(values)}).fit(inputs, rows.target)
    predict_first = FIRST_TREES[model.name]
    return predict_first(estimator, test_inputs, values)


def _first_of_xgboost(
    estimator: Any, inputs: Values, numbers: Sequence[int]
) -> list[Values]:
    """Predict m rows with the first trees of a fitted XGBoost, (m,) for each number of trees."""
    return [estimator.predict(inputs, iteration_range=(0, number)) for number in numbers]


def _first_of_boosting(
    estimator: Any, inputs: Values, numbers: Sequence[int]
) -> list[Values]:
    """Predict m rows with the first trees of gradient boosting, (m,) for each number of trees."""
    stages = [prediction.copy() for prediction in estimator.staged_predict(inputs)]
    return [stages[number - 1] for number in numbers]


def _first_of_forest(
    estimator: Any, inputs: Values, numbers: Sequence[int]
) -> list[Values]:
    """Predict m rows with the first trees of a random forest, (m,) for each number of trees.

    Predictions are added in the order of the forest's own `predict`, so that the means are equal to
    the last bit.
    """
    sums = np.cumsum(_of_trees(estimator, inputs), axis=0)
    return [sums[number - 1] / number for number in numbers]


def _first_of_adaboost(
    estimator: Any, inputs: Values, numbers: Sequence[int]
) -> list[Values]:
    """Predict m rows with the first trees of AdaBoost, (m,) for each number of trees.

    A prediction is the weighted median of the trees' predictions, as in
    `AdaBoostRegressor.predict`. The library's own `staged_predict` would compute every tree again
    for every number. If boosting has ended early, a number above that of all trees gives the model
    of all trees.
    """
    of_trees = _of_trees(estimator, inputs)
    rows = np.arange(len(inputs))
    predictions = []
    for number in numbers:
        first = np.transpose(of_trees[:number])  # (m, number)
        order = np.argsort(first, axis=1)
        weight_so_far = np.cumsum(estimator.estimator_weights_[order], axis=1)
        half = 0.5 * weight_so_far[:, -1:]
        # The first tree, in the order of the predictions, with which half of the weight is reached.
        middle = (weight_so_far >= half).argmax(axis=1)
        predictions.append(first[rows, order[rows, middle]])
    return predictions


def _of_trees(estimator: Any, inputs: Values) -> list[Values]:
    """Return the predictions of all trees of an ensemble of scikit-learn, (m,) each."""
    # The trees have their thresholds, and expect features, in single precision.
    single = np.asarray(inputs, dtype=np.float32)
    return [tree.predict(single, check_input=False) for tree in estimator.estimators_]


FIRST_TREES: dict[str, Callable[[Any, Values, Sequence[int]], list[Values]]] = {
    "adaboost": _first_of_adaboost,
    "gradient-boost": _first_of_boosting,
    "random-forest": _first_of_forest,
    "xgboost": _first_of_xgboost,
}
"""Functions that predict with the first trees of an ensemble, by the name of its model.

They take a fitted estimator, features (m, d), and numbers of trees. They return predictions, (m,),
for each of these numbers.
"""
