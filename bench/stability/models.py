"""Cases of the nine models: ordinary rows, the changes that spoil them, and what fits must do.

Models are fitted and asked as the product does it.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np

import bem
from bench.stability.case import EXACT_FACTORS, Answer, Case, Finding
from gen.arrays import Values
from gen.generation.plan import parameters
from gen.generation.sample import surface_of
from gen.runtime.errors import InputError
from gen.scene import Scene, load
from gen.statistics import describe
from learn.comparison.grid import baseline, untuned
from learn.dataset import Dataset, Request, remarks
from learn.features import chosen
from learn.features.sets import Rows
from learn.models import MODELS, STEP
from learn.stored import Origin, short_name
from learn.surrogate import Surrogate
from learn.surrogate.calibration import near
from learn.surrogate.fitting import Fit, Settings, fit_target

Change = Callable[[Dataset], Dataset]
Check = Callable[["Asked"], Iterator[Finding]]

ROWS = 90
NODES = 33
SEEN = 60  # the first rows train; of the others 10 calibrate and 20 test

CALIBRATING = 10


def scene() -> Scene:
    """The paper preset on the small grid."""
    text = f"samples = {ROWS}\n[surface]\nnodes = {NODES}\n"
    return Scene.parse(text, "the cases' scene")


@lru_cache(maxsize=1)
def solved() -> tuple[Values, Values]:
    """Delta and the 22 statistics (n, 23), and force and area (n, 2) [uN, %]."""
    wanted, plan = scene(), parameters(load("paper"), 0, ROWS)
    inputs, targets = [], []
    for row, delta in enumerate(plan.delta.tolist()):
        heights = surface_of(wanted, plan, row)
        inputs.append([delta, *describe(heights, wanted.spacing).values.values()])
        contact = bem.solve(heights, wanted.sides[0], delta)
        targets.append([contact.force, contact.area_percent])
    return np.array(inputs), np.array(targets)


@lru_cache(maxsize=8)
def ordinary(features: str = "paper", target: str = "area_percent") -> Dataset:
    """The rows as a dataset of paper or dimensionless features; the target is area or force."""
    described, targets = solved()
    wanted, side = chosen(features), scene().sides[0]
    numbers = Rows(described[:, 1:], described[:, 0], side)
    scale = wanted.scale(target, numbers, 1.0)
    return Dataset(
        inputs=wanted.of(numbers),
        target=targets[:, int(target == "area_percent")] / scale,
        rows=np.arange(ROWS),
        groups=np.arange(ROWS),
        database=np.zeros(ROWS, dtype=np.int64),
        population=np.zeros(ROWS, dtype=np.int64),
        target_name=target,
        unit="%" if target == "area_percent" else "uN",
        dropped={},
        source={"database": "the cases' rows", "database_sha256": "", "scene": scene().text()},
        described=described,
        origins=(Origin("the cases' rows", "", scene().text(), ROWS),),
        scale=scale,
        features=wanted,
    )


def altered(part: str, where: Any, to: float | None = None, factor: float = 1.0) -> Change:
    """Set some of the rows' `inputs` or `target` to a number, or multiply them.

    `where` is any index of the array.
    """

    def change(rows: Dataset) -> Dataset:
        values = getattr(rows, part).copy()
        values[where] = values[where] * factor if to is None else to
        return replace(rows, **{part: values})

    return change


def collinear(rows: Dataset) -> Dataset:
    """One input is twice another, one the sum of two."""
    inputs = rows.inputs.copy()
    inputs[:, 1], inputs[:, 2] = 2 * inputs[:, 3], inputs[:, 3] + inputs[:, 0]
    return replace(rows, inputs=inputs)


def doubled(rows: Dataset) -> Dataset:
    """The first half of the training rows twice."""
    return rows.at(np.r_[: SEEN // 2, : SEEN // 2, SEEN : rows.size])


def contradicting(rows: Dataset) -> Dataset:
    """The first half twice, with targets that are 10 % apart."""
    return altered("target", slice(SEEN // 2), factor=1.1)(doubled(rows))


CONSTANT_COLUMN = altered("inputs", np.s_[:, 5], 0.25)
DOMINANT_COLUMN = altered("inputs", np.s_[:, 20], factor=1e12)  # that a row's length is made of


FEWER: dict[str, dict[str, Any]] = {
    "random-forest": {"n_estimators": 20},
    "adaboost": {"n_estimators": 20},
    "gradient-boost": {"n_estimators": 30},
    "xgboost": {"n_estimators": 50},
    "mlp": {"max_iter": 30},
}
"""Of the tuned settings: less work, which nothing here depends on."""

WAYS = ("default", "tuned")


@dataclass(frozen=True, eq=False)
class Asked:
    """A model fitted by a request, with the settings of one of `WAYS`.

    The product has made `fit` of the rows `train`; the surrogate has this one model.
    """

    request: Request
    way: str
    fit: Fit
    surrogate: Surrogate
    train: Dataset
    test: Dataset

    @property
    def name(self) -> str:
        """Name of the model."""
        return self.request.models[0]

    @property
    def estimator(self) -> Any:
        """The fitted one, without its scaling."""
        return self.fit.learnt.pipeline.named_steps[STEP]

    @property
    def scaled(self) -> Values:
        """Training inputs as the estimator has seen them."""
        scaling = self.fit.learnt.pipeline.steps[0][1]
        inputs = self.train.inputs
        return np.asarray(inputs if scaling == "passthrough" else scaling.transform(inputs))

    @property
    def target(self) -> Values:
        """(n,) what the estimator was trained on."""
        return self.fit.learnt.scaling.scaled(self.train.target)

    def predicted(self, rows: Dataset) -> Values:
        """(n,) targets of some rows."""
        return self.fit.learnt.raw(rows.inputs)

    @property
    def remarks(self) -> tuple[str, ...]:
        """The warnings of the product about the rows and the fit."""
        normalisation = self.train.features.normalisation
        return (*remarks(self.train, normalisation), *self.fit.remarks)

    def score(self) -> float:
        """R2 on the training rows [1]; nan where the target is constant."""
        truth, found = self.train.target, self.predicted(self.train)
        unit = float(np.ptp(truth)) or np.nan
        rest, spread = (truth - found) / unit, (truth - truth.mean()) / unit
        return 1 - float(rest @ rest) / float(spread @ spread)

    def worse_than_constant(self) -> bool:
        """Whether the mean, and the median by absolute errors, would have served better."""
        truth, found = self.train.target, self.predicted(self.train)
        absolute = np.abs(truth - np.median(truth)).mean()
        return self.score() < 0 and bool(np.abs(truth - found).mean() > 1.01 * absolute)


def fitted(
    name: str,
    way: str,
    rows: Dataset,
    settings: Mapping[str, Any] | None = None,
    seen: int = SEEN,
) -> Asked:
    """Fit a model by one of `WAYS` to the first `seen` rows; of the others a third calibrates.

    `settings` come on top of those of the way.
    """
    ends = seen, seen + min(CALIBRATING, (rows.size - seen) // 2)
    train, calibration, test = map(rows.at, np.split(np.arange(rows.size), ends))
    request = Request(
        (Path("rows.h5"),),
        targets=(short_name(rows.target_name),),
        models=(name,),
        features=rows.features.name,
        normalisation=rows.features.normalisation,
    )
    values = baseline(name, rows.features.name)
    if way == "tuned":
        values = untuned(name, rows.features.name)[1] | FEWER.get(name, {})
    wanted = Settings({**values, **(settings or {})}, way == "tuned", way)
    folds = np.zeros(train.size, np.int8)
    fit = fit_target(request, train, calibration, folds, settings=wanted)
    known = {
        "features": rows.features.name,
        "columns": [(name, "1") for name in rows.features.columns],
        "nodes": NODES,
        "side": scene().sides[0],
        "spacing": scene().spacing,
        "modulus": 1.0,
    }
    low, high = train.inputs.min(axis=0), train.inputs.max(axis=0)
    surrogate = Surrogate(known, {"target": fit.learnt}, low, high, near(train))
    return Asked(request, way, fit, surrogate, train, test)


# Models whose predictions follow the unit of the target, with their libraries' settings.
SCALE_FREE = frozenset(MODELS) - {"svm", "mlp"}
SINGLE = 1e-5  # what rows rounded to single precision may change, over the largest prediction
SINGLE_INSIDE = 1e-6  # XGBoost sums in single precision
# Residual of a linear system over the size of its terms, which good elimination leaves [1].
BACKWARD = 1e-12


@lru_cache(maxsize=64)
def fitted_ordinarily(name: str, way: str, features: str, target: str) -> Asked:
    """Fitted to ordinary rows, once for all cases."""
    return fitted(name, way, ordinary(features, target))


def sound(asked: Asked) -> Iterator[Finding]:
    """Numbers, never worse than the mean without saying so."""
    numbers = np.concatenate([asked.predicted(rows) for rows in (asked.test, asked.train)])
    yield Finding("not finite", int(np.count_nonzero(~np.isfinite(numbers))), 0)
    unsaid = int(asked.worse_than_constant() and not asked.remarks)
    yield Finding("worse than a constant, unsaid", unsaid, 0)


def constant(asked: Asked) -> Iterator[Finding]:
    """A constant target is predicted, by models that can."""
    unable = {"kernel-ridge", "gaussian-process", "mlp"}
    if asked.name in unable and asked.train.features.name == "paper":
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
    if target != 1.0 and train.features.name == "paper" and not free:
        return
    other = fitted_ordinarily(asked.name, asked.way, train.features.name, train.target_name)
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


def solves_its_equations(asked: Asked) -> Iterator[Finding]:
    """Kernel ridge, which is our own: the residual of (K + alpha I) a = y over |K| |a| + |y|."""
    if asked.name != "kernel-ridge":
        return
    ridge, x = asked.estimator, asked.scaled.astype(np.longdouble)
    matrix = x @ x.T
    if ridge.kernel != "linear":
        squares = ((x[:, None, :] - x[None, :, :]) ** 2).sum(axis=2)
        matrix = np.exp(
            -squares * (1 / np.longdouble(x.shape[1]) if ridge.gamma is None else ridge.gamma)
        )
    matrix += np.longdouble(ridge.alpha_used_) * np.eye(len(x))
    a, y = ridge.dual_coef_.reshape(-1).astype(np.longdouble), asked.target.astype(np.longdouble)
    size = np.abs(matrix).sum(axis=1).max() * np.abs(a).max() + np.abs(y).max()
    residual = np.abs(matrix @ a - y).max() / size
    yield Finding("residual of its equations", float(residual), BACKWARD)


def _over(errors: Any, target: Values) -> float:
    """Largest error over the largest target."""
    return float(np.abs(errors).max()) / (float(np.abs(target).max()) or 1.0)


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
            for check in (sound, solves_its_equations, *self.checks):
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
    Spoilt("ordinary rows", "60 rows train"),
    WITHOUT_UNITS("ordinary rows without units", "dimensionless features"),
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
    Spoilt("duplicated rows", "30 rows, each twice", doubled),
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
