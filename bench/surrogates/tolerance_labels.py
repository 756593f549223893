"""Rows of the paper preset solved at several tolerances: times and areas, kept in a file."""

import hashlib
from collections.abc import Callable, Iterable, Sequence
from io import BytesIO
from pathlib import Path
from time import process_time
from typing import NamedTuple
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


class Kept(NamedTuple):
    """What the file holds: (t,) tolerances, (t, rows, 3) values and (t, rows) seconds."""

    tolerances: Values
    values: Values
    seconds: Values


class Solved:
    """Rows solved at several tolerances, kept in a file while they are made.

    Parameters
    ----------
    path : the file (npz); read if it is of the same scene
    tolerances : of the solver
    rows : number of rows

    Attributes
    ----------
    values : (tolerances, rows, 3) `MEASURED`, NaN where not solved yet
    seconds : (tolerances, rows) processor times [s]
    """

    def __init__(self, path: Path, tolerances: Sequence[float], rows: int) -> None:
        self.path, self.tolerances, self.rows = path, tuple(tolerances), rows
        self.values = np.full((len(tolerances), rows, len(MEASURED)), np.nan)
        self.seconds = np.full((len(tolerances), rows), np.nan)
        self._take_over()

    def missing(self) -> list[tuple[int, int]]:
        """Blocks of rows with something unsolved."""
        starts = range(0, self.rows, BLOCK)
        blocks = [(start, min(start + BLOCK, self.rows)) for start in starts]
        return [(a, b) for a, b in blocks if np.isnan(self.seconds[:, a:b]).any()]

    def solve(self, start: int, stop: int) -> None:
        """Solve a block at all tolerances, in an order that changes from block to block."""
        order = np.random.default_rng(start).permutation(len(self.tolerances))
        for place in order.tolist():
            scene = scene_of(self.tolerances[place])
            for row in range(start, stop):
                began = process_time()
                found = compute_rows(scene, row, row + 1)
                self.seconds[place, row] = process_time() - began
                if found["status"][0] == Status.DONE:
                    self.values[place, row] = [found[name][0] for name in MEASURED]

    def save(self) -> None:
        """Write the file, under its name once it is whole, with what else it held."""
        known = self._with_others()
        with whole(self.path, "arrays") as file:
            np.savez(
                file,
                key=_key(),
                tolerances=known.tolerances,
                values=known.values,
                seconds=known.seconds,
            )

    def _take_over(self) -> None:
        """Take over what the file has of these rows and tolerances."""
        kept = self._kept()
        if kept is not None:
            _copy(*kept, self.tolerances, self.values, self.seconds)

    def _with_others(self) -> Kept:
        """Join it with what the file has of other rows and tolerances."""
        kept = self._kept()
        if kept is None:
            return Kept(np.array(self.tolerances), self.values, self.seconds)
        tolerances = np.union1d(self.tolerances, kept.tolerances)
        rows = max(self.rows, kept.seconds.shape[1])
        values = np.full((len(tolerances), rows, len(MEASURED)), np.nan)
        seconds = np.full((len(tolerances), rows), np.nan)
        for source in (kept, Kept(np.array(self.tolerances), self.values, self.seconds)):
            _copy(*source, tolerances, values, seconds)
        return Kept(tolerances, values, seconds)

    def _kept(self) -> Kept | None:
        """What the file holds, if it is of the same scene, code and machine."""
        try:
            with np.load(BytesIO(self.path.read_bytes()), allow_pickle=False) as file:
                if str(file["key"]) != _key():
                    return None
                kept = Kept(file["tolerances"], file["values"], file["seconds"])
        except (OSError, ValueError, KeyError, BadZipFile, EOFError):
            return None
        rows = kept.seconds.shape[1:]
        if kept.values.shape != (len(kept.tolerances), *rows, len(MEASURED)):
            return None
        return kept


def _copy(
    tolerances: Values, values: Values, seconds: Values, wanted: Iterable[float], *into: Values
) -> None:
    """Copy the rows that both sides have, tolerance by tolerance."""
    rows = min(seconds.shape[1], into[1].shape[1])
    for place, tolerance in enumerate(wanted):
        for there in np.flatnonzero(tolerances == tolerance):
            into[0][place, :rows] = values[there, :rows]
            into[1][place, :rows] = seconds[there, :rows]


def scene_of(tolerance: float) -> Scene:
    """The paper preset with another tolerance."""
    preset = load("paper")
    return preset.model_copy(
        update={"contact": preset.contact.model_copy(update={"rtol": tolerance})}
    )


def _key() -> str:
    """Fingerprint of what the values depend on besides row and tolerance."""
    now = circumstances()  # times are those of one machine and one state of the code
    text = f"{PHYSICS} {scene_of(TIGHT).fingerprint()} {now['commit']} {now['machine']}"
    return hashlib.sha256(text.encode()).hexdigest()


def solve_all(solved: Solved, remark: Callable[[str], None]) -> None:
    """Solve what is missing; a signal ends it between two blocks."""
    missing = solved.missing()
    if not missing:
        return
    total = sum(stop - start for start, stop in missing)
    remark(f"solving {total} rows at {len(solved.tolerances)} tolerances")
    compute_rows(scene_of(DEFAULT), 0, 2)  # tables of the first solve belong to no tolerance
    with Interruption(listening=True) as interruption, RunProgress(total, "rows") as progress:
        for number, (start, stop) in enumerate(missing, 1):
            solved.solve(start, stop)
            progress.advance(stop - start, 0)
            if interruption.requested() or number % SAVE_BLOCKS == 0 or number == len(missing):
                solved.save()
            if interruption.requested():
                remark("interrupted; the same command goes on")
                raise KeyboardInterrupt
