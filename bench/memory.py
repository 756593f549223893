"""Peak memory of the nine models, beside what `learn.memory` reckons with.

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
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bench.page.content import Content, Table
from bench.report import Report
from bench.table import markdown
from gen.runtime.errors import InputError
from learn import memory
from learn.comparison.search.spaces import OPTIMA, SPACES
from learn.models import MODELS, STEP, pipeline

INPUTS = 23
SHARES = (0.05, 0.1)
"""Of the trees of an ensemble that are fitted."""

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


@dataclass(frozen=True)
class Peak:
    """Memory of one model.

    Attributes
    ----------
    model : name
    rows : training rows
    estimators : trees of the dearest candidate, 1 for a model without
    measured : peak of the largest fit made [GiB]
    peak : of the dearest candidate, carried on from the fits made [GiB]
    reckoned : what `learn.memory.needed` says [GiB]
    """

    model: str
    rows: int
    estimators: int
    measured: float
    peak: float
    reckoned: float


def measure(
    names: list[str], rows: int, remark: Callable[[str], None] = lambda line: None
) -> list[Peak]:
    """Fit models to random rows and take their peaks.

    Parameters
    ----------
    names : of models, all nine if empty
    rows : training rows
    remark : told of each model

    Raises
    ------
    InputError
        If a name is unknown, or a fit needs more than this machine has.
    """
    unknown = set(names) - MODELS.keys()
    if unknown:
        raise InputError(f"--model {min(unknown)!r}: give some of {', '.join(MODELS)}")
    found = []
    for name in names or list(MODELS):
        memory.check(name, rows)
        peak = _peak(name, rows)
        remark(f"{name}: {peak.peak:.2f} GiB, reckoned with {peak.reckoned:.2f}")
        found.append(peak)
    return found


def report(peaks: list[Peak]) -> Report:
    """Return the peaks as a file, and as lines of Markdown."""
    header = ("model", "training rows", "peak [GiB]", "reckoned with [GiB]")
    lines = ((p.model, f"{p.rows:,}", f"{p.peak:.2f}", f"{p.reckoned:.2f}") for p in peaks)
    return Report({"memory": peaks}, text=markdown(header, lines))


def contents(folder: Path) -> list[Content]:
    """List what a page shows of a folder that `report` has written."""
    return [
        Table(folder / "memory.csv", "Peak memory [GiB] of the dearest fit of each model's space.")
    ]


def _peak(name: str, rows: int) -> Peak:
    """Measure one model."""
    reckoned = memory.needed(name, rows) / 2**30
    most = max(SPACES[name].get("n_estimators", [1]))
    if most == 1:
        measured = _in_its_own_process(name, rows, 1)
        return Peak(name, rows, 1, measured, measured, reckoned)
    few, more = (max(1, round(share * most)) for share in SHARES)
    low, high = (_in_its_own_process(name, rows, number) for number in (few, more))
    each = max(high - low, 0.0) / (more - few)
    return Peak(name, rows, most, high, high + each * (most - more), reckoned)


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
