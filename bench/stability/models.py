"""Cases of the nine models: ordinary rows, changes that spoil rows, and checks of the fits.

The functions of the product fit the models, and make the predictions.
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
from learn.features import FeatureSet, chosen
from learn.features.rows import Rows
from learn.models import MODELS, STEP
from learn.surrogate import Surrogate
from learn.surrogate.calibration import plan_calibration
from learn.surrogate.fitting import fit_target
from learn.surrogate.learnt import Fit

Change = Callable[[Dataset], Dataset]
"""A function that takes rows, and returns a changed copy."""

Check = Callable[["FittedModel"], Iterator[Finding]]
"""A function that takes a fitted model, and yields findings about it."""

ROWS = 90
"""Number of rows, each of which has a surface of its own."""

NODES = 33
"""Nodes a side of the surfaces of the rows."""

SEEN = 60
"""Number of rows that train. They come first; then 10 rows calibrate, and 20 rows test."""

CALIBRATING = 10
"""Largest number of rows that calibrate."""

SCENE = Scene.parse(f"samples = {ROWS}\n[surface]\nnodes = {NODES}\n", "the cases' scene")
"""The scene of the rows: the default scene, which is the paper's, on a small grid."""

SIDE = SCENE.sides[0]
"""Scan length of the surfaces [um]."""

BACKWARD = 1e-12
"""Largest residual that a well solved linear system leaves, over the size of its terms [1]."""

FAR = (1e-12, 1e-3, 1e3, 1e12, 1e150, 1e300)
"""Factors that put statistics far outside of the range of the training rows [1]."""

FEWER: dict[str, dict[str, Any]] = {
    "random-forest": {"n_estimators": 20},
    "adaboost": {"n_estimators": 20},
    "gradient-boost": {"n_estimators": 30},
    "xgboost": {"n_estimators": 50},
    "mlp": {"max_iter": 30},
}
"""Settings that replace tuned ones to save work, by the name of the model.

No check depends on them.
"""


@dataclass(frozen=True, eq=False)
class SolvedRows:
    """The statistics and the contact areas of the rows of `SCENE`."""

    described: Values  # Delta [um], then the 22 statistics; shape (ROWS, 23)
    areas: Values  # contact areas [% of the patch], shape (ROWS,)


@lru_cache(maxsize=1)
def solved() -> SolvedRows:
    """Generate, describe and solve the rows of `SCENE`.

    The work is done once; further calls return the first result.
    """
    plan = parameters(load("paper"), 0, ROWS)
    deltas = plan.load.tolist()
    statistics: list[list[float]] = []
    areas: list[float] = []
    for row in range(ROWS):
        heights = surface_of(SCENE, plan, row)
        description = describe(heights, SCENE.spacing)
        statistics.append(list(description.values.values()))
        areas.append(bem.solve(heights, SIDE, deltas[row]).area_percent)
    described = np.column_stack([plan.load, statistics])
    return SolvedRows(described, np.array(areas))


@lru_cache(maxsize=8)
def ordinary(features: str = "paper") -> Dataset:
    """Return the rows of `SCENE` as a dataset whose target is the area.

    Parameters
    ----------
    features : str
        Name of the set of features, "paper" or "dimensionless".

    Returns
    -------
    Dataset
        The `ROWS` rows, without any fault. Calls with equal arguments return one object.
    """
    rows = solved()
    feature_set = chosen(features)
    delta = rows.described[:, 0]
    numbers = Rows(rows.described[:, 1:], delta, SIDE)
    scale = feature_set.scale(AREA.powers, numbers, modulus=1.0)
    zeros = np.zeros(ROWS, dtype=np.int64)
    return Dataset(
        inputs=feature_set.of(numbers),
        target=rows.areas / scale,
        rows=np.arange(ROWS),
        groups=np.arange(ROWS),
        database=zeros,
        population=zeros,
        target_name="area_percent",
        unit="%",
        dropped={},
        described=rows.described,
        origins=(Origin(database="the cases' rows", sha256="", scene=SCENE, rows=ROWS),),
        name="the cases' rows",
        powers=AREA.powers,
        scale=scale,
        features=feature_set,
    )


