"""Fits of a search: their data, one fit that serves many candidates, and finished fits on disk.

A fit with the largest number of estimators contains all smaller ones: its first k trees are the
model with k trees, to the last bit (`tests/learn/comparison/test_fits.py`). One kernel matrix
serves every alpha of kernel ridge.

No fit is done twice, whatever interrupts a search: each model and target has one file of lines
(JSON), to which the master appends a line when a fit has come back.
"""

import json
import math
from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, replace
from pathlib import Path
from time import perf_counter
from typing import Annotated, Any, Self

import numpy as np
from pydantic import ConfigDict, Field
from sklearn.metrics import r2_score

from gen.arrays import Indices, Values
from gen.runtime import documents, files
from gen.runtime.errors import InputError
from learn import kernel_ridge
from learn.comparison.folder import Count, Seconds, require_same
from learn.comparison.grid import Settings, Task
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
        """Return the training as a model sees it: targets as they are for means over surfaces."""
        if model != POPULATION.name:
            return replace(self, groups=None)
        return replace(self, target=self.scaling.restored(self.target), scaling=Scaling())

    def unfitted(self, model: str, settings: Settings, *, tuned: bool) -> Any:
        """Return the pipeline of a model; see `learn.models.pipeline`."""
        scaling, seed = self.normalisation, self.seed
        return pipeline(
            EVERY[model], settings, normalisation=scaling, seed=seed, tuned=tuned
        )

    def beside(self, rows: Indices | slice = slice(None)) -> dict[str, Indices]:
        """Return what the fit of a pipeline takes beside inputs and target of some rows."""
        return {} if self.groups is None else {f"{STEP}__surfaces": self.groups[rows]}

    @property
    def rows(self) -> int:
        """Number of training rows."""
        return self.target.size

    def first(self, rows: int) -> Self:
        """Return the same with the first training rows only."""
        some = {
            name: getattr(self, name)[:rows] for name in ("inputs", "target", "folds")
        }
        return replace(
            self, **some, groups=None if self.groups is None else self.groups[:rows]
        )


class Trial(documents.Document):
    """The score of one candidate on one fold, a line of the file."""

    model_config = ConfigDict(frozen=True)

    candidate: str  # its canonical settings, as `learn.comparison.grid.key` writes them
    fold: Annotated[int, Field(ge=0, lt=FOLDS)]  # left out of the training
    rows: Count  # for training at most
    r2: (
        Annotated[float, Field(ge=LEAST_SCORE, le=1)] | None
    )  # None if the fit failed or diverged
    failure: str = ""  # why there is no score
    remark: str = ""  # the fit's warnings
    seconds: Seconds = (
        0.0  # of fit and scoring, shared evenly by the candidates of one fit
    )

    @property
    def place(self) -> tuple[str, int, int]:
        """Candidate, fold and number of rows, which identify the trial."""
        return self.candidate, self.fold, self.rows


class Trials(AbstractContextManager["Trials"]):
    """The finished trials of one model and target, in a file that is held open.

    All have data, split, versions and seeds in common, the conditions. InputError is raised if the
    file holds trials of other conditions, is damaged or cannot be written.
    """

    def __init__(self, path: Path, conditions: dict[str, object]) -> None:
        self.path = path
        self.finished: dict[tuple[str, int, int], Trial] = {}
        content = files.read_bytes(path) if path.exists() else b""
        # A kill may have cut the last line short.
        whole = content[: content.rfind(b"\n") + 1]
        agreed = json.dumps(conditions, sort_keys=True)
        first, *lines = whole.split(b"\n")[:-1] or [agreed.encode()]
        stored = documents.parse(path, first, documents.Document)
        require_same(path, stored, json.loads(agreed))
        for number, line in enumerate(lines, start=2):
            trial = Trial(**documents.parse(f"{path}, line {number}", line, Trial))
            self.finished[trial.place] = trial
        files.make_folder(path.parent)
        files.write(path, b"\n".join([first, *lines, b""]))
        self._file = path.open("ab")

    def __exit__(self, *_: object) -> None:
        """Close the file."""
        self._file.close()

    def add(self, trials: list[Trial]) -> None:
        """Write the trials of one fit to the disk; InputError is raised if that is full."""
        lines = [json.dumps(trial.model_dump(), allow_nan=False) for trial in trials]
        try:
            self._file.write("".join(f"{line}\n" for line in lines).encode())
            self._file.flush()
        except OSError as error:
            raise InputError(f"{self.path} cannot be written: {error.strerror}") from None
        self.finished.update((trial.place, trial) for trial in trials)


