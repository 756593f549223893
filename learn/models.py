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

from gen.arrays import Indices
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
    own: Mapping[str, Any] = field(
        default_factory=dict
    )  # the baseline's, on top of the library's
    # Settings that all candidates of a search share, in their last fit too.
    tuned: Mapping[str, Any] = field(default_factory=dict)
    shared: str = ""  # setting of which one fit yields the predictions of all values
    ignored: str = (
        ""  # setting of the paper's grid that the library ignores today, and warns of
    )

    def estimator(self, seed: int, *, tuned: bool = False) -> Any:
        """Make the baseline's estimator, or that of a search, with the seed if it draws."""
        home, _, name = self.path.rpartition(".")
        given = {**self.own, **(self.tuned if tuned else {})}
        made = {
            name: value() if callable(value) else value for name, value in given.items()
        }
        estimator = getattr(import_module(home), name)(**made)
        drawn = "random_state" in estimator.get_params(deep=False)
        return estimator.set_params(random_state=seed) if drawn else estimator


def boosted() -> Any:
    """Make XGBoost's estimator on one thread, its defaults written out for searches to find."""
    from xgboost import XGBRegressor

    return XGBRegressor(n_estimators=100, max_depth=6, learning_rate=0.3, n_jobs=1)


def _tree() -> Any:
    """Return AdaBoost's default tree, written out so that a search can set its depth."""
    from sklearn.tree import DecisionTreeRegressor

    return DecisionTreeRegressor(max_depth=3)


def _kernel(bounds: Any = (1e-5, 1e5)) -> Any:
    """Return the kernel of a Gaussian process, whose length is fitted unless its bounds say so."""
    from sklearn.gaussian_process.kernels import RBF

    return RBF(1.0, bounds)


# all nine models by name, in the order of the paper's Table 4
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
# the model of a scene's own features, beside the nine, which fit these too
POPULATION = Model("population", "Population Mean", "learn.population.Population")
EVERY = MODELS | {POPULATION.name: POPULATION}  # all models by name


def default_model(features: str) -> str:
    """Return the model that `learn fit` takes for a feature set where none is given."""
    return POPULATION.name if features == SCENE else "kernel-ridge"


def versions() -> dict[str, str]:
    """Return the versions of the libraries that decide the numbers, "" for a missing one."""
    found = installed(
        (*LIBRARIES, "xgboost")
    )  # which is the package of xgboost-cpu elsewhere
    return {
        name: found.get(name, found.get(name.removesuffix("-cpu"), ""))
        for name in LIBRARIES
    }


REMARK_LENGTH = 300  # characters of a warning that are kept
STEP = "model"  # name of the estimator in its pipeline; its settings are `model__alpha` and so on


def models_named(names: list[str] | None, features: str = "") -> list[Model]:
    """Return the models of some names, or all of a feature set, in the order of `EVERY`."""
    known = EVERY if features == SCENE else MODELS
    for name in names or ():
        if name == POPULATION.name and name not in known:
            raise InputError(f"--model {name}: needs --features {SCENE}")
        if name not in known:
            raise InputError(f"--model {name!r}: give one of {', '.join(known)}")
    return [model for model in known.values() if not names or model.name in names]


def pipeline(
    model: Model,
    settings: Mapping[str, Any] | None = None,
    *,
    normalisation: str = "l2",
    seed: int = 0,
    tuned: bool = False,
) -> Any:
    """Build an unfitted pipeline of scikit-learn: scaling, then the model.

    The settings come on top of the baseline's; with `tuned`, so do those that all candidates of a
    search share. The normalisation is l2 (every row to unit length, the paper's), standard (every
    input to mean 0 and deviation 1), min-max (to 0..1) or none. The seed is that of the draws.
    """
    from sklearn.pipeline import Pipeline
    from sklearn.preprocessing import MinMaxScaler, Normalizer, StandardScaler

    scalings = {"l2": Normalizer, "standard": StandardScaler, "min-max": MinMaxScaler}
    scaling = "passthrough" if normalisation == "none" else scalings[normalisation]()
    given = {
        name: value for name, value in (settings or {}).items() if name != model.ignored
    }
    estimator = model.estimator(seed, tuned=tuned).set_params(**given)
    return Pipeline([("scaling", scaling), (STEP, estimator)])


