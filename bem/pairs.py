"""Real transforms as complex ones of half the length: columns of waves and their partners.

FFTW has vector instructions for complex transforms only, so that a row of real numbers takes it
several times as long as one of half as many complex ones. So number j of a row is z = a + i b here,
with the entries a and b of its columns 2 j and 2 j + 1, as they lie in memory.

With n such numbers in a row, the transform Z of z holds those of both parts, A = (Z(q, k) +
conj Z(-q, -k)) / 2 and B = (Z(q, k) - conj Z(-q, -k)) / 2i, and that of the row is A + exp(-i t) B
with t = pi k / n (Press et al. 2007, Numerical Recipes, section 12.3). A filter multiplies its
waves k and k + n by S and S'; it is even, so that S' is the factor of wave n - k. Z(q, k) becomes

    ((S + S') / 2 - (S - S') / 2 sin t) Z(q, k) + i (S - S') / 2 cos t conj Z(-q, -k).

Columns k and n - k are filtered together. Those of n - k are transformed backward, which leaves
them in the order of -q.
"""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from bem.arrays import Field


class Group(NamedTuple):
    """Some columns k up to the middle, and their partners n - k beyond it.

    Attributes
    ----------
    low, high : slice
        The columns k, and their partners.
    """

    low: slice
    high: slice

    @property
    def counts(self) -> tuple[int, int]:
        """Numbers of the columns k and of their partners."""
        low, high = (columns.stop - columns.start for columns in self)
        return low, high

    @property
    def paired(self) -> slice:
        """Which columns of `low` have a partner in `high`, counted from its first."""
        first = 0 if self.low.start else 1
        return slice(first, first + self.counts[1])


def groups(columns: int, most: int) -> Iterator[Group]:
    """Divide n columns into groups of at most `most` columns k and their partners."""
    half = columns // 2 + 1
    size = -(-half // -(-half // most))
    for start in range(0, half, size):
        stop = min(start + size, half)
        first, last = max(start, 1), min(stop - 1, (columns - 1) // 2)  # those with a partner
        yield Group(slice(start, stop), slice(columns - last, columns - first + 1))


def factors(spectrum: Field, columns: Any) -> tuple[Field, Field]:
    """Compute the factors by which a filter multiplies Z and i conj Z, in some columns.

    Parameters
    ----------
    spectrum : ndarray, shape (px, n + 1)
        Real transform of a kernel with periods (px, 2 n) that is even in both directions.
    columns : ndarray of int, shape (m,)
        Indices of the columns, from 0 to n - 1.

    Returns
    -------
    own : ndarray, shape (m, px)
        Factors of Z.
    across : ndarray, shape (m, px)
        Factors of i conj Z, the same in columns k and n - k.
    """
    waves, (rows, n) = spectrum.T, (len(spectrum), spectrum.shape[1] - 1)
    low, high = waves[columns] / (rows * n), waves[n - columns] / (rows * n)
    phase = np.pi * columns[:, np.newaxis] / n
    half_difference = (low - high) / 2
    return (low + high) / 2 - half_difference * np.sin(phase), half_difference * np.cos(phase)


def partners(waves: Any, crossing: Any, group: Group, high: int) -> Iterator[tuple[Any, Any]]:
    """Yield views of columns beside what has to be added to them; column 0 is its own partner.

    Parameters
    ----------
    waves : ndarray, shape (columns, px)
        The columns k of a group from row 0 on, and their partners from row `high` on.
    crossing : ndarray, shape (columns, px)
        In the same rows what each column adds to its partner.
    group : Group
        The group.
    high : int
        First row of the partners.

    Yields
    ------
    waves, crossing : ndarray
        Views of the same shape: of real and imaginary parts, of column 0 of complex numbers.
    """
    real = waves.real.dtype
    low, beyond = group.paired, slice(high, high + group.counts[1])
    for one, other in ((low, beyond), (beyond, low)):
        yield waves[one].view(real), crossing[other].view(real)[::-1]
    if not group.low.start:
        yield waves[0, :1], crossing[0, :1]
        yield waves[0, 1:], crossing[0, 1:][::-1]
