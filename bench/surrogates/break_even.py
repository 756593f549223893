"""Where a surrogate pays: what is spent before its first answer, and what each answer saves.

Times are t_d, t_h, t_f and t_p of the paper's section 4.4.
"""

import math
from dataclasses import dataclass

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
    """Time that is spent before the first answer [s]."""

    database: float  # t_d: rows solved, and surfaces generated again where features need them
    tuning: float  # t_h: the search for settings
    fit: float  # t_f

    @property
    def total(self) -> float:
        """All of it."""
        return self.database + self.tuning + self.fit


def break_even(build: float, solver: float, query: float) -> float:
    """Return the number of queries from which on a surrogate is cheaper, infinity if it never is.

    The times are those before the first answer, and of an answer by the solver and the surrogate.
    """
    return math.inf if query >= solver else math.ceil(build / (solver - query))
