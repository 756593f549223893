"""Targets without known powers of heights, lengths and E*, which hold at the training's scale only.

Features without units serve surfaces of any size and bodies of any E*, because each target is
divided by its scale before it is learnt. The scale is a product of powers of heights, lengths and
E*, which must be known. They are unknown for the result of a user's function, which may depend on a
length or a stress that is fixed in the function; databases of earlier versions do not state them
either. Predictions of a target without known powers hold at heights, lengths and E* of the training
only. Rows outside these ranges are flagged.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from gen.arrays import Indices, Values
from gen.quantities import Powers
from learn.features.columns import STATISTICS
from learn.features.rows import Rows
from learn.features.sets import FeatureSet
from learn.surrogate.training import Training

if TYPE_CHECKING:
    from learn.database_rows import Dataset

# Place of the rms height among the statistics.
RMS_HEIGHT = STATISTICS.index("height_rms")
# Largest relative distance outside a training range with which a number is not flagged. It leaves
# room for rounding only.
TOLERANCE = 1e-6
# Text for the user on a target without known powers; it follows the name of the target.
NO_POWERS = (
    "has no known powers of heights, lengths and E*: it holds at those of the training alone, and"
    " everything else is flagged"
)
# Names of the three numbers of the scale in cards and messages, and their units.
HEIGHT = "rms height"
LENGTH = "scan length L"
MODULUS = "E*"
UNITS = {HEIGHT: "um", LENGTH: "um", MODULUS: "MPa"}


def keeps_its_scale(powers: Powers | None, features: FeatureSet) -> bool:
    """Return whether the predictions of a target hold at every scale that the features serve.

    Parameters
    ----------
    powers : Powers or None
        Powers of heights, lengths and E* that the target scales with; None if they are unknown.
    features : FeatureSet
        Features that the target is learnt from.

    Returns
    -------
    bool
        False if predictions hold at the scale of the training only. Always True for features of a
        scene, whose rows have no other scale than the scene's.
    """
    return powers is not None or features.of_scene


def scale_ranges(rows: Dataset, train: Indices) -> dict[str, list[float]]:
    """Return the ranges of the three numbers of the scale over the training rows.

    The card of a surrogate keeps them if a target holds at the scale of the training only.

    Parameters
    ----------
    rows : Dataset
        The usable rows.
    train : ndarray, shape (m,)
        Positions of the training rows among them.

    Returns
    -------
    dict of str to list of float
        [smallest, largest] by the names `HEIGHT` [um], `LENGTH` [um] and `MODULUS` [MPa].
        Heights are from the training rows, lengths and E* from the scenes of all databases.
    """
    scenes = [origin.scene for origin in rows.origins]
    lengths = [float(np.sqrt(np.prod(scene.grid.sides))) for scene in scenes]
    moduli = [e_star for scene in scenes for e_star in scene.contact.e_star_limits]
    # The first column of `described` is Delta, the other ones are the statistics.
    rms_heights = rows.described[train, 1 + RMS_HEIGHT]
    return {
        HEIGHT: _ends(rms_heights),
        LENGTH: _ends(lengths),
        MODULUS: _ends(moduli),
    }


def _ends(values: Values | Sequence[float]) -> list[float]:
    """Return the smallest and the largest value as a list of two."""
    return [float(np.min(values)), float(np.max(values))]


def scale_notes(
    training: Training, targets: Sequence[str], rows: Rows, e_star: float | None
) -> list[str]:
    """Return a note for each row whose heights, lengths or E* are outside the training.

    Parameters
    ----------
    training : Training
        The training of a surrogate.
    targets : sequence of str
        Names of the targets that hold at the scale of the training only.
    rows : Rows
        n rows to predict.
    e_star : float or None
        E* of the prediction [MPa]; None for that of the training.

    Returns
    -------
    list of str
        One text for each row, with "; " between the notes on several numbers. It is "" for a row
        with all numbers inside their training ranges, and for all rows if `targets` is empty.
    """
    number = len(rows.delta)
    if not targets:
        return [""] * number
    notes: list[list[str]] = [[] for _ in range(number)]
    for name, values in _scale_of(rows, training, e_star).items():
        low, high = _trained_range(training, name)
        above_low = values >= low * (1 - TOLERANCE)
        below_high = values <= high * (1 + TOLERANCE)
        for row in np.flatnonzero(~(above_low & below_high)):
            notes[row].append(
                f"{name} {values[row]:.4g} {UNITS[name]} outside {low:.4g} to {high:.4g}, the only"
                f" scale of {', '.join(targets)}"
            )
    return ["; ".join(lines) for lines in notes]


def _scale_of(
    rows: Rows, training: Training, e_star: float | None
) -> Mapping[str, Values]:
    """Return the numbers of n rows that have to be inside training ranges, (n,) each, by name.

    E* [MPa] is always one of these numbers. Rms heights and scan lengths [um] are for features
    without units only: features with units include the heights, and `Training.grid_note` compares
    the side. `e_star` is the E* of the prediction [MPa]; None for the E* of the training.
    """
    number = len(rows.delta)
    modulus: Values | float = training.modulus
    if rows.layers is not None:
        modulus = rows.layers.e_star
    elif e_star is not None:
        modulus = e_star
    scale = {MODULUS: np.full(number, modulus)}
    if training.features.scaled:
        scale[HEIGHT] = rows.statistics[:, RMS_HEIGHT]
        scale[LENGTH] = np.full(number, rows.length)
    return scale


def _trained_range(training: Training, name: str) -> tuple[float, float]:
    """Return the smallest and largest value in the training of one number of the scale.

    `name` is `HEIGHT` [um], `LENGTH` [um] or `MODULUS` [MPa]. Cards of files of format 9 and before
    do not keep these ranges, which then follow from the other entries of the card.
    """
    card = training.card
    if "own_scale" in card:
        low, high = card["own_scale"][name]
        return low, high
    if name == HEIGHT:
        return _range_of_heights(training)
    if name == MODULUS:
        return training.modulus, training.modulus
    # `name` is `LENGTH`. The card of a single database has the entries of this database itself.
    sides = [entry["side"] for entry in card.get("databases", [card])]
    lengths = [float(np.sqrt(np.prod(side))) for side in sides]
    return min(lengths), max(lengths)


def _range_of_heights(training: Training) -> tuple[float, float]:
    """Return a range [um] that includes the rms heights of the training.

    It may be wider than their range. It follows from the ranges of Delta and of the features
    `delta/h` and `height_rms/h`, because the rms height is Delta times `height_rms/h` over
    `delta/h`.
    """
    columns = training.features.columns
    delta = columns.index("delta/h")
    rms = columns.index("height_rms/h")
    smallest_delta, largest_delta = training.card["delta"]
    smallest = smallest_delta * float(training.low[rms] / training.high[delta])
    largest = largest_delta * float(training.high[rms] / training.low[delta])
    return smallest, largest
