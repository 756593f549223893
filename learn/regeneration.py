"""Hybrid features for the rows of a database, which stores no surfaces.

Rows are pure functions of the scene, so each surface is generated again by the processes of the
run, and its statistics must agree with those of its row. The features are kept in a file beside the
database, `paper.h5` -> `paper.h5.pressed.npz`, together with the inputs that they belong to: only
rows that are new or have changed are computed, and an interrupted run continues.
"""

import hashlib
import time
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import NamedTuple
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from gen.arrays import Values
from gen.generation.plan import Plan, parameters
from gen.generation.sample import surface_of
from gen.runtime.errors import InputError, SourceError
from gen.runtime.files import atomic, require_file
from gen.runtime.terminal import RunProgress
from gen.scene import Scene
from gen.schema import PHYSICS, Status
from learn.database_rows import Stored
from learn.executor import Executor
from learn.features.columns import BLOCKS, HYBRID, STATISTICS
from learn.features.sets import SETS, FeatureSet
from learn.features.surface import LOOSE, SurfaceFeatures

VERSION = 4  # raised whenever `SurfaceFeatures.hybrid` changes its values

BLOCK_ROWS = (
    32  # rows that a process computes at a time, as far as whole surfaces allow it
)
SAVE_SECONDS = 20.0  # time between two writes of the file beside the database
AGREEMENT = 1e-6  # largest relative difference of statistics between processors


@dataclass(frozen=True, eq=False)
class CoarseSolves:
    """What the coarse solves of n rows give, NaN for rows without one."""

    delta: Values  # (n,), far-field displacement [um]
    columns: Values  # (n, 18), columns of `HYBRID`


class Block(NamedTuple):
    """Rows that one process computes."""

    first: int  # number of the first row
    end: int  # number of the row after the last one
    deltas: tuple[float, ...]  # their Deltas, or what stands for them [um]


class SharedSettings(NamedTuple):
    """What the computation of all blocks of a database needs."""

    scene: Scene
    folder: Path  # of the database
    blocks: int  # per side of the coarse solve
    pressed: bool  # True at pressures


@dataclass(frozen=True, eq=False)
class BlockFeatures:
    """Features of the k rows of a block, and the inputs that they belong to."""

    inputs: Values  # (k, 23 or 24), Delta, the 22 statistics and a drawn hardness
    values: Values  # (k, 18 or 19), columns of `HYBRID` and, at pressures, the solve's Delta [um]


def coarse_solves(
    part: Stored,
    executor: Executor,
    stopping: Callable[[], bool],
    features: FeatureSet = SETS["hybrid"],
) -> CoarseSolves:
    """Return what the coarse solve gives for every row of a database.

    Writes the file beside the database, and progress on standard error.

    Parameters
    ----------
    part : Stored
        n rows of the database.
    executor : Executor
        Processes that generate the surfaces.
    stopping : callable
        Tells whether to stop; it is asked between blocks of rows.
    features : FeatureSet
        The hybrid set, with the number of blocks and the load.

    Returns
    -------
    CoarseSolves
        Deltas and columns of n rows. Columns are NaN for rows that are not finished, or were not
        reached before the stop. At pressures Delta is the coarse solve's, otherwise the row's.

    Raises
    ------
    InputError
        If a surface that is generated again has other statistics than its row.
    """
    blocks = features.blocks or BLOCKS
    cache = Cache.read(part, blocks, pressed=features.by_pressure)
    job = Regeneration(part, cache)
    if job.missing.any():
        scene = part.scene
        folder = part.path.parent
        # Maps are prepared here before many processes ask for them at once.
        scene.surface.make_ready(folder)
        shared = SharedSettings(scene, folder, blocks, features.by_pressure)
        job.run(executor, shared, stopping)
    columns = cache.values[:, : len(HYBRID)]
    if features.by_pressure:
        return CoarseSolves(cache.values[:, -1], columns)
    return CoarseSolves(cache.inputs[:, 0], columns)


