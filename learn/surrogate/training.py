"""What a surrogate was trained on, and why rows lie outside it.

The flag of a row names what is unlike the training: a feature outside its range, a large distance
from the training (`learn.surrogate.interval`), another grid, or another hardness.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from bem.problem import Boundary, node_spacing
from gen.arrays import Values
from learn.features.columns import NODES
from learn.features.rows import Rows
from learn.features.scene import SCENE, plain
from learn.features.sets import SETS, FeatureSet
from learn.surrogate.interval import Distance

# relative difference from the training's hardness up to which two numbers are equal
SAME_HARDNESS = 1e-6
# the same for sides, and for spacings, which maps of one instrument hardly share
SAME_SIDE = 1e-3
SAME_SPACING = 0.02


@dataclass(frozen=True, eq=False)
class Training:
    """The training of a surrogate, as far as predictions need it."""

    card: Mapping[str, Any]  # of the surrogate
    features: FeatureSet  # the feature set that the models were trained on
    low: Values  # (d,), smallest features
    high: Values  # (d,), largest features
    distance: Distance  # distances from the training, with the limit of the flag
    modulus: float  # E* [MPa]
    boundary: Boundary  # of the patches
    # smallest and largest hardness over E*; None if no bodies yield
    hardness_limits: tuple[float, float] | None = None

    @classmethod
    def of(
        cls, card: Mapping[str, Any], low: Values, high: Values, distance: Distance
    ) -> Training:
        """Read a training from the card of a surrogate.

        Parameters
        ----------
        card : mapping of str to object
            Card of the surrogate.
        low, high : ndarray, shape (d,)
            Training ranges of the features.
        distance : Distance
            Distances from the training.

        Returns
        -------
        Training
            The training.
        """
        limits = card.get("hardness_ratio")
        if limits is not None:
            limits = (float(limits[0]), float(limits[1]))
        return cls(
            card=card,
            features=_features_of(card),
            low=low,
            high=high,
            distance=distance,
            modulus=float(card["modulus"]),
            boundary=card.get("boundary", "free"),
            hardness_limits=limits,
        )

    def reasons(self, rows: Rows, inputs: Values) -> list[str]:
        """Name for each row what is outside the training.

        Parameters
        ----------
        rows : Rows
            n rows to predict.
        inputs : ndarray, shape (n, d)
            Their features.

        Returns
        -------
        list of str
            For each row its own notes, then those on grid, hardness, distance and features; "" for
            a row inside the training.
        """
        number = len(inputs)
        grid_notes = {grid: self.grid_note(*grid) for grid in set(rows.grids)}
        columns = [
            _for_all_rows(rows.notes, number),
            _for_all_rows([grid_notes[grid] for grid in rows.grids], number),
            self._hardness_notes(rows, number),
            self._distance_notes(inputs),
            self._range_notes(inputs),
        ]
        return ["; ".join(filter(None, notes)) for notes in zip(*columns, strict=True)]

    def _hardness_notes(self, rows: Rows, number: int) -> list[str]:
        """Return for each row how its hardness differs from the training's, or ""."""
        notes = [""] * number
        if self.hardness_limits is None or rows.hardness_ratio is None:
            return notes
        low, high = self.hardness_limits
        if self.features.elastic:
            high = np.inf  # elastic bodies count as very hard ones
        ratios = np.broadcast_to(rows.hardness_ratio, number)
        inside = ratios >= low * (1 - SAME_HARDNESS)
        inside &= ratios <= high * (1 + SAME_HARDNESS)
        for row in np.flatnonzero(~inside):
            notes[row] = f"hardness/E* {ratios[row]:.4g} outside {low:.4g} to {high:.4g}"
        return notes

    def _distance_notes(self, inputs: Values) -> list[str]:
        """Return for each row the distance from the training beyond the limit, or ""."""
        notes = [""] * len(inputs)
        limit = self.distance.limit
        distances = self.distance.of(inputs)
        for row in np.flatnonzero(distances > limit):
            notes[row] = (
                f"distance from the training {distances[row]:.4g} outside 0 to {limit:.4g}"
            )
        return notes

    def _range_notes(self, inputs: Values) -> list[str]:
        """Return for each row which features are outside their training ranges, or ""."""
        notes = [""] * len(inputs)
        outside = (inputs < self.low) | (inputs > self.high)
        values = self.features.shown(inputs)
        low = self.features.shown(self.low)
        high = self.features.shown(self.high)
        names = self.features.names
        for row in np.flatnonzero(outside.any(axis=1)):
            notes[row] = "; ".join(
                f"{names[place]} {values[row, place]:.4g} outside {low[place]:.4g} to"
                f" {high[place]:.4g}"
                for place in np.flatnonzero(outside[row])
            )
        return notes

    def grid_note(self, shape: tuple[int, ...], sides: tuple[float, ...]) -> str:
        """Tell how a grid differs from the training's.

        Features with units bind a surrogate to the side and the spacing of its training.

        Parameters
        ----------
        shape : (int, int)
            Number of nodes along x and y.
        sides : (float, float)
            Lengths of the patch along x and y [um].

        Returns
        -------
        str
            The differences; "" if there are none.
        """
        notes = [
            self._nodes_note(shape),
            self._sides_note(sides),
            self._spacing_note(shape, sides),
        ]
        return "; ".join(filter(None, notes))

    def _nodes_note(self, shape: tuple[int, ...]) -> str:
        """Return how the nodes differ, or ""; as a feature they have a range instead."""
        databases = self.card.get("databases", [self.card])
        grids = list(dict.fromkeys(tuple(entry["nodes"]) for entry in databases))
        if NODES in self.features.columns or shape in grids:
            return ""
        trained = ", ".join(f"{nodes[0]:g} x {nodes[1]:g}" for nodes in grids)
        return f"{shape[0]} x {shape[1]} nodes, trained on {trained}"

    def _sides_note(self, sides: tuple[float, ...]) -> str:
        """Return how the ratio of the sides differs, or with units the sides themselves, or ""."""
        side_x, side_y = self.card["side"]
        if not np.isclose(sides[0] * side_y, sides[1] * side_x, rtol=SAME_SIDE):
            trained = f"{side_x:.6g} x {side_y:.6g} um"
            if side_x == side_y:
                trained = "square patches"
            return f"{sides[0]:.6g} x {sides[1]:.6g} um, trained on {trained}"
        same_side = np.isclose(sides[0], side_x, rtol=SAME_SIDE)
        if not self.features.scaled and not same_side:
            return f"side {sides[0]:.6g} um, trained on {side_x:.6g} um"
        return ""

    def _spacing_note(self, shape: tuple[int, ...], sides: tuple[float, ...]) -> str:
        """Return how the spacing differs along the first axis where it does, or ""."""
        if self.features.scaled or NODES in self.features.columns:
            return ""
        for nodes, side, trained in zip(shape, sides, self.card["spacing"], strict=True):
            spacing = node_spacing(max(nodes, 2), side, self.boundary)
            if not np.isclose(spacing, trained, rtol=SAME_SPACING):
                return f"spacing {spacing:.4g} um, trained on {trained:.4g} um"
        return ""


def _features_of(card: Mapping[str, Any]) -> FeatureSet:
    """Return the feature set that a card describes."""
    columns = tuple(name for name, _unit in card["columns"])
    load = str(card.get("load") or "delta")
    if card["features"] == SCENE:
        load = plain(columns[-1])
    return replace(
        SETS[card["features"]],
        columns=columns,
        blocks=int(card.get("blocks", 0)),
        load=load,
        elastic=bool(card.get("elastic")),
    )


def _for_all_rows(notes: Sequence[str], number: int) -> list[str]:
    """Return a note for each row, of none, one for all rows, or as many as there are rows."""
    if not notes:
        return [""] * number
    if len(notes) == 1:
        return list(notes) * number
    return list(notes)


def between(limits: tuple[float, float]) -> str:
    """Write a range of the hardness over E*.

    Parameters
    ----------
    limits : (float, float)
        Smallest and largest hardness over E*.

    Returns
    -------
    str
        As "0.003 to 0.1", or "0.01" if both are equal.
    """
    low, high = limits
    if low == high:
        return f"{low:.4g}"
    return f"{low:.4g} to {high:.4g}"
