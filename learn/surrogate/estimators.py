"""Fitted pipelines as numbers, and back: only the numbers that predictions need.

To load a model, an estimator of the installed version of its library is fitted to two rows of
zeros, and its numbers are then replaced by those of the file, after a check. The content of a file
therefore never decides which objects are built, and a file outlives versions of the libraries.
"""

import warnings
from collections.abc import Callable, Iterable
from copy import copy
from dataclasses import dataclass
from typing import Any

import numpy as np

from learn.arrays import Values
from learn.models import MODELS, STEP, pipeline
from learn.surrogate import boosters, forest
from learn.surrogate.forest import LEAF, Tree
from learn.surrogate.parts import (
    Part,
    count,
    mapping,
    number,
    numbers,
    positive,
    sequence,
    text,
)

DOUBLE = "f8"
ACTIVATIONS = ("identity", "logistic", "relu", "tanh")
RIDGE_KERNELS = ("linear", "rbf")
VECTOR_KERNELS = ("linear", "poly", "rbf", "sigmoid")
HIGHEST_DEGREE = 100
"""Of a polynomial kernel; the paper's grid ends at 7."""


def to_arrays(model: str, fitted: Any) -> dict[str, Any]:
    """Return the numbers of a fitted pipeline.

    Parameters
    ----------
    model : str
        Name of the model in `learn.models.MODELS`.
    fitted : object
        Scaling and estimator.

    Raises
    ------
    ValueError
        If it has settings that `learn fit` never gives.
    """
    scaling, estimator = fitted.steps[0][1], fitted.named_steps[STEP]
    return {"scaling": _scaling_to_arrays(scaling), "model": KINDS[model].to_arrays(estimator)}


def from_arrays(model: str, normalisation: str, part: Part, width: int) -> Any:
    """Return a fitted pipeline.

    Parameters
    ----------
    model, normalisation : str
        Names of the model and of the scaling.
    part : mapping
        Part of a file: from `to_arrays`, or forged.
    width : int
        Number of features.

    Raises
    ------
    ValueError
        If a number is missing, of another size or kind, or not finite.
    """
    built = pipeline(MODELS[model], normalisation=normalisation)
    scaling = _scaling_together(built.steps[0][1], mapping(part, "scaling"), width)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # about the fit to nothing
        estimator = KINDS[model].together(mapping(part, "model"), width)
    built.steps = [(built.steps[0][0], scaling), (STEP, estimator)]
    return built


def _nothing(width: int) -> tuple[Values, Values]:
    """Return two rows that a model is fitted to before its numbers are set."""
    return np.zeros((2, width)), np.zeros(2)


def _with(estimator: Any, width: int, **fitted: Any) -> Any:
    """Fit an estimator to two rows of zeros, then set its fitted attributes."""
    estimator.fit(*_nothing(width))
    for name, value in fitted.items():
        setattr(estimator, name, value)
    return estimator


def _scaling_to_arrays(scaling: Any) -> dict[str, Any]:
    if hasattr(scaling, "min_"):
        return {"offset": scaling.min_, "scale": scaling.scale_}
    return {"offset": scaling.mean_, "scale": scaling.scale_} if hasattr(scaling, "mean_") else {}


def _scaling_together(scaling: Any, part: Part, width: int) -> Any:
    """Return a fitted scaling."""
    if scaling == "passthrough":
        return scaling
    scaling.fit(np.zeros((2, width)))
    if not hasattr(scaling, "scale_"):
        return scaling
    offset, scale = numbers(part, "offset", width), numbers(part, "scale", width)
    if (scale <= 0).any():
        raise ValueError("a scale is not above 0")
    scaling.scale_ = scale
    if hasattr(scaling, "min_"):
        scaling.min_ = offset
        scaling.data_min_, scaling.data_range_ = -offset / scale, 1.0 / scale
        scaling.data_max_ = scaling.data_min_ + scaling.data_range_
    else:
        scaling.mean_, scaling.var_ = offset, scale**2
    return scaling


def _trees_to_arrays(estimators: Iterable[Any]) -> dict[str, Any]:
    """Return the trees of an ensemble of scikit-learn."""
    return forest.packed((_tree_to_arrays(each.tree_) for each in estimators), DOUBLE)


def _tree_to_arrays(tree: Any) -> Tree:
    leaf = tree.children_left == LEAF
    feature = np.where(leaf, 0, tree.feature)
    number = np.where(leaf, tree.value[:, 0, 0], tree.threshold)
    return Tree(tree.children_left, tree.children_right, feature, number)


