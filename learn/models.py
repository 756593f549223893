"""The nine models of the paper's section 3.3 as scikit-learn pipelines, and their targets' scale.

Baselines are the libraries' defaults with the paper's kernels: the Gaussian process has a radial
basis function of length 1 that is not fitted (Appendix A), kernel ridge a linear kernel. Features
without units need another length: see `learn.comparison.grid.baseline`.
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

LIBRARIES = ("numpy", "scipy", "scikit-learn", "xgboost-cpu")  # they decide the numbers

# epochs of the perceptron in its search and in its winner's fit; the baseline has 200, the default
LONG_TRAINING = 20_000


@dataclass(frozen=True)
class Model:
    """One kind of surrogate; settings that a library has to make are functions."""

    name: str  # on the command line and in files
    title: str  # in tables and pictures, as the paper writes it
    path: str  # of the estimator's class, or of a function that makes it
    # Settings of the baseline that are not the library's defaults.
    baseline: Mapping[str, Any] = field(default_factory=dict)
    # Settings that all candidates of a search share, in their last fit too.
    tuned: Mapping[str, Any] = field(default_factory=dict)
    shared: str = ""  # setting of which one fit yields the predictions of all values
    # Setting of the paper's grid that the library ignores today, and warns of.
    ignored: str = ""

    def estimator(self, seed: int, *, tuned: bool = False) -> Any:
        """Make an unfitted estimator.

        Parameters
        ----------
        seed : int
            Seed of its random numbers, if it draws any.
        tuned : bool
            Whether it has the settings that all candidates of a search share.

        Returns
        -------
        estimator of scikit-learn
            With the settings of the baseline.
        """
        settings = dict(self.baseline)
        if tuned:
            settings |= self.tuned
        for name, value in settings.items():
            if callable(value):
                settings[name] = value()
        module, _, name = self.path.rpartition(".")
        estimator = getattr(import_module(module), name)(**settings)
        if "random_state" in estimator.get_params(deep=False):
            estimator.set_params(random_state=seed)
        return estimator


def boosted() -> Any:
    """Make XGBoost's estimator on one thread, its defaults written out for searches to find."""
    from xgboost import XGBRegressor

    return XGBRegressor(n_estimators=100, max_depth=6, learning_rate=0.3, n_jobs=1)


def _tree() -> Any:
    """Return AdaBoost's default tree, written out so that a search can set its depth."""
    from sklearn.tree import DecisionTreeRegressor

    return DecisionTreeRegressor(max_depth=3)


def _kernel(bounds: Any = (1e-5, 1e5)) -> Any:
    """Return a radial basis function of length 1, which is fitted unless the bounds are "fixed"."""
    from sklearn.gaussian_process.kernels import RBF

    return RBF(1.0, bounds)


MODELS: dict[str, Model] = {
    model.name: model
    for model in (
        Model("decision-tree", "Decision Tree", "sklearn.tree.DecisionTreeRegressor"),
        Model(
            "random-forest",
            "Random Forest",
            "sklearn.ensemble.RandomForestRegressor",
            shared="n_estimators",
        ),
        Model(
            "adaboost",
            "AdaBoost",
            "sklearn.ensemble.AdaBoostRegressor",
            {"estimator": _tree},
            shared="n_estimators",
        ),
        Model("xgboost", "XGBoost", "learn.models.boosted", shared="n_estimators"),
        Model(
            "gradient-boost",
            "Gradient Boost",
            "sklearn.ensemble.GradientBoostingRegressor",
            shared="n_estimators",
            ignored="criterion",
        ),
        Model("svm", "SVM Regressor", "sklearn.svm.SVR"),
        Model(
            "gaussian-process",
            "GP Regressor",
            "sklearn.gaussian_process.GaussianProcessRegressor",
            {"kernel": partial(_kernel, "fixed"), "optimizer": None},
            {"kernel": _kernel, "optimizer": "fmin_l_bfgs_b"},
        ),
        Model(
            "kernel-ridge",
            "Kernel Ridge",
            "learn.kernel_ridge.SafeKernelRidge",
            shared="alpha",
        ),
        Model(
            "mlp",
            "MLP Regressor",
            "sklearn.neural_network.MLPRegressor",
            # L-BFGS counts evaluations too, and its default would end the training before.
            tuned={"max_iter": LONG_TRAINING, "max_fun": 2 * LONG_TRAINING},
        ),
    )
}
"""The nine models by name, in the order of the paper's Table 4."""

POPULATION = Model("population", "Population Mean", "learn.population.Population")
"""The model of scene features alone, which the nine models can be fitted to as well."""

EVERY = MODELS | {POPULATION.name: POPULATION}  # all models by name


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
    return POPULATION.name if features == SCENE else "kernel-ridge"


def versions() -> dict[str, str]:
    """Return the versions of `LIBRARIES` by name, "" for a library that is not installed."""
    # On other systems the package of xgboost-cpu is xgboost.
    numbers = installed((*LIBRARIES, "xgboost"))
    return {
        name: numbers.get(name, numbers.get(name.removesuffix("-cpu"), ""))
        for name in LIBRARIES
    }


REMARK_LENGTH = 300  # characters of a warning that are kept
STEP = "model"  # name of the estimator in its pipeline; its settings are `model__alpha` and so on


