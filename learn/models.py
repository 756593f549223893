"""The nine models of the paper's section 3.3 as scikit-learn pipelines, and scalings of targets.

A baseline is a model with the defaults of its library and the paper's kernel: for the Gaussian
process a radial basis function whose length is 1 and not fitted (Appendix A), for kernel ridge a
linear kernel. For features without units, `learn.comparison.grid.baseline` changes the length.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from gen.arrays import Indices, Values
from gen.quantities import QUANTITIES
from gen.runtime.errors import InputError
from gen.runtime.installation import versions as installed
from gen.runtime.memory import MIB, allowed, free
from learn.features.scene import SCENE
from learn.features.sets import Scaling

if TYPE_CHECKING:
    from learn.database_rows import Dataset

# Distributions whose versions decide the numbers of a fit.
LIBRARIES = ("numpy", "scipy", "scikit-learn", "xgboost-cpu")

# Largest number of epochs of the perceptron in a search and in the fit of its winner. The baseline
# has the default of the library, 200.
LONG_TRAINING = 20_000


@dataclass(frozen=True)
class Model:
    """One kind of model.

    A setting whose value is an object of a library is stored as the function that makes it, so that
    the library is imported only when it is needed.
    """

    name: str  # name on the command line and in files
    title: str  # name in tables and pictures, as in the paper
    path: str  # dotted path of the estimator's class, or of a function that makes the estimator
    # Settings of the baseline that differ from the defaults of the library.
    baseline: Mapping[str, Any] = field(default_factory=dict)
    # Further settings of all candidates of a search, and of the fit of its winner.
    tuned: Mapping[str, Any] = field(default_factory=dict)
    # Setting of which one fit gives the predictions for all values, as the number of trees; "" if
    # there is none.
    shared: str = ""
    # Setting of the paper's grid that the library no longer uses, and warns about; "" if there is
    # none.
    ignored: str = ""
    # Power of the number of training rows with which the time of a fit grows.
    growth: float = 1.0

    def estimator(self, seed: int, *, tuned: bool = False) -> Any:
        """Make an unfitted estimator.

        Parameters
        ----------
        seed : int
            Seed of its random numbers; not used by estimators that draw none.
        tuned : bool
            True to add the settings in `tuned` to those of the baseline.

        Returns
        -------
        estimator of scikit-learn
            The estimator with these settings.
        """
        settings = dict(self.baseline)
        if tuned:
            settings |= self.tuned
        for name, value in settings.items():
            if callable(value):  # a function that makes an object of a library
                settings[name] = value()
        module, _, name_in_module = self.path.rpartition(".")
        make = getattr(import_module(module), name_in_module)
        estimator = make(**settings)
        if "random_state" in estimator.get_params(deep=False):
            estimator.set_params(random_state=seed)
        return estimator


def boosted() -> Any:
    """Make XGBoost's estimator for one thread.

    Its defaults are written out: without them its settings are None, and searches read settings
    from the estimator.
    """
    from xgboost import XGBRegressor

    return XGBRegressor(n_estimators=100, max_depth=6, learning_rate=0.3, n_jobs=1)


def _tree() -> Any:
    """Make AdaBoost's default tree. Without it a search could not set the depth of the tree."""
    from sklearn.tree import DecisionTreeRegressor

    return DecisionTreeRegressor(max_depth=3)


def _kernel(bounds: Any = (1e-5, 1e5)) -> Any:
    """Make a radial basis function of length 1.

    `bounds` are the smallest and the largest length that a fit may choose, or "fixed" for a length
    that is not fitted.
    """
    from sklearn.gaussian_process.kernels import RBF

    return RBF(1.0, bounds)


