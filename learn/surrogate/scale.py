"""The scale that a surrogate holds at, where a target scales with no known power of it.

Features without units serve surfaces of any size and bodies of any E*, because targets are learnt
over their scale. That needs a target with known powers of heights, lengths and E*. The result of a
user's function may depend on a length or a stress that is fixed in the function, and databases of
earlier versions do not tell. Such a target holds at heights, lengths and E* of the training alone,
and everything else is flagged.
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

RMS_HEIGHT = STATISTICS.index("height_rms")  # column of the statistics
# relative distance beyond a range of the training up to which a number still counts as inside
TOLERANCE = 1e-6
NO_POWERS = (
    "has no known powers of heights, lengths and E*: it holds at those of the training alone, and"
    " everything else is flagged"
)
# names of the three numbers in cards and messages, and their units
HEIGHT = "rms height"
LENGTH = "scan length L"
MODULUS = "E*"
UNITS = {HEIGHT: "um", LENGTH: "um", MODULUS: "MPa"}


def keeps_its_scale(powers: Powers | None, features: FeatureSet) -> bool:
    """Return whether a target is known at every scale that the features serve.

    Parameters
    ----------
    powers : Powers or None
        Powers of heights, lengths and E* that the target scales with; None if they are unknown.
    features : FeatureSet
        Features of the target; those of a scene have no other scale than the scene's.

    Returns
    -------
    bool
        False if the target holds at the scale of the training alone.
    """
    return powers is not None or features.of_scene


def scale_ranges(rows: Dataset, train: Indices) -> dict[str, list[float]]:
    """Return the scale of training rows, for the card of targets that hold at this scale alone.

    Parameters
    ----------
    rows : Dataset
        The usable rows.
    train : ndarray, shape (m,)
        Positions of the training rows.

    Returns
    -------
    dict of str to list of float
        Smallest and largest rms height [um], scan length [um] and E* [MPa].
    """
    scenes = [origin.scene for origin in rows.origins]
    lengths = [float(np.sqrt(np.prod(scene.grid.sides))) for scene in scenes]
    moduli = [scene.contact.e_star for scene in scenes]
    # Delta stands before the statistics.
    return {
        HEIGHT: _ends(rows.described[train, 1 + RMS_HEIGHT]),
        LENGTH: _ends(lengths),
        MODULUS: _ends(moduli),
    }


def _ends(values: Values | Sequence[float]) -> list[float]:
    """Return the smallest and the largest value."""
    return [float(np.min(values)), float(np.max(values))]


def scale_notes(
    training: Training, targets: Sequence[str], rows: Rows, e_star: float | None
) -> list[str]:
    """Name for each row what is outside the scale that some targets hold at.

    Parameters
    ----------
    training : Training
        The training of a surrogate.
    targets : sequence of str
        Names of its targets that hold at the scale of the training alone.
    rows : Rows
        n rows to predict.
    e_star : float or None
        E* of the prediction [MPa]; None for that of the training.

    Returns
    -------
    list of str
        A note for each row; "" for a row inside this scale.
    """
    number = len(rows.delta)
    if not targets:
        return [""] * number
    notes: list[list[str]] = [[] for _ in range(number)]
    for name, values in _scale_of(rows, training, e_star).items():
        low, high = _trained_range(training, name)
        inside = (values >= low * (1 - TOLERANCE)) & (values <= high * (1 + TOLERANCE))
        for row in np.flatnonzero(~inside):
            notes[row].append(
                f"{name} {values[row]:.4g} {UNITS[name]} outside {low:.4g} to {high:.4g}, the only"
                f" scale of {', '.join(targets)}"
            )
    return ["; ".join(lines) for lines in notes]


def _scale_of(
    rows: Rows, training: Training, e_star: float | None
) -> Mapping[str, Values]:
    """Return E* [MPa], and for features without units heights and lengths [um], each (n,).

    Features with units have heights among them, and their side is compared with the grid.
    """
    number = len(rows.delta)
    modulus = training.modulus if e_star is None else e_star
    scale = {MODULUS: np.full(number, modulus)}
    if training.features.scaled:
        scale[HEIGHT] = rows.statistics[:, RMS_HEIGHT]
        scale[LENGTH] = np.full(number, rows.length)
    return scale


def _trained_range(training: Training, name: str) -> tuple[float, float]:
    """Return a range of the training; cards of older files tell it by other numbers."""
    card = training.card
    if "own_scale" in card:
        low, high = card["own_scale"][name]
        return low, high
    if name == HEIGHT:
        return _range_of_heights(training)
    if name == MODULUS:
        return training.modulus, training.modulus
    sides = [entry["side"] for entry in card.get("databases", [card])]
    lengths = [float(np.sqrt(np.prod(side))) for side in sides]
    return min(lengths), max(lengths)


def _range_of_heights(training: Training) -> tuple[float, float]:
    """Return the widest range of rms heights [um] that Delta and two features over h allow."""
    columns = training.features.columns
    delta = columns.index("delta/h")
    rms = columns.index("height_rms/h")
    smallest_delta, largest_delta = training.card["delta"]
    smallest = smallest_delta * float(training.low[rms] / training.high[delta])
    largest = largest_delta * float(training.high[rms] / training.low[delta])
    return smallest, largest
