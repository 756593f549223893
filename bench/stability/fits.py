"""Cases of fits of the nine models to rows of every kind, and the conditions that these meet.

`optimal` asks whether a fit is what its method defines, by the estimator's own numbers, in extended
precision.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import lru_cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.stability.case import EXACT_FACTORS, Answer, Case, Finding
from bench.stability.fitted import (
    CONSTANT_COLUMN,
    DOMINANT_COLUMN,
    SEEN,
    WAYS,
    Asked,
    Change,
    altered,
    collinear,
    contradicting,
    doubled,
    fitted,
    loaded,
    ordinary,
    rows_of,
    scene,
)
from gen.arrays import Values
from gen.runtime.errors import InputError
from learn.models import MODELS

Long = NDArray[np.longdouble]
Check = Callable[[Asked], Iterator[Finding]]

# Models whose predictions follow the unit of the target, with their libraries' settings.
SCALE_FREE = frozenset(MODELS) - {"svm", "mlp"}
SINGLE = 1e-5  # what rows rounded to single precision may change, over the largest prediction
SINGLE_INSIDE = 1e-6  # XGBoost sums in single precision
# Residual of a linear system over the size of its terms, which good elimination leaves [1].
BACKWARD = 1e-12
# How far libsvm may leave its conditions, ten times its tolerance, over the target's spread.
TUBE = 0.01


@lru_cache(maxsize=64)
def fitted_ordinarily(name: str, way: str, features: str, target: str) -> Asked:
    """Fitted to ordinary rows, once for all cases."""
    return fitted(name, way, ordinary(features, target))


def sound(asked: Asked) -> Iterator[Finding]:
    """Numbers, never worse than the mean without saying so."""
    everything = asked.surrogate.predict_rows(rows_of(asked.test)).values["target"]
    numbers = np.concatenate((everything, asked.predicted(asked.train)))
    yield Finding("not finite", int(np.count_nonzero(~np.isfinite(numbers))), 0)
    unsaid = int(asked.worse_than_constant() and not asked.remarks)
    yield Finding("worse than a constant, unsaid", unsaid, 0)


def saved(asked: Asked) -> Iterator[Finding]:
    """The file gives the same bits, intervals too."""
    rows = rows_of(asked.test)
    before, after = (
        [getattr(each.predict_rows(rows), part)["target"] for part in ("values", "low", "high")]
        for each in (asked.surrogate, loaded(asked))
    )
    differ = int(np.count_nonzero(np.not_equal(before, after)))
    yield Finding("numbers unlike after loading", differ, 0)


def constant(asked: Asked) -> Iterator[Finding]:
    """A constant target is predicted, by models that can."""
    unable = {"kernel-ridge", "gaussian-process", "mlp"}
    if asked.name in unable and asked.train.features == "paper":
        return
    value = float(asked.train.target[0])
    allowed = asked.estimator.epsilon / abs(value) if asked.name == "svm" else 1e-6
    error = np.abs(asked.predicted(asked.test) - value).max() / abs(value)
    yield Finding("off the constant", float(error), allowed)


def same_in_other_units(asked: Asked, target: float = 1.0) -> Iterator[Finding]:
    """Predictions are those of ordinary rows, times the factor of the target's unit.

    Other units of the target may change a fit without scaling, or of a model that is not free of
    scales.
    """
    train = asked.train
    free = asked.name in SCALE_FREE and asked.way == "default"
    if target != 1.0 and train.features == "paper" and not free:
        return
    other = fitted_ordinarily(asked.name, asked.way, train.features, train.target_name)
    expected = other.predicted(other.test) * target
    allowed = SINGLE_INSIDE if asked.name == "xgboost" else 0.0
    error = _over(asked.predicted(asked.test) - expected, expected)
    yield Finding("off the same in other units", error, allowed)


def flagged(asked: Asked) -> Iterator[Finding]:
    """Rows far outside the training are said to be, or refused; values are possible ones."""
    side = scene().sides[0]
    for factor in (1e-12, 1e-3, 1e3, 1e12, 1e150, 1e300):
        statistics, delta = asked.test.described[:, 1:] * factor, asked.test.described[:, 0]
        try:
            rows = asked.surrogate.of_statistics(statistics, delta, side)
            found = asked.surrogate.predict_rows(rows)
        except InputError:
            continue
        unsaid = sum(not reason for reason in found.reasons)
        yield Finding(f"statistics times {factor:g} unflagged", unsaid, 0)
        values = np.concatenate([found.values["target"], found.low["target"], found.high["target"]])
        impossible = np.count_nonzero(~((values >= 0) & (values <= 100)))
        yield Finding(f"statistics times {factor:g} impossible", int(impossible), 0)


def single(asked: Asked) -> Iterator[Finding]:
    """Rows in single precision are answered as the same rows in double."""
    short: Any = asked.test.inputs.astype(np.float32)
    learnt = asked.fit.learnt
    expected = learnt.raw(short.astype(np.float64))
    yield Finding("off double precision", _over(learnt.raw(short) - expected, expected), SINGLE)


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
    error = _over(asked.estimator.predict(asked.scaled) - expected, asked.target)
    yield Finding("off the means of its leaves", error, 1e-12)


def _within(asked: Asked) -> Iterator[Finding]:
    """Means and medians of leaves lie between the smallest and the largest target."""
    found = np.concatenate([asked.predicted(asked.train), asked.predicted(asked.test)])
    low, high = float(asked.train.target.min()), float(asked.train.target.max())
    beyond = max(low - float(found.min()), float(found.max()) - high, 0.0)
    yield Finding("beyond the training targets", _over(beyond, asked.train.target), 1e-12)


def _boosted(asked: Asked) -> Iterator[Finding]:
    """Squared loss: what is left on the training rows has a mean of zero."""
    rest = asked.target - asked.estimator.predict(asked.scaled)
    yield Finding("mean of what is left", _over(rest.mean(), asked.target), 1e-11)


def _over(errors: Any, target: Values) -> float:
    """Largest error over the largest target."""
    return float(np.abs(errors).max()) / (float(np.abs(target).max()) or 1.0)


CONDITIONS: dict[str, Callable[[Asked], Iterator[Finding]]] = {
    "decision-tree": _tree,
    "random-forest": _within,
    "adaboost": _within,
    "gradient-boost": _boosted,
    "svm": _vectors,
    "gaussian-process": _process,
    "kernel-ridge": _ridge,
}


@dataclass(frozen=True)
class Spoilt:
    """Rows of a kind: what is the matter with them, the input in words, and what is asked.

    `change` makes them from ordinary rows, `seen` of them train, `checks` come besides those that
    every fit has to pass, and `settings` on top of both ways' own.
    """

    family: str
    asked: str
    change: Change | None = None
    checks: tuple[Check, ...] = ()
    features: str = "paper"
    target: str = "area_percent"
    settings: Mapping[str, Any] = field(default_factory=dict)
    models: tuple[str, ...] = tuple(MODELS)
    seen: int = SEEN

    def fitted(self, name: str, way: str) -> Asked:
        """Fit a model to such rows, to ordinary ones once for all cases."""
        if self.change is None and not self.settings:
            return fitted_ordinarily(name, way, self.features, self.target)
        rows = ordinary(self.features, self.target)
        rows = self.change(rows) if self.change else rows
        return fitted(name, way, rows, self.settings, self.seen)

    def examine(self, name: str) -> Answer:
        """Fit with the libraries' settings and with tuned ones."""
        said: list[str] = []
        findings: list[Finding] = []
        for way in WAYS:
            asked = self.fitted(name, way)
            score, remarks = asked.score(), ", ".join(asked.remarks)[:150]
            told = "constant target" if np.isnan(score) else f"R2 {100 * score:.4g} % of seen rows"
            said.append(f"{way}: {told}" + f" ({remarks})" * bool(remarks))
            for check in (sound, optimal, *self.checks):
                findings += [each._replace(what=f"{way}: {each.what}") for each in check(asked)]
        return Answer("; ".join(said), findings)


