"""Rows of the paper preset solved at several tolerances: areas and times, kept in files."""

import hashlib
from collections.abc import Sequence
from pathlib import Path
from time import process_time

import numpy as np
from numpy.typing import NDArray

from bench.circumstances import circumstances
from bench.report import remark
from gen.generation.sample import compute_rows
from gen.runtime.output import make_folder
from gen.runtime.progress import RunProgress
from gen.scene import Scene, load
from gen.schema import PHYSICS, Status

TIGHT = 1e-10  # tolerance of the areas that count as true

DEFAULT = load("paper").contact.rtol

# Columns of a row's labels; its processor time [s] is the last one.
MEASURED = ("area_percent", "force", "contact_nodes")
# Rows that are solved at one tolerance before the next: none of them gets a busier machine.
BLOCK = 20
# `MEASURED` and seconds of rows, shape (n, 4); NaN where not solved yet, or in vain.
Labels = NDArray[np.float64]


def scene_of(tolerance: float) -> Scene:
    """Return the paper preset with another tolerance."""
    preset = load("paper")
    contact = preset.contact.model_copy(update={"rtol": tolerance})
    return preset.model_copy(update={"contact": contact})


def kept(folder: Path, tolerance: float, rows: int) -> Labels:
    """Open the labels of some rows, at least, that a file of their own holds.

    What is assigned to them is in the file at once. Its name tells scene, code and machine.
    """
    now = circumstances()  # times are those of one machine and one state of the code
    key = f"{PHYSICS} {scene_of(tolerance).fingerprint()} {now['state']} {now['machine']}"
    name = hashlib.sha256(key.encode()).hexdigest()[:16]
    empty = np.full((rows, len(MEASURED) + 1), np.nan)
    path = folder / f"rtol-{tolerance:g}-{name}.f8"
    make_folder(folder)
    with path.open("ab") as file:
        whole = file.tell() - file.tell() % empty[0].nbytes
        file.truncate(whole)
        file.write(empty.tobytes()[whole:])
    return np.memmap(path, np.float64, "r+").reshape(-1, empty.shape[1])


def solve_all(folder: Path, tolerances: Sequence[float], rows: int) -> dict[float, Labels]:
    """Solve rows at all tolerances, as far as a folder does not hold them yet."""
    labels = {each: kept(folder, each, rows) for each in tolerances}
    missing = [
        start
        for start in range(0, rows, BLOCK)
        if any(np.isnan(each[start : start + BLOCK, -1]).any() for each in labels.values())
    ]
    if missing:
        remark(f"solving {len(missing)} blocks of {BLOCK} rows at {len(labels)} tolerances")
        compute_rows(scene_of(DEFAULT), 0, 2)  # tables of the first solve belong to no tolerance
    with RunProgress(len(missing) * BLOCK, "rows") as progress:
        for start in missing:
            for place in np.random.default_rng(start).permutation(len(labels)):
                tolerance = tolerances[place]
                for row in range(start, min(start + BLOCK, rows)):
                    labels[tolerance][row] = _solved(scene_of(tolerance), row)
            progress.advance(BLOCK, 0)
    return labels


def _solved(scene: Scene, row: int) -> list[float]:
    """Return the labels of one row; they are NaN if it has no solution."""
    began = process_time()
    solved = compute_rows(scene, row, row + 1)
    seconds = process_time() - began
    done = solved["status"][0] == Status.DONE
    return [*(float(solved[name][0]) if done else np.nan for name in MEASURED), seconds]