@dataclass(frozen=True, eq=False)
class Cache:
    """The content of the file beside a database, which is filled block by block.

    Parameters
    ----------
    path : Path
        The file.
    key : str
        Fingerprint of all that the features depend on besides the inputs.
    inputs : ndarray, shape (n, 23 or 24)
        Delta, the 22 statistics and a drawn hardness of all rows of the database.
    values : ndarray, shape (n, 18 or 19)
        Features of the rows, NaN where they are missing; changed in place.
    """

    path: Path
    key: str
    inputs: Values
    values: Values

    @classmethod
    def read(cls, part: Stored, blocks: int, *, pressed: bool) -> "Cache":
        """Return the content for the rows of a database, with the features that the file has.

        Parameters
        ----------
        part : Stored
            n rows of the database.
        blocks : int
            Blocks per side of the coarse solve.
        pressed : bool
            True at pressures.

        Returns
        -------
        Cache
            The content; features are missing if there is no file, or a damaged one.
        """
        scene = part.scene
        suffix = ""
        if blocks != BLOCKS:
            suffix += f"-{blocks}"
        if pressed:
            suffix += "-by-pressure"
        path = part.path.with_name(f"{part.path.name}.pressed{suffix}.npz")
        columns = ",".join(HYBRID)
        text = f"{VERSION} {blocks} {LOOSE} {columns} {PHYSICS} {scene.fingerprint()}"
        if pressed:
            text += " by pressure"
        key = hashlib.sha256(text.encode()).hexdigest()
        inputs = part.described
        if scene.contact.draws_hardness:
            inputs = np.column_stack([inputs, part.columns["hardness"]])
        values = kept(path, key, inputs, len(HYBRID) + pressed)
        return cls(path, key, inputs, values)

    def save(self) -> str:
        """Write the file; return a warning if that is not possible, or ""."""
        try:
            with atomic(self.path, "arrays") as file:
                np.savez(file, key=self.key, inputs=self.inputs, values=self.values)
        except InputError as error:
            return f"warning: {error}: not kept"
        return ""


