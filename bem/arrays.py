"""Types of the arrays that this package hands around."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

# One number for every node of the grid, of shape (nx, ny).
Field = NDArray[np.float64]

# One number for every node of a list, of shape (m,).
Values = NDArray[np.float64]

# Indices of nodes, either into the flattened grid or into a list of nodes.
Nodes = NDArray[np.intp]

# Numbers in whichever precision the caller chose, float64 or float32.
Real = NDArray[Any]

# One decision for every node of a list, of shape (m,).
Mask = NDArray[np.bool_]
