"""The types of arrays that the modules of this package exchange."""

import numpy as np
from numpy.typing import NDArray

Values = NDArray[np.float64]
"""Inputs, targets, predictions, times: whatever is measured."""

Indices = NDArray[np.int64]
"""Positions of rows, and numbers of surfaces."""

Folds = NDArray[np.int8]
"""Fold of each training row."""

Whole = NDArray[np.int32]
"""Whole numbers as a surrogate's file stores them: nodes of trees, features that they ask for."""
