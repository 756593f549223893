"""What lies outside a surrogate's training: features beyond their ranges, other grids and sides."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from learn.features import FeatureSet
from learn.surrogate.prediction import Rows

Values = NDArray[np.float64]


def reasons(columns: tuple[str, ...], low: Values, high: Values, rows: Rows) -> tuple[str, ...]:
    """Say for each row what lies outside the training, "" if nothing does.

    Parameters
    ----------
    columns : names of the d features
    low, high : (d,) training ranges
    rows : with their own notes, which come first
    """
    outside = (rows.inputs < low) | (rows.inputs > high)
    notes = rows.notes if len(rows.notes) == len(rows.delta) else rows.notes * len(rows.delta)
    notes = notes or ("",) * len(rows.delta)
    if not outside.any():
        return notes
    found = []
    for row, note in enumerate(notes):
        beyond = [
            f"{columns[place]} {rows.inputs[row, place]:.4g} outside {low[place]:.4g} to"
            f" {high[place]:.4g}"
            for place in np.flatnonzero(outside[row])
        ]
        found.append("; ".join([note, *beyond] if note else beyond))
    return tuple(found)


def finite(raw: Values, scale: Values) -> Values:
    """Predictions over their scale, NaN where they or their product with it are not finite."""
    with np.errstate(over="ignore", invalid="ignore"):
        return np.where(np.isfinite(raw * scale), raw, np.nan)


def with_undefined(reasons: tuple[str, ...], target: str, raw: Values) -> tuple[str, ...]:
    """Add to the reasons of rows whose prediction is not finite that it is none.

    Parameters
    ----------
    reasons : n texts
    target : its name
    raw : (n,) predictions, from `finite`
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
    """Say how a grid differs from the training's, "" if it does not.

    Parameters
    ----------
    card : of the surrogate
    features : whose units, if they have any, bind it to its side and spacing
    shape : nodes
    sides : scan lengths [um]
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
        spacing, own = sides[0] / max(shape[0] - 1, 1), float(card["spacing"])
        if not np.isclose(spacing, own, rtol=0.02):
            said.append(f"spacing {spacing:.4g} um, trained on {own:.4g} um")
    return "; ".join(said)


def brief(reasons: str) -> str:
    """The first reason, and how many there are besides: for a narrow column."""
    first, _, others = reasons.partition("; ")
    return f"{first}; and {others.count('; ') + 1} more" if others else first
