"""One surface from a file: its contact, its statistics."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gen.errors import InputError
from gen.surface import load

if TYPE_CHECKING:
    from bem import Contact
    from gen.statistics import Description

Heights = NDArray[np.float64]


def solve_file(path: Path, side: str, **settings: Any) -> tuple[Contact, float]:
    """Solve the contact problem of a surface from a file.

    Parameters
    ----------
    path : heights [um], see `gen.surface.load`
    side : scan length, or two separated by a comma [um]
    settings : what else `bem.solve` takes, one load among it

    Returns
    -------
    (contact, seconds) : the solution and the time it took

    Raises
    ------
    InputError
        If the file cannot be read, a number is not allowed, or there is no solution.
    """
    import bem

    heights = load(path)
    sides = _sides(side)
    began = time.perf_counter()
    try:
        contact = bem.solve(heights, sides, **settings)
    except (bem.NotConverged, ValueError) as error:
        raise InputError(f"{path}: {error}") from None
    return contact, time.perf_counter() - began


def describe_file(path: Path, side: str) -> tuple[Heights, tuple[float, float], Description]:
    """Describe a surface from a file.

    Parameters
    ----------
    path, side : see `solve_file`

    Returns
    -------
    (heights, spacing, description) : (nx, ny) [um], along x and y [um], and the 22 statistics

    Raises
    ------
    InputError
        If the file cannot be read or a side is not allowed.
    """
    from gen.statistics import describe

    heights = load(path)
    sides = _sides(side)
    spacing = (sides[0] / (heights.shape[0] - 1), sides[1] / (heights.shape[1] - 1))
    return heights, spacing, describe(heights, spacing)


def _sides(text: str) -> tuple[float, float]:
    """Scan lengths along x and y from "1000" or "1000,500"."""
    try:
        lengths = [float(part) for part in text.split(",")]
    except ValueError:
        lengths = []
    if len(lengths) not in {1, 2} or not all(0 < length < np.inf for length in lengths):
        raise InputError(
            f"--side {text!r}: give the scan length in um, a number above 0, or two as 1000,500"
        )
    return lengths[0], lengths[-1]
