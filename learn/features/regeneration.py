"""Hybrid features for the rows of a database, which stores no surfaces.

Rows are pure functions of the scene, so each surface is generated again by the processes of the
run, and its statistics must agree with those of its row. The features are kept in a file beside the
database, `paper.h5` -> `paper.h5.pressed.npz`, together with the inputs that they belong to: only
rows that are new or have changed are computed, and an interrupted run continues.
"""

from __future__ import annotations

import hashlib
import time
import zlib
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any
from zipfile import BadZipFile

import numpy as np

from gen.arrays import Values
from gen.generation.plan import parameters
from gen.generation.sample import surface_of
from gen.runtime.errors import InputError, SourceError
from gen.runtime.files import atomic, require_file
from gen.runtime.terminal import RunProgress
from gen.scene import Scene
from gen.schema import PHYSICS, Status
from learn.executor import Executor
from learn.features.columns import BLOCKS, HYBRID, STATISTICS
from learn.features.sets import SETS, FeatureSet
from learn.features.surface import LOOSE, SurfaceFeatures

if TYPE_CHECKING:
    from learn.dataset import Stored

VERSION = 4  # raised whenever `SurfaceFeatures.hybrid` changes its values

BLOCK_ROWS = 32
SAVE_SECONDS = 20.0
AGREEMENT = 1e-6  # largest relative difference of statistics between processors
Block = tuple[int, int, tuple[float, ...]]  # first row, one past the last, Deltas [um]


