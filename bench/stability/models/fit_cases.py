"""Cases about fits: what the training rows may be like, each with all nine models."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from typing import Any

import numpy as np

from bench.stability.case import Answer, Case
from bench.stability.finding import Finding
from bench.stability.models.fitted import WAYS, Asked, fitted, loaded, rows_of, unlike
from bench.stability.models.optimality import optimal
from bench.stability.models.samples import (
    SEEN,
    Change,
    Values,
    ordinary,
    scene,
    unchanged,
    with_inputs,
    with_target,
)
from gen.errors import InputError
from learn.dataset import Dataset
from learn.models import MODELS

Check = Callable[[Asked], Iterator[Finding]]

SMALL, LARGE = 2.0**-40, 2.0**40
"""About 1e-12 and 1e12, as powers of two: changes of units that round nothing."""

SCALE_FREE = frozenset(MODELS) - {"svm", "mlp"}
"""Models whose predictions follow the unit of the target, with their libraries' settings."""

SINGLE = 1e-5
"""What rows rounded to single precision may change, over the largest prediction."""

SINGLE_INSIDE = 1e-6
"""XGBoost sums in single precision."""


@dataclass(frozen=True)
class Spoilt:
    """Rows of a kind.

    Attributes
    ----------
    family : what is the matter with them
    change : makes them from ordinary ones
    checks : of every model, besides those that every fit has to pass
    features, target : of the rows
    settings : of models, on top of both ways' own
    models : that are asked
    seen : rows that train
    """

    family: str
    asked: str
    change: Change = unchanged
    checks: tuple[Check, ...] = ()
    features: str = "paper"
    target: str = "area_percent"
    settings: Mapping[str, Any] = field(default_factory=dict)
    models: tuple[str, ...] = tuple(MODELS)
    seen: int = SEEN


def cases() -> Iterator[Case]:
    """Family after family."""
    for spoilt in KINDS:
        for name in spoilt.models:
            yield Case(
                f"models: {spoilt.family}",
                MODELS[name].title,
                spoilt.asked,
                partial(_examine, spoilt, name),
                slow=False,
            )


def _examine(spoilt: Spoilt, name: str) -> Answer:
    """Fit with the libraries' settings and with tuned ones."""
    said: list[str] = []
    findings: list[Finding] = []
    for way in WAYS:
        asked = _fitted(spoilt, name, way)
        said.append(f"{way}: {_in_words(asked)}")
        for check in (_sound, optimal, *spoilt.checks):
            findings += [replace(found, what=f"{way}: {found.what}") for found in check(asked)]
    return Answer("; ".join(said), findings)


def _fitted(spoilt: Spoilt, name: str, way: str) -> Asked:
    if spoilt.change is unchanged and not spoilt.settings:
        return _ordinary(name, way, spoilt.features, spoilt.target)
    rows = spoilt.change(ordinary(spoilt.features, spoilt.target))
    return fitted(name, way, rows, spoilt.settings, spoilt.seen)


@lru_cache(maxsize=64)
def _ordinary(name: str, way: str, features: str, target: str) -> Asked:
    """Fitted to ordinary rows, once for all cases."""
    return fitted(name, way, ordinary(features, target))


def _in_words(asked: Asked) -> str:
    score = asked.score()
    said = "constant target" if np.isnan(score) else f"R2 {100 * score:.4g} % of seen rows"
    remarks = ", ".join(asked.remarks)
    return f"{said} ({remarks[:150]})" if remarks else said


def _sound(asked: Asked) -> Iterator[Finding]:
    """Numbers, never worse than the mean without saying so."""
    everything = asked.surrogate.predict_rows(rows_of(asked.test)).values["target"]
    bad = np.count_nonzero(~np.isfinite(everything))
    bad += np.count_nonzero(~np.isfinite(asked.predicted(asked.train)))
    yield Finding("not finite", int(bad), 0)
    unsaid = int(asked.worse_than_constant() and not asked.remarks)
    yield Finding("worse than a constant, unsaid", unsaid, 0)


def saved(asked: Asked) -> Iterator[Finding]:
    """The file gives the same bits, intervals too."""
    rows = rows_of(asked.test)
    before, after = (each.predict_rows(rows) for each in (asked.surrogate, loaded(asked)))
    differ = sum(
        unlike(getattr(before, part)["target"], getattr(after, part)["target"])
        for part in ("values", "low", "high")
    )
    yield Finding("numbers unlike after loading", differ, 0)


def constant(asked: Asked) -> Iterator[Finding]:
    """A constant target is predicted, by models that can."""
    if (
        asked.name in {"kernel-ridge", "gaussian-process", "mlp"}
        and asked.train.features == "paper"
    ):
        return
    value = float(asked.train.target[0])
    error = np.abs(asked.predicted(asked.test) - value).max() / abs(value)
    allowed = asked.estimator.epsilon / abs(value) if asked.name == "svm" else 1e-6
    yield Finding("off the constant", float(error), allowed)


def same_inputs(asked: Asked) -> Iterator[Finding]:
    """Predictions are those for inputs in ordinary units."""
    yield _in_other_units(asked, 1.0)


def same_target(factor: float) -> Check:
    """Predictions are those for a target in ordinary units, times a factor."""

    def check(asked: Asked) -> Iterator[Finding]:
        if asked.train.features != "paper" or (asked.name in SCALE_FREE and asked.way == "default"):
            yield _in_other_units(asked, factor)

    return check


