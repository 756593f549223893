"""Checked access to the parts of a surrogate's file.

Every part passes through these functions before a library uses it, because compiled code trusts
sizes and indices.
"""

import math
from collections.abc import Collection, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from learn.arrays import Values, Whole

Part = Mapping[str, Any]


def _of(part: Any, name: str) -> Any:
    """Return the entry of a part by its name, None if there is none."""
    return part.get(name) if isinstance(part, dict) else None


def array(part: Part, name: str, kind: str, *shape: int | None) -> NDArray[Any]:
    """Return an array of finite numbers of a given type and shape.

    Parameters
    ----------
    part : mapping
        Part that holds the array.
    name : str
        Name of the array.
    kind : str
        Type of the numbers, as numpy writes it.
    *shape : int or None
        Size of each axis, None for any.

    Raises
    ------
    ValueError
        If the array is missing or differs; the message names it.
    """
    entry = _of(part, name)
    if not isinstance(entry, np.ndarray) or entry.dtype != np.dtype(kind):
        raise ValueError(f"{name} is no array of {kind}")
    same = [wanted in {None, size} for wanted, size in zip(shape, entry.shape, strict=False)]
    if len(shape) != entry.ndim or not all(same):
        raise ValueError(f"{name} has the shape {entry.shape}")
    if not np.isfinite(entry).all():
        raise ValueError(f"{name} is not finite")
    return entry


def numbers(part: Part, name: str, *shape: int | None) -> Values:
    """Return an array of finite numbers of double precision; see `array`."""
    return array(part, name, "f8", *shape)


def integers(part: Part, name: str, *shape: int | None) -> Whole:
    """Return an array of whole numbers; see `array`."""
    return array(part, name, "i4", *shape)


def number(part: Part, name: str, low: float = -math.inf, high: float = math.inf) -> float:
    """Return a finite number within bounds.

    Raises
    ------
    ValueError
        If the entry is missing or differs.
    """
    entry = _of(part, name)
    if type(entry) not in {int, float} or not math.isfinite(entry) or not low <= entry <= high:
        raise ValueError(f"{name} is {str(entry)[:40]}")
    return float(entry)


def count(part: Part, name: str, low: int = 0, high: int = 2**53) -> int:
    """Return a whole number within bounds; see `number`."""
    entry = number(part, name, low, high)
    if type(part[name]) is not int:
        raise ValueError(f"{name} is {entry}")
    return int(part[name])


def positive(part: Part, name: str) -> float:
    """Return a finite number above 0; see `number`."""
    entry = number(part, name, 0.0)
    if not entry:
        raise ValueError(f"{name} is 0")
    return entry


def text(part: Part, name: str, allowed: Collection[str] | None = None) -> str:
    """Return a text, one of the allowed ones if these are given.

    Raises
    ------
    ValueError
        If the entry is missing or differs.
    """
    entry = _of(part, name)
    if not isinstance(entry, str) or (allowed is not None and entry not in allowed):
        raise ValueError(f"{name} is {str(entry)[:40]!r}")
    return entry


def mapping(part: Part, name: str) -> Part:
    """Return a dictionary.

    Raises
    ------
    ValueError
        If the entry is missing or no dictionary.
    """
    entry = _of(part, name)
    if isinstance(entry, dict):
        return entry
    raise ValueError(f"{name} is missing")


def sequence(part: Part, name: str, size: int | None = None) -> list[Any]:
    """Return a list, of a given size if there is one.

    Raises
    ------
    ValueError
        If the entry is missing, no list, or of another size.
    """
    entry = _of(part, name)
    if not isinstance(entry, list) or size not in {None, len(entry)}:
        raise ValueError(f"{name} is no list of {'any' if size is None else size} entries")
    return entry
