"""Baselines of Table 4 on rows that are split by surfaces, or by rows as the paper's may have been.

A split by rows puts rows of one surface on both sides: models recognise surfaces that they were
trained on, and their scores are better than on surfaces that they have never seen. `learn` never
splits so; here it is one of the readings of a paper that does not say how it split.
"""

import numpy as np
from numpy.typing import NDArray

from bench.paper.nearest.population import Rows
from gen.runtime.errors import InputError
from learn.kernel_ridge import predictions
from learn.metrics import Scores, scores
from learn.models import MODELS, pipeline
from learn.split import TEST_SHARE

SPLITS = "rows", "surfaces"
"""What a split draws: each row by itself, or whole surfaces."""

SEED = 0  # of the split and of the models


def divide(
    surface: NDArray[np.int64], split: str, seed: int = SEED
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Split rows 80:20 for training and test.

    Parameters
    ----------
    surface : ndarray of int, shape (n,)
        Number of the surface of each row.
    split : str
        One of `SPLITS`.
    seed : int
        Seed of the draw.

    Returns
    -------
    ndarray, ndarray
        Positions of the training rows and of the test rows, in random order. A fifth of the rows
        tests, rounded down; of whole surfaces up to a fifth of the rows.

    Raises
    ------
    InputError
        For another kind of split, or without a row on either side.
    """
    if split not in SPLITS:
        raise InputError(f"split {split!r}: give {' or '.join(SPLITS)}")
    groups = surface if split == "surfaces" else np.arange(surface.size)
    random = np.random.default_rng(seed)
    _, own, sizes = np.unique(groups, return_inverse=True, return_counts=True)
    order = random.permutation(sizes.size)
    tests = order[np.cumsum(sizes[order]) <= int(TEST_SHARE * surface.size)]
    testing = np.isin(own, tests)
    shuffled = random.permutation(surface.size)
    train, test = shuffled[~testing[shuffled]], shuffled[testing[shuffled]]
    if min(train.size, test.size) < 2:
        raise InputError(f"{surface.size} rows of {sizes.size} groups: too few to split")
    return train, test


def baseline(
    model: str, rows: Rows, split: str, seed: int = SEED, most: int | None = None
) -> Scores:
    """Fit a model with its library's settings, and score it on the test rows [%].

    Parameters
    ----------
    model : str
        A name of `learn.models.MODELS`.
    rows : Rows
        The database.
    split, seed
        See `divide`.
    most : int, optional
        Number of training rows at most, the first of the draw; all if left out.
    """
    train, test = divide(rows.surface, split, seed)
    train = train[:most]
    inputs, target = rows.inputs, rows.target
    fitted = pipeline(MODELS[model], seed=seed)
    if model == "kernel-ridge":  # linear: the same predictions without a matrix of all rows
        scaled = fitted.named_steps["scaling"].transform(inputs)
        (predicted,) = predictions(scaled[train], target[train], scaled[test], {}, [1.0])
    else:
        predicted = fitted.fit(inputs[train], target[train]).predict(inputs[test])
    return scores(target[test], predicted)