UNFINISHED = "the training ended at its largest number of steps, before it had converged"
AT_BOUND = "the likelihood of the kernel is largest at an end of its range"


@contextmanager
def remarks() -> Iterator[list[str]]:
    """Collect in a list what libraries warn of while models are fitted, each once, for users.

    What a library will change in its later versions is left out: it says nothing about the model.
    """
    from sklearn.exceptions import ConvergenceWarning

    said: list[str] = []
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        yield said
    for each in caught:
        text = " ".join(str(each.message).split())[:REMARK_LENGTH]
        if issubclass(each.category, ConvergenceWarning):
            text = AT_BOUND if "bound" in text else UNFINISHED
        if text not in said and not issubclass(
            each.category, FutureWarning | DeprecationWarning
        ):
            said.append(text)


USUAL = (
    1e-3,
    1e3,
)  # range of the medians of targets that are not scaled, as areas in percent
FAR = (
    10.0  # mean over the deviation from which on models learn the distance from the mean
)
# exponent of the other targets' scaled median: 2^2 to 2^3, that of the paper's areas, whose
# hyperparameters these targets are fitted with
SIZE = 3


def learns_root(column: str) -> bool:
    """Return whether surrogates learn the square root of a target.

    They do where it counts nodes in contact, which are never below 0. The error of the force, over
    its scale, grew by a third when its root was learnt.
    """
    quantity = QUANTITIES.get(column)
    return quantity is not None and quantity.counts_nodes


def scaling_of(dataset: Dataset, train: Indices, *, standard: bool = False) -> Scaling:
    """Return the scaling of a dataset's target over its training rows, (m,).

    With rooted features it is of the square root of a target for which `learns_root` holds. With
    `standard` it has mean 0 and deviation 1 whatever the features, as a Gaussian process needs it,
    whose predictions are the mean where it knows nothing.
    """
    target = dataset.target[train]
    root = dataset.features.rooted and learns_root(dataset.target_name)
    if not (standard or dataset.features.scaled):
        mean, deviation = float(target.mean()), float(target.std())
        mean = mean if abs(mean) > FAR * deviation else 0.0
        magnitudes = np.abs(
            target - mean
        )  # outliers do not move the median of those above 0
        size = float(np.median(magnitudes[magnitudes > 0])) if magnitudes.any() else 0.0
        if size == 0 or USUAL[0] <= size <= USUAL[1]:
            return Scaling(mean)
        return Scaling(mean, 2.0 ** (math.frexp(size)[1] - SIZE))
    target = np.sqrt(target) if root else target
    return Scaling(float(target.mean()), float(target.std()) or 1.0, root)


USABLE = 0.85  # share of the free memory that a fit may take; the rest is the system's
PROCESS = 350 * MIB  # bytes of a process with its libraries, before any fit
# Peak bytes per pair of training rows; a matrix of double precision has 8. A baseline whose kernel
# is not fitted takes half. These and the others were measured (`bench memory`, at commit 10684ff).
PAIR_BYTES = {"gaussian-process": 62.0, "kernel-ridge": 19.0}
# MiB of up to 2,000 deep trees for `TREE_ROWS` rows; they grow in proportion to the rows
TREES = {"random-forest": 2048, "adaboost": 1536, "xgboost": 2560, "gradient-boost": 1792}
TREE_ROWS = 10_000
OTHERS = 512  # MiB of other models, as of a cache of kernel rows


def check_memory(model: str, rows: int, *, baseline: bool = False) -> None:
    """Refuse a fit of a model to some rows in one process that this machine cannot hold."""
    pairs = PAIR_BYTES.get(model, 0.0) * (
        0.52 if baseline and model == "gaussian-process" else 1
    )
    flat = 0 if baseline else TREES.get(model, OTHERS) * MIB
    need = PROCESS + pairs * rows**2 + flat * max(1.0, rows / TREE_ROWS)
    limit = USABLE * min(allowed(), free())
    if need > limit:
        raise InputError(
            f"{model} needs about {need / 2**30:.1f} GiB for {rows} training rows, this machine has"
            f" {limit / 2**30:.1f} to give: take fewer with --train-rows, fewer workers, or another"
            " --model"
        )
