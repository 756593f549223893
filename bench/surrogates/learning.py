"""Learning curves: what more samples bring, and what they cost."""

from collections.abc import Iterator
from dataclasses import asdict, dataclass

import numpy as np

from bench.surrogates.answer_times import SolverTimes, SurrogateTimes
from bench.surrogates.break_even import break_even, build_times
from bench.surrogates.fitting import Fitted, Parts, fit
from learn.dataset import Dataset
from learn.features import chosen
from learn.metrics import scores
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


def sizes(most: int) -> list[int]:
    """Return the training rows of a curve's points: doubled up to all of them."""
    doubled = [FEWEST * 2**power for power in range(30) if FEWEST * 2**power < 0.75 * most]
    return [*doubled, most]


def curve(
    request: Request,
    parts: Parts,
    database_rows: int,
    solver: SolverTimes,
    answer: SurrogateTimes,
    full: Fitted,
) -> Iterator[Point]:
    """Yield the points of one feature set, the last with all rows.

    Parameters
    ----------
    request : from `bench.surrogates.fitting.request_for`
    parts : rows
    database_rows : that had to be solved for them, those left out included
    solver, answer : times of an answer by the solver and with this feature set
    full : the surrogate of all training rows
    """
    features = chosen(request.features)
    for size in sizes(parts.train.size):
        fits = [full] if size == parts.train.size else list(_fits(request, parts, size))
        rows = size * database_rows / parts.train.size
        judged = [asdict(scores(parts.test.target, each.predict(parts.test))) for each in fits]
        medians = {name: float(np.median([each[name] for each in judged])) for name in judged[0]}
        builds = [build_times(rows, solver, answer, each, features) for each in fits]
        build = float(np.median([each.total for each in builds]))
        yield Point(
            features=request.features,
            trained=size,
            rows=round(rows),
            **medians,
            build=build,
            break_even=break_even(build, solver.solve, answer.new),
        )


def _fits(request: Request, parts: Parts, size: int) -> Iterator[Fitted]:
    """Fit different rows, as often as there are rows for."""
    for draw in range(min(DRAWS, parts.train.size // size)):
        rows: Dataset = parts.train.at(np.arange(draw * size, (draw + 1) * size))
        yield fit(request, rows, parts.calibration, (np.arange(size) % 5).astype(np.int8))
