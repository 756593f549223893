"""One fit of a search, and its expected cost."""

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from learn.comparison.search.pruning import Settings, baseline_key, key


@dataclass(frozen=True)
class Task:
    """One fit: the candidates that it serves, and the fold that it leaves out.

    Attributes
    ----------
    model : str
        Name of the model.
    candidates : tuple of dict
        Canonical settings, which differ only in the setting whose values one fit serves.
    fold : int
        The fold that is left out of the training, and predicted.
    rows : int
        Number of training rows at most.
    baseline : bool
        True for the one candidate that is the baseline, which lacks the settings that the grid's
        candidates share.
    """

    model: str
    candidates: tuple[Settings, ...]
    fold: int
    rows: int
    baseline: bool = False

    @property
    def names(self) -> list[str]:
        """The name of each candidate in its trials."""
        return [baseline_key(c) if self.baseline else key(c) for c in self.candidates]


def expected_work(task: Task) -> float:
    """Guess the relative cost of a task of one model, for the order of tasks and the time left."""
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
    if most.get("loss") == "huber":  # gradient boosting evaluates it leaf by leaf
        work *= 15
    if "hidden_layer_sizes" in most:
        sizes = most["hidden_layer_sizes"]
        work *= sum(a * b for a, b in pairwise(sizes)) + 23 * sizes[0]
        work *= 20 if most.get("solver") == "lbfgs" else 1  # others end by themselves long before
    if task.model == "kernel-ridge":
        work *= len(task.candidates) if most.get("kernel") == "rbf" else 0.01
    return work


def _magnitude(value: Any) -> float:
    return abs(float(value)) if isinstance(value, int | float) else 1.0