def fit(training: Training, task: Task) -> list[Trial]:
    """Fit the candidates of a task and score each on the fold that was left out.

    A fit that fails is a result too: its trials have no score, but the reason. InputError is raised
    if this machine lacks the memory.
    """
    training = training.seen_by(task.model)
    outside, model = training.folds == task.fold, EVERY[task.model]
    candidates = [*task.candidates.values()]
    inside = np.flatnonzero(~outside)[: task.rows]
    data = training.inputs[inside], training.target[inside], training.inputs[outside]
    check_memory(task.model, inside.size)
    shared = "" if task.baseline else model.shared
    common = {k: v for k, v in candidates[0].items() if k != shared}
    with remarks() as said:
        began = perf_counter()
        try:
            unfitted = training.unfitted(task.model, common, tuned=not task.baseline)
            if shared in candidates[0]:
                values = [candidate[shared] for candidate in candidates]
                found = shared_predictions(model, unfitted, data, shared, values)
            else:
                fitted = unfitted.fit(*data[:2], **training.beside(inside))
                found = [fitted.predict(data[2])]
            scores = [_score(training.target[outside], each) for each in found]
        except (
            Exception
        ) as error:  # whatever a library raises: the candidates have no score
            if len(candidates) > 1:
                # A shared fit may fail late, after candidates that are fine: fit them one by one.
                alone = [
                    replace(task, candidates={n: c}) for n, c in task.candidates.items()
                ]
                return [trial for own in alone for trial in fit(training, own)]
            scores = [(None, reason(error))]
        seconds = (perf_counter() - began) / len(candidates)
    of_all: dict[str, Any] = {"remark": "; ".join(said), "seconds": seconds}
    return [
        Trial(
            candidate=name,
            fold=task.fold,
            rows=task.rows,
            r2=r2,
            failure=failure,
            **of_all,
        )
        for name, (r2, failure) in zip(task.candidates, scores, strict=True)
    ]


def reason(error: Exception) -> str:
    """Say in one line why a fit has failed."""
    return " ".join(str(error).split())[:REMARK_LENGTH] or type(error).__name__


def _score(truth: Values, predicted: Values) -> tuple[float | None, str]:
    """Return R2, or None, and the reason why there is none."""
    if not np.isfinite(predicted).all():
        return None, "prediction not finite"
    with np.errstate(over="ignore"):  # squares of diverged predictions
        score = float(r2_score(truth, predicted))
    return (
        (score, "") if LEAST_SCORE <= score < math.inf else (None, "prediction diverged")
    )


def shared_predictions(
    model: Model,
    pipeline: Any,
    data: tuple[Values, Values, Values],
    name: str,
    values: Sequence[Any],
) -> list[Values]:
    """Predict with every value of the setting, by its name, that one fit serves, (m,) each.

    The pipeline is unfitted, with all other settings; the data are training inputs, (n, d), their
    target, (n,), and test inputs, (m, d).
    """
    train, target, test = data
    scaling, estimator = pipeline.named_steps["scaling"], pipeline.named_steps[STEP]
    if scaling != "passthrough":
        train = scaling.fit_transform(train)
        test = scaling.transform(test)
    if model.name == "kernel-ridge":
        settings = {
            key: value for key, value in estimator.get_params().items() if key != name
        }
        return kernel_ridge.predictions(train, target, test, settings, values)
    estimator.set_params(**{name: max(values)}).fit(train, target)
    return _of_first_trees(model.name, estimator, test, values)


def _of_first_trees(
    model: str, estimator: Any, test: Values, numbers: Sequence[int]
) -> list[Values]:
    """Predict with each number of the first trees of an ensemble, (m,) each."""
    if model == "xgboost":
        return [
            estimator.predict(test, iteration_range=(0, number)) for number in numbers
        ]
    if model == "gradient-boost":
        stages = [predicted.copy() for predicted in estimator.staged_predict(test)]
        return [stages[number - 1] for number in numbers]
    single = np.asarray(test, dtype=np.float32)
    of_trees = [tree.predict(single, check_input=False) for tree in estimator.estimators_]
    if model == "random-forest":  # running means, added up in the forest's own order
        sums = np.cumsum(of_trees, axis=0)
        return [sums[number - 1] / number for number in numbers]
    # Weighted medians, as `AdaBoostRegressor.predict` takes them; its own `staged_predict` computes
    # every tree again for every stage. Where boosting ended early larger numbers are one model.
    found, rows = [], np.arange(len(test))
    for number in numbers:
        first = np.transpose(of_trees[:number])
        order = np.argsort(first, axis=1)
        share = np.cumsum(estimator.estimator_weights_[order], axis=1)
        middle = (share >= 0.5 * share[:, -1:]).argmax(axis=1)
        found.append(first[rows, order[rows, middle]])
    return found
