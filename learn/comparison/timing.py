"""Fit a model to all training rows, score it, and time it while nothing else runs.

The times of a search are taken while other fits run beside them. These are taken while the other
processes wait, on one thread, as medians.
"""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from statistics import median
from time import perf_counter
from typing import Any

import numpy as np

from learn import bounded
from learn.arrays import Values
from learn.comparison.grid import Settings
from learn.comparison.training import Training
from learn.metrics import Scores, scores
from learn.models import MODELS, STEP, pipeline, remarks

FITS = (3, 7)
"""Fewest and most fits that a median is over."""

ENOUGH = 5.0
"""Seconds after which the fewest repetitions are enough."""

TOO_LONG = 300.0
"""Seconds after which no further repetition is begun."""

NO_TIMES = {"fit": None, "fits": 0, "test": None, "row": None}
"""Times of a fit that has failed."""


@dataclass(frozen=True)
class TimedFit:
    """A model to fit to all training rows.

    Attributes
    ----------
    model : str
        Name of the model.
    settings : dict
        Settings on top of the baseline's.
    tuned : bool
        Whether it is the winner of a search.
    baseline : bool
        Whether it is the baseline: always, unless `tuned` says that it is a search's winner.
    until : float
        Time of `time.time` at which the fit is stopped [s].
    """

    model: str
    settings: Settings = field(default_factory=dict)
    tuned: bool = False
    baseline: bool = False
    until: float = math.inf

    @property
    def of_grid(self) -> bool:
        """Whether it has the settings that all candidates of a grid share."""
        return self.tuned and not self.baseline

    @property
    def kind(self) -> str:
        """Name of the folder of its result."""
        return "tuned" if self.tuned else "baseline"


@dataclass(frozen=True, eq=False)
class FitResult:
    """Scores, predictions and times of a model.

    Attributes
    ----------
    train, test : Scores or None
        Scores on the training and the test rows, None if the fit failed.
    prediction : ndarray, shape (m,)
        Predictions of the test rows, empty if the fit failed.
    fitted : dict
        Settings that the fit has chosen by itself, such as a kernel's length.
    times : dict
        Medians, on one thread of one process: "fit" to all training rows, which is over "fits"
        fits, prediction of the "test" set and of a single "row" [s]; None if the fit failed.
    failure : str
        The reason why there are no scores.
    remarks : tuple of str
        Warnings of the fit.
    """

    train: Scores | None
    test: Scores | None
    prediction: Values
    fitted: dict[str, str]
    times: dict[str, float | None]
    failure: str = ""
    remarks: tuple[str, ...] = ()


def fit_in_time(training: Training, task: TimedFit) -> FitResult | None:
    """Fit, score and time a model; None if that was stopped at its time."""
    return bounded.call(fit_and_time, training, task, task.until)


def fit_and_time(training: Training, task: TimedFit) -> FitResult:
    """Fit, score and time a model."""
    unfitted = pipeline(
        MODELS[task.model],
        task.settings,
        normalisation=training.normalisation,
        seed=training.seed,
        tuned=task.of_grid,
    )
    with remarks() as said:
        try:
            result = _scored_and_timed(training, unfitted, task.until)
        except Exception as error:  # whatever a library raises: the model has no scores
            text = " ".join(str(error).split())[:300] or type(error).__name__
            result = FitResult(None, None, np.empty(0), {}, {**NO_TIMES}, failure=text)
    return replace(result, remarks=tuple(said))


def _scored_and_timed(training: Training, unfitted: Any, until: float) -> FitResult:
    first = perf_counter()
    fitted = unfitted.fit(training.inputs, training.target)
    alone = perf_counter() - first
    restored = training.scaling.restored
    prediction = restored(fitted.predict(training.test_inputs))
    train = scores(restored(training.target), restored(fitted.predict(training.inputs)))
    test = scores(training.test_target, prediction)
    chosen = _chosen(fitted)
    times: dict[str, float | None] = {
        "test": median(repeated(lambda: fitted.predict(training.test_inputs), (3, 9))),
        "row": median(repeated(lambda: fitted.predict(training.test_inputs[:1]), (5, 99))),
    }

    def again() -> None:
        unfitted.fit(training.inputs, training.target)

    # The first of several fits is a warm-up; a fit that is too long to be repeated counts itself.
    fits = repeated(again, FITS, alone, until) or [alone]
    return FitResult(
        train, test, prediction, chosen, {**times, "fit": median(fits), "fits": len(fits)}
    )


def repeated(
    action: Callable[[], Any],
    bounds: tuple[int, int],
    before: float = 0.0,
    until: float = math.inf,
) -> list[float]:
    """Time an action repeatedly.

    Parameters
    ----------
    action : callable
        The action.
    bounds : tuple of int
        Fewest and most repetitions; fewer, even none, if they take too long.
    before : float
        Time that the action took before, which tells whether another one ends in time [s].
    until : float
        Time of `time.time` by which the last one has to end [s].

    Returns
    -------
    list of float
        Times [s].
    """
    taken: list[float] = []
    while len(taken) < bounds[1] and before + sum(taken) < TOO_LONG:
        if len(taken) >= bounds[0] and sum(taken) > ENOUGH:
            break
        if time.time() + 2 * max([before, *taken]) >= until:
            break
        began = perf_counter()
        action()
        taken.append(perf_counter() - began)
    return taken


def _chosen(fitted: Any) -> dict[str, str]:
    """Return the settings that the fit itself has chosen."""
    estimator = fitted.named_steps[STEP]
    kernel = getattr(estimator, "kernel_", None)
    chosen = {} if kernel is None else {"kernel": str(kernel)}
    epochs = getattr(estimator, "n_iter_", None)
    if isinstance(epochs, int):
        chosen["iterations"] = str(epochs)
    return chosen
