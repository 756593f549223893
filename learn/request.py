"""A request to learn from a database: its rows, targets, features and models."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from gen.runtime.errors import InputError
from learn import features
from learn.arrays import Values
from learn.executor import Executor
from learn.features.sets import BLOCKS
from learn.models import NORMALISATIONS


@dataclass(frozen=True)
class Request:
    """A comparison or a fit to be made.

    Attributes
    ----------
    database : Path
        A database made by `gen`.
    output : Path
        The comparison folder, or the file of the surrogate.
    targets : tuple of str
        Names of targets: any of "area", "force" or further columns.
    models : tuple of str
        Names of models; all nine if there are none.
    area_max : float or None
        Largest area that is kept [%], None for all.
    normalisation : str
        One of `learn.models.NORMALISATIONS`.
    features : str
        A name of `learn.features.SETS`.
    seed : int
        Seed of the split and of the models.
    train_rows : int or None
        Number of training rows at most, None for all.
    again : bool
        True to repeat fits whose results the folder has.
    limit : float or None
        Time for the searches [s], None for whole grids.
    roots : bool
        True to learn square roots of areas, with the features that surrogates see
        (`learn.features.FeatureSet.with_roots`).
    blocks : int
        Blocks per side of the coarse solve of hybrid features, one of
        `learn.features.sets.BLOCK_COUNTS`.
    calibrate_on : Path or None
        Database whose rows calibrate the intervals; None for rows of the first ones.
    others : tuple of Path
        Further databases, whose rows are learnt together with those of the first.
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
    roots: bool = False
    blocks: int = BLOCKS
    calibrate_on: Path | None = None
    others: tuple[Path, ...] = ()

    @property
    def databases(self) -> tuple[Path, ...]:
        """All databases."""
        return (self.database, *self.others)

    def __post_init__(self) -> None:
        """Raise InputError for an unknown normalisation."""
        if self.normalisation not in NORMALISATIONS:
            known = ", ".join(NORMALISATIONS)
            raise InputError(f"--normalise {self.normalisation!r}: give one of {known}")


def hybrid_for(
    request: Request, executor: Executor, stopping: Callable[[], bool] = lambda: False
) -> Values | None:
    """Return the columns that the database's surfaces add, (rows, 17); None if none are asked for.

    See `learn.features.regeneration.hybrid_rows`, which takes the other arguments.
    """
    wanted = features.chosen(request.features, roots=request.roots, blocks=request.blocks)
    if not wanted.needs_surface:
        return None
    from learn.features.regeneration import hybrid_rows

    return hybrid_rows(request.database, executor, stopping, wanted.solved_blocks)
