"""Quantiles that new rows, or rows of new groups, do not exceed with a given probability."""

import math

import numpy as np

from gen.runtime.errors import InputError
from learn.arrays import Values


def quantile(scores: Values, level: float) -> float:
    """Return the score that a new row does not exceed with a probability of `level` or more.

    Parameters
    ----------
    scores : ndarray, shape (n,)
        Ascending scores.
    level : float
        Probability between 0 and 1.

    Returns
    -------
    float
        The k-th score, k = ceil((n + 1) level), infinity where k > n.

    Source: A. N. Angelopoulos, S. Bates (2021), arXiv:2107.07511, section 1.
    """
    place = math.ceil((scores.size + 1) * checked_level(level) - 1e-9)
    return float(scores[place - 1]) if place <= scores.size else math.inf


def quantile_over_groups(scores: tuple[Values, ...], level: float) -> float:
    """Return the score that a row of a new group does not exceed with a probability of `level`.

    Parameters
    ----------
    scores : tuple of ndarray
        Scores of K groups, each of one row or more.
    level : float
        Probability between 0 and 1.

    Returns
    -------
    float
        The quantile of all scores, each of which weighs 1 / (K + 1) over the rows of its group,
        and of an infinite one of weight 1 / (K + 1).

    Source: Y. Lee, R. F. Barber, R. Willett (2023), arXiv:2306.06342, section 3.
    """
    together = np.concatenate(scores)
    weights = np.concatenate([np.full(each.size, 1.0 / each.size) for each in scores])
    order = np.argsort(together, kind="stable")
    reached = np.cumsum(weights[order]) / (len(scores) + 1)
    place = int(np.searchsorted(reached, checked_level(level) - 1e-9))
    return float(together[order[place]]) if place < together.size else math.inf


def checked_level(level: float) -> float:
    """Return a coverage after a check that intervals can have it.

    Raises
    ------
    InputError
        Unless it is between 0 and 1.
    """
    if not 0 < level < 1:
        raise InputError(f"--interval {level:g}: give a coverage between 0 and 1, as 0.9")
    return level
