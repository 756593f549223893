"""How sure the scores of a comparison are: bootstrap intervals over the surfaces of the test rows."""

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
    record, groups = folder.record(), folder.test_groups()
    known = {place: folder.prediction(*reversed(place)) for place in places}
    truth, _ = known[places[0]]
    found: dict[Place, dict[str, tuple[float, float]]] = {}
    for (model, kind), pair in known.items() if groups is not None else ():
        if pair[0].size != groups.size:
            raise InputError(
                f"{folder.path / 'rows.csv'} has {groups.size} test rows, {kind}/{model}.csv has"
                f" {pair[0].size}: move one of them away"
            )
        found[model, kind] = _drawn(folder, model, kind, pair, groups)
    drawn = "tiles" if record.get("split_by_tile") else "surfaces"
    drawn = drawn if record.get("split_by_surface", True) else "rows"
    number = 0 if groups is None else len(set(groups.tolist()))
    found = {place: ends for place, ends in found.items() if ends}
    named = "" if groups is None else drawn
    return Intervals(found, named, number, spread(truth), frozenset(places))


def _drawn(
    folder: Folder, model: str, kind: str, pair: tuple[Values, Values], groups: Values
) -> dict[str, tuple[float, float]]:
    """Return the intervals of one result; predictions without scores are damaged."""
    try:
        return bootstrap(*pair, LEVEL, groups)
    except ValueError as error:
        raise InputError(f"{folder.path / kind / model}.csv cannot be read: {error}") from None
