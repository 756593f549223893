"""Peak memory of the nine models, beside the estimate of `learn.memory`.

Each fit runs in a process of its own, since the peak of a process never falls. Ensembles are fitted
with a tenth and a twentieth of their largest number of trees: their memory is a line in it, which
is then carried on. The tuned Gaussian process takes a single step of its likelihood's ascent; the
further ones need the same memory again, not more. The support vector machine ends after so many
iterations that its cache of kernel rows is full.
"""

import multiprocessing
import resource
import sys
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from bench.report import Report, remark
from bench.table import formatted
from gen.runtime.errors import InputError
from learn import memory
from learn.comparison.search.spaces import OPTIMA, SPACES
from learn.models import MODELS, STEP, pipeline

INPUTS = 23
SHARES = (0.05, 0.1)  # of the trees of an ensemble that are fitted

LARGEST: dict[str, dict[str, Any]] = {
    "decision-tree": {"max_depth": 30},
    "random-forest": {"max_depth": 100, "max_features": "sqrt"},
    "adaboost": {"estimator__max_depth": 35},
    "xgboost": {"max_depth": 15, "learning_rate": 0.01},
    "gradient-boost": {"max_depth": 100, "max_features": "sqrt"},
    "svm": {**OPTIMA["svm"], "max_iter": 50_000},
    "gaussian-process": {"alpha": 0.0374},
    "kernel-ridge": {"alpha": 1e-5, "gamma": 5.0, "kernel": "rbf"},
    "mlp": {"hidden_layer_sizes": (50, 100, 200, 100, 50), "solver": "lbfgs", "max_iter": 5},
}
"""Settings of the search spaces that take the most memory."""


COLUMNS = {
    "model": "{model}",
    "training rows": "{rows:,}",
    "peak [GiB]": "{peak:.2f}",
    "reckoned with [GiB]": "{reckoned:.2f}",
}


def measure(names: list[str], rows: int) -> list[dict[str, Any]]:
    """Fit models, all nine if none are named, to random rows and take their peaks.

    Raises
    ------
    InputError
        If a name is unknown, or a fit needs more than this machine has.
    """
    unknown = set(names) - MODELS.keys()
    if unknown:
        raise InputError(f"--model {min(unknown)!r}: give some of {', '.join(MODELS)}")
    peaks = []
    for name in names or list(MODELS):
        memory.check(name, rows)
        peaks.append(_peak(name, rows))
        remark("{model}: {peak:.2f} GiB, reckoned with {reckoned:.2f}".format(**peaks[-1]))
    return peaks


def report(peaks: list[dict[str, Any]]) -> Report:
    """Make a report of what was measured."""
    return Report({"memory": peaks}, text=formatted(COLUMNS, peaks))


def _peak(name: str, rows: int) -> dict[str, Any]:
    """Measure one model: the largest fit made, and the dearest candidate, carried on from it."""
    most = max(SPACES[name].get("n_estimators", [1]))
    few, more = (max(1, round(share * most)) for share in SHARES)
    measured, each = _in_its_own_process(name, rows, more), 0.0
    if most > 1:
        each = max(measured - _in_its_own_process(name, rows, few), 0.0) / (more - few)
    return {
        "model": name,
        "rows": rows,
        "estimators": most,
        "measured": measured,
        "peak": measured + each * (most - more),
        "reckoned": memory.needed(name, rows) / 2**30,
    }


def _in_its_own_process(name: str, rows: int, estimators: int) -> float:
    """Peak of a fit [GiB]."""
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        return float(pool.apply(_fit, (name, rows, estimators)))


def _fit(name: str, rows: int, estimators: int) -> float:
    """Fit, predict a fifth as many rows, and return this process's peak [GiB]."""
    generator = np.random.default_rng(0)
    inputs = generator.uniform(0.1, 1.0, (rows, INPUTS))
    target = inputs[:, 0] ** 2 + inputs[:, 1] + 0.1 * generator.normal(size=rows)
    model = pipeline(MODELS[name], LARGEST[name], tuned=True)
    if "n_estimators" in SPACES[name]:
        model.set_params(**{f"{STEP}__n_estimators": estimators})
    if name == "gaussian-process":
        model.set_params(**{f"{STEP}__optimizer": _one_step})
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of epochs cut short, which is meant
        model.fit(inputs, target)
        model.predict(inputs[: max(rows // 5, 1)])
    return _peak_of_this_process()


def _peak_of_this_process() -> float:
    """Most memory that this process has held since it began [GiB].

    Linux's `ru_maxrss` would start from that of the process that began this one.
    """
    try:
        status = Path("/proc/self/status").read_text(encoding="ascii")
        return int(status.partition("VmHWM:")[2].split()[0]) * 1024 / 2**30
    except (OSError, IndexError, ValueError):
        unit = 1 if sys.platform == "darwin" else 1024
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 2**30


def _one_step(objective: Any, start: Any, bounds: Any) -> tuple[Any, float]:
    """An optimiser that evaluates once, with the gradient."""
    value, _ = objective(start)
    return start, float(value)