def altered(
    part: str, where: Any, to: float | None = None, factor: float = 1.0
) -> Change:
    """Return a function that sets some numbers of rows to a value, or multiplies them.

    Parameters
    ----------
    part : {"inputs", "target"}
        Field of the dataset, an array with a row of the dataset in each row.
    where : index
        Any index of that array; `...` for all of its numbers.
    to : float, optional
        New value, in the unit of the numbers.
    factor : float
        Factor of the numbers; not used if there is a new value [1].

    Returns
    -------
    callable
        Function that takes rows, and returns a changed copy.
    """

    def change(rows: Dataset) -> Dataset:
        """Return a copy of the rows with the changed numbers."""
        values = getattr(rows, part).copy()
        if to is None:
            values[where] = values[where] * factor
        else:
            values[where] = to
        return replace(rows, **{part: values})

    return change


def collinear(rows: Dataset) -> Dataset:
    """Make one input twice another one, and one input the sum of two.

    Parameters
    ----------
    rows : Dataset
        The rows, which stay as they are.

    Returns
    -------
    Dataset
        The changed rows.
    """
    inputs = rows.inputs.copy()
    first = inputs[:, 0]
    fourth = inputs[:, 3]
    inputs[:, 1] = 2 * fourth
    inputs[:, 2] = fourth + first
    return replace(rows, inputs=inputs)


def doubled(rows: Dataset) -> Dataset:
    """Replace the second half of the training rows by the first half.

    Parameters
    ----------
    rows : Dataset
        The rows, which stay as they are.

    Returns
    -------
    Dataset
        The rows, as many as before; the first half of the training rows appears twice.
    """
    half = SEEN // 2
    return rows.at(np.r_[:half, :half, SEEN : rows.size])


@dataclass(frozen=True, eq=False)
class FittedModel:
    """A model that the product has fitted, and a surrogate with this model alone."""

    name: str  # name of the model in `MODELS`
    fit: Fit  # the fit, with its warnings
    surrogate: Surrogate  # its target is named "target"
    train: Dataset  # rows that the model was fitted to
    test: Dataset  # rows that it has not seen

    @property
    def estimator(self) -> Any:
        """The fitted estimator, without the scaling of inputs before it."""
        return self.fit.learnt.pipeline.named_steps[STEP]

    def predicted(self, rows: Dataset) -> Values:
        """Predict the target of rows.

        Parameters
        ----------
        rows : Dataset
            The n rows.

        Returns
        -------
        ndarray, shape (n,)
            Targets in the unit of the rows, also impossible ones, as areas below 0.
        """
        return self.fit.learnt.raw(rows.inputs)

    @property
    def remarks(self) -> tuple[str, ...]:
        """Warnings of the product about the training rows and the fit."""
        of_rows = remarks(self.train, self.train.features.normalisation)
        return (*of_rows, *self.fit.remarks)

    def score(self) -> float:
        """Return R2 on the training rows [1]; NaN if the target is constant."""
        truth = self.train.target
        predicted = self.predicted(self.train)
        # Errors over the range of the target, so that their squares do not overflow.
        target_range = float(np.ptp(truth)) or np.nan  # NaN makes the score NaN
        error = (truth - predicted) / target_range
        spread = (truth - truth.mean()) / target_range
        return 1 - float(error @ error) / float(spread @ spread)

    def worse_than_constant(self) -> bool:
        """Return whether constants fit the training rows better than the model.

        The mean of the target has to have smaller squared errors than the model, and the median
        smaller absolute errors by more than 1 %.
        """
        truth = self.train.target
        predicted = self.predicted(self.train)
        by_median = np.abs(truth - np.median(truth)).mean()
        by_model = np.abs(truth - predicted).mean()
        return self.score() < 0 and bool(by_model > 1.01 * by_median)


