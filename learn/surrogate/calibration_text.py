"""The card's entry on the calibration of the intervals: its fields, and its words."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

from gen.runtime.errors import InputError
from learn.surrogate.parts import Part, count, mapping, text

if TYPE_CHECKING:
    from learn.surrogate.learnt import Learnt

ROUNDING = 1e-9
"""Difference up to which a level counts as the largest one."""

FEWEST = 9
"""Smallest number of groups whose intervals of 90 % hold for other groups too."""


class Calibrated(NamedTuple):
    """How intervals are calibrated, if not by held-out rows of the only map or database.

    Attributes
    ----------
    scheme : {"ranges", "each", "others"}
        Classes that intervals hold for (`learn.surrogate.conformal`).
    kind : str
        "map" or "database": what the groups are.
    groups : int
        Number of groups.
    database : str
        Database of the rows that calibrate; "" if the training rows do.
    sha256 : str
        Its fingerprint.
    """

    scheme: str
    kind: str
    groups: int
    database: str = ""
    sha256: str = ""


def check(card: Part) -> None:
    """Refuse an entry that is incomplete; a card without one is whole.

    Raises
    ------
    ValueError
        If the entry is wrong; the message names it.
    """
    if "calibration" not in card:
        return
    entry = mapping(card, "calibration")
    scheme = text(entry, "scheme", ("ranges", "each", "others"))
    text(entry, "kind", ("map", "database"))
    groups = count(entry, "groups", 1)
    text(entry, "database")
    text(entry, "sha256")
    if (groups >= FEWEST) != (scheme == "others") or (groups == 1) != (scheme == "ranges"):
        raise ValueError(f"intervals of {groups} groups are calibrated by {scheme}")


def counted(card: Mapping[str, Any]) -> str:
    """Say by how many groups, or rows, intervals are calibrated: "17 maps"."""
    entry = card.get("calibration")
    if entry is None or entry["scheme"] == "ranges":
        return f"{card['rows']['calibration']} rows"
    groups = f"{entry['groups']} {entry['kind']}s"
    return groups if entry["scheme"] == "others" else f"the rows of {groups}"


def require_level(card: Mapping[str, Any], learnt: Mapping[str, Learnt], level: float) -> None:
    """Refuse a level of intervals that has too few groups or rows to be calibrated.

    Parameters
    ----------
    card : mapping of str to object
        Card of the surrogate.
    learnt : mapping of str to Learnt
        Its models by target.
    level : float
        Wanted coverage.

    Raises
    ------
    InputError
        With the largest level.
    """
    for name, each in learnt.items():
        largest = each.calibration.largest_level
        if level > largest + ROUNDING:
            by = counted(card)
            raise InputError(
                f"--interval {level:g}: intervals of {name} are calibrated by {by}, which"
                f" reach {math.floor(1000 * largest) / 1000:g} at most: give less"
            )


def line(card: Mapping[str, Any]) -> str:
    """Say by what intervals are calibrated and what they hold for; "" for held-out rows."""
    if "calibration" not in card:
        return ""
    entry = Calibrated(**card["calibration"])
    kinds = f"{entry.kind}s"
    origin = f" of {entry.database}" if entry.database else ""
    if entry.scheme == "ranges":
        return f"calibrated by {card['rows']['calibration']} rows{origin}: hold for rows like these"
    if entry.scheme == "each":
        return (
            f"calibrated on each of {entry.groups} {kinds}{origin}: hold for further surfaces of"
            f" these {kinds}; for others, {FEWEST} {kinds} or more are needed"
        )
    how = "" if entry.database else ", each predicted without it"
    return (
        f"calibrated by whole {kinds}{origin} ({entry.groups} of them{how}): hold for other"
        f" {kinds} like these, up to {100 * entry.groups / (entry.groups + 1):.1f} %"
    )
