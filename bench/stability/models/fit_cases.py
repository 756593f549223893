"""Cases about fits: training rows of every kind, each with all nine models."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from bench.stability.case import EXACT_FACTORS, Answer, Case, Finding
from bench.stability.models import fit_checks as judged
from bench.stability.models import samples
from bench.stability.models.fitted import WAYS, Asked, fitted
from bench.stability.models.samples import SEEN, altered
from learn.models import MODELS


@dataclass(frozen=True)
class Spoilt:
    """Rows of a kind: what is the matter with them, the input in words, and what is asked.

    `change` makes them from ordinary rows, `seen` of them train, `checks` come besides those that
    every fit has to pass, and `settings` on top of both ways' own.
    """

    family: str
    asked: str
    change: samples.Change | None = None
    checks: tuple[judged.Check, ...] = ()
    features: str = "paper"
    target: str = "area_percent"
    settings: Mapping[str, Any] = field(default_factory=dict)
    models: tuple[str, ...] = tuple(MODELS)
    seen: int = SEEN

    def fitted(self, name: str, way: str) -> Asked:
        """Fit a model to such rows, to ordinary ones once for all cases."""
        if self.change is None and not self.settings:
            return judged.fitted_ordinarily(name, way, self.features, self.target)
        rows = samples.ordinary(self.features, self.target)
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
            for check in (judged.sound, judged.optimal, *self.checks):
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
        checks = (partial(judged.same_in_other_units, target=factor),)
        title, change = f"target in {unit} units{family}", altered("target", ..., factor=factor)
        yield Spoilt(title, f"{asked}force times {name}", change, checks, features, "force")


WITHOUT_UNITS = partial(Spoilt, features="dimensionless")
SINGULAR = partial(Spoilt, models=("kernel-ridge",))
CONSTANT, SAME = altered("target", ..., 3.7), (judged.same_in_other_units,)
TO_SMALL, TO_LARGE = (altered("inputs", ..., factor=each) for each in EXACT_FACTORS.values())
KINDS = (
    Spoilt("ordinary rows", "60 rows train", checks=(judged.saved,)),
    WITHOUT_UNITS("ordinary rows without units", "dimensionless features", checks=(judged.saved,)),
    Spoilt("constant target", "area 3.7 % in all rows", CONSTANT, (judged.constant,)),
    WITHOUT_UNITS(
        "constant target without units",
        "dimensionless features, area 3.7 % in all rows",
        CONSTANT,
        (judged.constant,),
    ),
    Spoilt("constant column", "an input is 0.25 in all rows", samples.CONSTANT_COLUMN),
    WITHOUT_UNITS(
        "constant column without units", "dimensionless features", samples.CONSTANT_COLUMN
    ),
    Spoilt("collinear columns", "an input is twice another, one a sum of two", samples.collinear),
    Spoilt("duplicated rows", "30 rows, each twice", samples.doubled, (judged.saved,)),
    Spoilt("contradicting rows", "30 rows, each twice, targets 10 % apart", samples.contradicting),
    Spoilt(
        "a row of zeros", "cannot be scaled to unit length", altered("inputs", [3, SEEN + 15], 0.0)
    ),
    Spoilt("inputs in small units", "all inputs times 2^-40", TO_SMALL, SAME),
    Spoilt("inputs in large units", "all inputs times 2^40", TO_LARGE, SAME),
    Spoilt("one input in small units", "an input times 1e12", samples.DOMINANT_COLUMN),
    WITHOUT_UNITS(
        "one input in small units, standardised",
        "dimensionless features, an input times 1e12",
        samples.DOMINANT_COLUMN,
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
        samples.doubled,
        settings={"alpha": 0.0},
    ),
    SINGULAR("nearly singular, other alphas", "alpha 1e-300, 60 rows", settings={"alpha": 1e-300}),
    Spoilt(
        "nearly singular process",
        "alpha 1e-10, length 1e3: every row nearly the same to it; rows twice",
        samples.doubled,
        settings={"alpha": 1e-10, "kernel__length_scale": 1e3, "optimizer": None},
        models=("gaussian-process",),
    ),
    Spoilt(
        "far outside", "statistics of the test rows times 1e-12 to 1e300", checks=(judged.flagged,)
    ),
    WITHOUT_UNITS("far outside, without units", "dimensionless features", checks=(judged.flagged,)),
    Spoilt("single precision", "float32 rows are asked", checks=(judged.single,)),
)