def _trees_together(part: Part, name: str, width: int) -> list[Any]:
    """Return trees of scikit-learn, each an estimator."""
    from sklearn.tree import DecisionTreeRegressor

    pattern = DecisionTreeRegressor().fit(*_nothing(width))
    state = pattern.tree_.__getstate__()
    estimators = []
    for tree in forest.unpacked(mapping(part, name), DOUBLE, width):
        leaf = tree.left == LEAF
        nodes = np.zeros(tree.left.size, dtype=state["nodes"].dtype)
        nodes["left_child"], nodes["right_child"] = tree.left, tree.right
        nodes["feature"] = np.where(leaf, -2, tree.feature)  # as scikit-learn marks leaves
        nodes["threshold"] = np.where(leaf, -2.0, tree.number)
        values = np.where(leaf, tree.number, 0.0).reshape(-1, 1, 1)
        built = type(pattern.tree_)(width, np.array([1], dtype=np.intp), 1)
        own = {"max_depth": tree.depth, "node_count": len(nodes), "nodes": nodes, "values": values}
        built.__setstate__(state | own)
        estimator = copy(pattern)
        estimator.tree_ = built
        estimators.append(estimator)
    return estimators


def _tree(part: Part, width: int) -> Any:
    (tree,) = _trees_together(part, "trees", width)
    return tree


def _random_forest(part: Part, width: int) -> Any:
    trees = _trees_together(part, "trees", width)
    model = _with(MODELS["random-forest"].estimator(0).set_params(n_estimators=1), width)
    return _renamed(model, trees, estimators_=trees)


def _renamed(model: Any, trees: list[Any], **fitted: Any) -> Any:
    """Set the number of trees and the attributes that a fit sets."""
    model.set_params(n_estimators=len(trees))
    for name, value in fitted.items():
        setattr(model, name, value)
    return model


def _ada_boost_to_arrays(model: Any) -> dict[str, Any]:
    weights = np.asarray(model.estimator_weights_[: len(model.estimators_)], dtype=np.float64)
    return {"trees": _trees_to_arrays(model.estimators_), "weights": weights}


def _ada_boost(part: Part, width: int) -> Any:
    trees = _trees_together(part, "trees", width)
    weights = numbers(part, "weights", len(trees))
    if (weights < 0).any():
        raise ValueError("a weight is below 0")
    model = _with(MODELS["adaboost"].estimator(0).set_params(n_estimators=1), width)
    errors = np.ones(len(trees))
    return _renamed(
        model, trees, estimators_=trees, estimator_weights_=weights, estimator_errors_=errors
    )


def _gradient_boost_to_arrays(model: Any) -> dict[str, Any]:
    return {
        "trees": _trees_to_arrays(model.estimators_[:, 0]),
        "start": float(np.ravel(model.init_.constant_)[0]),
        "learning_rate": float(model.learning_rate),
    }


def _gradient_boost(part: Part, width: int) -> Any:
    from sklearn.dummy import DummyRegressor

    rate = positive(part, "learning_rate")
    trees = _trees_together(part, "trees", width)
    start = DummyRegressor(strategy="constant", constant=number(part, "start"))
    start.fit(*_nothing(width))
    model = MODELS["gradient-boost"].estimator(0).set_params(n_estimators=1, learning_rate=rate)
    stages = np.empty((len(trees), 1), dtype=object)
    stages[:, 0] = trees
    return _renamed(
        _with(model, width), trees, estimators_=stages, init_=start, n_estimators_=len(trees)
    )


def _vectors_to_arrays(model: Any) -> dict[str, Any]:
    return {
        "kernel": model.kernel,
        "degree": int(model.degree),
        "coef0": float(model.coef0),
        "gamma": float(model._gamma),
        "vectors": model.support_vectors_,
        "weights": model.dual_coef_[0],
        "intercept": float(model.intercept_[0]),
    }


def _vectors(part: Part, width: int) -> Any:
    vectors = numbers(part, "vectors", None, width)
    size = len(vectors)
    weights = numbers(part, "weights", size).reshape(1, size)
    intercept = np.array([number(part, "intercept")])
    model = MODELS["svm"].estimator(0)
    model.set_params(
        kernel=text(part, "kernel", VECTOR_KERNELS),
        degree=count(part, "degree", 0, HIGHEST_DEGREE),
        coef0=number(part, "coef0"),
    )
    gamma = number(part, "gamma", 0.0)
    _with(model, width)
    return _with(
        model,
        width,
        support_=np.arange(size, dtype=np.int32),
        support_vectors_=np.ascontiguousarray(vectors),
        _n_support=np.full_like(model._n_support, size),
        dual_coef_=weights,
        _dual_coef_=weights,
        intercept_=intercept,
        _intercept_=intercept,
        shape_fit_=(size, width),
        _gamma=gamma,
    )


def _kernel_to_arrays(kernel: Any) -> dict[str, Any]:
    """Return the lengths of a radial basis function, its amplitude and its noise if it has them.

    Raises
    ------
    ValueError
        For other kernels.
    """
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, Product, Sum, WhiteKernel

    parts: dict[str, Any] = {"amplitude": None, "white": None}
    radial = kernel
    if type(radial) is Sum and type(radial.k2) is WhiteKernel:
        radial, parts["white"] = radial.k1, float(radial.k2.noise_level)
    if type(radial) is Product and type(radial.k1) is ConstantKernel:
        radial, parts["amplitude"] = radial.k2, float(radial.k1.constant_value)
    if type(radial) is not RBF:
        raise ValueError(f"Gaussian processes with the kernel {kernel} are not kept")
    return parts | {"lengths": np.atleast_1d(np.asarray(radial.length_scale, dtype=np.float64))}


