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
from bench.stability.case import Answer, Case, Finding
from gen.arrays import Values
from gen.generation.plan import parameters
from gen.generation.sample import surface_of
from gen.quantities import AREA
from gen.runtime.errors import InputError
from gen.scene import Scene, load
from gen.statistics import describe
from learn.comparison.folder import Settings
from learn.comparison.grid import baseline, space_of
from learn.database_rows import Dataset, Origin
from learn.dataset import Request, remarks
from learn.features import chosen
from learn.features.rows import Rows
from learn.models import MODELS, STEP
from learn.surrogate import Surrogate
from learn.surrogate.calibration import plan_calibration
from learn.surrogate.fitting import fit_target
from learn.surrogate.learnt import Fit

Change = Callable[[Dataset], Dataset]
Check = Callable[["Asked"], Iterator[Finding]]

ROWS = 90
NODES = 33
SEEN = 60  # the first rows train; of the others 10 calibrate and 20 test
CALIBRATING = 10
SCENE = Scene.parse(f"samples = {ROWS}\n[surface]\nnodes = {NODES}\n", "the cases' scene")
SIDE = SCENE.sides[0]
# Residual of a linear system over the size of its terms, which good elimination leaves [1].
BACKWARD = 1e-12

FEWER: dict[str, dict[str, Any]] = {
    "random-forest": {"n_estimators": 20},
    "adaboost": {"n_estimators": 20},
    "gradient-boost": {"n_estimators": 30},
    "xgboost": {"n_estimators": 50},
    "mlp": {"max_iter": 30},
}
"""Of the tuned settings: less work, which nothing here depends on."""


@lru_cache(maxsize=1)
def solved() -> tuple[Values, Values]:
    """Return Delta and the 22 statistics, (n, 23), and the areas, (n,) [%]."""
    plan = parameters(load("paper"), 0, ROWS)
    surfaces = [surface_of(SCENE, plan, row) for row in range(ROWS)]
    statistics = [[*describe(each, SCENE.spacing).values.values()] for each in surfaces]
    pairs = zip(surfaces, plan.load.tolist(), strict=True)
    areas = [bem.solve(heights, SIDE, delta).area_percent for heights, delta in pairs]
    return np.column_stack([plan.load, statistics]), np.array(areas)


@lru_cache(maxsize=8)
def ordinary(features: str = "paper") -> Dataset:
    """Return the rows as a dataset of paper or dimensionless features; the target is the area."""
    described, areas = solved()
    wanted, numbers = chosen(features), Rows(described[:, 1:], described[:, 0], SIDE)
    scale, none = wanted.scale(AREA.powers, numbers, 1.0), np.zeros(ROWS, dtype=np.int64)
    return Dataset(
        inputs=wanted.of(numbers),
        target=areas / scale,
        rows=np.arange(ROWS),
        groups=np.arange(ROWS),
        database=none,
        population=none,
        target_name="area_percent",
        unit="%",
        dropped={},
        described=described,
        origins=(Origin("the cases' rows", "", SCENE, ROWS),),
        name="the cases' rows",
        powers=AREA.powers,
        scale=scale,
        features=wanted,
    )


def altered(
    part: str, where: Any, to: float | None = None, factor: float = 1.0
) -> Change:
    """Set some of the rows' `inputs` or `target` to a number, or multiply them.

    `where` is any index of the array.
    """

    def change(rows: Dataset) -> Dataset:
        values = getattr(rows, part).copy()
        values[where] = values[where] * factor if to is None else to
        return replace(rows, **{part: values})

    return change


def collinear(rows: Dataset) -> Dataset:
    """Make one input twice another, and one the sum of two."""
    inputs = rows.inputs.copy()
    inputs[:, 1], inputs[:, 2] = 2 * inputs[:, 3], inputs[:, 3] + inputs[:, 0]
    return replace(rows, inputs=inputs)


