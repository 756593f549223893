"""The sizes at which a growing database is looked at, and how sure each look has to be.

Looking often makes it likely that one look is lucky. The sizes are therefore fixed in advance, and
the look at size number k may be wrong with a probability of only `RISK` / ((k + 1) (k + 2)). These
probabilities add up to `RISK`, so that it bounds the probability that a surrogate worse than its
mark is accepted at any of the sizes, however many of them are looked at.
"""

import math
from dataclasses import dataclass

RISK = 0.05
"""Largest probability that a surrogate is accepted although its error is above the mark."""

SMALLEST_ROWS = 60
"""Rows of the smallest database, at least."""

SMALLEST_SURFACES = 20
"""Surfaces of the smallest database, at least."""

RATIO = math.sqrt(2)
"""Ratio of two successive sizes."""


@dataclass(frozen=True)
class Sizes:
    """The sizes of a database with a number of samples on each surface.

    Attributes
    ----------
    samples_per_surface : int
        Rows of one surface; sizes are multiples of it.
    """

    samples_per_surface: int

    def rows(self, number: int) -> int:
        """Return the rows of a size, in two significant digits, rounded up to whole surfaces.

        Parameters
        ----------
        number : int
            Number of the size, from 0.
        """
        smallest = max(SMALLEST_ROWS, SMALLEST_SURFACES * self.samples_per_surface)
        wanted = int(float(f"{smallest * RATIO**number:.2g}"))
        return self.rounded_up(wanted)

    def rounded_up(self, rows: int) -> int:
        """Round a number of rows up to whole surfaces."""
        return -(-rows // self.samples_per_surface) * self.samples_per_surface

    def number(self, rows: int) -> int:
        """Return the number of the smallest size that has some number of rows, or more."""
        number = 0
        while self.rows(number) < rows:
            number += 1
        return number


def risk(number: int) -> float:
    """Return the probability with which the look at a size may accept a surrogate wrongly.

    Parameters
    ----------
    number : int
        Number of the size, from 0.
    """
    return RISK / ((number + 1) * (number + 2))