def fitted(
    name: str,
    tuning: str,
    rows: Dataset,
    settings: Mapping[str, Any] | None = None,
    seen: int = SEEN,
) -> FittedModel:
    """Fit a model to the first of some rows, by the functions of the product.

    Parameters
    ----------
    name : str
        Name of the model in `MODELS`.
    tuning : {"default", "tuned"}
        Settings of the model: the defaults of its library, or tuned ones (with `FEWER`).
    rows : Dataset
        The rows.
    settings : mapping, optional
        Settings that replace some of the above, by their names.
    seen : int
        Number of rows that train; they come first. Half of the other rows, but at most
        `CALIBRATING`, calibrate, and the remaining rows test.

    Returns
    -------
    FittedModel
        The fitted model, with its training rows and its test rows.
    """
    calibrating = min(CALIBRATING, (rows.size - seen) // 2)
    parts = np.split(np.arange(rows.size), [seen, seen + calibrating])
    train, calibration, test = map(rows.at, parts)
    features = rows.features
    request = Request(
        (Path("rows.h5"),),
        targets=("area",),
        models=(name,),
        features=features.name,
        normalisation=features.normalisation,
    )
    is_tuned = tuning == "tuned"
    if is_tuned:
        values = {**space_of(name, features.name).default, **FEWER.get(name, {})}
    else:
        values = baseline(name, features.name)
    values = {**values, **(settings or {})}
    plan = plan_calibration(name, train, calibration)
    fit = fit_target(
        request,
        train,
        plan,
        np.zeros(train.size, np.int8),  # folds, which only a choice of settings needs
        settings=Settings(values, is_tuned, tuning),
        other=calibration,
    )
    surrogate = Surrogate(
        card=_card(features),
        learnt={"target": fit.learnt},
        low=train.inputs.min(axis=0),
        high=train.inputs.max(axis=0),
        distance=plan.distance,
    )
    return FittedModel(name=name, fit=fit, surrogate=surrogate, train=train, test=test)


def _card(features: FeatureSet) -> dict[str, Any]:
    """Return the entries of a surrogate's card that its predictions need, by their names."""
    return {
        "features": features.name,
        "nodes": NODES,
        "side": SIDE,
        "spacing": SCENE.spacing,
        "modulus": 1.0,
        "columns": [(column, "1") for column in features.columns],
    }


def sound(model: FittedModel) -> Iterator[Finding]:
    """Check that predictions are finite, and that a model worse than a constant has a warning.

    Parameters
    ----------
    model : FittedModel
        The model.

    Yields
    ------
    Finding
        Number of predictions for training and test rows that are not finite; then 1 if the warning
        is missing, else 0.
    """
    not_finite = 0
    for rows in (model.test, model.train):
        predicted = model.predicted(rows)
        not_finite += int(np.count_nonzero(~np.isfinite(predicted)))
    yield Finding(
        name="not finite",
        error=not_finite,
        allowed=0,
    )
    lacks_warning = model.worse_than_constant() and not model.remarks
    yield Finding(
        name="worse than a constant, unsaid",
        error=int(lacks_warning),
        allowed=0,
    )


def constant(model: FittedModel) -> Iterator[Finding]:
    """Check that a constant target is predicted.

    Parameters
    ----------
    model : FittedModel
        The model, fitted to a constant target.

    Yields
    ------
    Finding
        Largest relative error on the test rows [1]. There is none for kernel ridge, the Gaussian
        process and the neural network, which predict constants only nearly.
    """
    if model.name in {"kernel-ridge", "gaussian-process", "mlp"}:
        return
    value = float(model.train.target[0])
    allowed = 1e-6
    if model.name == "svm":  # it ignores errors below its epsilon
        allowed = model.estimator.epsilon / abs(value)
    error = np.abs(model.predicted(model.test) - value).max()
    yield Finding(
        name="off the constant",
        error=float(error / abs(value)),
        allowed=allowed,
    )


def flagged(model: FittedModel) -> Iterator[Finding]:
    """Check that rows far outside of the training are refused, or flagged with possible areas.

    The rows are the test rows with all statistics times a factor.

    Parameters
    ----------
    model : FittedModel
        The model.

    Yields
    ------
    Finding
        For each factor of `FAR`: the number of rows without a flag, and the number of areas and
        bounds of intervals outside of 0 to 100 %. There is none if the rows are refused.
    """
    delta = model.test.described[:, 0]
    for factor in FAR:
        statistics = model.test.described[:, 1:] * factor
        try:
            rows = model.surrogate.of_statistics(statistics, delta, SIDE)
            prediction = model.surrogate.predict_rows(rows)
        except InputError:  # the rows are refused
            continue
        unflagged = sum(not reason for reason in prediction.reasons)
        name = f"statistics times {factor:g}"
        yield Finding(
            name=f"{name} unflagged",
            error=unflagged,
            allowed=0,
        )
        areas = np.concatenate(
            [
                prediction.values["target"],
                prediction.low["target"],
                prediction.high["target"],
            ]
        )
        is_possible = (areas >= 0) & (areas <= 100)
        impossible = int(np.count_nonzero(~is_possible))
        yield Finding(
            name=f"{name} impossible",
            error=impossible,
            allowed=0,
        )


def solves_its_equations(model: FittedModel) -> Iterator[Finding]:
    """Check that kernel ridge, which is code of the product, solves (K + alpha I) a = y.

    Parameters
    ----------
    model : FittedModel
        The model.

    Yields
    ------
    Finding
        Largest residual over |K + alpha I| |a| + |y| in the maximum norm, computed in the machine's
        longest numbers [1]. There is none for other models.
    """
    if model.name != "kernel-ridge":
        return
    learnt = model.fit.learnt
    ridge = model.estimator
    inputs = model.train.inputs
    scaling = learnt.pipeline.steps[0][1]
    if scaling != "passthrough":
        inputs = scaling.transform(inputs)
    x = np.asarray(inputs, dtype=np.longdouble)
    matrix = x @ x.T
    if ridge.kernel != "linear":
        gamma = ridge.gamma
        if gamma is None:  # the default of scikit-learn
            gamma = 1 / np.longdouble(x.shape[1])
        # Radial functions: K = exp(-gamma |x_i - x_j|^2).
        differences = x[:, None, :] - x[None, :, :]
        squares = (differences**2).sum(axis=2)
        matrix = np.exp(-squares * gamma)
    matrix += np.longdouble(ridge.alpha_used_) * np.eye(len(x))
    a = ridge.dual_coef_.reshape(-1).astype(np.longdouble)
    y = learnt.scaling.scaled(model.train.target).astype(np.longdouble)
    norm = np.abs(matrix).sum(axis=1).max()
    size = norm * np.abs(a).max() + np.abs(y).max()
    residual = np.abs(matrix @ a - y).max() / size
    yield Finding(
        name="residual of its equations",
        error=float(residual),
        allowed=BACKWARD,
    )


def unchanged(rows: Dataset) -> Dataset:
    """Return the rows as they are.

    Parameters
    ----------
    rows : Dataset
        The rows.

    Returns
    -------
    Dataset
        The same object.
    """
    return rows


@dataclass(frozen=True)
class Spoilt:
    """A family of cases: rows with one fault, and a case for each of `models`."""

    family: str  # name of the family, which is the fault
    input: str  # the input in words
    change: Change = unchanged  # makes the rows from ordinary ones
    # Checks besides `sound` and `solves_its_equations`, which every fit has to pass.
    checks: tuple[Check, ...] = ()
    features: str = "paper"  # name of the set of features, "paper" or "dimensionless"
    # Settings that replace some of each model's settings, by their names.
    settings: Mapping[str, Any] = field(default_factory=dict)
    models: tuple[str, ...] = tuple(MODELS)  # names of the models
    seen: int = SEEN  # number of the first rows, which train

    def examine(self, name: str) -> Answer:
        """Fit a model with its library's settings and with tuned ones, and judge both fits.

        Parameters
        ----------
        name : str
            Name of the model in `MODELS`.

        Returns
        -------
        Answer
            R2 and warnings of both fits in words, with the findings of all checks. Their names
            begin with "default: " or "tuned: ".
        """
        parts: list[str] = []
        findings: list[Finding] = []
        for tuning in ("default", "tuned"):
            rows = self.change(ordinary(self.features))
            model = fitted(name, tuning, rows, self.settings, self.seen)
            parts.append(f"{tuning}: {_in_words(model)}")
            for check in (sound, solves_its_equations, *self.checks):
                findings.extend(
                    replace(finding, name=f"{tuning}: {finding.name}")
                    for finding in check(model)
                )
        return Answer("; ".join(parts), findings)


def _in_words(model: FittedModel) -> str:
    """Return a text with R2 on the training rows, and the first 150 letters of all warnings.

    If the target is constant, "constant target" replaces R2.
    """
    score = model.score()
    text = f"R2 {100 * score:.4g} % of seen rows"
    if np.isnan(score):
        text = "constant target"
    warnings = ", ".join(model.remarks)[:150]
    if warnings:
        text += f" ({warnings})"
    return text


def cases() -> Iterator[Case]:
    """Yield a case for each family and each of its models."""
    for spoilt in KINDS:
        for name in spoilt.models:
            yield Case(
                family=f"models: {spoilt.family}",
                name=MODELS[name].title,
                input=spoilt.input,
                examine=partial(spoilt.examine, name),
            )


KINDS = (
    Spoilt(
        family="ordinary rows",
        input="60 rows train",
    ),
    Spoilt(
        family="constant target",
        input="area 3.7 % in all rows",
        change=altered("target", ..., to=3.7),
        checks=(constant,),
    ),
    Spoilt(
        family="constant column",
        input="an input is 0.25 in all rows",
        change=altered("inputs", np.s_[:, 5], to=0.25),
    ),
    Spoilt(
        family="collinear columns",
        input="an input is twice another, one a sum of two",
        change=collinear,
    ),
    Spoilt(
        family="duplicated rows",
        input="30 rows, each twice",
        change=doubled,
    ),
    Spoilt(
        family="a row of zeros",
        input="cannot be scaled to unit length",
        change=altered("inputs", [3, SEEN + 15], to=0.0),
    ),
    Spoilt(
        family="tiny inputs",
        input="all inputs times 2^-40",
        change=altered("inputs", ..., factor=2.0**-40),
    ),
    Spoilt(
        family="huge inputs",
        input="all inputs times 2^40",
        change=altered("inputs", ..., factor=2.0**40),
    ),
    Spoilt(
        family="one huge input",
        input="an input times 1e12",
        change=altered("inputs", np.s_[:, 20], factor=1e12),
    ),
    Spoilt(
        family="outlier among inputs",
        input="one row times 1e9",
        change=altered("inputs", 3, factor=1e9),
    ),
    Spoilt(
        family="outlier among targets",
        input="one area of 1e12 %",
        change=altered("target", 3, to=1e12),
    ),
    Spoilt(
        family="few rows",
        input="6 rows train, 2 calibrate, 2 test",
        change=lambda rows: rows.at(np.arange(10)),
        seen=6,
    ),
    Spoilt(
        family="nearly singular",
        input="alpha 0, linear kernel or radial functions, 30 rows twice",
        change=doubled,
        settings={"alpha": 0.0},
        models=("kernel-ridge",),
    ),
    Spoilt(
        family="nearly singular process",
        input="alpha 1e-10, length 1e3: every row nearly the same to it; rows twice",
        change=doubled,
        settings={"alpha": 1e-10, "kernel__length_scale": 1e3, "optimizer": None},
        models=("gaussian-process",),
    ),
    Spoilt(
        family="far outside",
        input="statistics of the test rows times 1e-12 to 1e300",
        checks=(flagged,),
    ),
    Spoilt(
        family="far outside, without units",
        input="dimensionless features",
        checks=(flagged,),
        features="dimensionless",
    ),
)
"""The families of cases, in the order of the table."""
