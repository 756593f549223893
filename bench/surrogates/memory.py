"""Peak memory of fits of the nine models, beside the memory that is reckoned with before a fit.

Each fit runs in a process of its own, because the peak of a process never falls. The memory of an
ensemble is a linear function of its number of trees: it is measured with `SHARES` of the trees and
extrapolated to all of them. Three fits are cut short, because further steps take no more memory.
The Gaussian process evaluates its likelihood once. The support vector machine and the perceptron
have a limit of iterations, within which the cache of kernel rows of the former becomes full.
"""

import multiprocessing
import resource
import sys
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bench.files import Row
from bench.report import remark
from gen.arrays import Values
from gen.runtime.errors import InputError
from learn.comparison.grid import INPUTS
from learn.comparison.paper import OPTIMA, SPACES
from learn.models import MODELS, STEP, check_memory, models_named, needed_memory, pipeline

GIB = 2**30
"""Bytes of a GiB."""

SHARES = (0.05, 0.1)
"""Shares of the largest number of trees of an ensemble that are fitted."""

FEWEST_ROWS = 100
"""Smallest number of training rows that is accepted."""

LARGEST: dict[str, dict[str, Any]] = {
    "decision-tree": {"max_depth": 30},
    "random-forest": {"max_depth": 100, "max_features": "sqrt"},
    "adaboost": {"estimator__max_depth": 35},
    "xgboost": {"max_depth": 15, "learning_rate": 0.01},
    "gradient-boost": {"max_depth": 100, "max_features": "sqrt"},
    "svm": {**OPTIMA["svm"], "max_iter": 50_000},
    "gaussian-process": {"alpha": 0.0374},
    "kernel-ridge": {"alpha": 1e-5, "gamma": 5.0, "kernel": "rbf"},
    "mlp": {
        "hidden_layer_sizes": (50, 100, 200, 100, 50),
        "solver": "lbfgs",
        "max_iter": 5,
    },
}
"""Settings of the candidate of each grid that takes the most memory, without its trees."""

TREES = "n_estimators"
"""Name of the setting that is the number of trees."""


@dataclass(frozen=True)
class _Peaks:
    """Most memory that a process has held since it began, at two times [GiB]."""

    before: float  # before the fit
    after: float  # after the fit and a prediction


def memory(models: list[str], rows: int) -> list[Row]:
    """Fit models to random rows, and compare their peak memory with the one reckoned with.

    Progress is printed on standard error.

    Parameters
    ----------
    models : list of str
        Names of the models; all nine if it is empty.
    rows : int
        Number of training rows, `FEWEST_ROWS` or more.

    Returns
    -------
    list of Row
        One row for each model: its training rows; its largest number of trees, 1 without trees; the
        memory of the process before the fit (`before`), the peak of the candidate that takes the
        most (`peak`), and what `learn.models.needed_memory` reckons with (`reckoned`) [GiB].

    Raises
    ------
    InputError
        If a name is unknown, there are too few rows, or a fit needs more than this machine has.
    """
    if rows < FEWEST_ROWS:
        raise InputError(f"--rows {rows}: give {FEWEST_ROWS} or more")
    names = [model.name for model in models_named(models) if model.name in LARGEST]
    table = []
    for name in names:
        check_memory(name, rows)
        row = _row(name, rows)
        remark(f"{name}: {row['peak']:.2f} GiB, reckoned with {row['reckoned']:.2f}")
        table.append(row)
    return table


def _row(name: str, rows: int) -> Row:
    """Measure a model; the peak of an ensemble is extrapolated to its largest number of trees."""
    trees = max(SPACES[name].get(TREES, [1]))
    fewer_trees, fitted_trees = (max(1, round(share * trees)) for share in SHARES)
    peaks = _measured(name, rows, fitted_trees)
    peak = peaks.after
    if trees > 1:
        peak_of_fewer = _measured(name, rows, fewer_trees).after
        of_a_tree = max(peak - peak_of_fewer, 0.0) / (fitted_trees - fewer_trees)
        peak += of_a_tree * (trees - fitted_trees)
    return {
        "model": name,
        "rows": rows,
        "trees": trees,
        "before": peaks.before,
        "peak": peak,
        "reckoned": needed_memory(name, rows) / GIB,
    }


def _measured(name: str, rows: int, trees: int) -> _Peaks:
    """Fit a model in a new process, and return its peaks."""
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        peaks: _Peaks = pool.apply(_fit, (name, rows, trees))
    return peaks


def _fit(name: str, rows: int, trees: int) -> _Peaks:
    """Fit a model to random rows, predict a fifth of them, and return this process's peaks."""
    rng = np.random.default_rng(0)
    inputs = rng.uniform(0.1, 1.0, (rows, INPUTS))
    target = inputs[:, 0] ** 2 + inputs[:, 1] + 0.1 * rng.normal(size=rows)
    estimator = pipeline(MODELS[name], LARGEST[name], tuned=True)
    if "max_iter" in LARGEST[name]:
        # The tuned settings have more steps than are needed to see the memory.
        estimator.set_params(**{f"{STEP}__max_iter": LARGEST[name]["max_iter"]})
    if TREES in SPACES[name]:
        estimator.set_params(**{f"{STEP}__{TREES}": trees})
    if name == "gaussian-process":
        estimator.set_params(**{f"{STEP}__optimizer": _one_step})
    before = _peak_of_this_process()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # trainings are cut short on purpose
        estimator.fit(inputs, target)
        estimator.predict(inputs[: rows // 5])
    return _Peaks(before=before, after=_peak_of_this_process())


def _peak_of_this_process() -> float:
    """Return the most memory that this process has held since it began [GiB].

    On Linux, `ru_maxrss` would begin with the peak of the process that started this one.
    """
    try:
        status = Path("/proc/self/status").read_text(encoding="ascii")
        kibibytes = int(status.partition("VmHWM:")[2].split()[0])
    except (OSError, IndexError, ValueError):
        bytes_per_unit = 1 if sys.platform == "darwin" else 1024
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * bytes_per_unit / GIB
    return kibibytes * 1024 / GIB


def _one_step(objective: Any, start: Values, **_: object) -> tuple[Values, float]:
    """Evaluate the likelihood and its gradient once, in place of an optimiser."""
    value, _gradient = objective(start)
    return start, float(value)
