"""One fit of a search, and what it is expected to cost."""

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from learn.comparison.pruning import Settings


@dataclass(frozen=True)
class Task:
    """One fit: candidates that it serves, and the fold that it leaves out.

    Attributes
    ----------
    model : name of the model
    candidates : canonical settings; they differ in the setting that one fit serves only
    fold : left out of the training, and predicted
    rows : training rows at most
    """

    model: str
    candidates: tuple[Settings, ...]
    fold: int
    rows: int


def expected_work(task: Task) -> float:
    """Guess the relative cost of a task of one model: for the order of tasks and the time left."""
    most = {
        name: max((c[name] for c in task.candidates), key=_magnitude) for name in task.candidates[0]
    }
    work = float(task.rows)
    for name in ("n_estimators", "max_features", "C"):
        work *= _magnitude(most.get(name, 1.0)) ** (0.5 if name == "C" else 1.0)
    depth = most.get("max_depth", most.get("estimator__max_depth"))
    if depth is not None:
        work *= min(depth, 20)
    if most.get("criterion") == "absolute_error":
        work *= 5
    if most.get("loss") == "huber":  # of gradient boosting, whose leaves take it one by one
        work *= 15
    if "hidden_layer_sizes" in most:
        sizes = most["hidden_layer_sizes"]
        work *= sum(a * b for a, b in pairwise(sizes)) + 23 * sizes[0]
        work *= 3 if most.get("solver") == "lbfgs" else 1
    if task.model == "kernel-ridge":
        work *= len(task.candidates) if most.get("kernel") == "rbf" else 0.01
    return work


def _magnitude(value: Any) -> float:
    return abs(float(value)) if isinstance(value, int | float) else 1.0
