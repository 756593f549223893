"""What a campaign works on: a scene, its undisturbed database, the one that is disturbed."""

import json
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gen.database import Reader
from gen.generation.plan import parameters
from gen.runtime.errors import InputError
from gen.scene import Scene
from gen.scene.columns import ALL_COLUMNS
from gen.schema import Status
from tests.faults.runs import BOUND, PROGRAM, Ended, Hang, Run

SCENE = "samples = {samples}\nsamples_per_surface = 2\n[surface]\nnodes = 17\n"
SAMPLES = 600
"""Rows of a campaign's database: some seconds of work, so that most strikes come in its midst."""

RANKS = 3
"""Processes of a run under mpiexec: a master and two workers."""

EARLY = 0.25
"""Share of the strikes at any moment from the start on; the others find a run at work."""

Columns = dict[str, NDArray[Any]]


class NotPossible(Exception):
    """A disturbance is not allowed on this machine; the text says why."""


@dataclass(frozen=True)
class Found:
    """What came of one disturbance.

    Attributes
    ----------
    detail : what was done, in words
    fault : what was wrong, "" if nothing was
    hit : whether the run was still there to be disturbed
    seconds : from the disturbance to the end of the run [s]
    """

    detail: str
    fault: str = ""
    hit: bool = True
    seconds: float = 0.0


class Stage:
    """A folder with a scene, its reference, and the database under attack.

    Parameters
    ----------
    folder : an empty folder to work in
    samples : rows of the database
    random : of victims and moments

    Attributes
    ----------
    path : the database under attack, which is there once a run has made it
    reference : columns of an undisturbed run
    """

    def __init__(self, folder: Path, samples: int, random: np.random.Generator) -> None:
        self.folder, self.random = folder, random
        text = SCENE.format(samples=samples)
        (folder / "scene.toml").write_text(text)
        self.scene = Scene.parse(text, "scene.toml")
        self.path = folder / "disturbed.h5"
        with self.run(0, output="reference.h5") as run:
            ended = run.wait()
        reference = columns_of(folder / "reference.h5")
        if ended.code or reference is None:
            raise InputError(f"an undisturbed run fails: {ended.text.strip()}")
        self.reference: Columns = reference

    def columns(self) -> Columns | None:
        """All columns of the database under attack; None if there is none."""
        return columns_of(self.path)

    def pending(self) -> NDArray[np.intp]:
        """Rows that the database under attack lacks."""
        columns = self.columns()
        rows = self.scene.samples
        return np.arange(rows) if columns is None else np.flatnonzero(~finished(columns))

    def ranks(self) -> int:
        """Alone or under mpiexec, as it comes."""
        return int(self.random.choice((0, RANKS)))

    def run(
        self,
        ranks: int,
        *options: str,
        output: str = "disturbed.h5",
        ailments: Mapping[int, str] | None = None,
    ) -> Run:
        """Start a run; `ailments` are rows, and what they suffer from: see `program`."""
        program: tuple[str, ...] = PROGRAM
        if ailments:
            known = {
                repr(float(parameters(self.scene, row, row + 1).delta[0])): name
                for row, name in ailments.items()
            }
            (self.folder / "ailments.json").write_text(json.dumps(known))
            program = ("-m", "tests.faults.program", "ailments.json")
        return Run(self.folder, ranks, "run", "scene.toml", "-o", output, *options, program=program)

    def await_moment(self, run: Run) -> None:
        """Wait for a random moment of a run, or for its end if that is sooner."""
        if self.random.random() < EARLY:
            time.sleep(self.random.uniform(0.0, 2.0))
        else:
            share = self.random.uniform(0.0, 0.8)
            self.await_rows(run, 1 + int(share * len(self.pending())))
            time.sleep(self.random.uniform(0.0, 0.05))

    def await_rows(self, run: Run, number: int) -> None:
        """Wait until a run has finished some rows, or has ended."""
        wanted = self._finished() + number
        limit = time.monotonic() + BOUND
        while run.alive() and self._finished() < wanted:
            if time.monotonic() > limit:
                raise Hang
            time.sleep(0.05)

    def _finished(self) -> int:
        """Number of finished rows, without a look at their columns."""
        if not self.path.exists():
            return 0
        with Reader(self.path) as reader:
            counts = reader.counts()
        return counts.done + counts.failed


def columns_of(path: Path) -> Columns | None:
    """All columns of a database, into memory; None where there is no file yet."""
    if not path.exists():
        return None
    with Reader(path) as reader:
        return {column.name: reader.column(column.name) for column in reader.columns()}


def finished(columns: Columns | None) -> NDArray[np.bool_]:
    """(rows,) whether a row is done or failed; no rows in no file."""
    if columns is None:
        return np.zeros(0, dtype=bool)
    return np.asarray(columns["status"] != Status.PENDING)


def row_fault(
    before: Columns | None,
    now: Columns | None,
    reference: Columns,
    failed: Mapping[int, int] | None = None,
) -> str:
    """What is wrong with the finished rows of a database after a disturbance, "" if nothing is.

    Parameters
    ----------
    before, now : its columns before and after, None for no file
    reference : the columns of an undisturbed run of the same scene
    failed : rows that have to have failed, and the code of the reason that they have to give
    """
    if now is None:
        return "" if before is None else "the database has vanished"
    expected = failed or {}
    for row, reason in expected.items():
        if (now["status"][row], now["reason"][row]) != (Status.FAILED, reason):
            return f"row {row} should have failed for reason {reason}"
    done = finished(now)
    done[list(expected)] = False
    for name in (column.name for column in ALL_COLUMNS if column.deterministic):
        if name in now and now[name][done].tobytes() != reference[name][done].tobytes():
            return f"a finished row has a wrong {name}"
    if before is not None:
        old = finished(before)
        if not finished(now)[old].all():
            return "a finished row is pending again"
        if now["solve_seconds"][old].tobytes() != before["solve_seconds"][old].tobytes():
            return "a finished row was computed again"
    return ""


def difference(now: Columns | None, reference: Columns) -> str:
    """How a finished database differs from the undisturbed one, "" if it does not."""
    if now is None or not finished(now).all():
        return "the database that should be finished has pending rows"
    return row_fault(None, now, reference)


def code_fault(ended: Ended, now: Columns | None) -> str:
    """What is wrong with an exit code and a text, whatever has happened."""
    if ended.code == 0 and (now is None or not finished(now).all()):
        return "exit code 0 although rows are pending"
    if ended.code == 2 and "Traceback" in ended.text:
        return "a traceback in place of one clear line"
    return ""


def refusal_fault(ended: Ended, words: str) -> str:
    """What is wrong with the way in which a run refused: exit code 2 and one line, these words."""
    lines = [line for line in ended.text.splitlines() if line.startswith("gen: ")]
    if ended.code != 2:
        return f"exit code {ended.code} in place of a refusal"
    if len(lines) != 1 or "Traceback" in ended.text:
        return "a refusal that is not one clear line"
    return "" if words in lines[0] else f"a refusal without {words!r}: {lines[0]}"
