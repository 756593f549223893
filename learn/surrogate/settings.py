"""Settings of a surrogate's model: a tuned winner's, the paper's optimum, or a small search's.

The paper's optima belong to its own features and scaling. For features without units, the settings
of kernel methods are searched on a validation fold, with so few rows that it takes seconds; the
kernel of the Gaussian process, with one length per input, maximises the likelihood on a thousand
rows. The settings of trees and perceptron depend less on units, and are the paper's where possible.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gen.runtime.errors import InputError
from gen.runtime.terminal import to_type
from learn.arrays import Values
from learn.comparison.folder import Folder
from learn.comparison.paper import OPTIMA
from learn.models import MODELS, NORMALISATIONS, STEP, pipeline, remarks
from learn.request import Request

SEARCH_ROWS = 3000
"""Largest number of training rows of the small searches."""

LIKELIHOOD_ROWS = 800
"""Rows for the likelihood of a kernel with a length for every input."""

LENGTHS = (0.1, 1.0, 10.0, 100.0)
"""Lengths of a kernel from which the search for the most likely one starts."""

USUAL_LENGTH = 10.0
"""Length of standardised inputs that the search starts from too."""

ALPHAS = (1e-6, 1e-5, 1e-4, 1e-3, 1e-2)
GAMMAS = (1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2)
PENALTIES = (10.0, 100.0, 1000.0)

NETWORK: dict[str, Any] = {
    "hidden_layer_sizes": (100, 50),
    "activation": "tanh",
    "solver": "lbfgs",
    "alpha": 1e-2,
    "max_iter": 3000,
    "max_fun": 6000,
}
"""The perceptron for features without units, for which two layers suffice."""


class Settings(NamedTuple):
    """Settings of an estimator, and their origin.

    Attributes
    ----------
    values : dict of str to object
        Settings that differ from the model's baseline.
    tuned : bool
        True if the baseline includes the settings that all candidates of a search share.
    origin : str
        Origin, in words.
    """

    values: dict[str, Any]
    tuned: bool
    origin: str


def choose(
    request: Request, folder: Folder | None, inputs: Values, target: Values, folds: NDArray[np.int8]
) -> Settings:
    """Choose the settings of a fit.

    Parameters
    ----------
    request : Request
        Request with one model, features and seed.
    folder : Folder or None
        Comparison that has tuned the model.
    inputs : ndarray, shape (n, d)
        Inputs of the training rows.
    target : ndarray, shape (n,)
        Target, of mean 0 and deviation 1 except for the paper's features and other models than
        the Gaussian process.
    folds : ndarray of int, shape (n,)
        Fold of each training row; the first one validates.
    """
    (name,) = request.models
    if folder is not None:
        return _tuned(folder, name)
    if name == "gaussian-process":
        return _most_likely(request, inputs, target)
    if request.features == "paper" and request.normalisation == "l2":
        return Settings(dict(OPTIMA[name]), True, "the paper's optimum")
    if name in {"kernel-ridge", "svm"}:
        return _searched(request, inputs, target, folds)
    if name == "mlp":
        return Settings(dict(NETWORK), False, "built in")
    return Settings(dict(OPTIMA[name]), True, "the paper's optimum")


def tuned_conditions(folder: Folder, model: str) -> dict[str, Any]:
    """Return the features, rows and seed that a tuned winner rests on.

    InputError is raised if the folder has no tuned model of this name.
    """
    conditions: dict[str, Any] = folder.record()["conditions"]
    _tuned(folder, model)
    return {"features": "paper", **conditions}


def _tuned(folder: Folder, model: str) -> Settings:
    winner = folder.winner(model)
    if winner is None:
        raise InputError(
            f"--from: {folder.path} has no tuned {model}: {to_type(f'learn tune --model {model}')}"
        )
    origin = f"tuned in {folder.path}" if winner.of_grid else f"the baseline, by {folder.path}"
    return Settings(winner.settings, winner.of_grid, origin)


def _candidates(name: str) -> list[dict[str, Any]]:
    if name == "kernel-ridge":
        return [{"kernel": "rbf", "gamma": gamma, "alpha": a} for gamma in GAMMAS for a in ALPHAS]
    return [
        {"kernel": "rbf", "gamma": gamma, "C": penalty, "epsilon": 0.01}
        for gamma in GAMMAS[2:]
        for penalty in PENALTIES
    ]


def _searched(
    request: Request, inputs: Values, target: Values, folds: NDArray[np.int8]
) -> Settings:
    """Return the candidate with the smallest error on the first fold, fitted to the other ones."""
    (name,) = request.models
    validating = folds.min()  # 0, unless a few large groups fill the first folds together
    inside = np.flatnonzero(folds != validating)[:SEARCH_ROWS]
    outside = folds == validating
    best: tuple[float, dict[str, Any]] = (np.inf, {})
    for settings in _candidates(name):
        model = pipeline(
            MODELS[name], settings, normalisation=request.normalisation, seed=request.seed
        )
        with remarks():  # singular with a tiny alpha: the error will tell
            predicted = model.fit(inputs[inside], target[inside]).predict(inputs[outside])
        error = float(np.mean((predicted - target[outside]) ** 2))
        if error < best[0]:
            best = error, settings
    if not best[1]:
        raise InputError(f"{name}: no candidate of the built-in search could be fitted")
    return Settings(best[1], False, f"best of {len(_candidates(name))} on a validation fold")


def _most_likely(request: Request, inputs: Values, target: Values) -> Settings:
    """Return the most likely radial basis function with a length per input, and noise.

    The likelihood has several maxima, and where the lengths are far too short it is flat: the
    process then predicts the mean everywhere. Kernels of one length, which are fitted within
    moments, are therefore searched from lengths over four decades. The lengths of the inputs start
    from the best of these, and from `LENGTHS`; the most likely result counts.
    """
    few = inputs[:LIKELIHOOD_ROWS], target[:LIKELIHOOD_ROWS]
    alike = max((_fitted(request, np.array([each]), *few) for each in LENGTHS), key=_likelihood)
    starts = {float(alike.kernel_.k1.k2.length_scale), USUAL_LENGTH}
    every = np.ones(inputs.shape[1])
    fits = [alike, *(_fitted(request, each * every, *few) for each in sorted(starts))]
    return Settings(
        {"kernel": max(fits, key=_likelihood).kernel_, "optimizer": None, "alpha": 1e-10},
        False,
        f"kernel of the largest likelihood on {len(few[1])} rows, from {len(LENGTHS) + len(starts)}"
        " starts",
    )


def _fitted(request: Request, lengths: Values, inputs: Values, target: Values) -> Any:
    """Return a Gaussian process whose amplitude, lengths and noise maximise the likelihood."""
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    kernel = ConstantKernel(10.0, (1e-2, 1e5)) * RBF(lengths, (1e-2, 1e4))
    kernel += WhiteKernel(1e-3, (1e-9, 1.0))
    settings = {"kernel": kernel, "optimizer": "fmin_l_bfgs_b", "alpha": 1e-10}
    process = pipeline(
        MODELS["gaussian-process"],
        settings,
        normalisation=request.normalisation,
        seed=request.seed,
    )
    with remarks():  # lengths at their bound: inputs that do not matter
        return process.fit(inputs, target).named_steps[STEP]


def _likelihood(process: Any) -> float:
    return float(process.log_marginal_likelihood_value_)


def normalisation_of(features_default: str, given: str) -> str:
    """Return the given scaling, or the default of the features; InputError if there is none."""
    if given and given not in NORMALISATIONS:
        raise InputError(f"--normalise {given!r}: give one of {', '.join(NORMALISATIONS)}")
    return given or features_default
