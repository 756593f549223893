"""Hybrid features for the rows of a database, which stores no surfaces.

Rows are pure functions of the scene, so each surface is generated again by the processes of the
run, and its statistics must agree with those of its row. The features are kept in a file beside the
database, `paper.h5` -> `paper.h5.pressed.npz`, together with the inputs that they belong to: only
rows that are new or have changed are computed, and an interrupted run continues.
"""

import hashlib
import time
import zlib
from collections.abc import Callable, Iterator
from io import BytesIO
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from gen.arrays import Values
from gen.database import Reader
from gen.generation.plan import Parameters, parameters
from gen.generation.sample import surface_of
from gen.runtime.errors import InputError, SourceError
from gen.runtime.files import atomic, require_file
from gen.runtime.terminal import RunProgress
from gen.scene import Scene
from gen.schema import PHYSICS, Status
from learn.executor import Executor
from learn.features.sets import BLOCKS, HYBRID, STATISTICS, modulus
from learn.features.surface import LOOSE, SurfaceFeatures

VERSION = 3
"""Raised whenever `SurfaceFeatures.hybrid` changes its values."""

BLOCK_ROWS = 32
SAVE_SECONDS = 20.0
AGREEMENT = 1e-6
"""Largest relative difference of statistics between processors."""

Block = tuple[int, int, tuple[float, ...]]
"""First row, one past the last, and the displacement of each row [um]."""


def hybrid_rows(
    path: Path, executor: Executor, stopping: Callable[[], bool], blocks: int = BLOCKS
) -> Values:
    """Return the columns of `HYBRID` for every row of a database, (n, 17).

    They are NaN for rows that are not finished or were not reached before the stop, for which
    `stopping` is asked between blocks of rows. The executor generates the surfaces; `blocks` is the
    number per side of the coarse solve. InputError is raised if the file is no database, or its
    surfaces cannot be generated again.
    """
    job = _Job(path, blocks)
    if not job.blocks:
        return job.values
    scene, folder, _ = job.shared
    # Maps are prepared here before many processes ask for them at once.
    scene.surface.make_ready(folder)
    rows = sum(stop - start for start, stop, _ in job.blocks)
    with RunProgress(rows, "surfaces") as progress:
        progress.say(
            f"{path}: generating {rows} surfaces anew for their hybrid features; they are kept in"
            f" {job.cache}"
        )

        def keep(block: Block, result: tuple[Values, Values]) -> None:
            job.keep(block, *result)
            progress.advance(block[1] - block[0], 0)

        def ended() -> bool:
            return stopping() or bool(job.fault)

        try:
            executor.run(_compute, job.shared, job.blocks, keep, stopping=ended)
        finally:
            note = "" if job.fault else job.save()
            if note:
                progress.say(note)
    if job.fault:
        raise InputError(job.fault)
    return job.values


def _compute(shared: tuple[Scene, Path, int], block: Block) -> tuple[Values, Values]:
    """Compute a block of the rows of a scene, whose database lies in a folder."""
    scene, folder, blocks = shared
    scene.surface.make_ready(folder, verify=False)
    return compute_block(scene, block, blocks)


def compute_block(scene: Scene, block: Block, blocks: int = BLOCKS) -> tuple[Values, Values]:
    """Return inputs (k, 23 or 24) and features (k, 17) of a block's rows, NaN where undefined.

    Displacements are the plan's where the scene gives them, otherwise those of the database: its
    solver found them from pressures or forces.
    """
    start, stop, found = block
    plan = parameters(scene, start, stop)
    deltas = plan.delta if plan.quantity == "delta" else np.array(found)
    inputs = np.full((stop - start, len(_inputs(scene))), np.nan)
    values = np.full((stop - start, len(HYBRID)), np.nan)
    inputs[:, 0] = deltas
    ratios = None if plan.hardness is None else np.asarray(plan.hardness) / modulus(scene)
    if scene.contact.draws_hardness:
        inputs[:, -1] = plan.hardness
    surface: SurfaceFeatures | None = None
    for row in range(stop - start):
        if row == 0 or plan.surface[row] != plan.surface[row - 1]:
            surface = _surface(scene, plan, row, f"row {start + row}")
        if surface is None:  # failed rows of the database: they have no inputs either
            continue
        try:
            inputs[row, 1 : 1 + len(STATISTICS)] = surface.statistics
            if deltas[row] > 0 and not surface.description.reason:
                ratio = None if ratios is None else float(ratios[row])
                values[row] = surface.hybrid(float(deltas[row]), ratio, blocks)
        except InputError:
            continue
    return inputs, values


