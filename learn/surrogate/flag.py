"""The flag of rows that are unlike the training: their features, distance, grid or hardness.

Each feature may lie within its range and all of them together may still be unlike any surface of
the training. The distance is Mahalanobis's, over the root of the number of features. Its limit is
the distance that 97 % of the training rows keep, each measured from rows of other surfaces:
features depend on each other, and those of surfaces of another generator do so in other ways. Where
there are many maps or databases, it is the largest distance that intervals vouch for: each is left
out in turn, and a new row of one like these lies beyond the limit with a probability of 10 % at
most.

A few databases are a few clouds of features with nothing between them: elastic bodies of one kind
of surface, bodies that yield of another. Distances are then measured from the nearest of them. Its
covariance is drawn towards the mean of all, as a database may have fewer rows than features (J. H.
Friedman (1989), J. Am. Stat. Assoc. 84, 165, regularised discriminant analysis).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from bem.problem import node_spacing
from gen.arrays import Indices, Values
from learn.features.scene import SCENE, shown
from learn.features.sets import NODES, Rows
from learn.surrogate.interval import CONSTANT, Scores

if TYPE_CHECKING:
    from learn.surrogate.model import Surrogate

SHARE = 0.9
"""Share of the rows of a new map or database that lie within the limit, or more."""

INSIDE = 0.97
"""Share of the training rows that lie within the limit where maps or databases do not decide it."""

RIDGE = 1e-4
"""Added to the variances of features of deviation 1: features that repeat others, such as roots,
leave directions without any."""

SAME = 1e-6
"""Relative distance from the training's hardness within which a hardness counts as equal."""

RIDGE_OF_MAPS = 0.01
"""The same where many maps or databases are one cloud: few directions tell them from another."""


@dataclass(frozen=True, eq=False)
class Distance:
    """Distances from the training of d features, or from the nearest of its k databases or maps."""

    centres: Values  # (k, d), mean features
    whitenings: Values  # (k, d, d), after which differences from the mean are uncorrelated
    limit: float  # largest distance that is not flagged

    def measured(self, inputs: Values) -> tuple[Values, Indices]:
        """Return the distance of rows from the nearest mean and its number, (n,), by (n, d)."""
        squares = np.full((len(self.centres), len(inputs)), np.inf)
        with np.errstate(over="ignore", invalid="ignore"):
            for own, centre, whitening in zip(squares, self.centres, self.whitenings, strict=True):
                own[:] = np.mean(((inputs - centre) @ whitening) ** 2, axis=1)
        return np.sqrt(squares.min(axis=0)), squares.argmin(axis=0)

    def of(self, inputs: Values) -> Values:
        """Return the distance of each row, (n,), from the nearest mean, by its features, (n, d)."""
        return self.measured(inputs)[0]


def nowhere(features: int) -> Distance:
    """Return distances of 0, of which none is flagged."""
    return Distance(np.zeros((1, features)), np.zeros((1, features, features)), np.inf)


def from_maps(inputs: Values, groups: Indices, others: Values | None = None) -> Distance:
    """Measure distances from rows, (n, d), with the limit that a new map or database keeps.

    Each of the groups of the rows, (n,), is left out in turn, or they are those of other rows,
    (m, d), from the training.
    """
    whole = _unlimited(inputs, ridge=RIDGE_OF_MAPS)
    if others is not None:
        found = whole.of(others)
    else:
        found = np.empty(len(inputs))
        for group in np.unique(groups):
            own = groups == group
            found[own] = _unlimited(inputs[~own], ridge=RIDGE_OF_MAPS).of(inputs[own])
    return replace(whole, limit=Scores.of(found, groups).quantile(SHARE))


def from_surfaces(
    inputs: Values, clouds: Indices, parts: Indices
) -> tuple[Distance, Values, Indices]:
    """Measure distances from the nearest cloud of rows, (n, d), with a limit that most rows keep.

    Clouds, (n,), are numbered from 0 on. Also return the distance of each row from the rows of
    other parts, (n,), and the number of the nearest cloud.
    """
    far, nearest = np.empty(len(inputs)), np.empty(len(inputs), dtype=np.int64)
    known = np.zeros(len(inputs), dtype=np.bool_)
    for part in np.unique(parts):
        own = parts == part
        seen = np.unique(clouds[~own])
        far[own], places = _unlimited(inputs[~own], clouds[~own]).measured(inputs[own])
        nearest[own] = seen[places]
        known[own] = np.isin(clouds[own], seen)
    # A cloud of which no other part has rows says nothing about the distance from its own.
    limit = float(np.quantile(far[known] if known.any() else far, INSIDE, method="higher"))
    return replace(_unlimited(inputs, clouds), limit=limit), far, nearest


