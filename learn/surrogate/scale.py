"""The scale that a surrogate holds at, where a target scales with no known power of it.

Features without units serve surfaces of any size and bodies of any E*, because targets are learnt
over their scale. A target without powers of heights, lengths and E* cannot be: what a user's
function returns may hold a length or a stress of its own, and databases of earlier versions do not
tell. Such a target holds at heights, lengths and E* of the training alone, and everything else is
flagged.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from gen.arrays import Indices
from learn.features.columns import STATISTICS
from learn.features.rows import Rows
from learn.features.sets import FeatureSet

if TYPE_CHECKING:
    from learn.database_rows import Dataset
    from learn.surrogate.learnt import Learnt
    from learn.surrogate.model import Surrogate

RMS_HEIGHT = STATISTICS.index("height_rms")  # place among the statistics
SAME = 1e-6  # relative distance beyond a range of the training within which two numbers are equal
OWN_SCALE = (
    "has no known powers of heights, lengths and E*: it holds at those of the training alone, and"
    " everything else is flagged"
)
HEIGHT, LENGTH, MODULUS = (
    "rms height",
    "scan length L",
    "E*",
)  # of the training, in messages
UNITS = {HEIGHT: "um", LENGTH: "um", MODULUS: "MPa"}


def keeps_its_scale(learnt: Learnt, features: FeatureSet) -> bool:
    """Return whether a target is known at every scale that the features serve.

    Parameters
    ----------
    learnt : Learnt
        The fitted target.
    features : FeatureSet
        Its features; those of a scene have no other scale than the scene's.

    Returns
    -------
    bool
        False if the target holds at the scale of the training alone.
    """
    return learnt.powers is not None or features.of_scene


def own_scale(
    sets: Sequence[Dataset], learnt: Iterable[Learnt], train: Indices
) -> dict[str, dict[str, list[float]]]:
    """Return the entry of the card about the scale of the training, if a target needs it.

    Parameters
    ----------
    sets : sequence of Dataset
        The usable rows, for each target.
    learnt : iterable of Learnt
        The fitted targets.
    train : ndarray, shape (m,)
        Positions of the training rows.

    Returns
    -------
    dict
        Nothing if every target scales with known powers; else "own_scale" with the least and the
        largest rms height, scan length [um] and E* [MPa].
    """
    rows = sets[0]
    if all(keeps_its_scale(target, rows.features) for target in learnt):
        return {}
    heights = rows.described[train, 1 + RMS_HEIGHT]
    scenes = [origin.scene for origin in rows.origins]
    lengths = [float(np.sqrt(np.prod(scene.grid.sides))) for scene in scenes]
    moduli = [scene.contact.e_star for scene in scenes]
    ranges = {HEIGHT: heights, LENGTH: lengths, MODULUS: moduli}
    ends = {
        name: [float(np.min(each)), float(np.max(each))] for name, each in ranges.items()
    }
    return {"own_scale": ends}


def scale_notes(surrogate: Surrogate, rows: Rows, e_star: float | None) -> list[str]:
    """Say of each row why it is outside the scale that some target holds at; "" if it is inside.

    Parameters
    ----------
    surrogate : Surrogate
        The surrogate.
    rows : Rows
        n rows to predict.
    e_star : float or None
        E* of the prediction [MPa]; None for that of the training.

    Returns
    -------
    list of str
        A note for each row.
    """
    features = surrogate.features
    notes: list[list[str]] = [[] for _ in rows.delta]
    bound = [
        name
        for name, learnt in surrogate.learnt.items()
        if not keeps_its_scale(learnt, features)
    ]
    if not bound:
        return [""] * len(notes)
    scale = {
        MODULUS: np.full(len(notes), surrogate.modulus if e_star is None else e_star)
    }
    if (
        features.scaled
    ):  # features with units have heights, and their side is compared elsewhere
        scale[HEIGHT] = rows.statistics[:, RMS_HEIGHT]
        scale[LENGTH] = np.full(len(notes), rows.length)
    for name, values in scale.items():
        low, high = _range(surrogate, name)
        outside = ~((values >= low * (1 - SAME)) & (values <= high * (1 + SAME)))
        for row in np.flatnonzero(outside):
            notes[row].append(
                f"{name} {values[row]:.4g} {UNITS[name]} outside {low:.4g} to {high:.4g}, the only"
                f" scale of {', '.join(bound)}"
            )
    return ["; ".join(lines) for lines in notes]


def _range(surrogate: Surrogate, name: str) -> tuple[float, float]:
    """Return a range of the training; of older files, what their cards tell of it."""
    card: dict[str, Any] = surrogate.card
    if "own_scale" in card:
        low, high = card["own_scale"][name]
        return low, high
    if name == HEIGHT:
        return _heights_of(surrogate)
    if name == MODULUS:
        return surrogate.modulus, surrogate.modulus
    sides = [entry["side"] for entry in card.get("databases", [card])]
    lengths = [float(np.sqrt(np.prod(side))) for side in sides]
    return min(lengths), max(lengths)


def _heights_of(surrogate: Surrogate) -> tuple[float, float]:
    """Return the widest range of rms heights that follows from Delta and two features over h."""
    columns = surrogate.features.columns
    delta, rms = columns.index("delta/h"), columns.index("height_rms/h")
    low, high = surrogate.low, surrogate.high
    least, most = surrogate.card["delta"]
    return least * float(low[rms] / high[delta]), most * float(high[rms] / low[delta])
