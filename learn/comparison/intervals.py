"""How sure the scores of a comparison are: bootstrap intervals, drawn by surface.

Rows of one surface, or of one tile of a map, are drawn together.
"""

from typing import NamedTuple

from gen.runtime.errors import InputError
from learn.arrays import Values
from learn.comparison.folder import Folder
from learn.metrics import BOOTSTRAP, LEVEL, bootstrap, spread

__all__ = ["BOOTSTRAP", "LEVEL", "Intervals", "of"]

Place = tuple[str, str]
"""Model and kind of a result."""


class Intervals(NamedTuple):
    """Intervals of the scores on the test rows.

    Attributes
    ----------
    of : dict
        Low and high of each score that has an interval [%], by model and kind; empty if the folder
        does not say which rows belong together, or all are of one group.
    drawn : str
        What is drawn, "surfaces", "tiles" or "rows"; "" if the folder does not say.
    groups : int
        Number of them among the test rows.
    spread : float
        Variance of the solved values of the test rows over their mean, in the target's unit.
    scored : frozenset
        Model and kind of all results that have scores.
    """

    of: dict[Place, dict[str, tuple[float, float]]]
    drawn: str
    groups: int
    spread: float
    scored: frozenset[Place]


def of(folder: Folder) -> Intervals | None:
    """Draw the intervals of all results of a folder.

    Parameters
    ----------
    folder : Folder
        The folder of a target.

    Returns
    -------
    Intervals or None
        None if the folder has no result with scores.

    Raises
    ------
    InputError
        If predictions or groups are damaged.
    """
    places = [(m, kind) for m, kind, result in folder.results() if result.get("test")]
    if not places:
        return None
    known = {place: folder.prediction(*reversed(place)) for place in places}
    middle, scored = spread(known[places[0]][0]), frozenset(places)
    record, groups = folder.record(), folder.test_groups()
    if groups is None:
        return Intervals({}, "", 0, middle, scored)
    found = {place: _drawn(folder, place, pair, groups) for place, pair in known.items()}
    drawn = "tiles" if record.get("split_by_tile") else "surfaces"
    drawn = drawn if record.get("split_by_surface", True) else "rows"
    number = len(set(groups.tolist()))
    return Intervals({p: ends for p, ends in found.items() if ends}, drawn, number, middle, scored)


def _drawn(
    folder: Folder, place: Place, pair: tuple[Values, Values], groups: Values
) -> dict[str, tuple[float, float]]:
    """Return the intervals of one result; predictions without scores are damaged."""
    path = folder.path / place[1] / f"{place[0]}.csv"
    if pair[0].size != groups.size:
        raise InputError(
            f"{path} has {pair[0].size} rows, rows.csv has {groups.size} test rows: move it away"
        )
    try:
        return bootstrap(*pair, LEVEL, groups)
    except ValueError as error:
        raise InputError(f"{path} cannot be read: {error}: move it away") from None