def _surface(scene: Scene, plan: Parameters, row: int, name: str) -> SurfaceFeatures | None:
    """Make the surface of a row again; None for one that cannot be made, whose rows have failed."""
    try:
        return of_scene(scene, surface_of(scene, plan, row), name)
    except SourceError:
        raise
    except (ArithmeticError, InputError):
        return None


def _inputs(scene: Scene) -> tuple[str, ...]:
    """Return the columns of a database that decide the features of its rows."""
    return ("delta", *STATISTICS, *(("hardness",) if scene.contact.draws_hardness else ()))


def of_scene(scene: Scene, heights: Values, name: str) -> SurfaceFeatures:
    """Return a surface with the side, spacing and boundary of a scene."""
    return SurfaceFeatures(heights, scene.sides, scene.spacing, name, scene.contact.boundary)


class _Job:
    """The rows that the file beside the database has, and the rows that it lacks."""

    def __init__(self, path: Path, blocks: int = BLOCKS) -> None:
        with Reader(path) as reader:
            scene, self.first = reader.scene, reader.rows.start
            done = reader.column("status") == Status.DONE
            self.inputs = np.stack([reader.column(name) for name in _inputs(scene)], axis=1)
        finer = "" if blocks == BLOCKS else f"-{blocks}"
        self.path, self.cache = path, path.with_name(f"{path.name}.pressed{finer}.npz")
        self.shared = scene, path.parent, blocks
        # A fingerprint of all that the features depend on besides the inputs.
        text = f"{VERSION} {blocks} {LOOSE} {','.join(HYBRID)} {PHYSICS} {scene.fingerprint()}"
        self.key = hashlib.sha256(text.encode()).hexdigest()
        self.values, self.fault = self._kept(), ""
        self.last_save = time.monotonic()
        usable = done & np.isfinite(self.inputs).all(axis=1)
        lacking = np.flatnonzero(usable & ~np.isfinite(self.values).all(axis=1))
        self.left = set((self.first + lacking).tolist())
        self.blocks = [
            (start, stop, tuple(self.inputs[start - self.first : stop - self.first, 0].tolist()))
            for start, stop in _blocks(self.left, scene.samples_per_surface)
        ]

    def keep(self, block: Block, inputs: Values, values: Values) -> None:
        """Store the features of a block, or say why they cannot be the database's."""
        start, stop, _ = block
        for row in range(start, stop):
            if row not in self.left:
                continue
            own, again = self.inputs[row - self.first], inputs[row - start]
            if not np.allclose(own, again, rtol=AGREEMENT, atol=AGREEMENT * 1e-3):
                self.fault = self.fault or (
                    f"{self.path}: row {row}, generated anew from its scene, is another surface:"
                    " use --features paper or dimensionless"
                )
                return
            self.values[row - self.first] = values[row - start]
            self.left.discard(row)
        if time.monotonic() > self.last_save + SAVE_SECONDS:
            self.save()

    def save(self) -> str:
        """Write the file beside the database; return why that was not possible, or ""."""
        self.last_save = time.monotonic()
        try:
            with atomic(self.cache, "arrays") as file:
                np.savez(file, key=self.key, inputs=self.inputs, values=self.values)
        except InputError as error:
            return f"warning: {error}: not kept"
        return ""

    def _kept(self) -> Values:
        """Return the features that the file has for rows whose inputs have not changed."""
        values = np.full((len(self.inputs), len(HYBRID)), np.nan)
        try:  # numpy leaves a broken file open
            content = BytesIO(require_file(self.cache).read_bytes())
            with np.load(content, allow_pickle=False) as kept:
                key, inputs, known = str(kept["key"]), kept["inputs"], kept["values"]
        except (OSError, ValueError, KeyError, BadZipFile, EOFError, MemoryError, zlib.error):
            return values
        if key != self.key or {inputs.dtype, known.dtype} != {np.dtype(np.float64)}:
            return values
        if inputs.ndim == 2 and inputs.shape[1] == self.inputs.shape[1]:
            rows = min(len(inputs), len(values))
            same = (inputs[:rows] == self.inputs[:rows]).all(axis=1)
            if known.shape == (len(inputs), len(HYBRID)):
                values[:rows][same] = known[:rows][same]
        return values


def _blocks(rows: set[int], samples_per_surface: int) -> Iterator[tuple[int, int]]:
    """Yield runs of rows of whole surfaces, at most about `BLOCK_ROWS` long."""
    length = max(1, BLOCK_ROWS // samples_per_surface) * samples_per_surface
    for number in sorted({row // length for row in rows}):
        inside = [row for row in range(number * length, (number + 1) * length) if row in rows]
        yield inside[0], inside[-1] + 1
