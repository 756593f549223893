"""Real transforms as complex ones of half the length: columns of waves and their partners.

FFTW has vector instructions for complex transforms and none for real ones, which take more than
twice as long as complex ones of the same work. Neighbours along a row can be the real and the
imaginary part of one number, as they lie in memory, so that no value is moved.

With the n = py / 2 numbers z = a + i b of a row, the transform Z of z holds those of both parts,
A = (Z(q, k) + conj Z(-q, -k)) / 2 and B = (Z(q, k) - conj Z(-q, -k)) / 2i, and that of the field is
A + exp(-i t) B with t = pi k / n (Press et al. 2007, Numerical Recipes, section 12.3). Filtering
its waves k and k + n by factors S and S' therefore makes of Z(q, k)

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
        The columns of both kinds.
    """

    low: slice
    high: slice

    @property
    def many(self) -> tuple[int, int]:
        """Numbers of columns of both kinds."""
        low, high = (columns.stop - columns.start for columns in self)
        return low, high

    @property
    def paired(self) -> slice:
        """Places of the columns with a partner among those of `low`."""
        first = 0 if self.low.start else 1
        return slice(first, first + self.many[1])


def groups(columns: int, most: int) -> Iterator[Group]:
    """Divide the n columns into groups of at most some columns k each, and their partners."""
    half = columns // 2 + 1
    size = -(-half // -(-half // most))
    for start in range(0, half, size):
        stop = min(start + size, half)
        first, last = max(start, 1), min(stop - 1, (columns - 1) // 2)  # those with a partner
        yield Group(slice(start, stop), slice(columns - last, columns - first + 1))


def factors(spectrum: Field, columns: Any) -> tuple[Field, Field]:
    """Return the factors of Z, and those of i conj Z, in some columns.

    Parameters
    ----------
    spectrum : ndarray, shape (px, n + 1)
        Real transform of a kernel with periods (px, 2 n) that is even in both directions.
    columns : ndarray of int, shape (m,)
        Columns k or n - k.

    Returns
    -------
    own, across : ndarray, shape (m, px)
        The latter are the same for k and n - k.
    """
    waves, (rows, n) = spectrum.T, (len(spectrum), spectrum.shape[1] - 1)
    low, high = waves[columns] / (rows * n), waves[n - columns] / (rows * n)
    phase = np.pi * columns[:, np.newaxis] / n
    half_difference = (low - high) / 2
    return (low + high) / 2 - half_difference * np.sin(phase), half_difference * np.cos(phase)


def partners(waves: Any, crossing: Any, group: Group, high: int) -> Iterator[tuple[Any, Any]]:
    """Pair columns with what their partners add to them; column 0 is its own partner.

    Parameters
    ----------
    waves, crossing : ndarray, shape (columns, px)
        Columns k of a group from row 0 and their partners from row `high`, and what each of them
        adds to its partner.
    group : Group
        The group.
    high : int
        Row from which on the partners lie.

    Yields
    ------
    waves, crossing : ndarray
        Views of both, as real numbers where that takes less time.
    """
    real = waves.real.dtype
    low, beyond = group.paired, slice(high, high + group.many[1])
    for one, other in ((low, beyond), (beyond, low)):
        yield waves[one].view(real), crossing[other].view(real)[::-1]
    if not group.low.start:
        yield waves[0, :1], crossing[0, :1]
        yield waves[0, 1:], crossing[0, 1:][::-1]
