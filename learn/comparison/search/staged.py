"""One fit for many candidates: the predictions of every number of estimators, and of every alpha.

A fit with the largest number of estimators contains all smaller ones: its first k trees are the
model with k trees, to the last bit (`tests/learn/comparison/search/test_staged.py`). This holds for
boosting whose later trees leave the earlier ones as they are; `require_served` refuses spaces with
any other.
"""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from gen.runtime.errors import InputError
from learn import kernel_ridge
from learn.arrays import Values
from learn.comparison.search.spaces import Space
from learn.models import STEP, Model

SERVED: dict[str, dict[str, tuple[Any, ...]]] = {
    "xgboost": {"booster": (None, "gbtree"), "early_stopping_rounds": (None,)},
    "gradient-boost": {"n_iter_no_change": (None,)},
}
"""Values, by model and setting, with which the first k trees of a fit are the model with k trees.

DART scales earlier trees as it adds later ones, linear boosting has no trees, and a boosting that
stops early also trains on fewer rows.
"""


def require_served(model: Model, space: Space) -> None:
    """Refuse a space with boosting whose smaller numbers of trees one fit does not serve.

    Parameters
    ----------
    model : Model
        The model.
    space : dict
        Values to try, by setting.

    Raises
    ------
    InputError
        If there is a value of `SERVED`'s settings that it does not list.
    """
    for name, served in SERVED.get(model.name, {}).items():
        for value in space.get(name, []):
            if value not in served:
                listed = " or ".join(map(repr, served))
                raise InputError(
                    f"{model.name}: {name}={value!r} cannot be searched, since one fit serves all"
                    f" numbers of trees and its first trees are no model then: give {listed}"
                )


def shared_predictions(
    model: Model,
    pipeline: Any,
    data: tuple[Values, Values, Values],
    name: str,
    values: Sequence[Any],
) -> list[Values]:
    """Predict with every value of the setting that one fit serves.

    Parameters
    ----------
    model : Model
        The model.
    pipeline : sklearn.pipeline.Pipeline
        Unfitted, with all other settings.
    data : tuple of ndarray
        Training inputs (n, d) and target (n,), test inputs (m, d).
    name : str
        The setting that one fit serves.
    values : sequence
        Its values.

    Returns
    -------
    list of ndarray, shape (m,)
        Predictions for each value.
    """
    train, target, test = data
    scaling, estimator = pipeline.named_steps["scaling"], pipeline.named_steps[STEP]
    if scaling != "passthrough":
        train = scaling.fit_transform(train)
        test = scaling.transform(test)
    if model.name == "kernel-ridge":
        settings = {key: value for key, value in estimator.get_params().items() if key != name}
        return kernel_ridge.predictions(train, target, test, settings, values)
    estimator.set_params(**{name: max(values)}).fit(train, target)
    numbers = sorted(set(values))
    predictions = _PREFIXES[model.name](estimator, test, numbers)
    wanted = dict(zip(numbers, predictions, strict=True))
    return [wanted[value] for value in values]


def _forest(estimator: Any, test: Values, numbers: Sequence[int]) -> Iterator[Values]:
    """Yield running means over the trees, added up in the forest's own order."""
    rows = np.asarray(test, dtype=np.float32)
    total, wanted = np.zeros(len(rows)), set(numbers)
    for number, tree in enumerate(estimator.estimators_, start=1):
        total += tree.predict(rows, check_input=False)
        if number in wanted:
            yield total / number


def _ada_boost(estimator: Any, test: Values, numbers: Sequence[int]) -> Iterator[Values]:
    """Yield weighted medians over the first trees, as `AdaBoostRegressor.predict` takes them.

    Its own `staged_predict` computes every tree's predictions again for every stage. Boosting may
    end early: larger numbers are then the same model.
    """
    of_trees = np.array([tree.predict(test) for tree in estimator.estimators_]).T
    for number in numbers:
        first = of_trees[:, :number]
        order = np.argsort(first, axis=1)
        share = np.cumsum(estimator.estimator_weights_[order], axis=1)
        middle = (share >= 0.5 * share[:, -1:]).argmax(axis=1)
        rows = np.arange(len(first))
        yield first[rows, order[rows, middle]]


def _gradient_boost(estimator: Any, test: Values, numbers: Sequence[int]) -> Iterator[Values]:
    wanted = set(numbers)
    for number, predicted in enumerate(estimator.staged_predict(test), start=1):
        if number in wanted:
            yield predicted.copy()


def _xgboost(estimator: Any, test: Values, numbers: Sequence[int]) -> Iterator[Values]:
    for number in numbers:
        yield estimator.predict(test, iteration_range=(0, number))


_PREFIXES = {
    "random-forest": _forest,
    "adaboost": _ada_boost,
    "gradient-boost": _gradient_boost,
    "xgboost": _xgboost,
}
