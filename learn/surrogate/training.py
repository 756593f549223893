"""The training of a surrogate, and how rows to predict differ from it.

A row is flagged if it differs from the training: a feature is outside its range by more than a
small margin (`gen.ranges`), the distance from the training is large (`learn.surrogate.interval`),
or the grid or the hardness is not one of the training's.
`Training.reasons` says in words what differs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from bem.problem import Boundary, node_spacing
from gen.arrays import Values
from learn.features.columns import BASE_RATIO, NODES
from learn.features.layers import SAME, TrainedLayers
from learn.features.rows import Rows
from learn.features.scene import SCENE, plain
from learn.features.sets import SETS, FeatureSet
from learn.surrogate.interval import Distance

# Largest relative differences from the training with which a row is not flagged.
SAME_HARDNESS = 1e-6  # room for rounding only
SAME_SIDE = 1e-3
SAME_SPACING = 0.02  # maps of one instrument rarely have exactly equal spacings


@dataclass(frozen=True, eq=False)
class Training:
    """The facts about a surrogate's training that predictions need."""

    card: Mapping[str, Any]  # card of the surrogate, from `learn.surrogate.card.make`
    features: FeatureSet  # feature set that the models were trained on
    low: Values  # (d,), smallest value of each feature
    high: Values  # (d,), largest value of each feature
    distance: Distance  # measures distances from the training; has the limit of the flag
    modulus: float  # E* [MPa]
    boundary: Boundary  # boundary of the patches
    # smallest and largest hardness over E* of the bodies that yield; None if all are elastic
    hardness_limits: tuple[float, float] | None = None
    layers: TrainedLayers | None = None  # layers of the bodies; None for half-spaces

    @classmethod
    def of(
        cls, card: Mapping[str, Any], low: Values, high: Values, distance: Distance
    ) -> Training:
        """Make the training of a surrogate from its card, ranges and distances.

        Parameters
        ----------
        card : mapping of str to object
            Card of the surrogate.
        low, high : ndarray, shape (d,)
            Smallest and largest value of each feature in the training.
        distance : Distance
            Distances from the training.

        Returns
        -------
        Training
            The training.
        """
        # Cards state a hardness only if some bodies yield, and a boundary only if it is not free.
        limits = card.get("hardness_ratio")
        if limits is not None:
            limits = (float(limits[0]), float(limits[1]))
        layers: TrainedLayers | None = None
        if "layers" in card:
            layers = TrainedLayers.of_card(card["layers"])
        return cls(
            card=card,
            features=_features_of(card),
            low=low,
            high=high,
            distance=distance,
            modulus=float(card["modulus"]),
            boundary=card.get("boundary", "free"),
            hardness_limits=limits,
            layers=layers,
        )

    def reasons(self, rows: Rows, inputs: Values) -> list[str]:
        """Say for each row how it differs from the training.

        Parameters
        ----------
        rows : Rows
            n rows to predict.
        inputs : ndarray, shape (n, d)
            Features of the rows.

        Returns
        -------
        list of str
            One text for each row, of notes with "; " between them: first `rows.notes`, then the
            notes on grid, hardness, layer, distance and features. "" for a row inside the training.
        """
        number = len(inputs)
        # Many rows share a grid, so that each grid is compared once.
        note_of_grid = {
            grid: self.grid_note(grid.shape, grid.sides) for grid in set(rows.grids)
        }
        grid_notes = [note_of_grid[grid] for grid in rows.grids]
        columns = [
            _one_for_each_row(rows.notes, number),
            _one_for_each_row(grid_notes, number),
            self._hardness_notes(rows, number),
            self._layer_notes(rows, number),
            self._distance_notes(inputs),
            self._range_notes(inputs),
        ]
        return ["; ".join(filter(None, notes)) for notes in zip(*columns, strict=True)]

    def _hardness_notes(self, rows: Rows, number: int) -> list[str]:
        """Return a note for each row whose hardness is outside the training's, else "".

        `number` is the number of rows. If all bodies of the training, or those of the rows, are
        elastic, no row has a note.
        """
        notes = [""] * number
        if self.hardness_limits is None or rows.hardness_ratio is None:
            return notes
        low, high = self.hardness_limits
        if self.features.elastic:
            # The training has elastic bodies, too: no hardness is too large.
            high = np.inf
        ratios = np.broadcast_to(rows.hardness_ratio, number)
        inside = ratios >= low * (1 - SAME_HARDNESS)
        inside &= ratios <= high * (1 + SAME_HARDNESS)
        for row in np.flatnonzero(~inside):
            notes[row] = f"hardness/E* {ratios[row]:.4g} outside {low:.4g} to {high:.4g}"
        return notes

    def _layer_notes(self, rows: Rows, number: int) -> list[str]:
        """Return a note for each row whose layer has a ratio of moduli outside the training's.

        `number` is the number of rows. If the ratio is a feature, its range decides instead.
        """
        notes = [""] * number
        is_feature = BASE_RATIO in self.features.columns
        if rows.layers is None or self.layers is None or is_feature:
            return notes
        if self.layers.base_ratio is None:  # a rigid base has no modulus
            return notes
        low, high = self.layers.base_ratio
        ratios = np.broadcast_to(rows.layers.base_ratio, number)
        inside = ratios >= low * (1 - SAME)
        inside &= ratios <= high * (1 + SAME)
        for row in np.flatnonzero(~inside):
            notes[row] = f"base's E*/E* {ratios[row]:.4g} outside {low:.4g} to {high:.4g}"
        return notes

    def _distance_notes(self, inputs: Values) -> list[str]:
        """Return a note for each row whose distance from the training is beyond the limit, else "".

        `inputs` are the features of n rows, (n, d). A NaN distance is not beyond the limit.
        """
        notes = [""] * len(inputs)
        limit = self.distance.limit
        distances = self.distance.of(inputs)
        for row in np.flatnonzero(distances > limit):
            notes[row] = (
                f"distance from the training {distances[row]:.4g} outside 0 to {limit:.4g}"
            )
        return notes

    def _range_notes(self, inputs: Values) -> list[str]:
        """Return a note for each row on its features outside their training ranges, else "".

        Features within the margins of the ranges, see `FeatureSet.margins`, are not outside.
        `inputs` are the features of n rows, (n, d). A note shows the features as `FeatureSet.shown`
        does, without the logarithms of a scene.
        """
        notes = [""] * len(inputs)
        outside = self.features.is_outside(inputs, self.low, self.high)
        values = self.features.shown(inputs)
        low = self.features.shown(self.low)
        high = self.features.shown(self.high)
        names = self.features.names
        for row in np.flatnonzero(outside.any(axis=1)):
            notes_on_features = [
                f"{names[place]} {values[row, place]:.4g} outside {low[place]:.4g} to"
                f" {high[place]:.4g}"
                for place in np.flatnonzero(outside[row])
            ]
            notes[row] = "; ".join(notes_on_features)
        return notes

    def grid_note(self, shape: tuple[int, ...], sides: tuple[float, ...]) -> str:
        """Say how a grid differs from the grids of the training.

        Nodes and the ratio of the sides are always compared. Side and spacing are compared for
        features with units only: features without units serve patches of any size.

        Parameters
        ----------
        shape : (int, int)
            Number of nodes along x and y.
        sides : (float, float)
            Lengths of the patch along x and y [um].

        Returns
        -------
        str
            Notes on the differences, with "; " between them; "" if there are none.
        """
        notes = [
            self._nodes_note(shape),
            self._sides_note(sides),
            self._spacing_note(shape, sides),
        ]
        return "; ".join(filter(None, notes))

    def _nodes_note(self, shape: tuple[int, ...]) -> str:
        """Return a note if no database of the training has this number of nodes, else "".

        Where the number of nodes is a feature, the training range of this feature decides instead.
        """
        # The card of a single database has the entries of this database itself.
        databases = self.card.get("databases", [self.card])
        grids = list(dict.fromkeys(tuple(entry["nodes"]) for entry in databases))
        if NODES in self.features.columns or shape in grids:
            return ""
        trained = ", ".join(f"{nodes[0]:g} x {nodes[1]:g}" for nodes in grids)
        return f"{shape[0]} x {shape[1]} nodes, trained on {trained}"

    def _sides_note(self, sides: tuple[float, ...]) -> str:
        """Return a note if the ratio of the sides differs from the training's, else "".

        For features with units, an equal ratio but another side [um] has a note too.
        """
        side_x, side_y = self.card["side"]
        same_ratio = np.isclose(sides[0] * side_y, sides[1] * side_x, rtol=SAME_SIDE)
        if not same_ratio:
            trained = f"{side_x:.6g} x {side_y:.6g} um"
            if side_x == side_y:
                trained = "square patches"
            return f"{sides[0]:.6g} x {sides[1]:.6g} um, trained on {trained}"
        same_side = np.isclose(sides[0], side_x, rtol=SAME_SIDE)
        if not self.features.scaled and not same_side:
            return f"side {sides[0]:.6g} um, trained on {side_x:.6g} um"
        return ""

    def _spacing_note(self, shape: tuple[int, ...], sides: tuple[float, ...]) -> str:
        """Return a note on the first axis whose spacing [um] differs from the training's, else "".

        Features without units, and features with the number of nodes among them, allow any spacing.
        """
        if self.features.scaled or NODES in self.features.columns:
            return ""
        for nodes, side, trained in zip(shape, sides, self.card["spacing"], strict=True):
            # A single node has no spacing; its grid has a note on the nodes already.
            spacing = node_spacing(max(nodes, 2), side, self.boundary)
            if not np.isclose(spacing, trained, rtol=SAME_SPACING):
                return f"spacing {spacing:.4g} um, trained on {trained:.4g} um"
        return ""


def _features_of(card: Mapping[str, Any]) -> FeatureSet:
    """Rebuild the feature set that the models were trained on from the card of their surrogate.

    It is the set of `SETS` that the card names, with the columns, coarse blocks, load and elastic
    bodies of the training.
    """
    # Cards leave out these three entries for a load by Delta, no blocks, and one kind of bodies.
    load = card.get("load") or "delta"
    blocks = card.get("blocks", 0)
    elastic = card.get("elastic", False)
    columns = tuple(name for name, _unit in card["columns"])
    if card["features"] == SCENE:
        # The load is the last feature of a scene; `plain` takes "log(...)" off its column.
        load = plain(columns[-1])
    return replace(
        SETS[card["features"]],
        columns=columns,
        blocks=int(blocks),
        load=str(load),
        elastic=bool(elastic),
    )


def _one_for_each_row(notes: Sequence[str], number: int) -> list[str]:
    """Return one note for each of n rows.

    `notes` are n notes, a single note that holds for all rows, or none, which gives "" for all.
    """
    if not notes:
        return [""] * number
    if len(notes) == 1:
        return list(notes) * number
    return list(notes)


def hardness_range_text(limits: tuple[float, float]) -> str:
    """Write a range of the hardness over E* for people.

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
