"""What is asked of a database: rows, targets, features, models; and what its surfaces add."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from gen.runtime import farm
from gen.runtime.errors import InputError
from learn import features
from learn.arrays import Values
from learn.comparison.spaces import Space
from learn.models import NORMALISATIONS


@dataclass(frozen=True)
class Request:
    """What to compare and where.

    Attributes
    ----------
    database : made by `gen`
    output : the comparison folder
    targets : one or more of "area", "force" or further columns
    models : names; all nine for none
    area_max : largest area that is kept [%], None for all
    normalisation : one of `learn.models.NORMALISATIONS`
    features : a name of `learn.features.SETS`
    seed : of the split and of the models
    train_rows : training rows at most, None for all
    again : True to measure anew what is there
    limit : time for the searches [s], None for whole grids
    spaces : search spaces by model, None for those of the features (`learn.comparison.spaces`)
    """

    database: Path
    output: Path
    targets: tuple[str, ...] = ("area",)
    models: tuple[str, ...] = ()
    area_max: float | None = None
    normalisation: str = "l2"
    features: str = "paper"
    seed: int = 0
    train_rows: int | None = None
    again: bool = False
    limit: float | None = None
    spaces: Mapping[str, Space] | None = None

    def __post_init__(self) -> None:
        """Refuse what needs no file to be seen wrong; raises InputError."""
        if self.normalisation not in NORMALISATIONS:
            known = ", ".join(NORMALISATIONS)
            raise InputError(f"--normalise {self.normalisation!r}: give one of {known}")


def pressed_for(request: Request, world: farm.World, stopping: Callable[[], bool]) -> Values | None:
    """What the database's surfaces add to the features, if they need it; collective.

    Parameters
    ----------
    request : says which features
    world : whose processes generate the surfaces
    stopping : asked on the master between surfaces
    """
    if not features.chosen(request.features).needs_surface:
        return None
    from learn.features.regeneration import pressed_rows

    return pressed_rows(request.database, world, stopping)