def doubled(rows: Dataset) -> Dataset:
    """Take the first half of the training rows twice."""
    return rows.at(np.r_[: SEEN // 2, : SEEN // 2, SEEN : rows.size])


@dataclass(frozen=True, eq=False)
class Asked:
    """A model as the product has fitted it to the rows `train`, and a surrogate of it alone."""

    name: str
    fit: Fit
    surrogate: Surrogate
    train: Dataset
    test: Dataset

    @property
    def estimator(self) -> Any:
        """The fitted one, without its scaling."""
        return self.fit.learnt.pipeline.named_steps[STEP]

    def predicted(self, rows: Dataset) -> Values:
        """(n,) targets of some rows."""
        return self.fit.learnt.raw(rows.inputs)

    @property
    def remarks(self) -> tuple[str, ...]:
        """The warnings of the product about the rows and the fit."""
        return (
            *remarks(self.train, self.train.features.normalisation),
            *self.fit.remarks,
        )

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
    """Fit a model with the settings of its library (`default`) or of the paper (`tuned`).

    The first `seen` rows train, of the others a third calibrates; `settings` come on top.
    """
    ends = seen, seen + min(CALIBRATING, (rows.size - seen) // 2)
    train, calibration, test = map(rows.at, np.split(np.arange(rows.size), ends))
    features = rows.features
    request = Request(
        (Path("rows.h5"),),
        targets=("area",),
        models=(name,),
        features=features.name,
        normalisation=features.normalisation,
    )
    values = baseline(name, features.name)
    if way == "tuned":
        values = space_of(name, features.name).default | FEWER.get(name, {})
    wanted = Settings({**values, **(settings or {})}, way == "tuned", way)
    plan = plan_calibration(name, train, calibration)
    folds = np.zeros(train.size, np.int8)
    fit = fit_target(request, train, plan, folds, settings=wanted, other=calibration)
    known: dict[str, Any] = {"features": features.name, "nodes": NODES, "side": SIDE}
    known |= {"spacing": SCENE.spacing, "modulus": 1.0}
    known["columns"] = [(each, "1") for each in features.columns]
    low, high = train.inputs.min(axis=0), train.inputs.max(axis=0)
    surrogate = Surrogate(known, {"target": fit.learnt}, low, high, plan.distance)
    return Asked(name, fit, surrogate, train, test)


def sound(asked: Asked) -> Iterator[Finding]:
    """Numbers, never worse than the mean without saying so."""
    numbers = np.concatenate(
        [asked.predicted(rows) for rows in (asked.test, asked.train)]
    )
    yield Finding("not finite", int(np.count_nonzero(~np.isfinite(numbers))), 0)
    unsaid = int(asked.worse_than_constant() and not asked.remarks)
    yield Finding("worse than a constant, unsaid", unsaid, 0)


def constant(asked: Asked) -> Iterator[Finding]:
    """A constant target is predicted, by models that can."""
    if asked.name in {"kernel-ridge", "gaussian-process", "mlp"}:
        return
    value = float(asked.train.target[0])
    allowed = asked.estimator.epsilon / abs(value) if asked.name == "svm" else 1e-6
    error = np.abs(asked.predicted(asked.test) - value).max() / abs(value)
    yield Finding("off the constant", float(error), allowed)


def flagged(asked: Asked) -> Iterator[Finding]:
    """Rows far outside the training are said to be, or refused; values are possible ones."""
    for factor in (1e-12, 1e-3, 1e3, 1e12, 1e150, 1e300):
        statistics, delta = (
            asked.test.described[:, 1:] * factor,
            asked.test.described[:, 0],
        )
        try:
            rows = asked.surrogate.of_statistics(statistics, delta, SIDE)
            found = asked.surrogate.predict_rows(rows)
        except InputError:
            continue
        unsaid = sum(not reason for reason in found.reasons)
        yield Finding(f"statistics times {factor:g} unflagged", unsaid, 0)
        values = np.concatenate(
            [found.values["target"], found.low["target"], found.high["target"]]
        )
        impossible = np.count_nonzero(~((values >= 0) & (values <= 100)))
        yield Finding(f"statistics times {factor:g} impossible", int(impossible), 0)


def solves_its_equations(asked: Asked) -> Iterator[Finding]:
    """Kernel ridge, which is our own: the residual of (K + alpha I) a = y over |K| |a| + |y|."""
    if asked.name != "kernel-ridge":
        return
    learnt, ridge, inputs = asked.fit.learnt, asked.estimator, asked.train.inputs
    scaling = learnt.pipeline.steps[0][1]
    scaled = inputs if scaling == "passthrough" else scaling.transform(inputs)
    x = np.asarray(scaled, dtype=np.longdouble)
    matrix = x @ x.T
    if ridge.kernel != "linear":
        squares = ((x[:, None, :] - x[None, :, :]) ** 2).sum(axis=2)
        gamma = 1 / np.longdouble(x.shape[1]) if ridge.gamma is None else ridge.gamma
        matrix = np.exp(-squares * gamma)
    matrix += np.longdouble(ridge.alpha_used_) * np.eye(len(x))
    a = ridge.dual_coef_.reshape(-1).astype(np.longdouble)
    y = learnt.scaling.scaled(asked.train.target).astype(np.longdouble)
    size = np.abs(matrix).sum(axis=1).max() * np.abs(a).max() + np.abs(y).max()
    residual = np.abs(matrix @ a - y).max() / size
    yield Finding("residual of its equations", float(residual), BACKWARD)


@dataclass(frozen=True)
class Spoilt:
    """Rows of a kind: what is the matter with them, the input in words, and what is asked.

    `change` makes them from ordinary rows, `seen` of them train, `checks` come besides those that
    every fit has to pass, and `settings` on top of the model's own.
    """

    family: str
    asked: str
    change: Change = lambda rows: rows
    checks: tuple[Check, ...] = ()
    features: str = "paper"
    settings: Mapping[str, Any] = field(default_factory=dict)
    models: tuple[str, ...] = tuple(MODELS)
    seen: int = SEEN

    def examine(self, name: str) -> Answer:
        """Fit with the libraries' settings and with tuned ones."""
        said: list[str] = []
        findings: list[Finding] = []
        for way in ("default", "tuned"):
            rows = self.change(ordinary(self.features))
            asked = fitted(name, way, rows, self.settings, self.seen)
            score, remarks = asked.score(), ", ".join(asked.remarks)[:150]
            told = (
                "constant target"
                if np.isnan(score)
                else f"R2 {100 * score:.4g} % of seen rows"
            )
            said.append(f"{way}: {told}" + f" ({remarks})" * bool(remarks))
            for check in (sound, solves_its_equations, *self.checks):
                findings += [
                    each._replace(what=f"{way}: {each.what}") for each in check(asked)
                ]
        return Answer("; ".join(said), findings)


def cases() -> Iterator[Case]:
    """Yield family after family."""
    for spoilt in KINDS:
        for name in spoilt.models:
            examine = partial(spoilt.examine, name)
            yield Case(
                f"models: {spoilt.family}", MODELS[name].title, spoilt.asked, examine
            )


KINDS = (
    Spoilt("ordinary rows", "60 rows train"),
    Spoilt(
        "constant target",
        "area 3.7 % in all rows",
        altered("target", ..., 3.7),
        (constant,),
    ),
    Spoilt(
        "constant column",
        "an input is 0.25 in all rows",
        altered("inputs", np.s_[:, 5], 0.25),
    ),
    Spoilt("collinear columns", "an input is twice another, one a sum of two", collinear),
    Spoilt("duplicated rows", "30 rows, each twice", doubled),
    Spoilt(
        "a row of zeros",
        "cannot be scaled to unit length",
        altered("inputs", [3, SEEN + 15], 0.0),
    ),
    Spoilt(
        "tiny inputs", "all inputs times 2^-40", altered("inputs", ..., factor=2.0**-40)
    ),
    Spoilt(
        "huge inputs", "all inputs times 2^40", altered("inputs", ..., factor=2.0**40)
    ),
    Spoilt(
        "one huge input",
        "an input times 1e12",
        altered("inputs", np.s_[:, 20], factor=1e12),
    ),
    Spoilt("outlier among inputs", "one row times 1e9", altered("inputs", 3, factor=1e9)),
    Spoilt("outlier among targets", "one area of 1e12 %", altered("target", 3, 1e12)),
    Spoilt(
        "few rows",
        "6 rows train, 2 calibrate, 2 test",
        lambda rows: rows.at(np.arange(10)),
        seen=6,
    ),
    Spoilt(
        "nearly singular",
        "alpha 0, linear kernel or radial functions, 30 rows twice",
        doubled,
        settings={"alpha": 0.0},
        models=("kernel-ridge",),
    ),
    Spoilt(
        "nearly singular process",
        "alpha 1e-10, length 1e3: every row nearly the same to it; rows twice",
        doubled,
        settings={"alpha": 1e-10, "kernel__length_scale": 1e3, "optimizer": None},
        models=("gaussian-process",),
    ),
    Spoilt(
        "far outside",
        "statistics of the test rows times 1e-12 to 1e300",
        checks=(flagged,),
    ),
    Spoilt(
        "far outside, without units",
        "dimensionless features",
        checks=(flagged,),
        features="dimensionless",
    ),
)
