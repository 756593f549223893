"""Names of the arrays that pass between the modules of this package, and what none may have."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gen.runtime.errors import InputError

Values = NDArray[np.float64]
"""Numbers of any meaning and shape; docstrings give both."""

Indices = NDArray[np.int64]
"""Positions of rows, and numbers of surfaces, maps or groups."""

Heights = Values
"""Heights of a surface on its grid of nodes, shape (nx, ny) [um]."""

Columns = dict[str, NDArray[Any]]
"""Some rows of a database: for each column's name its values, one for each row."""


def refuse_masked(name: str, given: Any) -> None:
    """Refuse an array with masked entries; one with a mask of nothing is as any other."""
    if np.ma.is_masked(given):
        raise InputError(f"{name} are masked in places: fill or crop them")
