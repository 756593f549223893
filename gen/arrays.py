"""Names of the arrays that pass between the modules of this package."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Values = NDArray[np.float64]  # numbers of any meaning and shape; docstrings give both
Indices = NDArray[np.int64]  # positions of rows, and numbers of surfaces, maps or groups
Heights = Values  # heights of a surface on its grid of nodes, shape (nx, ny) [um]

Columns = dict[str, NDArray[Any]]
"""Some rows of a database: for each column's name its values, one for each row."""
