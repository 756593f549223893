"""Flags of rows outside a surrogate's training: features beyond their ranges, other grids."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from bem.spacing import BOUNDARIES, Boundary, node_spacing
from learn.arrays import Values
from learn.features import FeatureSet
from learn.surrogate.prediction import Rows

ROUNDING = 1e-6
"""Relative distance from the training's hardness within which a hardness is taken for it."""


def reasons(columns: tuple[str, ...], low: Values, high: Values, rows: Rows) -> tuple[str, ...]:
    """Return for each row the features outside their training ranges; "" if there is none.

    Parameters
    ----------
    columns : tuple of str
        Names of the d features.
    low, high : ndarray, shape (d,)
        Training ranges.
    rows : Rows
        Rows, with notes that stand first among the reasons.
    """
    outside = (rows.inputs < low) | (rows.inputs > high)
    notes = rows.notes if len(rows.notes) == len(rows.delta) else rows.notes * len(rows.delta)
    notes = notes or ("",) * len(rows.delta)
    if not outside.any():
        return notes
    texts = []
    for row, note in enumerate(notes):
        beyond = [
            f"{columns[place]} {rows.inputs[row, place]:.4g} outside {low[place]:.4g} to"
            f" {high[place]:.4g}"
            for place in np.flatnonzero(outside[row])
        ]
        texts.append("; ".join([note, *beyond] if note else beyond))
    return tuple(texts)


def finite(raw: Values, scale: Values) -> Values:
    """Replace predictions over their scale by NaN where they or their products are not finite."""
    with np.errstate(over="ignore", invalid="ignore"):
        return np.where(np.isfinite(raw * scale), raw, np.nan)


def with_undefined(reasons: tuple[str, ...], target: str, raw: Values) -> tuple[str, ...]:
    """Add to the reasons of rows that their prediction is not finite.

    Parameters
    ----------
    reasons : tuple of str
        Reasons of the n rows.
    target : str
        Name of the target.
    raw : ndarray, shape (n,)
        Predictions over their scale, from `finite`.
    """
    undefined = np.isnan(raw)
    if not undefined.any():
        return reasons
    said = f"the surrogate has no finite {target}"
    return tuple(
        "; ".join(filter(None, (said, reason))) if bad else reason
        for reason, bad in zip(reasons, undefined, strict=True)
    )


def grid_note(
    card: Mapping[str, Any],
    features: FeatureSet,
    shape: tuple[int, int],
    sides: tuple[float, float],
) -> str:
    """Return how a grid differs from the training's; "" if it does not.

    Parameters
    ----------
    card : mapping of str to object
        Card of the surrogate.
    features : FeatureSet
        Feature set; one with units binds the surrogate to its side and spacing.
    shape : tuple of int
        Nodes along both axes.
    sides : tuple of float
        Scan lengths [um].
    """
    nodes, side = int(card["nodes"]), float(card["side"])
    said = []
    if shape != (nodes, nodes):
        said.append(f"{shape[0]} x {shape[1]} nodes, trained on {nodes} x {nodes}")
    if not np.isclose(sides[0], sides[1], rtol=1e-3):
        said.append(f"{sides[0]:.6g} x {sides[1]:.6g} um, trained on square patches")
    elif not features.scaled and not np.isclose(sides[0], side, rtol=1e-3):
        said.append(f"side {sides[0]:.6g} um, trained on {side:.6g} um")
    if not features.scaled:
        boundary, own = boundary_of(card), float(card["spacing"])
        spacing = node_spacing(max(shape[0], 2), sides[0], boundary)
        if not np.isclose(spacing, own, rtol=0.02):
            said.append(f"spacing {spacing:.4g} um, trained on {own:.4g} um")
    return "; ".join(said)


def boundary_of(card: Mapping[str, Any]) -> Boundary:
    """Return the boundary of the training's patches; the card of free patches has no such entry."""
    (boundary,) = (each for each in BOUNDARIES if each == card.get("boundary", "free"))
    return boundary


def between(limits: tuple[float, float]) -> str:
    """Describe a range of the hardness over E*: "0.003 to 0.1", or "0.01" for a fixed one."""
    low, high = limits
    return f"{low:.4g}" if low == high else f"{low:.4g} to {high:.4g}"


def hardness_note(limits: tuple[float, float] | None, hardness_ratio: float | None) -> str:
    """Return how a hardness lies outside that of the training; "" if it does not.

    Parameters
    ----------
    limits : tuple of float or None
        Smallest and largest hardness over E* of the training, None for elastic bodies.
    hardness_ratio : float or None
        Hardness over E* of the prediction.
    """
    if limits is None or hardness_ratio is None:
        return ""
    low, high = limits
    if low * (1 - ROUNDING) <= hardness_ratio <= high * (1 + ROUNDING):
        return ""
    return f"hardness/E* {hardness_ratio:.4g} outside {low:.4g} to {high:.4g}"


def brief(reasons: str) -> str:
    """Shorten reasons to the first one and the number of the others, for a narrow column."""
    first, _, others = reasons.partition("; ")
    return f"{first}; and {others.count('; ') + 1} more" if others else first