MODELS: dict[str, Model] = {
    model.name: model
    for model in (
        Model(
            name="decision-tree",
            title="Decision Tree",
            path="sklearn.tree.DecisionTreeRegressor",
        ),
        Model(
            name="random-forest",
            title="Random Forest",
            path="sklearn.ensemble.RandomForestRegressor",
            shared="n_estimators",
        ),
        Model(
            name="adaboost",
            title="AdaBoost",
            path="sklearn.ensemble.AdaBoostRegressor",
            baseline={"estimator": _tree},
            shared="n_estimators",
        ),
        Model(
            name="xgboost",
            title="XGBoost",
            path="learn.models.boosted",
            shared="n_estimators",
        ),
        Model(
            name="gradient-boost",
            title="Gradient Boost",
            path="sklearn.ensemble.GradientBoostingRegressor",
            shared="n_estimators",
            ignored="criterion",
        ),
        Model(name="svm", title="SVM Regressor", path="sklearn.svm.SVR", growth=2.0),
        Model(
            name="gaussian-process",
            title="GP Regressor",
            path="learn.gaussian_process.LengthProcess",
            baseline={"kernel": partial(_kernel, "fixed"), "optimizer": None},
            tuned={"kernel": _kernel, "optimizer": "fmin_l_bfgs_b"},
            growth=3.0,
        ),
        Model(
            name="kernel-ridge",
            title="Kernel Ridge",
            path="learn.kernel_ridge.SafeKernelRidge",
            shared="alpha",
            growth=3.0,
        ),
        Model(
            name="mlp",
            title="MLP Regressor",
            path="sklearn.neural_network.MLPRegressor",
            # L-BFGS also has a largest number of evaluations, whose default would end the training
            # before its largest number of epochs.
            tuned={"max_iter": LONG_TRAINING, "max_fun": 2 * LONG_TRAINING},
            growth=2.0,  # A step of a search on fewer rows has fewer epochs, too.
        ),
    )
}
"""The nine models by name, in the order of the paper's Table 4."""

POPULATION = Model(
    name="population", title="Population Mean", path="learn.population.Population"
)
"""A tenth model, for the feature set `scene` only. The nine models can be fitted to it, too."""

EVERY = MODELS | {POPULATION.name: POPULATION}
"""All ten models by name."""


def default_model(features: str) -> str:
    """Return the model that `learn fit` takes without the option `--model`.

    Parameters
    ----------
    features : str
        Name of the feature set.

    Returns
    -------
    str
        Name of the model.
    """
    if features == SCENE:
        return POPULATION.name
    return "kernel-ridge"


def versions() -> dict[str, str]:
    """Return the versions of `LIBRARIES` by their names, "" for a library that is not installed."""
    numbers = installed((*LIBRARIES, "xgboost"))
    versions_by_name = {}
    for name in LIBRARIES:
        # On some systems the distribution xgboost-cpu is called xgboost.
        alternative = name.removesuffix("-cpu")
        versions_by_name[name] = numbers.get(name, numbers.get(alternative, ""))
    return versions_by_name


# Largest number of characters of a warning of a library that is kept.
REMARK_LENGTH = 300
# Name of the estimator in its pipeline. Its setting alpha, for example, is called `model__alpha`.
STEP = "model"


def models_named(names: list[str] | None, features: str = "") -> list[Model]:
    """Return the models with given names.

    Parameters
    ----------
    names : list of str or None
        Names of models from the command line; None or an empty list for all models that can be
        fitted to these features.
    features : str
        Name of the feature set.

    Returns
    -------
    list of Model
        Models without repetition, in the order of `EVERY`.

    Raises
    ------
    InputError
        If a name is unknown, or its model cannot be fitted to these features.
    """
    allowed_models = EVERY if features == SCENE else MODELS
    for name in names or ():
        if name == POPULATION.name and name not in allowed_models:
            raise InputError(f"--model {name}: needs --features {SCENE}")
        if name not in allowed_models:
            raise InputError(f"--model {name!r}: give one of {', '.join(allowed_models)}")
    return [
        model for model in allowed_models.values() if not names or model.name in names
    ]


