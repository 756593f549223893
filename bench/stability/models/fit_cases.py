"""Cases about fits: what the training rows may be like, each with all nine models."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from bench.stability.case import Answer, Case, Finding
from bench.stability.models.fit_checks import (
    Check,
    constant,
    fitted_ordinarily,
    flagged,
    same_inputs,
    same_target,
    saved,
    single,
    sound,
)
from bench.stability.models.fitted import WAYS, Asked, fitted
from bench.stability.models.optimality import optimal
from bench.stability.models.samples import (
    SEEN,
    Change,
    ordinary,
    unchanged,
    with_inputs,
    with_target,
)
from bench.stability.models.spoiling import (
    collinear,
    constant_column,
    contradicting,
    dominant,
    doubled,
    outlier,
    spike,
    times,
    zero_row,
)
from learn.models import MODELS

SMALL, LARGE = 2.0**-40, 2.0**40
"""About 1e-12 and 1e12, as powers of two: changes of units that round nothing."""


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
        for check in (sound, optimal, *spoilt.checks):
            findings += [found._replace(what=f"{way}: {found.what}") for found in check(asked)]
    return Answer("; ".join(said), findings)


def _fitted(spoilt: Spoilt, name: str, way: str) -> Asked:
    if spoilt.change is unchanged and not spoilt.settings:
        return fitted_ordinarily(name, way, spoilt.features, spoilt.target)
    rows = spoilt.change(ordinary(spoilt.features, spoilt.target))
    return fitted(name, way, rows, spoilt.settings, spoilt.seen)


def _in_words(asked: Asked) -> str:
    score = asked.score()
    said = "constant target" if np.isnan(score) else f"R2 {100 * score:.4g} % of seen rows"
    remarks = ", ".join(asked.remarks)
    return f"{said} ({remarks[:150]})" if remarks else said


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
    Spoilt("constant column", "an input is 0.25 in all rows", with_inputs(constant_column)),
    Spoilt(
        "constant column without units",
        "dimensionless features",
        with_inputs(constant_column),
        features="dimensionless",
    ),
    Spoilt(
        "collinear columns", "an input is twice another, one a sum of two", with_inputs(collinear)
    ),
    Spoilt("duplicated rows", "30 rows, each twice", doubled, (saved,)),
    Spoilt("contradicting rows", "30 rows, each twice, targets 10 % apart", contradicting),
    Spoilt("a row of zeros", "cannot be scaled to unit length", with_inputs(zero_row)),
    Spoilt(
        "inputs in small units",
        "all inputs times 2^-40",
        with_inputs(times(SMALL)),
        (same_inputs,),
    ),
    Spoilt(
        "inputs in large units", "all inputs times 2^40", with_inputs(times(LARGE)), (same_inputs,)
    ),
    Spoilt("one input in small units", "an input times 1e12", with_inputs(dominant)),
    Spoilt(
        "one input in small units, standardised",
        "dimensionless features, an input times 1e12",
        with_inputs(dominant),
        features="dimensionless",
    ),
    Spoilt("outlier among inputs", "one row times 1e9", with_inputs(outlier)),
    Spoilt("outlier among targets", "one force of 1e12 uN", with_target(spike), target="force"),
    Spoilt(
        "few rows", "6 rows train, 2 calibrate, 2 test", lambda rows: rows.at(np.arange(10)), seen=6
    ),
    *(
        Spoilt(
            f"target in {'large' if factor < 1 else 'small'} units",
            f"force times {name}",
            with_target(times(factor)),
            (same_target(factor),),
            target="force",
        )
        for name, factor in (("2^-40", SMALL), ("2^40", LARGE))
    ),
    *(
        Spoilt(
            f"target in {'large' if factor < 1 else 'small'} units, without units",
            f"dimensionless features, force times {name}",
            with_target(times(factor)),
            (same_target(factor),),
            "dimensionless",
            "force",
        )
        for name, factor in (("2^-40", SMALL), ("2^40", LARGE))
    ),
    Spoilt(
        "nearly singular",
        "alpha 0, linear kernel or radial functions, 30 rows twice",
        doubled,
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
        doubled,
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
