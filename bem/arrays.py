"""Types of the arrays that functions of this package take and return."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

# One number for every node of the grid, of shape (nx, ny).
Field = NDArray[np.float64]

# One number for every node of a list, of shape (m,).
Values = NDArray[np.float64]

# Indices of nodes, either into the flattened grid or into a list of nodes.
Nodes = NDArray[np.intp]

# Numbers of any shape in double or single precision; docstrings say which.
Real = NDArray[Any]

# One truth value for every node of the grid, of shape (nx, ny), or of a list, of shape (m,).
Mask = NDArray[np.bool_]