def pipeline(
    model: Model,
    settings: Mapping[str, Any] | None = None,
    *,
    normalisation: str = "l2",
    seed: int = 0,
    tuned: bool = False,
) -> Any:
    """Build an unfitted pipeline of scikit-learn: a scaling of the inputs, then a model.

    Parameters
    ----------
    model : Model
        The model.
    settings : mapping, optional
        Values by setting, which replace those of the baseline. The setting in `Model.ignored` is
        left out.
    normalisation : str
        Scaling of the inputs: "l2" (rows to unit length, as in the paper), "standard" (each input
        to mean 0 and deviation 1), "min-max" (each input to the range 0 to 1) or "none".
    seed : int
        Seed of the model's random numbers.
    tuned : bool
        True to add the settings in `Model.tuned`.

    Returns
    -------
    Pipeline
        A pipeline with the steps "scaling" and `STEP`.
    """
    from sklearn.pipeline import Pipeline
    from sklearn.preprocessing import MinMaxScaler, Normalizer, StandardScaler

    scalings = {"l2": Normalizer, "standard": StandardScaler, "min-max": MinMaxScaler}
    scaling: Any = "passthrough"
    if normalisation != "none":
        scaling = scalings[normalisation]()
    effective = dict(settings or {})
    effective.pop(model.ignored, None)
    estimator = model.estimator(seed, tuned=tuned).set_params(**effective)
    return Pipeline([("scaling", scaling), (STEP, estimator)])


# Remark of `remarks` on a training that did not converge.
UNFINISHED = "the training ended at its largest number of steps, before it had converged"
# Remark of `remarks` on a fitted length of a kernel at an end of its range.
AT_BOUND = "the likelihood of the kernel is largest at an end of its range"


@contextmanager
def remarks() -> Iterator[list[str]]:
    """Collect the warnings that libraries give in a context, as remarks for users.

    Warnings that training did not converge are replaced by `UNFINISHED` or `AT_BOUND`. Other
    warnings are cut to `REMARK_LENGTH` characters. Announcements of changes in later versions of a
    library are left out, because they say nothing about the model.

    Yields
    ------
    list of str
        The remarks, each of them once. The list is empty until the context ends, and stays empty
        if an error leaves the context.
    """
    from sklearn.exceptions import ConvergenceWarning

    texts: list[str] = []
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        yield texts
    for warning in caught:
        text = " ".join(str(warning.message).split())[:REMARK_LENGTH]
        if issubclass(warning.category, ConvergenceWarning):
            text = AT_BOUND if "bound" in text else UNFINISHED
        is_announcement = issubclass(warning.category, FutureWarning | DeprecationWarning)
        if text not in texts and not is_announcement:
            texts.append(text)


USUAL = (1e-3, 1e3)
"""Smallest and largest median of targets that keep their scale, as areas in percent do."""

FAR = 10.0
"""Largest ratio of a target's mean to its deviation at which the mean is not subtracted."""

SIZE = 3
"""Exponent of 2 for the scaling of targets whose median is not `USUAL`: it becomes 2^2 to 2^3.

The median of the paper's areas is in this range. Settings that were found for areas then suit these
targets, too.
"""


def learns_root(column: str) -> bool:
    """Tell whether surrogates learn the square root of a target.

    They do so for numbers and shares of nodes, as the area. For the force over its scale, the root
    would make the error a third larger.

    Parameters
    ----------
    column : str
        Column of the target.

    Returns
    -------
    bool
        True for the root; False for other quantities, and for outputs of a user's function.
    """
    quantity = QUANTITIES.get(column)
    return quantity is not None and quantity.counts_nodes


def scaling_of(dataset: Dataset, train: Indices, *, standard: bool = False) -> Scaling:
    """Return the scaling of a target over its training rows.

    Parameters
    ----------
    dataset : Dataset
        Rows of the target.
    train : ndarray, shape (m,)
        Positions of the training rows.
    standard : bool
        True for mean 0 and deviation 1 with features of any set. A Gaussian process needs this: its
        prediction far from all training rows is 0.

    Returns
    -------
    Scaling
        With `standard`, and for features without units, a scaling to mean 0 and deviation 1, of
        the square root of the target if the features have roots and `learns_root` is true.
        Otherwise a scaling that subtracts a mean that is far larger than the deviation (`FAR`), and
        divides by a power of two if the median is not of the size of areas in percent (`USUAL`).
    """
    target = dataset.target[train]
    if not (standard or dataset.features.scaled):
        return _scaling_by_power_of_two(target)
    root = dataset.features.rooted and learns_root(dataset.target_name)
    if root:
        target = np.sqrt(target)
    deviation = float(target.std()) or 1.0  # 1 for a constant target
    return Scaling(mean=float(target.mean()), deviation=deviation, root=root)