def cases() -> Iterator[Case]:
    """Family after family."""
    for spoilt in KINDS:
        for name in spoilt.models:
            examine = partial(spoilt.examine, name)
            yield Case(f"models: {spoilt.family}", MODELS[name].title, spoilt.asked, examine)


def _other_units(features: str, family: str, asked: str) -> Iterator[Spoilt]:
    """The force in other units."""
    for (name, factor), unit in zip(EXACT_FACTORS.items(), ("large", "small"), strict=True):
        checks = (partial(same_in_other_units, target=factor),)
        title, change = f"target in {unit} units{family}", altered("target", ..., factor=factor)
        yield Spoilt(title, f"{asked}force times {name}", change, checks, features, "force")


WITHOUT_UNITS = partial(Spoilt, features="dimensionless")
SINGULAR = partial(Spoilt, models=("kernel-ridge",))
CONSTANT, SAME = altered("target", ..., 3.7), (same_in_other_units,)
TO_SMALL, TO_LARGE = (altered("inputs", ..., factor=each) for each in EXACT_FACTORS.values())
KINDS = (
    Spoilt("ordinary rows", "60 rows train", checks=(saved,)),
    WITHOUT_UNITS("ordinary rows without units", "dimensionless features", checks=(saved,)),
    Spoilt("constant target", "area 3.7 % in all rows", CONSTANT, (constant,)),
    WITHOUT_UNITS(
        "constant target without units",
        "dimensionless features, area 3.7 % in all rows",
        CONSTANT,
        (constant,),
    ),
    Spoilt("constant column", "an input is 0.25 in all rows", CONSTANT_COLUMN),
    WITHOUT_UNITS("constant column without units", "dimensionless features", CONSTANT_COLUMN),
    Spoilt("collinear columns", "an input is twice another, one a sum of two", collinear),
    Spoilt("duplicated rows", "30 rows, each twice", doubled, (saved,)),
    Spoilt("contradicting rows", "30 rows, each twice, targets 10 % apart", contradicting),
    Spoilt(
        "a row of zeros", "cannot be scaled to unit length", altered("inputs", [3, SEEN + 15], 0.0)
    ),
    Spoilt("inputs in small units", "all inputs times 2^-40", TO_SMALL, SAME),
    Spoilt("inputs in large units", "all inputs times 2^40", TO_LARGE, SAME),
    Spoilt("one input in small units", "an input times 1e12", DOMINANT_COLUMN),
    WITHOUT_UNITS(
        "one input in small units, standardised",
        "dimensionless features, an input times 1e12",
        DOMINANT_COLUMN,
    ),
    Spoilt("outlier among inputs", "one row times 1e9", altered("inputs", 3, factor=1e9)),
    Spoilt(
        "outlier among targets", "one force of 1e12 uN", altered("target", 3, 1e12), target="force"
    ),
    Spoilt(
        "few rows", "6 rows train, 2 calibrate, 2 test", lambda rows: rows.at(np.arange(10)), seen=6
    ),
    *_other_units("paper", "", ""),
    *_other_units("dimensionless", ", without units", "dimensionless features, "),
    SINGULAR(
        "nearly singular",
        "alpha 0, linear kernel or radial functions, 30 rows twice",
        doubled,
        settings={"alpha": 0.0},
    ),
    SINGULAR("nearly singular, other alphas", "alpha 1e-300, 60 rows", settings={"alpha": 1e-300}),
    Spoilt(
        "nearly singular process",
        "alpha 1e-10, length 1e3: every row nearly the same to it; rows twice",
        doubled,
        settings={"alpha": 1e-10, "kernel__length_scale": 1e3, "optimizer": None},
        models=("gaussian-process",),
    ),
    Spoilt("far outside", "statistics of the test rows times 1e-12 to 1e300", checks=(flagged,)),
    WITHOUT_UNITS("far outside, without units", "dimensionless features", checks=(flagged,)),
    Spoilt("single precision", "float32 rows are asked", checks=(single,)),
)