def _unlimited(inputs: Values, labels: Indices | None = None, ridge: float = RIDGE) -> Distance:
    """Return the distances from some rows, or from the nearest of their groups, without a limit."""
    labels = np.zeros(len(inputs), dtype=np.int64) if labels is None else labels
    features, deviation = inputs.shape[1], inputs.std(axis=0)
    groups = [inputs[labels == label] for label in np.unique(labels)]
    # A new value of a feature that is constant, in every group, is flagged by its range.
    least = CONSTANT * np.abs(inputs).max(axis=0)
    varying = np.any([own.std(axis=0) > least for own in groups], axis=0)
    scale = np.where(varying, deviation, np.inf)
    means = [own.mean(axis=0) for own in groups]
    units = [(own - mean) / scale for own, mean in zip(groups, means, strict=True)]
    squares = [unit.T @ unit for unit in units]
    shared = np.sum(squares, axis=0) / len(inputs)
    whitenings = []
    for own, products in zip(groups, squares, strict=True):
        covariance = (products + features * shared) / (len(own) + features)
        inverse = np.linalg.inv(covariance + ridge * np.eye(features))
        whitenings.append(np.linalg.cholesky(inverse) / scale[:, None])
    return Distance(np.array(means), np.array(whitenings), np.inf)


def reasons_of(surrogate: Surrogate, rows: Rows, inputs: Values) -> list[str]:
    """Return why each row, with features (n, d), is outside the training; "" if it is inside.

    The rows' own notes stand first, then the grid, the hardness, the distance and the features.
    """
    features, number, found = surrogate.features, len(inputs), [list[str]() for _ in inputs]
    grids = {grid: grid_note(surrogate, *grid) for grid in set(rows.grids)}
    for notes in (rows.notes, [grids[grid] for grid in rows.grids]):
        for said, note in zip(found, [*notes] * number if len(notes) == 1 else notes, strict=False):
            said.append(note)
    if surrogate.hardness_limits is not None and rows.hardness_ratio is not None:
        low, high = surrogate.hardness_limits
        high = np.inf if features.elastic else high  # elastic bodies are very hard ones
        for row, ratio in enumerate(np.broadcast_to(rows.hardness_ratio, number).tolist()):
            if not low * (1 - SAME) <= ratio <= high * (1 + SAME):
                found[row].append(f"hardness/E* {ratio:.4g} outside {low:.4g} to {high:.4g}")
    far, limit = surrogate.distance.measured(inputs)[0], surrogate.distance.limit
    outside = (inputs < surrogate.low) | (inputs > surrogate.high)
    told, names = [inputs, surrogate.low, surrogate.high], features.names
    if features.name == SCENE:  # without logarithms
        told = [shown(features.columns, each) for each in told]
    values, least, most = told
    for row in np.flatnonzero(outside.any(axis=1) | (far > limit)).tolist():
        if far[row] > limit:
            text = f"distance from the training {far[row]:.4g} outside 0 to {limit:.4g}"
            found[row].append(text)
        found[row] += [
            f"{names[place]} {values[row, place]:.4g} outside {least[place]:.4g} to"
            f" {most[place]:.4g}"
            for place in np.flatnonzero(outside[row])
        ]
    return ["; ".join(filter(None, each)) for each in found]


def grid_note(surrogate: Surrogate, shape: tuple[int, ...], sides: tuple[float, ...]) -> str:
    """Return how a grid differs from the training's; "" if it does not.

    It has nodes along both axes and sides [um]. Features with units bind the surrogate to its side
    and spacing.
    """
    said, card, features = [], surrogate.card, surrogate.features
    grids = list(dict.fromkeys(tuple(each["nodes"]) for each in card.get("databases", [card])))
    if shape not in grids and NODES not in features.columns:
        trained = ", ".join(f"{nodes[0]:g} x {nodes[1]:g}" for nodes in grids)
        said.append(f"{shape[0]} x {shape[1]} nodes, trained on {trained}")
    own = card["side"]
    if not np.isclose(sides[0] * own[1], sides[1] * own[0], rtol=1e-3):
        trained = "square patches" if own[0] == own[1] else f"{own[0]:.6g} x {own[1]:.6g} um"
        said.append(f"{sides[0]:.6g} x {sides[1]:.6g} um, trained on {trained}")
    elif not features.scaled and not np.isclose(sides[0], own[0], rtol=1e-3):
        said.append(f"side {sides[0]:.6g} um, trained on {own[0]:.6g} um")
    if features.scaled or NODES in features.columns:  # whose nodes are in their range or not
        return "; ".join(said)
    for nodes, side, usual in zip(shape, sides, card["spacing"], strict=True):
        spacing = node_spacing(max(nodes, 2), side, surrogate.boundary)
        if not np.isclose(spacing, usual, rtol=0.02):
            said.append(f"spacing {spacing:.4g} um, trained on {usual:.4g} um")
            break
    return "; ".join(said)


def between(limits: tuple[float, float]) -> str:
    """Describe a range of the hardness over E*: "0.003 to 0.1", or "0.01" for a fixed one."""
    low, high = limits
    return f"{low:.4g}" if low == high else f"{low:.4g} to {high:.4g}"
