"""Hybrid features for the rows of a database, which stores no surfaces.

Rows are pure functions of the scene. Each surface is therefore generated again, by the processes of
the run, and its statistics must agree with those of its row. The features are kept in a file beside
the database: `paper.h5.pressed.npz` beside `paper.h5`. The file also has the inputs of each row, so
that later runs compute only rows that are new or have changed. An interrupted run is continued.
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
from learn.features.surface import LOOSE, CoarseMaterial, SurfaceFeatures

# Version of the features in files; it is raised whenever `SurfaceFeatures.hybrid` changes values.
VERSION = 4
# Number of rows that a process computes at a time, rounded down to whole surfaces, but at least one
# surface.
BLOCK_ROWS = 32
# Shortest time between two writes of the file beside the database, except for the last one [s].
SAVE_SECONDS = 20.0
# Largest relative difference of statistics between a row and its surface generated again, which may
# be on another processor.
AGREEMENT = 1e-6


@dataclass(frozen=True, eq=False)
class CoarseSolves:
    """Results of the coarse solves of n rows."""

    delta: Values  # (n,), far-field displacement [um]
    columns: Values  # (n, 18), columns of `HYBRID`; NaN for rows without a solve


class Block(NamedTuple):
    """Rows that one process computes at a time."""

    first: int  # number of the first row, as the scene counts its rows
    end: int  # number of the last row plus 1
    # Delta of each row, or the length that replaces it under pressures (`by_pressure`) [um]
    deltas: tuple[float, ...]


class SharedSettings(NamedTuple):
    """Settings of the computation of all blocks of a database."""

    scene: Scene
    folder: Path  # folder of the database
    blocks: int  # blocks per side of the coarse solve
    pressed: bool  # True if features are those under a pressure, False if under a Delta


@dataclass(frozen=True, eq=False)
class BlockFeatures:
    """Features of the k rows of a block, and the inputs from which they were computed."""

    # (k, 23 to 26), Delta, the 22 statistics, and what is drawn of hardness and layer
    inputs: Values
    # (k, 18 or 19), columns of `HYBRID` and, under pressures, the Delta of the solve [um]
    values: Values


def coarse_solves(
    part: Stored,
    executor: Executor,
    stopping: Callable[[], bool],
    features: FeatureSet = SETS["hybrid"],
) -> CoarseSolves:
    """Return the results of the coarse solves of all rows of a database.

    Rows that the file beside the database lacks are computed, and added to the file. Shows progress
    on standard error.

    Parameters
    ----------
    part : Stored
        All n rows of the database.
    executor : Executor
        Processes that generate the surfaces.
    stopping : callable
        Function that is called between blocks of rows. Once it returns True, no further block is
        begun.
    features : FeatureSet
        The hybrid set, with the number of blocks and the load.

    Returns
    -------
    CoarseSolves
        Deltas and columns of n rows. Under pressures Delta is that of the coarse solve, otherwise
        that of the row. Columns and, under pressures, Delta are NaN for rows whose status is not
        done, rows whose coarse solve fails or lacks a statistic, and rows that were not computed
        before a stop.

    Raises
    ------
    SourceError
        If a map or a function that surfaces are made of cannot be used.
    InputError
        If a surface that is generated again has statistics that differ from those of its row.
    """
    blocks = features.blocks or BLOCKS
    cache = Cache.read(part, blocks, pressed=features.by_pressure)
    job = Regeneration(part, cache)
    if job.missing.any():
        scene = part.scene
        folder = part.path.parent
        # Maps are prepared once, before all processes of the run need them.
        scene.surface.make_ready(folder)
        shared = SharedSettings(
            scene=scene, folder=folder, blocks=blocks, pressed=features.by_pressure
        )
        job.run(executor, shared, stopping)
    columns = cache.values[:, : len(HYBRID)]
    if features.by_pressure:
        return CoarseSolves(delta=cache.values[:, -1], columns=columns)
    return CoarseSolves(delta=cache.inputs[:, 0], columns=columns)


@dataclass(frozen=True, eq=False)
class Cache:
    """The features in the file beside a database, which are completed block by block.

    Parameters
    ----------
    path : Path
        The file.
    key : str
        Fingerprint of the scene, the code and the settings on which features depend.
    inputs : ndarray, shape (n, 23 to 26)
        Delta, the 22 statistics, and what is drawn of hardness and layer, of all rows of the
        database.
    values : ndarray, shape (n, 18 or 19)
        Columns of `HYBRID` and, under pressures, the Delta of the solve; NaN if they are missing.
        `Regeneration` writes into this array.
    """

    path: Path
    key: str
    inputs: Values
    values: Values

    @classmethod
    def read(cls, part: Stored, blocks: int, *, pressed: bool) -> "Cache":
        """Read the features that the file beside a database has for its rows.

        Parameters
        ----------
        part : Stored
            All n rows of the database.
        blocks : int
            Blocks per side of the coarse solve.
        pressed : bool
            True for features by pressure.

        Returns
        -------
        Cache
            Features of n rows. They are NaN for rows whose inputs have changed, and for all rows if
            there is no file, or a damaged one.
        """
        scene = part.scene
        suffix = ""
        if blocks != BLOCKS:
            suffix += f"-{blocks}"
        if pressed:
            suffix += "-by-pressure"
        path = part.path.with_name(f"{part.path.name}.pressed{suffix}.npz")
        columns = ",".join(HYBRID)
        # Any change of this text changes the keys, so that existing files are no longer used.
        text = f"{VERSION} {blocks} {LOOSE} {columns} {PHYSICS} {scene.fingerprint()}"
        if pressed:
            text += " by pressure"
        if scene.contact.layer is not None:
            text += " layered"  # earlier versions pressed the blocks into half-spaces
        key = hashlib.sha256(text.encode()).hexdigest()
        drawn = [part.columns[name] for name in _drawn_of_bodies(scene)]
        inputs = np.column_stack([part.described, *drawn])
        values = features_in(path, key, inputs, columns=_width(pressed=pressed))
        return cls(path=path, key=key, inputs=inputs, values=values)

    def save(self) -> str:
        """Write the file; return "", or a warning for the user if it cannot be written."""
        try:
            with atomic(self.path, "arrays") as file:
                np.savez(file, key=self.key, inputs=self.inputs, values=self.values)
        except InputError as error:
            return f"warning: {error}: not kept"
        return ""


def _drawn_of_bodies(scene: Scene) -> list[str]:
    """Return the names of the numbers of bodies that a scene draws.

    They are "hardness" and the names of `Layer.drawn`, also as columns of the database.
    """
    names = []
    if scene.contact.draws_hardness:
        names.append("hardness")
    if scene.contact.layer is not None:
        names += scene.contact.layer.drawn
    return names


def _width(*, pressed: bool) -> int:
    """Return the number of features of a row: columns of `HYBRID` and, under pressures, a Delta."""
    if pressed:
        return len(HYBRID) + 1
    return len(HYBRID)


class Regeneration:
    """The computation of the features that a cache lacks.

    Parameters
    ----------
    part : Stored
        All n rows of the database.
    cache : Cache
        Features of the rows, which are completed.
    """

    def __init__(self, part: Stored, cache: Cache) -> None:
        self.part = part
        self.cache = cache
        self.first = int(part.rows[0])  # number of the first row
        usable = part.columns["status"] == Status.DONE
        usable &= np.isfinite(cache.inputs).all(axis=1)
        has_features = np.isfinite(cache.values).all(axis=1)
        # (n,), True for rows whose features have to be computed
        self.missing: NDArray[np.bool_] = usable & ~has_features
        self.saved = time.monotonic()  # time of the last write of the file [s]

    def run(
        self, executor: Executor, shared: SharedSettings, stopping: Callable[[], bool]
    ) -> None:
        """Compute the missing features until a stop, and write the file.

        Shows progress on standard error.

        Parameters
        ----------
        executor : Executor
            Processes that generate the surfaces.
        shared : SharedSettings
            Settings of the computation.
        stopping : callable
            Function that is called between blocks. Once it returns True, no further block is begun.

        Raises
        ------
        SourceError
            If a map or a function that surfaces are made of cannot be used.
        InputError
            If a surface that is generated again has statistics that differ from those of its row.
        """
        blocks = self._blocks()
        rows = sum(block.end - block.first for block in blocks)
        self.saved = time.monotonic()
        with RunProgress(rows, "rows") as progress:
            progress.say(
                f"{self.part.path}: generating the surfaces of {rows} rows anew for hybrid"
                f" features, which are kept in {self.cache.path}"
            )

            def keep(block: Block, features: BlockFeatures) -> None:
                """Keep the features of a block; write the file if `SAVE_SECONDS` have passed.

                The time is counted from the last write.
                """
                self._keep(block, features)
                progress.advance(rows=block.end - block.first)
                if time.monotonic() > self.saved + SAVE_SECONDS:
                    self.saved = time.monotonic()
                    # A warning is not needed here: if this write fails, the last write, below,
                    # fails too and is reported.
                    self.cache.save()

            try:
                executor.run(compute_block, shared, blocks, keep, stopping=stopping)
            finally:
                warning = self.cache.save()
                if warning:
                    progress.say(warning)

    def _blocks(self) -> list[Block]:
        """Divide the rows with missing features into blocks, without dividing a surface.

        A block begins and ends with a missing row; it may have complete rows in between.
        """
        rows_per_surface = self.part.scene.samples_per_surface
        surfaces_per_block = max(1, BLOCK_ROWS // rows_per_surface)
        rows_per_block = surfaces_per_block * rows_per_surface
        positions = np.flatnonzero(self.missing)  # in the database
        block_of_row = (self.first + positions) // rows_per_block
        blocks = []
        for number in np.unique(block_of_row):
            inside = positions[block_of_row == number]
            start = int(inside[0])
            end = int(inside[-1]) + 1
            deltas = tuple(self.cache.inputs[start:end, 0].tolist())
            blocks.append(
                Block(first=self.first + start, end=self.first + end, deltas=deltas)
            )
        return blocks

    def _keep(self, block: Block, features: BlockFeatures) -> None:
        """Write the missing features of a block into the cache.

        Raises InputError if a surface does not agree with its row.
        """
        inside = slice(block.first - self.first, block.end - self.first)
        missing = self.missing[inside]
        # Statistics that are 0 apart from rounding need an absolute tolerance.
        agrees = np.isclose(
            self.cache.inputs[inside],
            features.inputs,
            rtol=AGREEMENT,
            atol=AGREEMENT * 1e-3,
        ).all(axis=1)
        wrong = missing & ~agrees
        if wrong.any():
            # Damaged rows are the likely cause, and other features would learn from them.
            remedy = self.part.damage or "use --features paper or dimensionless"
            raise InputError(
                f"{self.part.path}: row {block.first + np.argmax(wrong)}, generated anew from its"
                f" scene, is another surface: {remedy}"
            )
        self.cache.values[inside][missing] = features.values[missing]


def compute_block(shared: SharedSettings, block: Block) -> BlockFeatures:
    """Generate the surfaces of a block's rows again, and compute the features.

    Any process can do this. If the scene draws displacements and features are by Delta, the Deltas
    are drawn again. Otherwise they are those of the block: Deltas that the solver of the database
    computed from pressures or forces, or the lengths that replace Delta under pressures.

    Parameters
    ----------
    shared : SharedSettings
        Settings of the computation.
    block : Block
        k rows.

    Returns
    -------
    BlockFeatures
        Inputs and features. Statistics and features of a row are NaN if its surface cannot be
        generated. Features are also NaN if a statistic is undefined or the coarse solve fails.

    Raises
    ------
    SourceError
        If a map or a function that surfaces are made of cannot be used.
    """
    scene = shared.scene
    # `coarse_solves` has verified the maps.
    scene.surface.make_ready(shared.folder, verify=False)
    plan = parameters(scene, block.first, block.end)
    deltas = np.array(block.deltas)
    if scene.quantity == "delta" and not shared.pressed:
        deltas = plan.load
    rows = block.end - block.first
    drawn = _drawn_of_bodies(scene)
    # Columns of `BlockFeatures.inputs`: Delta, the statistics, and the drawn numbers of bodies.
    first_of_bodies = 1 + len(STATISTICS)
    inputs = np.full((rows, first_of_bodies + len(drawn)), np.nan)
    values = np.full((rows, _width(pressed=shared.pressed)), np.nan)
    inputs[:, 0] = deltas
    numbers_of_bodies = {"hardness": plan.hardness, **plan.layer}
    for place, name in enumerate(drawn, start=first_of_bodies):
        inputs[:, place] = numbers_of_bodies[name]
    surface: SurfaceFeatures | None = None
    for row in range(rows):
        is_first_of_surface = row == 0 or plan.surface[row] != plan.surface[row - 1]
        if is_first_of_surface:
            surface = _surface(scene, plan, row, f"row {block.first + row}")
        if surface is None:  # The row failed in the database, too. Its features stay NaN.
            continue
        inputs[row, 1:first_of_bodies] = _statistics(surface)
        material = _material(scene, plan, row)
        values[row] = _values(surface, float(deltas[row]), material, shared)
    return BlockFeatures(inputs=inputs, values=values)


def _surface(scene: Scene, plan: Plan, row: int, name: str) -> SurfaceFeatures | None:
    """Generate the surface of a row of a plan; return None if its heights cannot be computed.

    `name` is the name of the surface in messages. Raises SourceError if a map or a function that
    the surface is made of cannot be used.
    """
    try:
        heights = surface_of(scene, plan, row)
    except SourceError:  # It concerns all rows, unlike other InputErrors.
        raise
    except (ArithmeticError, InputError):
        return None
    return SurfaceFeatures(
        heights=heights,
        sides=scene.grid.sides,
        spacing=scene.grid.spacing,
        name=name,
        boundary=scene.contact.boundary,
    )


def _material(scene: Scene, plan: Plan, row: int) -> CoarseMaterial:
    """Return the material of the bodies of a row of a plan."""
    body = scene.contact.body(plan.layer_of(row))
    e_star = scene.contact.e_star
    if body is not None:
        e_star = body.e_star
    hardness = plan.hardness_of(row)
    ratio: float | None = None
    if hardness is not None:
        ratio = hardness / e_star
    return CoarseMaterial.of(ratio, body)


def _statistics(surface: SurfaceFeatures) -> Values:
    """Return the statistics of a surface, (22,), all NaN if they cannot be computed."""
    try:
        return np.array(list(surface.description.values.values()))
    except (ArithmeticError, InputError):
        return np.full(len(STATISTICS), np.nan)


def _values(
    surface: SurfaceFeatures,
    load: float,
    material: CoarseMaterial,
    shared: SharedSettings,
) -> Values:
    """Return the columns of `HYBRID` for a surface, (18,), and under pressures also Delta, (19,).

    `load` is Delta or, under pressures, the pressure as a length (`by_pressure`): the nominal
    pressure times L / E*, both [um]. `material` is that of the bodies. All numbers are NaN if the
    load is not above 0, a statistic is undefined, or the coarse solve fails. Under pressures a
    first solve finds Delta, and a second one gives the columns at this Delta. If only the second
    one fails, Delta is kept.
    """
    values = np.full(_width(pressed=shared.pressed), np.nan)
    try:
        # Loads of 0 or less make no contact. `reason` says why a statistic is undefined.
        if load > 0 and not surface.description.reason:
            if shared.pressed:
                # the first of the two solves
                delta = surface.reached(load, material, shared.blocks)
                values[-1] = delta
            else:
                delta = load
            values[: len(HYBRID)] = surface.hybrid(delta, material, shared.blocks)
    except (ArithmeticError, InputError):
        return values
    return values


def features_in(
    path: Path, key: str, inputs: Values, columns: int = len(HYBRID)
) -> Values:
    """Read the features of a file for the rows whose inputs have not changed.

    Parameters
    ----------
    path : Path
        The file beside a database, which may be missing or damaged.
    key : str
        Fingerprint of the features. The features of a file with a different one are not used.
    inputs : ndarray, shape (n, d)
        Inputs of the rows.
    columns : int
        Number m of features.

    Returns
    -------
    ndarray, shape (n, m)
        Features, NaN for rows without features in the file.
    """
    values = np.full((len(inputs), columns), np.nan)
    try:
        content = require_file(path).read_bytes()
        # Load from bytes, because numpy does not close a damaged file.
        with np.load(BytesIO(content), allow_pickle=False) as file:
            key_of_file = str(file["key"])
            old_inputs = file["inputs"]
            old_values = file["values"]
    except (OSError, ValueError, KeyError, BadZipFile, EOFError, MemoryError, zlib.error):
        return values
    # A file of another scene or version, or with arrays of another form, is not used.
    if key_of_file != key or old_inputs.ndim != 2:
        return values
    if old_inputs.shape[1] != inputs.shape[1]:
        return values
    if old_values.shape != (len(old_inputs), columns):
        return values
    if {old_inputs.dtype, old_values.dtype} != {np.dtype(np.float64)}:
        return values
    rows = min(len(old_inputs), len(values))
    unchanged = (old_inputs[:rows] == inputs[:rows]).all(axis=1)
    values[:rows][unchanged] = old_values[:rows][unchanged]
    return values
