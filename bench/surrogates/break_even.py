"""Where a surrogate pays: what is spent before its first answer, and what each answer saves.

Times are t_d, t_h, t_f and t_p of the paper's section 4.4.
"""

import math
from dataclasses import dataclass

from bench.surrogates.answer_times import SolverTimes, SurrogateTimes
from bench.surrogates.fitting import Fitted
from learn.comparison import paper
from learn.features import FeatureSet

PAPER_SOLVE = 189.79
"""Mean time of the paper's solver for one contact (section 4.4) [s]."""

PAPER_ROWS, PAPER_TESTS = 15_878, 3_175
"""Rows of the paper's database, and of its test set, which its prediction times are for."""

PAPER_BREAK_EVEN = 15_893
"""Where the paper finds its break-even point (section 4.4)."""

TAKEN = 1e-3
"""Seconds below which settings were taken from a table, not searched."""


@dataclass(frozen=True)
class BuildTimes:
    """Time that is spent before the first answer [s].

    Attributes
    ----------
    database : t_d, solving all rows, and generating surfaces again where the features need them
    tuning : t_h, the search for settings
    fit : t_f
    """

    database: float
    tuning: float
    fit: float

    @property
    def total(self) -> float:
        """All of it."""
        return self.database + self.tuning + self.fit


def build_times(
    rows: float, solver: SolverTimes, answer: SurrogateTimes, fitted: Fitted, features: FeatureSet
) -> BuildTimes:
    """Add up the time that a surrogate takes before its first answer.

    Parameters
    ----------
    rows : of its database
    solver, answer : measured times
    fitted : the surrogate
    features : its feature set; one that needs surfaces generates them anew
    """
    again = solver.surface + answer.surface if features.needs_surface else 0.0
    return BuildTimes(rows * (solver.row + again), fitted.choosing, fitted.fitting)


def of_the_paper() -> tuple[BuildTimes, float]:
    """Return kernel ridge's times in the paper, and its time for a prediction [s]."""
    fit, tests = paper.TIMES["tuned"]["kernel-ridge"]
    tuning = paper.TUNING_SECONDS["kernel-ridge"]
    return BuildTimes(PAPER_ROWS * PAPER_SOLVE, tuning, fit), tests / PAPER_TESTS


def break_even(build: float, solver: float, query: float) -> float:
    """Return the number of queries from which on a surrogate is cheaper, infinity if it never is.

    Parameters
    ----------
    build : time before the first answer [s]
    solver, query : times of an answer by the solver and by the surrogate [s]
    """
    return math.inf if query >= solver else math.ceil(build / (solver - query))
