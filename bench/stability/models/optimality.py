"""Is a fit what its method defines? From the estimator's own numbers, in extended precision."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.stability.case import Finding
from bench.stability.models.fitted import Asked

Long = NDArray[np.longdouble]

BACKWARD = 1e-12
"""Residual of a linear system over the size of its terms, which good elimination leaves [1]."""

TUBE = 0.01
"""How far libsvm may leave its conditions, ten times its tolerance, over the target's spread."""


def optimal(asked: Asked) -> Iterator[Finding]:
    """The conditions that a fit of this model has to fulfil on its training rows, if it has any."""
    if asked.name in CONDITIONS:
        yield from CONDITIONS[asked.name](asked)


def _ridge(asked: Asked) -> Iterator[Finding]:
    ridge = asked.estimator
    kernel = _kernel(asked, ridge.kernel, ridge.gamma)
    yield _backward(kernel, ridge.alpha_used_, ridge.dual_coef_, asked)


def _process(asked: Asked) -> Iterator[Finding]:
    process = asked.estimator
    length = process.kernel_.length_scale
    kernel = _kernel(asked, "rbf", 1 / (2 * np.longdouble(length) ** 2))
    yield _backward(kernel, process.alpha, process.alpha_, asked)


def _kernel(asked: Asked, kind: str, gamma: Any) -> Long:
    x = asked.scaled.astype(np.longdouble)
    if kind == "linear":
        return np.asarray(x @ x.T)
    gamma = 1 / np.longdouble(x.shape[1]) if gamma is None else gamma
    squares = ((x[:, None, :] - x[None, :, :]) ** 2).sum(axis=2)
    return np.asarray(np.exp(-np.longdouble(gamma) * squares))


def _backward(kernel: Long, alpha: float, coefficients: Any, asked: Asked) -> Finding:
    """Residual of (K + alpha I) a = y over |K| |a| + |y|."""
    a = np.asarray(coefficients, dtype=np.longdouble).reshape(-1)
    y = asked.target.astype(np.longdouble)
    matrix = kernel + np.longdouble(alpha) * np.eye(len(kernel))
    residual = np.abs(matrix @ a - y).max()
    size = np.abs(matrix).sum(axis=1).max() * np.abs(a).max() + np.abs(y).max()
    return Finding("residual of its equations", float(residual / size), BACKWARD)


def _vectors(asked: Asked) -> Iterator[Finding]:
    """Karush, Kuhn and Tucker's conditions of epsilon-insensitive regression."""
    machine = asked.estimator
    coefficients = np.zeros(asked.train.size)
    coefficients[machine.support_] = machine.dual_coef_.reshape(-1)
    over = float(np.abs(coefficients).max() / machine.C) - 1
    yield Finding("multipliers beyond C", max(over, 0.0), 1e-12)
    balance = abs(float(coefficients.sum())) / (len(coefficients) * machine.C)
    yield Finding("multipliers' sum", balance, 1e-12)
    rest = asked.target - machine.predict(asked.scaled)
    inside, free = coefficients == 0, np.abs(coefficients) < machine.C * (1 - 1e-9)
    outside = np.where(free, np.abs(rest) - machine.epsilon, 0.0)
    slack = np.where(inside | free, 0.0, machine.epsilon - np.abs(rest))
    unit = max(float(np.std(asked.target)), machine.epsilon)
    worst = float(np.maximum(outside, slack).max()) / unit
    yield Finding("off its tube", max(worst, 0.0), TUBE)


def _tree(asked: Asked) -> Iterator[Finding]:
    """Each leaf predicts the mean of its rows."""
    leaves = asked.estimator.apply(asked.scaled.astype(np.float32))
    means = {leaf: asked.target[leaves == leaf].mean() for leaf in np.unique(leaves)}
    expected = np.array([means[leaf] for leaf in leaves])
    error = np.abs(asked.estimator.predict(asked.scaled) - expected).max()
    yield Finding("off the means of its leaves", _over(error, asked.target), 1e-12)


def _within(asked: Asked) -> Iterator[Finding]:
    """Means and medians of leaves lie between the smallest and the largest target."""
    found = np.concatenate([asked.predicted(asked.train), asked.predicted(asked.test)])
    low, high = float(asked.train.target.min()), float(asked.train.target.max())
    beyond = max(low - float(found.min()), float(found.max()) - high, 0.0)
    yield Finding("beyond the training targets", _over(beyond, asked.train.target), 1e-12)


def _boosted(asked: Asked) -> Iterator[Finding]:
    """Squared loss: what is left on the training rows has a mean of zero."""
    rest = asked.target - asked.estimator.predict(asked.scaled)
    yield Finding("mean of what is left", _over(abs(float(rest.mean())), asked.target), 1e-11)


def _over(error: float, target: NDArray[np.float64]) -> float:
    """Over the largest target."""
    return float(error) / (float(np.abs(target).max()) or 1.0)


CONDITIONS: dict[str, Callable[[Asked], Iterator[Finding]]] = {
    "decision-tree": _tree,
    "random-forest": _within,
    "adaboost": _within,
    "gradient-boost": _boosted,
    "svm": _vectors,
    "gaussian-process": _process,
    "kernel-ridge": _ridge,
}