def hybrid_rows(
    part: Stored,
    executor: Executor,
    stopping: Callable[[], bool],
    features: FeatureSet = SETS["hybrid"],
) -> tuple[Values, Values]:
    """Return Delta, (n,), and the columns of `HYBRID` for every row of a database, (n, 18).

    At pressures Delta is the coarse solve's. They are NaN for rows that are not finished or were
    not reached before the stop, for which `stopping` is asked between blocks of rows. The executor
    generates the surfaces. InputError is raised if its surfaces cannot be generated again.
    """
    pressed, blocks = features.load == "pressure", features.blocks or BLOCKS
    cache, content = _content(part, blocks, pressed=pressed)
    inputs, values = content["inputs"], content["values"]
    usable = (part.columns["status"] == Status.DONE) & np.isfinite(inputs).all(axis=1)
    left = usable & ~np.isfinite(values).all(axis=1)
    found = (values[:, -1] if pressed else inputs[:, 0]), values[:, : len(HYBRID)]
    if not left.any():
        return found
    scene, path, first = part.scene, part.path, int(part.rows[0])
    length = max(1, BLOCK_ROWS // scene.samples_per_surface) * scene.samples_per_surface
    places, tasks = np.flatnonzero(left), list[Block]()
    for number in np.unique((first + places) // length):  # runs of whole surfaces
        inside = places[(first + places) // length == number]
        deltas = tuple(inputs[inside[0] : inside[-1] + 1, 0].tolist())
        tasks.append((first + int(inside[0]), first + int(inside[-1]) + 1, deltas))
    # Maps are prepared here before many processes ask for them at once.
    scene.surface.make_ready(path.parent)
    rows, last = sum(stop - start for start, stop, _ in tasks), time.monotonic()
    with RunProgress(rows, "surfaces") as progress:
        progress.say(
            f"{path}: generating {rows} surfaces anew for their hybrid features; they are kept in"
            f" {cache}"
        )

        def keep(block: Block, result: tuple[Values, Values]) -> None:
            nonlocal last
            inside = slice(block[0] - first, block[1] - first)
            same = np.isclose(inputs[inside], result[0], AGREEMENT, AGREEMENT * 1e-3).all(
                axis=1
            )
            if (wrong := left[inside] & ~same).any():
                raise InputError(
                    f"{path}: row {block[0] + np.argmax(wrong)}, generated anew from its scene, is"
                    " another surface: use --features paper or dimensionless"
                )
            values[inside][left[inside]] = result[1][left[inside]]
            progress.advance(block[1] - block[0])
            if time.monotonic() > last + SAVE_SECONDS:
                last = time.monotonic()
                _save(cache, content)

        try:
            shared = scene, path.parent, blocks, pressed
            executor.run(compute_block, shared, tasks, keep, stopping=stopping)
        finally:
            if note := _save(cache, content):
                progress.say(note)
    return found


def _content(part: Stored, blocks: int, *, pressed: bool) -> tuple[Path, dict[str, Any]]:
    """Return the file beside a database, and what it should hold: values are NaN that it lacks."""
    scene = part.scene
    finer = "" if blocks == BLOCKS else f"-{blocks}"
    finer += "-by-pressure" if pressed else ""
    cache = part.path.with_name(f"{part.path.name}.pressed{finer}.npz")
    # A fingerprint of all that the features depend on besides the inputs.
    text = (
        f"{VERSION} {blocks} {LOOSE} {','.join(HYBRID)} {PHYSICS} {scene.fingerprint()}"
    )
    text += " by pressure" * pressed
    key = hashlib.sha256(text.encode()).hexdigest()
    drawn = [part.columns["hardness"]] if scene.contact.draws_hardness else []
    inputs = np.column_stack([part.inputs, *drawn])
    values = kept(cache, key, inputs, len(HYBRID) + pressed)
    return cache, {"key": key, "inputs": inputs, "values": values}


def compute_block(
    shared: tuple[Scene, Path, int, bool], block: Block
) -> tuple[Values, Values]:
    """Return inputs (k, 23 or 24) and features (k, 18) of a block's rows, NaN where undefined.

    At pressures, for which `by_pressure` stands, the coarse solve's Delta is a further column.
    Displacements are the plan's where the scene gives them, otherwise those of the database, which
    lies in a folder: its solver found them from pressures or forces.
    """
    scene, folder, blocks, pressed = shared
    scene.surface.make_ready(folder, verify=False)
    start, stop, found = block
    plan = parameters(scene, start, stop)
    deltas = plan.load if scene.quantity == "delta" and not pressed else np.array(found)
    width = 1 + len(STATISTICS) + scene.contact.draws_hardness
    inputs = np.full((stop - start, width), np.nan)
    values = np.full((stop - start, len(HYBRID) + pressed), np.nan)
    inputs[:, 0] = deltas
    ratios = (
        None
        if plan.hardness is None
        else np.asarray(plan.hardness) / scene.contact.e_star
    )
    if scene.contact.draws_hardness:
        inputs[:, -1] = plan.hardness
    surface: SurfaceFeatures | None = None
    for row in range(stop - start):
        try:
            if row == 0 or plan.surface[row] != plan.surface[row - 1]:
                surface = None
                grid, name = scene.grid, f"row {start + row}"
                own = grid.sides, grid.spacing, name, scene.contact.boundary
                surface = SurfaceFeatures(surface_of(scene, plan, row), *own)
            if surface is None:  # failed rows of the database: they have no inputs either
                continue
            inputs[row, 1 : 1 + len(STATISTICS)] = list(
                surface.description.values.values()
            )
            if deltas[row] > 0 and not surface.description.reason:
                ratio = None if ratios is None else float(ratios[row])
                delta = float(deltas[row])
                if pressed:
                    values[row, -1] = delta = surface.reached(delta, ratio, blocks)
                values[row, : len(HYBRID)] = surface.hybrid(delta, ratio, blocks)
        except SourceError:
            raise
        except (ArithmeticError, InputError):
            continue
    return inputs, values


def _save(cache: Path, content: dict[str, Any]) -> str:
    """Write the file beside the database; return why that was not possible, or ""."""
    try:
        with atomic(cache, "arrays") as file:
            np.savez(file, **content)
    except InputError as error:
        return f"warning: {error}: not kept"
    return ""


def kept(cache: Path, key: str, inputs: Values, columns: int = len(HYBRID)) -> Values:
    """Return the features that a file has for rows whose inputs have not changed, else NaN."""
    values = np.full((len(inputs), columns), np.nan)
    try:  # numpy leaves a broken file open
        with np.load(
            BytesIO(require_file(cache).read_bytes()), allow_pickle=False
        ) as file:
            theirs, before, known = str(file["key"]), file["inputs"], file["values"]
    except (OSError, ValueError, KeyError, BadZipFile, EOFError, MemoryError, zlib.error):
        return values
    shapes = len(before) if before.ndim else 0, inputs.shape[1]
    fits = before.shape == shapes and known.shape == (len(before), columns)
    if theirs == key and fits and {before.dtype, known.dtype} == {np.dtype(np.float64)}:
        rows = min(len(before), len(values))
        same = (before[:rows] == inputs[:rows]).all(axis=1)
        values[:rows][same] = known[:rows][same]
    return values
