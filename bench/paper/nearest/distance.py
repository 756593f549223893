"""The distance of a database and its baselines from the paper's Tables 1 and 4."""

from collections.abc import Mapping

import numpy as np

from bench.paper.facts import RANGES
from bench.paper.unstated.readings import range_distance
from gen.arrays import Values
from learn.comparison import paper
from learn.metrics import Scores

UNEXPLAINED = {"bandwidth_x", "bandwidth_y"}  # quantities that the paper defines otherwise
QUANTITIES = tuple(name for name in RANGES if name not in UNEXPLAINED)
"""Quantities of Table 1 that count: Hurst exponent, displacement, area and 20 statistics."""


def distance(columns: Mapping[str, Values], scores: Mapping[str, Scores]) -> float:
    """Measure how far a database and its baselines are from both tables, D = D1 + D4.

    D1, of Table 1, is the mean over `QUANTITIES` of

        (|low - low'| + |high - high'|) / (2 (high' - low')),

    with the ends of a quantity's range here and, primed, in the paper. D4, of Table 4, is the mean
    of |ln(e / e')| over the models and their four errors e: nMSE, nMAE, nMaxE and 100 % - R2.

    Parameters
    ----------
    columns : mapping of str to ndarray, shape (n,)
        Quantities of Table 1 by the names of their columns.
    scores : mapping of str to Scores
        Scores of baselines by the names of their models, of all nine or fewer [%].

    Returns
    -------
    float
        The distance; 0 for the paper's numbers themselves, 1 for ranges that are off by their
        widths, or for errors that are off by factors of e [1].
    """
    return of_table_1(columns) + of_table_4(scores)


def of_table_1(columns: Mapping[str, Values]) -> float:
    """Return D1 of `distance`."""
    return float(np.mean([range_distance(columns[name], name) for name in QUANTITIES])) / 100


def of_table_4(scores: Mapping[str, Scores]) -> float:
    """Return D4 of `distance`."""
    theirs = paper.TEST["baseline"]
    ratios = [np.divide(_errors(found), _errors(theirs[name])) for name, found in scores.items()]
    return float(np.abs(np.log(ratios)).mean())


def _errors(scores: Scores) -> tuple[float, float, float, float]:
    return scores.nmse, scores.nmae, scores.nmaxe, 100 - scores.r2