def _kernel_together(part: Part, width: int) -> Any:
    """Return a kernel; a single length is that of all features."""
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    lengths = numbers(part, "lengths", None)
    if lengths.size not in {1, width} or (lengths <= 0).any():
        raise ValueError("lengths are not above 0, one or one for each feature")
    kernel = RBF(float(lengths[0]) if lengths.size == 1 else lengths, "fixed")
    if part.get("amplitude") is not None:
        kernel = ConstantKernel(positive(part, "amplitude"), "fixed") * kernel
    if part.get("white") is not None:
        kernel += WhiteKernel(positive(part, "white"), "fixed")
    return kernel


def _process_to_arrays(model: Any) -> dict[str, Any]:
    return {
        **_kernel_to_arrays(model.kernel_),
        "noise": float(model.alpha),
        "rows": model.X_train_,
        "weights": np.ravel(model.alpha_),
    }


def _process(part: Part, width: int) -> Any:
    """Return a Gaussian process without the Cholesky factor, which `learnt` computes if needed."""
    rows, kernel = numbers(part, "rows", None, width), _kernel_together(part, width)
    model = MODELS["gaussian-process"].estimator(0)
    model.set_params(kernel=kernel, alpha=positive(part, "noise"), optimizer=None)
    return _with(
        model,
        width,
        X_train_=rows,
        y_train_=np.zeros(len(rows)),
        alpha_=numbers(part, "weights", len(rows)),
        L_=None,
    )


def _ridge_to_arrays(model: Any) -> dict[str, Any]:
    return {
        "kernel": model.kernel,
        "gamma": None if model.gamma is None else float(model.gamma),
        "alpha": float(model.alpha),
        "rows": model.X_fit_,
        "weights": np.ravel(model.dual_coef_),
    }


def _ridge(part: Part, width: int) -> Any:
    rows = numbers(part, "rows", None, width)
    gamma = None if part.get("gamma") is None else positive(part, "gamma")
    kernel = text(part, "kernel", RIDGE_KERNELS)
    model = MODELS["kernel-ridge"].estimator(0).set_params(kernel=kernel, gamma=gamma, alpha=1.0)
    weights = numbers(part, "weights", len(rows))
    return _with(model, width, X_fit_=rows, dual_coef_=weights).set_params(
        alpha=number(part, "alpha", 0.0)
    )


def _perceptron_to_arrays(model: Any) -> dict[str, Any]:
    return {
        "activation": model.activation,
        "weights": list(model.coefs_),
        "offsets": list(model.intercepts_),
    }


def _perceptron(part: Part, width: int) -> Any:
    layers = len(sequence(part, "weights"))
    if not layers:
        raise ValueError("no layers")
    weights, offsets, before = [], [], width
    for place, pair in enumerate(
        zip(part["weights"], sequence(part, "offsets", layers), strict=True)
    ):
        after = 1 if place == layers - 1 else None
        weights.append(numbers({"weights": pair[0]}, "weights", before, after))
        before = weights[-1].shape[1]
        offsets.append(numbers({"offsets": pair[1]}, "offsets", before))
    model = MODELS["mlp"].estimator(0).set_params(hidden_layer_sizes=(1,), max_iter=1)
    model.set_params(activation=text(part, "activation", ACTIVATIONS))
    _with(model, width, coefs_=weights, intercepts_=offsets, n_layers_=layers + 1)
    return model.set_params(hidden_layer_sizes=tuple(each.size for each in offsets[:-1]))


@dataclass(frozen=True)
class Kind:
    """Conversion of a kind of model to numbers and back.

    Attributes
    ----------
    to_arrays : callable
        Converts a fitted estimator to a part of the file.
    together : callable
        Converts a part and the number of features to a fitted estimator.
    """

    to_arrays: Callable[[Any], dict[str, Any]]
    together: Callable[[Part, int], Any]


KINDS: dict[str, Kind] = {
    "decision-tree": Kind(lambda model: {"trees": _trees_to_arrays([model])}, _tree),
    "random-forest": Kind(
        lambda model: {"trees": _trees_to_arrays(model.estimators_)}, _random_forest
    ),
    "adaboost": Kind(_ada_boost_to_arrays, _ada_boost),
    "xgboost": Kind(boosters.to_arrays, boosters.from_arrays),
    "gradient-boost": Kind(_gradient_boost_to_arrays, _gradient_boost),
    "svm": Kind(_vectors_to_arrays, _vectors),
    "gaussian-process": Kind(_process_to_arrays, _process),
    "kernel-ridge": Kind(_ridge_to_arrays, _ridge),
    "mlp": Kind(_perceptron_to_arrays, _perceptron),
}
"""By the name of the model in `learn.models.MODELS`."""