def _scaling_by_power_of_two(target: Values) -> Scaling:
    """Return the scaling of a target, (m,), for features with units.

    The mean is subtracted if it is more than `FAR` deviations. The target is divided by a power of
    two if its median magnitude is outside the range `USUAL`.
    """
    mean = float(target.mean())
    if abs(mean) <= FAR * float(target.std()):
        mean = 0.0
    magnitudes = np.abs(target - mean)
    if not magnitudes.any():  # a constant target
        return Scaling(mean=mean)
    # The size of outliers does not change the median. Zeros, as of bodies that do not yield, would.
    median = float(np.median(magnitudes[magnitudes > 0]))
    smallest, largest = USUAL
    if smallest <= median <= largest:
        return Scaling(mean=mean)
    _, exponent = math.frexp(median)
    return Scaling(mean=mean, deviation=2.0 ** (exponent - SIZE))


# Largest share of the free memory that a fit may need; the rest is left to the system.
USABLE = 0.85
# Memory of a process with its libraries, before any fit [bytes].
PROCESS = 350 * MIB
# Largest memory of a fit for each pair of training rows [bytes], by model. One matrix of double
# precision has 8. `asperity bench memory` measures what this and the following numbers bound.
PAIR_BYTES = {"gaussian-process": 62.0, "kernel-ridge": 19.0}
# Share of `PAIR_BYTES` that a Gaussian process needs if its kernel is not fitted.
FIXED_KERNEL = 0.52
# Memory of up to 2,000 deep trees for at most `TREE_ROWS` training rows [MiB], by model. For more
# rows it is larger in proportion.
TREES = {"random-forest": 2048, "adaboost": 1536, "xgboost": 2560, "gradient-boost": 1792}
# Number of training rows for which `TREES` states the memory.
TREE_ROWS = 10_000
# Memory of each model without trees for at most `TREE_ROWS` training rows [MiB], in addition to
# `PAIR_BYTES`: a cache of kernel rows, for example.
OTHERS = 512


def needed_memory(model: str, rows: int, *, baseline: bool = False) -> float:
    """Return the memory that is reckoned with for a fit.

    Parameters
    ----------
    model : str
        Name of the model.
    rows : int
        Number of training rows.
    baseline : bool
        True for the fit of a baseline, which needs less memory than the fits of a search.

    Returns
    -------
    float
        Memory of the process with its libraries and the fit [bytes].
    """
    pair_bytes = PAIR_BYTES.get(model, 0.0)
    if baseline and model == "gaussian-process":
        pair_bytes *= FIXED_KERNEL
    needed = PROCESS + pair_bytes * rows**2
    if not baseline:
        needed += TREES.get(model, OTHERS) * MIB * max(1.0, rows / TREE_ROWS)
    return needed


def check_memory(model: str, rows: int, *, baseline: bool = False) -> None:
    """Refuse a fit for which the memory of this machine does not suffice.

    Parameters
    ----------
    model : str
        Name of the model.
    rows : int
        Number of training rows.
    baseline : bool
        True for the fit of a baseline, which needs less memory than the fits of a search.

    Raises
    ------
    InputError
        If the fit needs more than `USABLE` of the free memory.
    """
    needed = needed_memory(model, rows, baseline=baseline)
    limit = USABLE * min(allowed(), free())  # bytes
    if needed > limit:
        raise InputError(
            f"{model} needs about {needed / 2**30:.1f} GiB for {rows} training rows, this machine"
            f" has {limit / 2**30:.1f} to give: take fewer with --train-rows, fewer workers, or"
            " another --model"
        )
