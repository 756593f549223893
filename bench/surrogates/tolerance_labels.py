"""Rows of the paper preset solved at several tolerances: times and areas, kept in files."""

import hashlib
from collections.abc import Callable, Sequence
from io import BytesIO
from pathlib import Path
from time import process_time
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from bench.circumstances import circumstances
from gen.generation.sample import compute_rows
from gen.runtime.interruption import Interruption
from gen.runtime.output import whole
from gen.runtime.progress import RunProgress
from gen.scene import Scene, load
from gen.schema import PHYSICS, Status

TIGHT = 1e-10
"""Tolerance of the areas that count as true."""

DEFAULT = load("paper").contact.rtol

Values = NDArray[np.float64]

MEASURED = ("area_percent", "force", "contact_nodes")

BLOCK = 20
"""Rows that are solved at one tolerance before the next: none of them gets a busier machine."""

SAVE_BLOCKS = 5
"""Blocks between two saves."""


class Labels:
    """Rows solved at one tolerance, kept in a file while they are made.

    Parameters
    ----------
    folder : of the file; one of the same scene, code and machine is continued
    tolerance : of the solver
    rows : number of rows, at least

    Attributes
    ----------
    values : (rows, 3) `MEASURED`, NaN where not solved yet or in vain
    seconds : (rows,) processor times, NaN where not solved yet [s]
    """

    def __init__(self, folder: Path, tolerance: float, rows: int) -> None:
        self._path = folder / f"rtol-{tolerance:g}.npz"
        self._scene = scene_of(tolerance)
        kept = self._kept()
        self._table = np.full((max(rows, len(kept)), len(MEASURED) + 1), np.nan)
        self._table[: len(kept)] = kept
        self.values, self.seconds = self._table[:, :-1], self._table[:, -1]

    def solve(self, start: int, stop: int) -> None:
        """Solve a block of rows."""
        for row in range(start, stop):
            began = process_time()
            solved = compute_rows(self._scene, row, row + 1)
            self.seconds[row] = process_time() - began
            if solved["status"][0] == Status.DONE:
                self.values[row] = [solved[name][0] for name in MEASURED]

    def save(self) -> None:
        """Write the file, under its name once it is whole."""
        with whole(self._path, "arrays") as file:
            np.savez(file, key=_key(), table=self._table)

    def _kept(self) -> Values:
        """Return the rows that the file holds, if it is of the same scene, code and machine."""
        nothing = np.empty((0, len(MEASURED) + 1))
        try:
            with np.load(BytesIO(self._path.read_bytes()), allow_pickle=False) as file:
                table: Values = file["table"] if str(file["key"]) == _key() else nothing
        except (OSError, ValueError, KeyError, BadZipFile, EOFError):
            return nothing
        return table if table.shape[1:] == nothing.shape[1:] else nothing


def scene_of(tolerance: float) -> Scene:
    """Return the paper preset with another tolerance."""
    preset = load("paper")
    return preset.model_copy(
        update={"contact": preset.contact.model_copy(update={"rtol": tolerance})}
    )


def _key() -> str:
    """Return a fingerprint of all that the values depend on besides row and tolerance."""
    now = circumstances()  # times are those of one machine and one state of the code
    text = f"{PHYSICS} {scene_of(TIGHT).fingerprint()} {now['commit']} {now['machine']}"
    return hashlib.sha256(text.encode()).hexdigest()


def solve_all(
    folder: Path, tolerances: Sequence[float], rows: int, remark: Callable[[str], None]
) -> dict[float, Labels]:
    """Solve rows at all tolerances, as far as they are not kept in a folder.

    Raises
    ------
    KeyboardInterrupt
        After a signal, between two blocks: the same call goes on.
    """
    labels = {each: Labels(folder, each, rows) for each in tolerances}
    blocks = [(start, min(start + BLOCK, rows)) for start in range(0, rows, BLOCK)]
    missing = [
        block
        for block in blocks
        if any(np.isnan(each.seconds[slice(*block)]).any() for each in labels.values())
    ]
    if not missing:
        return labels
    total = sum(stop - start for start, stop in missing)
    remark(f"solving {total} rows at {len(labels)} tolerances")
    compute_rows(scene_of(DEFAULT), 0, 2)  # tables of the first solve belong to no tolerance
    with Interruption(listening=True) as interruption, RunProgress(total, "rows") as progress:
        for number, (start, stop) in enumerate(missing, 1):
            for place in np.random.default_rng(start).permutation(len(labels)):
                labels[tolerances[place]].solve(start, stop)
            progress.advance(stop - start, 0)
            if interruption.requested() or number % SAVE_BLOCKS == 0 or number == len(missing):
                for each in labels.values():
                    each.save()
            if interruption.requested():
                remark("interrupted; the same command goes on")
                raise KeyboardInterrupt
    return labels