def _in_other_units(asked: Asked, factor: float) -> Finding:
    other = _ordinary(asked.name, asked.way, asked.train.features, asked.train.target_name)
    expected = other.predicted(other.test) * factor
    size = float(np.abs(expected).max()) or 1.0
    error = float(np.abs(asked.predicted(asked.test) - expected).max()) / size
    allowed = SINGLE_INSIDE if asked.name == "xgboost" else 0.0
    return Finding("off the same in other units", error, allowed)


def flagged(asked: Asked) -> Iterator[Finding]:
    """Rows far outside the training are said to be, or refused; values are possible ones."""
    side = scene().surface.side
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
    found, expected = learnt.raw(short), learnt.raw(short.astype(np.float64))
    size = float(np.abs(expected).max()) or 1.0
    yield Finding("off double precision", float(np.abs(found - expected).max()) / size, SINGLE)


def _constant_column(inputs: Values) -> Values:
    inputs[:, 5] = 0.25
    return inputs


def _collinear(inputs: Values) -> Values:
    inputs[:, 1], inputs[:, 2] = 2 * inputs[:, 3], inputs[:, 3] + inputs[:, 0]
    return inputs


def _zero_row(inputs: Values) -> Values:
    inputs[[3, SEEN + 15]] = 0.0
    return inputs


def _outlier(inputs: Values) -> Values:
    inputs[3] *= 1e9
    return inputs


def _dominant(inputs: Values) -> Values:
    inputs[:, 20] *= 1e12
    return inputs


def _doubled(rows: Dataset) -> Dataset:
    """The first half of the training rows twice."""
    order = np.concatenate([np.arange(SEEN // 2), np.arange(SEEN // 2), np.arange(SEEN, rows.size)])
    return rows.at(order)


def _contradicting(rows: Dataset) -> Dataset:
    twice = _doubled(rows)
    target = twice.target.copy()
    target[: SEEN // 2] *= 1.1
    return replace(twice, target=target)


def _spike(target: Values) -> Values:
    target[3] = 1e12
    return target


def _times(factor: float) -> Callable[[Values], Values]:
    return lambda values: values * factor


KINDS = (
    Spoilt("ordinary rows", "60 rows train", checks=(saved,)),
    Spoilt(
        "ordinary rows without units",
        "dimensionless features",
        features="dimensionless",
        checks=(saved,),
    ),
    Spoilt(
        "constant target",
        "area 3.7 % in all rows",
        with_target(lambda t: np.full_like(t, 3.7)),
        (constant,),
    ),
    Spoilt(
        "constant target without units",
        "dimensionless features, area 3.7 % in all rows",
        with_target(lambda t: np.full_like(t, 3.7)),
        (constant,),
        "dimensionless",
    ),
    Spoilt("constant column", "an input is 0.25 in all rows", with_inputs(_constant_column)),
    Spoilt(
        "constant column without units",
        "dimensionless features",
        with_inputs(_constant_column),
        features="dimensionless",
    ),
    Spoilt(
        "collinear columns", "an input is twice another, one a sum of two", with_inputs(_collinear)
    ),
    Spoilt("duplicated rows", "30 rows, each twice", _doubled, (saved,)),
    Spoilt("contradicting rows", "30 rows, each twice, targets 10 % apart", _contradicting),
    Spoilt("a row of zeros", "cannot be scaled to unit length", with_inputs(_zero_row)),
    Spoilt(
        "inputs in small units",
        "all inputs times 2^-40",
        with_inputs(_times(SMALL)),
        (same_inputs,),
    ),
    Spoilt(
        "inputs in large units", "all inputs times 2^40", with_inputs(_times(LARGE)), (same_inputs,)
    ),
    Spoilt("one input in small units", "an input times 1e12", with_inputs(_dominant)),
    Spoilt(
        "one input in small units, standardised",
        "dimensionless features, an input times 1e12",
        with_inputs(_dominant),
        features="dimensionless",
    ),
    Spoilt("outlier among inputs", "one row times 1e9", with_inputs(_outlier)),
    Spoilt("outlier among targets", "one force of 1e12 uN", with_target(_spike), target="force"),
    Spoilt(
        "few rows", "6 rows train, 2 calibrate, 2 test", lambda rows: rows.at(np.arange(10)), seen=6
    ),
    *(
        Spoilt(
            f"target in {'large' if factor < 1 else 'small'} units",
            f"force times {name}",
            with_target(_times(factor)),
            (same_target(factor),),
            target="force",
        )
        for name, factor in (("2^-40", SMALL), ("2^40", LARGE))
    ),
    *(
        Spoilt(
            f"target in {'large' if factor < 1 else 'small'} units, without units",
            f"dimensionless features, force times {name}",
            with_target(_times(factor)),
            (same_target(factor),),
            "dimensionless",
            "force",
        )
        for name, factor in (("2^-40", SMALL), ("2^40", LARGE))
    ),
    Spoilt(
        "nearly singular",
        "alpha 0, linear kernel or radial functions, 30 rows twice",
        _doubled,
        settings={"alpha": 0.0},
        models=("kernel-ridge",),
    ),
    Spoilt(
        "nearly singular, other alphas",
        "alpha 1e-300, 60 rows",
        settings={"alpha": 1e-300},
        models=("kernel-ridge",),
    ),
    Spoilt(
        "nearly singular process",
        "alpha 1e-10, length 1e3: every row nearly the same to it; rows twice",
        _doubled,
        settings={"alpha": 1e-10, "kernel__length_scale": 1e3, "optimizer": None},
        models=("gaussian-process",),
    ),
    Spoilt("far outside", "statistics of the test rows times 1e-12 to 1e300", checks=(flagged,)),
    Spoilt(
        "far outside, without units",
        "dimensionless features",
        checks=(flagged,),
        features="dimensionless",
    ),
    Spoilt("single precision", "float32 rows are asked", checks=(single,)),
)
