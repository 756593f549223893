"""Fit a model to all training rows, score it, and time it alone.

A search's own times are taken while other fits run beside them; these are taken while the other
processes wait, on one thread, as medians.
"""

import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from statistics import median
from time import perf_counter
from typing import Any

import numpy as np

from learn import memory
from learn.arrays import Values
from learn.comparison.pruning import Settings
from learn.comparison.training_data import held
from learn.metrics import Scores, scores
from learn.models import MODELS, pipeline

FITS = (3, 7)
"""Fewest and most fits of a time."""

ENOUGH = 5.0
"""Seconds after which the fewest are enough."""

TOO_LONG = 300.0
"""Seconds after which no further fit is begun, however few there were."""


@dataclass(frozen=True)
class Final:
    """A model to fit.

    Attributes
    ----------
    model : its name
    settings : on top of the baseline's
    tuned : whether it is a search's winner
    """

    model: str
    settings: Settings = field(default_factory=dict)
    tuned: bool = False


@dataclass(frozen=True, eq=False)
class Times:
    """Medians, on one thread of one process [s].

    Attributes
    ----------
    fit : of a fit to all training rows
    fits : number of fits that the median is over
    test : of predicting the whole test set
    row : of predicting a single row
    """

    fit: float = math.nan
    fits: int = 0
    test: float = math.nan
    row: float = math.nan


@dataclass(frozen=True, eq=False)
class Outcome:
    """What became of a model.

    Attributes
    ----------
    train, test : scores on the training and the test rows, None if the fit failed
    prediction : (m,) of the test rows
    fitted : settings that the fit has found by itself, such as a kernel's length
    times : medians
    failure : why there are no scores
    remarks : warnings of the fit
    """

    train: Scores | None
    test: Scores | None
    prediction: Values
    fitted: dict[str, str]
    times: Times
    failure: str = ""
    remarks: tuple[str, ...] = ()


def measure(final: Final) -> Outcome:
    """Fit, score and time a model on the data that this process holds."""
    training = held()
    model = MODELS[final.model]
    settings = {**final.settings, **(model.refit if final.tuned else {})}
    unfitted = pipeline(
        model,
        settings,
        normalisation=training.normalisation,
        seed=training.seed,
        tuned=final.tuned,
    )
    need = memory.needed(model.name, training.target.size, baseline=not final.tuned)
    with memory.reserved(need), warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            outcome = _measured(unfitted)
        except Exception as error:  # whatever a library raises: the model has no scores
            text = " ".join(str(error).split())[:300] or type(error).__name__
            outcome = Outcome(None, None, np.empty(0), {}, Times(), failure=text)
    remarks = tuple(dict.fromkeys(" ".join(str(each.message).split()) for each in caught))
    return Outcome(**{**vars(outcome), "remarks": remarks})


def _measured(unfitted: Any) -> Outcome:
    training = held()
    first = perf_counter()
    fitted = unfitted.fit(training.inputs, training.target)
    fits = [perf_counter() - first]
    restored = training.scaling.restored
    prediction = restored(fitted.predict(training.test_inputs))
    train = scores(restored(training.target), restored(fitted.predict(training.inputs)))
    test = scores(training.test_target, prediction)
    # The first of several is a warm-up; the only one of a long fit has to do.
    fits = _repeated(lambda: unfitted.fit(training.inputs, training.target), FITS, fits[0]) or fits
    times = Times(
        fit=median(fits),
        fits=len(fits),
        test=median(_repeated(lambda: fitted.predict(training.test_inputs), (3, 9), 0.0)),
        row=median(_repeated(lambda: fitted.predict(training.test_inputs[:1]), (5, 99), 0.0)),
    )
    return Outcome(train, test, prediction, _found(fitted), times)


def _repeated(action: Callable[[], Any], bounds: tuple[int, int], spent: float) -> list[float]:
    """Times of an action, as many as are affordable after what was spent already."""
    taken: list[float] = []
    while len(taken) < bounds[1] and spent < TOO_LONG:
        if len(taken) >= bounds[0] and sum(taken) > ENOUGH:
            break
        began = perf_counter()
        action()
        taken.append(perf_counter() - began)
        spent += taken[-1]
    return taken


def _found(fitted: Any) -> dict[str, str]:
    """What the fit itself has chosen."""
    estimator = fitted.named_steps["model"]
    kernel = getattr(estimator, "kernel_", None)
    found = {} if kernel is None else {"kernel": str(kernel)}
    epochs = getattr(estimator, "n_iter_", None)
    if isinstance(epochs, int):
        found["iterations"] = str(epochs)
    return found
