"""Flags of rows outside a surrogate's training: features beyond their ranges, other grids."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from bem.spacing import BOUNDARIES, Boundary, node_spacing
from learn.arrays import Values
from learn.features import FeatureSet
from learn.surrogate.prediction import Rows

ROUNDING = 1e-6
"""Relative distance from the training's hardness within which a hardness counts as equal."""


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
    said = []
    grids = list(dict.fromkeys(pair(each, "nodes") for each in databases_of(card)))
    if shape not in grids and not features.needs_nodes:
        trained = ", ".join(f"{nodes[0]:g} x {nodes[1]:g}" for nodes in grids)
        said.append(f"{shape[0]} x {shape[1]} nodes, trained on {trained}")
    own = pair(card, "side")
    if not np.isclose(sides[0] * own[1], sides[1] * own[0], rtol=1e-3):
        trained = "square patches" if own[0] == own[1] else f"{own[0]:.6g} x {own[1]:.6g} um"
        said.append(f"{sides[0]:.6g} x {sides[1]:.6g} um, trained on {trained}")
    elif not features.scaled and not np.isclose(sides[0], own[0], rtol=1e-3):
        said.append(f"side {sides[0]:.6g} um, trained on {own[0]:.6g} um")
    if not features.scaled:
        said += _spacing_notes(card, features, shape, sides)
    return "; ".join(said)


def databases_of(card: Mapping[str, Any]) -> Sequence[Mapping[str, Any]]:
    """Return the databases of a card with their nodes; the card itself if it is of only one."""
    several: Sequence[Mapping[str, Any]] = card.get("databases", [card])
    return several


def _spacing_notes(
    card: Mapping[str, Any],
    features: FeatureSet,
    shape: tuple[int, int],
    sides: tuple[float, float],
) -> list[str]:
    """Return how the spacing of a grid differs from the training's, for the first axis it does."""
    if features.needs_nodes:  # the side is the training's, and the nodes are in its range or not
        return []
    boundary, own = boundary_of(card), pair(card, "spacing")
    for nodes, side, trained in zip(shape, sides, own, strict=True):
        spacing = node_spacing(max(nodes, 2), side, boundary)
        if not np.isclose(spacing, trained, rtol=0.02):
            return [f"spacing {spacing:.4g} um, trained on {trained:.4g} um"]
    return []


def pair(card: Mapping[str, Any], name: str) -> tuple[float, float]:
    """Return an entry of a card along x and y.

    Parameters
    ----------
    card : mapping of str to object
        Card of the surrogate.
    name : str
        "nodes" [1], "side" or "spacing" [um].
    """
    first, second = card[name]
    return float(first), float(second)


def boundary_of(card: Mapping[str, Any]) -> Boundary:
    """Return the boundary of the training's patches; the card of free patches has no such entry."""
    (boundary,) = (each for each in BOUNDARIES if each == card.get("boundary", "free"))
    return boundary


def between(limits: tuple[float, float]) -> str:
    """Describe a range of the hardness over E*: "0.003 to 0.1", or "0.01" for a fixed one."""
    low, high = limits
    return f"{low:.4g}" if low == high else f"{low:.4g} to {high:.4g}"


def hardness_note(
    limits: tuple[float, float] | None, hardness_ratio: float | None, *, elastic: bool = False
) -> str:
    """Return how a hardness lies outside that of the training; "" if it does not.

    Parameters
    ----------
    limits : tuple of float or None
        Smallest and largest hardness over E* of the training, None for elastic bodies.
    hardness_ratio : float or None
        Hardness over E* of the prediction.
    elastic : bool
        True if elastic bodies are in the training: they are the end of the harder ones.
    """
    if limits is None or hardness_ratio is None:
        return ""
    low, high = limits
    if elastic:
        high = np.inf
    if low * (1 - ROUNDING) <= hardness_ratio <= high * (1 + ROUNDING):
        return ""
    return f"hardness/E* {hardness_ratio:.4g} outside {low:.4g} to {high:.4g}"
