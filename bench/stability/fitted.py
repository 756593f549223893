"""Ordinary rows, the changes that spoil them, and a model fitted and asked as the product does."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

import bem
from gen.arrays import Values
from gen.generation.plan import parameters
from gen.generation.sample import surface_of
from gen.scene import Scene, load
from gen.statistics import describe
from learn.comparison.grid import baseline, untuned
from learn.dataset import Dataset, Request, remarks
from learn.features import chosen
from learn.features.sets import build, target_scale
from learn.models import STEP
from learn.stored import Origin, short_name
from learn.surrogate import Surrogate, card
from learn.surrogate.calibration import near
from learn.surrogate.fitting import Fit, Settings, fit_target
from learn.surrogate.model import Rows

Change = Callable[[Dataset], Dataset]

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
    statistics, delta = described[:, 1:], described[:, 0]
    scale = target_scale(wanted, target, statistics, delta, side, 1.0)
    return Dataset(
        inputs=build(wanted, statistics, delta, side),
        target=targets[:, int(target == "area_percent")] / scale,
        rows=np.arange(ROWS),
        groups=np.arange(ROWS),
        database=np.zeros(ROWS, dtype=np.int64),
        population=np.zeros(ROWS, dtype=np.int64),
        names=wanted.columns,
        target_name=target,
        unit="%" if target == "area_percent" else "uN",
        dropped={},
        source={"database": "the cases' rows", "database_sha256": "", "scene": scene().text()},
        described=described,
        origins=(Origin("the cases' rows", "", scene().text(), ROWS),),
        scale=scale,
        features=features,
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
        normalisation = "l2" if self.train.features == "paper" else "standard"
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
        Path("rows.h5"),
        Path("out"),
        targets=(short_name(rows.target_name),),
        models=(name,),
        features=rows.features,
        normalisation=chosen(rows.features).normalisation,
    )
    values = baseline(name, rows.features)
    if way == "tuned":
        values = untuned(name, rows.features)[1] | FEWER.get(name, {})
    wanted = Settings({**values, **(settings or {})}, way == "tuned", way)
    folds = np.zeros(train.size, np.int8)
    fit = fit_target(request, train, calibration, folds, settings=wanted)
    known = {
        "features": rows.features,
        "columns": [],
        "nodes": NODES,
        "side": scene().sides[0],
        "spacing": scene().spacing,
        "modulus": 1.0,
    }
    low, high = train.inputs.min(axis=0), train.inputs.max(axis=0)
    surrogate = Surrogate(known, {"target": fit.learnt}, low, high, near(train))
    return Asked(request, way, fit, surrogate, train, test)


def rows_of(rows: Dataset) -> Rows:
    """Rows that a surrogate can be asked about."""
    side = scene().sides[0]
    return Rows(rows.inputs, rows.described[:, 1:], rows.described[:, 0], side, ())


def loaded(asked: Asked) -> Surrogate:
    """The surrogate after it was written, with the card of a whole one, and read."""
    (name,), learnt = asked.request.targets, asked.fit.learnt
    calibrated = sum(scores.size for scores in learnt.calibration.scores)
    train = np.arange(asked.train.rows.size)
    sizes = {"train": train.size, "calibration": calibrated, "test": 0}
    judged = card.judge(learnt, asked.test, np.arange(asked.test.rows.size))
    judged |= {"settings": {}, "settings_from": asked.way, "remarks": list(asked.remarks)}
    whole = card.make(asked.request, asked.train, train, sizes, {name: judged})
    with TemporaryDirectory() as folder:
        path = Path(folder) / "model.surrogate"
        replace(asked.surrogate, card=whole, learnt={name: learnt}).save(path)
        read = Surrogate.load(path)
    return replace(read, learnt={"target": read.learnt[name]})
