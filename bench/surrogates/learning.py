"""Learning curves: what more samples bring, and what they cost."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from bench.surrogates.costs import BuildCosts, break_even, build_costs
from bench.surrogates.fitting import Fitted, Parts, fit
from learn.dataset import Dataset
from learn.features import chosen
from learn.metrics import Scores, scores
from learn.request import Request

FEWEST = 100
"""Training rows of a curve's first point."""

DRAWS = 3
"""Fits of a point, each to other rows, as long as the rows suffice; the median error counts."""


@dataclass(frozen=True)
class Point:
    """A surrogate of some training rows.

    Attributes
    ----------
    features : feature set
    trained : training rows
    rows : of the database, with those that calibrate, test or are left out
    nmse, nmae, nmaxe, r2 : scores on the test rows, which are the same for all points [%]
    build : seconds before the first answer: database, tuning, fit
    break_even : queries on new surfaces from which on it is cheaper than our solver
    """

    features: str
    trained: int
    rows: int
    nmse: float
    nmae: float
    nmaxe: float
    r2: float
    build: float
    break_even: float


@dataclass(frozen=True)
class Prices:
    """What a curve's costs are made of [s].

    Attributes
    ----------
    row : a database's row
    again : a surface generated anew, with its features
    solve, query : an answer of the solver and of the surrogate, on a new surface
    """

    row: float
    again: float
    solve: float
    query: float


def sizes(most: int) -> list[int]:
    """Training rows of a curve's points: doubled up to all of them."""
    doubled = [FEWEST * 2**power for power in range(30) if FEWEST * 2**power < 0.75 * most]
    return [*doubled, most]


def curve(
    request: Request, parts: Parts, database_rows: int, prices: Prices, full: Fitted
) -> Iterator[Point]:
    """Yield the points of one feature set, the last with all rows.

    Parameters
    ----------
    request : from `bench.surrogates.fitting.request_for`
    parts : rows
    database_rows : that had to be solved for them, those left out included
    prices : of this feature set
    full : the surrogate of all training rows
    """
    for size in sizes(parts.train.size):
        fits = [full]
        if size < parts.train.size:
            fits = list(_fits(request, parts, size))
        found = [scores(parts.test.target, each.predict(parts.test)) for each in fits]
        rows = size * database_rows / parts.train.size
        costs = [
            build_costs(rows, prices.row, each, chosen(request.features), prices.again)
            for each in fits
        ]
        yield _point(request.features, size, round(rows), found, costs, prices)


def _fits(request: Request, parts: Parts, size: int) -> Iterator[Fitted]:
    """Fits to different rows, as many as there are rows for."""
    for draw in range(min(DRAWS, parts.train.size // size)):
        rows: Dataset = parts.train.at(np.arange(draw * size, (draw + 1) * size))
        yield fit(request, rows, parts.calibration, (np.arange(size) % 5).astype(np.int8))


def _point(
    features: str,
    size: int,
    rows: int,
    found: Sequence[Scores],
    costs: Sequence[BuildCosts],
    prices: Prices,
) -> Point:
    names = ("nmse", "nmae", "nmaxe", "r2")
    medians = {name: float(np.median([getattr(each, name) for each in found])) for name in names}
    build = float(np.median([each.total for each in costs]))
    return Point(
        features=features,
        trained=size,
        rows=rows,
        **medians,
        build=build,
        break_even=break_even(build, prices.solve, prices.query),
    )