class Regeneration:
    """Computes the features of a database's rows that a cache does not have.

    Parameters
    ----------
    part : Stored
        n rows of the database.
    cache : Cache
        Their features, which are filled in.
    """

    def __init__(self, part: Stored, cache: Cache) -> None:
        self.part = part
        self.cache = cache
        self.first = int(part.rows[0])
        usable = part.columns["status"] == Status.DONE
        usable &= np.isfinite(cache.inputs).all(axis=1)
        # (n,), rows whose features have to be computed
        self.missing: NDArray[np.bool_] = usable & ~np.isfinite(cache.values).all(axis=1)
        self.saved = time.monotonic()

    def run(
        self, executor: Executor, shared: SharedSettings, stopping: Callable[[], bool]
    ) -> None:
        """Compute the missing features, or those before a stop, and write the file.

        Parameters
        ----------
        executor : Executor
            Processes that generate the surfaces.
        shared : SharedSettings
            What the computation of all blocks needs.
        stopping : callable
            Tells whether to stop; it is asked between blocks.

        Raises
        ------
        InputError
            If a surface that is generated again has other statistics than its row.
        """
        blocks = self._blocks()
        rows = sum(block.end - block.first for block in blocks)
        self.saved = time.monotonic()
        with RunProgress(rows, "surfaces") as progress:
            progress.say(
                f"{self.part.path}: generating {rows} surfaces anew for their hybrid features; they"
                f" are kept in {self.cache.path}"
            )

            def keep(block: Block, features: BlockFeatures) -> None:
                self._keep(block, features)
                progress.advance(block.end - block.first)
                if time.monotonic() > self.saved + SAVE_SECONDS:
                    self.saved = time.monotonic()
                    self.cache.save()

            try:
                executor.run(compute_block, shared, blocks, keep, stopping=stopping)
            finally:
                warning = self.cache.save()
                if warning:
                    progress.say(warning)

    def _blocks(self) -> list[Block]:
        """Divide the rows with missing features into runs of whole surfaces."""
        per_surface = self.part.scene.samples_per_surface
        length = max(1, BLOCK_ROWS // per_surface) * per_surface
        places = np.flatnonzero(self.missing)
        numbers = (self.first + places) // length
        blocks = []
        for number in np.unique(numbers):
            inside = places[numbers == number]
            first = int(inside[0])
            end = int(inside[-1]) + 1
            deltas = tuple(self.cache.inputs[first:end, 0].tolist())
            blocks.append(Block(self.first + first, self.first + end, deltas))
        return blocks

    def _keep(self, block: Block, features: BlockFeatures) -> None:
        """Fill in the features of a block; refuse surfaces that do not agree with their rows."""
        inside = slice(block.first - self.first, block.end - self.first)
        missing = self.missing[inside]
        same = np.isclose(
            self.cache.inputs[inside], features.inputs, AGREEMENT, AGREEMENT * 1e-3
        ).all(axis=1)
        wrong = missing & ~same
        if wrong.any():
            raise InputError(
                f"{self.part.path}: row {block.first + np.argmax(wrong)}, generated anew from its"
                " scene, is another surface: use --features paper or dimensionless"
            )
        self.cache.values[inside][missing] = features.values[missing]


def compute_block(shared: SharedSettings, block: Block) -> BlockFeatures:
    """Compute the features of a block's rows, on any process.

    Displacements are the plan's where the scene gives them, otherwise those of the database: its
    solver computed them from pressures or forces.

    Parameters
    ----------
    shared : SharedSettings
        The scene, and what features are wanted.
    block : Block
        k rows.

    Returns
    -------
    BlockFeatures
        Inputs and features, NaN where a surface or a coarse solve is undefined.

    Raises
    ------
    SourceError
        If a file that surfaces are made of cannot be used.
    """
    scene = shared.scene
    scene.surface.make_ready(shared.folder, verify=False)
    plan = parameters(scene, block.first, block.end)
    deltas = np.array(block.deltas)
    if scene.quantity == "delta" and not shared.pressed:
        deltas = plan.load
    rows = block.end - block.first
    width = 1 + len(STATISTICS) + scene.contact.draws_hardness
    inputs = np.full((rows, width), np.nan)
    values = np.full((rows, len(HYBRID) + shared.pressed), np.nan)
    inputs[:, 0] = deltas
    if scene.contact.draws_hardness:
        inputs[:, -1] = plan.hardness
    surface: SurfaceFeatures | None = None
    for row in range(rows):
        if row == 0 or plan.surface[row] != plan.surface[row - 1]:
            surface = _surface(scene, plan, row, f"row {block.first + row}")
        if surface is None:  # failed rows of the database have no inputs either
            continue
        inputs[row, 1 : 1 + len(STATISTICS)] = _statistics(surface)
        hardness = plan.hardness_of(row)
        ratio = None if hardness is None else hardness / scene.contact.e_star
        values[row] = _values(surface, float(deltas[row]), ratio, shared)
    return BlockFeatures(inputs, values)


def _surface(scene: Scene, plan: Plan, row: int, name: str) -> SurfaceFeatures | None:
    """Make the surface of a row of a plan; None if its numbers cannot be computed."""
    try:
        heights = surface_of(scene, plan, row)
    except SourceError:
        raise
    except (ArithmeticError, InputError):
        return None
    grid = scene.grid
    return SurfaceFeatures(
        heights, grid.sides, grid.spacing, name, scene.contact.boundary
    )


def _statistics(surface: SurfaceFeatures) -> Values:
    """Return the statistics of a surface, (22,), NaN if they cannot be computed."""
    try:
        return np.array(list(surface.description.values.values()))
    except (ArithmeticError, InputError):
        return np.full(len(STATISTICS), np.nan)


def _values(
    surface: SurfaceFeatures, load: float, ratio: float | None, shared: SharedSettings
) -> Values:
    """Return the features of a surface under a load [um], (18,), NaN where they are undefined.

    At pressures, for which `by_pressure` stands, the coarse solve's Delta is a further one.
    """
    values = np.full(len(HYBRID) + shared.pressed, np.nan)
    delta = load
    try:
        if load > 0 and not surface.description.reason:
            if shared.pressed:
                delta = surface.reached(load, ratio, shared.blocks)
                values[-1] = delta
            values[: len(HYBRID)] = surface.hybrid(delta, ratio, shared.blocks)
    except (ArithmeticError, InputError):
        return values
    return values


def kept(path: Path, key: str, inputs: Values, columns: int = len(HYBRID)) -> Values:
    """Read the features that a file has for rows whose inputs have not changed.

    Parameters
    ----------
    path : Path
        The file beside a database, which may be missing or damaged.
    key : str
        Fingerprint that the file has to have.
    inputs : ndarray, shape (n, d)
        Inputs of the rows.
    columns : int
        Number m of features.

    Returns
    -------
    ndarray, shape (n, m)
        Features, NaN for rows that the file does not have.
    """
    values = np.full((len(inputs), columns), np.nan)
    try:
        content = require_file(path).read_bytes()
        # From bytes, because numpy leaves a broken file open.
        with np.load(BytesIO(content), allow_pickle=False) as file:
            key_of_file = str(file["key"])
            old_inputs = file["inputs"]
            old_values = file["values"]
    except (OSError, ValueError, KeyError, BadZipFile, EOFError, MemoryError, zlib.error):
        return values
    if key_of_file != key or old_inputs.ndim != 2:
        return values
    if old_inputs.shape[1] != inputs.shape[1]:
        return values
    if old_values.shape != (len(old_inputs), columns):
        return values
    if {old_inputs.dtype, old_values.dtype} != {np.dtype(np.float64)}:
        return values
    rows = min(len(old_inputs), len(values))
    same = (old_inputs[:rows] == inputs[:rows]).all(axis=1)
    values[:rows][same] = old_values[:rows][same]
    return values
