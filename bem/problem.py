"""A contact problem as its user states it, checked before anything is computed."""

import math
from dataclasses import dataclass, field
from typing import Any, Literal, TypeVar, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bem.influence import KERNELS, Kernel

FarField = Literal["rigid", "compliant"]
FAR_FIELDS: tuple[FarField, ...] = get_args(FarField)
Field = NDArray[np.float64]
Name = TypeVar("Name", bound=str)

LENGTHS = (0.0, math.inf, "above 0 um")
"""What a length may be: beyond the first number, below the second, in words."""


@dataclass(frozen=True, eq=False)
class Problem:
    """A contact problem, checked.

    Attributes
    ----------
    heights : (nx, ny) surface, the material above pressing down into the half-space [um]
    delta : far-field displacement from first touch on [um]
    spacing : of the nodes along the first and the second axis [um]
    modulus : plane-strain modulus E* = E / (1 - nu^2) [MPa]
    kernel, far_field : see `solve`
    rtol : largest violation of complementarity accepted [Delta]
    max_iterations : bound on the steps of conjugate gradients
    """

    heights: Field = field(repr=False)
    delta: float
    spacing: tuple[float, float]
    modulus: float
    kernel: Kernel
    far_field: FarField
    rtol: float
    max_iterations: int

    @property
    def aspect(self) -> float:
        """Second side of a cell over its first [1]."""
        return self.spacing[1] / self.spacing[0]


def pose(
    heights: ArrayLike,
    side: float | tuple[float, float],
    delta: float,
    *,
    spacing: float | tuple[float, float] | None,
    modulus: float,
    poisson: float,
    kernel: Kernel,
    far_field: FarField,
    rtol: float,
    max_iterations: int,
) -> Problem:
    """Check the arguments of `bem.solve`, which says what they are.

    Raises
    ------
    ValueError
        one line: what was given and what is allowed
    """
    surface = _checked_heights(heights)
    problem = Problem(
        heights=surface,
        delta=_checked("delta", delta, -math.inf, math.inf, "a finite number of um"),
        spacing=_checked_spacing(surface.shape, side, spacing),
        modulus=_checked("modulus", modulus, 0, math.inf, "above 0 MPa")
        / (1 - _checked_poisson(poisson) ** 2),
        kernel=_checked_choice("kernel", kernel, KERNELS),
        far_field=_checked_choice("far_field", far_field, FAR_FIELDS),
        rtol=_checked("rtol", rtol, 1e-15, 1, "between 1e-15 and 1"),
        max_iterations=_checked_count("max_iterations", max_iterations),
    )
    if problem.kernel == "concentrated-force" and problem.aspect != 1:
        raise ValueError(
            f"kernel = 'concentrated-force' needs square cells, spacing is {problem.spacing} um:"
            " use kernel = 'uniform-pressure'"
        )
    return problem


def _checked_heights(heights: ArrayLike) -> Field:
    """(nx, ny) finite floats, or a ValueError that says what is wrong."""
    if np.ma.is_masked(heights):
        raise ValueError("heights are masked in places: fill or crop them")
    try:
        given = np.asarray(heights)
    except ValueError:
        raise ValueError("heights have rows of unequal length: a grid (nx, ny) is needed") from None
    if given.dtype.kind not in "fiu":
        raise ValueError(f"heights are of type {given.dtype}: real numbers are needed")
    if given.ndim != 2 or given.size == 0:
        raise ValueError(f"heights have shape {given.shape}: a grid of nodes (nx, ny) is needed")
    surface: Field = np.array(given, dtype=np.float64, order="C")
    holes = surface.size - int(np.count_nonzero(np.isfinite(surface)))
    if holes:
        raise ValueError(f"heights hold {holes} values that are not finite: fill or crop them")
    surface.setflags(write=False)
    return surface


def _checked_spacing(shape: tuple[int, int], side: Any, spacing: Any) -> tuple[float, float]:
    """Spacing per axis from the sides, unless it was given itself."""
    sides = _checked_pair("side", side)
    if spacing is not None:
        return _checked_pair("spacing", spacing)
    if min(shape) < 2:
        raise ValueError(
            f"a grid of {shape[0]} x {shape[1]} nodes has no side / (nodes - 1): give the spacing"
        )
    return sides[0] / (shape[0] - 1), sides[1] / (shape[1] - 1)


def _checked_pair(name: str, given: Any) -> tuple[float, float]:
    """One length for both axes, or one for each."""
    pair = (given, given) if np.ndim(given) == 0 else tuple(given)
    if len(pair) != 2:
        raise ValueError(f"{name} = {given!r}: one length or two are needed, in um")
    return _checked(name, pair[0], *LENGTHS), _checked(name, pair[1], *LENGTHS)


def _checked(name: str, value: Any, low: float, high: float, allowed: str) -> float:
    """A finite float strictly between low and high."""
    try:
        number = math.nan if isinstance(value, bool | np.bool_) else float(value)
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"{name} = {value!r}: must be {allowed}") from None
    if not low < number < high:
        raise ValueError(f"{name} = {value!r}: must be {allowed}")
    return number


def _checked_poisson(poisson: Any) -> float:
    allowed = "above -1 and at most 0.5"
    return _checked("poisson", poisson, -1, math.nextafter(0.5, 1), allowed)


def _checked_count(name: str, value: Any) -> int:
    """A whole number of one or more."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < 1:
        raise ValueError(f"{name} = {value!r}: must be a whole number of at least 1")
    return int(value)


def _checked_choice(name: str, value: Name, choices: tuple[Name, ...]) -> Name:
    if not isinstance(value, str) or value not in choices:
        raise ValueError(f"{name} = {value!r}: must be one of {', '.join(choices)}")
    return value
