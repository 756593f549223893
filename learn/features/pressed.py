"""Columns that the hybrid set adds: from the heights themselves, and from a coarse contact solve.

Of 4,000 rows of the paper preset (kernel ridge, areas to 16.56 %, 2,540 rows train, three splits)
the columns of `COARSE` have an nMSE of the area of 0.28 %, with roots 0.26 %. `LOCAL` makes this
0.14 %; the shares by Persson's theory alone make it 0.16 %. The number of spots and bearing shares
at parts of Delta changed nothing and are left out.
"""

import numpy as np

from learn.arrays import Values

BLOCKS = 33
"""Blocks per side; on a surface with fewer nodes every node is a block."""

BLOCK_COUNTS = (BLOCKS, 65)
"""Blocks per side that a user can choose from. A patch without edges has one less: those of 2^k
nodes a side are then equal, and transforms of their number fast."""

COARSE = (
    "bearing_share",
    "bearing_interference/delta",
    "coarse_area_percent",
    "coarse_force/(E*.L.delta)",
    "coarse_displacement/delta",
    "refined_share",
    "refined_interference/delta",
)
"""Columns that comparisons of models add; all are pure numbers, as are the others."""

FACTORS = (0.5, 1.0, 2.0)
"""Multiples of the coarse pressures from which the area inside the blocks is estimated: real local
contacts lie on other curves than Persson's, which models find between these."""

SHIFTS = (-1.0, -0.5, 0.5, 1.0)
"""Shifts of the displacement, over the rms s of the heights that the blocks do not resolve, above
which nodes are counted."""

POWERS = (2, 3)
"""Powers of the mean interference of the nodes that stand above the displacement."""

_AREAS = tuple(f"local_area({factor:g}p)" for factor in FACTORS)
_SHIFTED = tuple(f"refined_share({shift:+g}s)" for shift in SHIFTS)

LOCAL = (
    *_AREAS,
    *_SHIFTED,
    *(f"refined_interference_{power}/delta" for power in POWERS),
    "coarse_perimeter/L",
)
"""Columns of the same solve that surrogates see too."""

HYBRID = (*COARSE, *LOCAL)
"""All columns, in the order in which `SurfaceFeatures.hybrid` returns them."""

ROOTED = (
    "bearing_share",
    "coarse_area_percent",
    "coarse_force/(E*.L.delta)",
    "refined_share",
    "refined_interference/delta",
)
"""Columns of `COARSE` whose square roots surrogates see too: like the area they begin at first
touch and span decades, and the roots tell small values apart."""

ROOTED_LOCAL = (*_AREAS, *_SHIFTED)
"""Columns of `LOCAL` whose square roots surrogates see too."""


def names(*, roots: bool, blocks: int) -> tuple[str, ...]:
    """Return the names of the columns that a set adds; parameters as of `values`."""
    found: tuple[str, ...] = COARSE
    if roots:
        found += tuple(f"sqrt({name})" for name in ROOTED)
    if blocks:
        found += (*LOCAL, *(f"sqrt({name})" for name in ROOTED_LOCAL))
    return found


def values(hybrid: Values, *, roots: bool, blocks: int) -> Values:
    """Return the columns that a set adds, (n, d).

    Parameters
    ----------
    hybrid : ndarray, shape (n, 17)
        Columns of `HYBRID`.
    roots : bool
        True to add the square roots of `ROOTED`.
    blocks : int
        Blocks per side; 0 for the columns of `COARSE` alone.
    """

    def column(name: str) -> Values:
        return hybrid[:, HYBRID.index(name)]

    parts = [column(name) for name in COARSE]
    if roots:
        parts += [np.sqrt(column(name)) for name in ROOTED]
    if blocks:
        parts += [column(name) for name in LOCAL]
        parts += [np.sqrt(column(name)) for name in ROOTED_LOCAL]
    return np.column_stack(parts)