def models_named(names: list[str] | None, features: str = "") -> list[Model]:
    """Return models by their names.

    Parameters
    ----------
    names : list of str or None
        Names that the user has given; None or an empty list for all models.
    features : str
        Name of the feature set.

    Returns
    -------
    list of Model
        Models without repetition, in the order of `EVERY`.

    Raises
    ------
    InputError
        If there is no model of a name for these features.
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
    """Build an unfitted pipeline of scikit-learn: scaling, then the model.

    Parameters
    ----------
    model : Model
        The model.
    settings : mapping, optional
        Values by setting, on top of the baseline's.
    normalisation : str
        Scaling of the inputs: "l2" (every row to unit length, the paper's), "standard" (every input
        to mean 0 and deviation 1), "min-max" (every input to 0..1) or "none".
    seed : int
        Seed of the model's random numbers.
    tuned : bool
        Whether the settings that all candidates of a search share are added.

    Returns
    -------
    Pipeline
        With the steps "scaling" and `STEP`.
    """
    from sklearn.pipeline import Pipeline
    from sklearn.preprocessing import MinMaxScaler, Normalizer, StandardScaler

    scalings = {"l2": Normalizer, "standard": StandardScaler, "min-max": MinMaxScaler}
    scaling = "passthrough" if normalisation == "none" else scalings[normalisation]()
    effective = dict(settings or {})
    effective.pop(model.ignored, None)
    estimator = model.estimator(seed, tuned=tuned).set_params(**effective)
    return Pipeline([("scaling", scaling), (STEP, estimator)])


UNFINISHED = "the training ended at its largest number of steps, before it had converged"
AT_BOUND = "the likelihood of the kernel is largest at an end of its range"


@contextmanager
def remarks() -> Iterator[list[str]]:
    """Collect the warnings of libraries while models are fitted, in words for users.

    Announcements of changes in later versions of a library are left out, because they tell nothing
    about the model.

    Yields
    ------
    list of str
        Empty within the context. At its end it is filled with the texts, without repetition.
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
"""Range of the medians of targets that are not scaled, as areas in percent."""

FAR = 10.0
"""Mean over the deviation of a target from which on models learn the distance from the mean."""

SIZE = 3
"""Exponent of the largest scaled median of other targets, which are scaled to 2^2 to 2^3.

This is the median of the paper's areas, whose hyperparameters these targets are fitted with.
"""


def learns_root(column: str) -> bool:
    """Return whether surrogates learn the square root of a target.

    They do where the target counts nodes in contact, which are never below 0. The error of the
    force, over its scale, grew by a third when its root was learnt.

    Parameters
    ----------
    column : str
        Column of the target.

    Returns
    -------
    bool
        True for the root; False for quantities that are not in `gen.quantities` too.
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
        Places of the training rows.
    standard : bool
        Whether the scaled target has mean 0 and deviation 1 whatever the features. A Gaussian
        process needs that: its prediction far from all training rows is 0.

    Returns
    -------
    Scaling
        To mean 0 and deviation 1 for features without units too, of the square root if they are
        rooted and `learns_root` holds. Targets of other features are divided by a power of two if
        they are very large or small.
    """
    target = dataset.target[train]
    if not (standard or dataset.features.scaled):
        return _scaling_by_power_of_two(target)
    root = dataset.features.rooted and learns_root(dataset.target_name)
    if root:
        target = np.sqrt(target)
    return Scaling(float(target.mean()), float(target.std()) or 1.0, root)


def _scaling_by_power_of_two(target: Values) -> Scaling:
    """Return the scaling of a target, (m,), that keeps its numbers or divides by a power of two.

    The mean is subtracted first if it is far larger than the deviation.
    """
    mean = float(target.mean())
    if abs(mean) <= FAR * float(target.std()):
        mean = 0.0
    magnitudes = np.abs(target - mean)
    if not magnitudes.any():
        return Scaling(mean)
    # Outliers do not move the median.
    median = float(np.median(magnitudes[magnitudes > 0]))
    if USUAL[0] <= median <= USUAL[1]:
        return Scaling(mean)
    return Scaling(mean, 2.0 ** (math.frexp(median)[1] - SIZE))


USABLE = 0.85  # share of the free memory that a fit may take; the rest is the system's
PROCESS = 350 * MIB  # bytes of a process with its libraries, before any fit
# Peak bytes per pair of training rows; a matrix of double precision has 8. These and the following
# numbers were measured (`bench memory`, at commit 10684ff).
PAIR_BYTES = {"gaussian-process": 62.0, "kernel-ridge": 19.0}
FIXED_KERNEL = (
    0.52  # share of these bytes for a Gaussian process whose kernel is not fitted
)
# MiB of up to 2,000 deep trees for `TREE_ROWS` rows; they grow in proportion to the rows
TREES = {"random-forest": 2048, "adaboost": 1536, "xgboost": 2560, "gradient-boost": 1792}
TREE_ROWS = 10_000
OTHERS = 512  # MiB of other models, as of a cache of kernel rows


def check_memory(model: str, rows: int, *, baseline: bool = False) -> None:
    """Refuse a fit in one process that this machine cannot hold.

    Parameters
    ----------
    model : str
        Name of the model.
    rows : int
        Number of training rows.
    baseline : bool
        Whether the fit is of a baseline, which takes less than those of a search.

    Raises
    ------
    InputError
        If the fit needs more than `USABLE` of the free memory.
    """
    of_pair = PAIR_BYTES.get(model, 0.0)
    if baseline and model == "gaussian-process":
        of_pair *= FIXED_KERNEL
    need = PROCESS + of_pair * rows**2
    if not baseline:
        need += TREES.get(model, OTHERS) * MIB * max(1.0, rows / TREE_ROWS)
    limit = USABLE * min(allowed(), free())
    if need > limit:
        raise InputError(
            f"{model} needs about {need / 2**30:.1f} GiB for {rows} training rows, this machine has"
            f" {limit / 2**30:.1f} to give: take fewer with --train-rows, fewer workers, or another"
            " --model"
        )
