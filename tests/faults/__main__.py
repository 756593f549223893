"""`python -m tests.faults`: the fault campaign, from 77 faults down to a single kind."""

import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from bench.files import write_rows
from gen.runtime import command_line, farm
from gen.runtime.errors import InputError
from tests.faults.kinds import KINDS
from tests.faults.stage import (
    BOUND,
    SAMPLES,
    Found,
    Hang,
    Stage,
    columns_of,
    difference,
    finished,
    row_fault,
)

ROUNDS = 7 * len(KINDS)
"""Disturbances of a whole campaign: each kind seven times."""

MISSES = 4
"""Rounds for each disturbance that is asked for, at most: some come when the run is over."""


@dataclass(frozen=True)
class Round:
    """One disturbed run: its kind ("" if only finished), what came of it, finished rows."""

    kind: str
    found: Found
    before: int
    after: int

    def line(self) -> str:
        """The round in one line."""
        verdict = self.found.fault or ("ok" if self.found.hit or not self.kind else "came too late")
        return (
            f"{self.kind or 'nothing':24} {self.found.detail:32} {self.before:5} ->"
            f" {self.after:5} rows, end after {self.found.seconds:4.1f} s: {verdict}"
        )


def campaign(
    folder: Path,
    rounds: int = ROUNDS,
    *,
    seed: int = 0,
    samples: int = SAMPLES,
    kinds: Sequence[str] = tuple(KINDS),
    minutes: float = float("inf"),
) -> Iterator[Round]:
    """Disturb runs until `rounds` have hit, each kind in turn and in random order.

    Finished databases are compared and begun anew, the last one at the end as a round of kind "".
    No round begins after `minutes`.
    """
    if unknown := set(kinds) - set(KINDS):
        raise InputError(f"no kind {sorted(unknown)[0]!r}; there are {', '.join(KINDS)}")
    random = np.random.default_rng(seed)
    stage = Stage(folder, samples, random)
    limit = time.monotonic() + 60.0 * minutes
    deck: list[str] = []
    hits = tried = 0
    while hits < rounds and tried < MISSES * rounds and time.monotonic() < limit:
        deck = deck or [str(kind) for kind in random.permutation(kinds)]
        kind = deck.pop()
        columns = columns_of(stage.path)
        if columns is not None and finished(columns).all():
            stage.path.unlink()
        done = _round(stage, kind, KINDS[kind])
        tried += 1
        hits += done.found.hit
        yield done
    yield _round(stage, "", _completed)


def _round(stage: Stage, kind: str, act: Callable[[Stage], Found]) -> Round:
    """Disturb the database, and judge the rows that it has then."""
    before = columns_of(stage.path)
    try:
        found = act(stage)
    except Hang:
        found = Found("", f"no end within {BOUND:g} s", seconds=BOUND)
    now = columns_of(stage.path)
    fault = found.fault or row_fault(before, now, stage.reference)
    if not fault and not kind:
        fault = difference(now, stage.reference)
    judged = Found(found.detail, fault, found.hit, found.seconds)
    return Round(kind, judged, int(finished(before).sum()), int(finished(now).sum()))


def _completed(stage: Stage) -> Found:
    """Let the last database finish."""
    with stage.run(0) as run:
        ended = run.wait()
    fault = f"exit code {ended.code}" if ended.code else ""
    return Found("the rest", fault, hit=False, seconds=ended.seconds)


def by_kind(rounds: Sequence[Round]) -> list[dict[str, Any]]:
    """Rows of a table: faults of each kind, and what came of them."""
    most = max((done.after for done in rounds), default=0)
    rows = []
    for kind in KINDS:
        mine = [done for done in rounds if done.kind == kind]
        hits = [done for done in mine if done.found.hit]
        wrong = sum(bool(done.found.fault) for done in mine)
        if mine:
            partly = [done for done in hits if 0 < done.before < most or 0 < done.after < most]
            rows.append(
                {
                    "kind": kind,
                    "injected": len(hits),
                    "partly_done": len(partly),
                    "longest_end_s": max(done.found.seconds for done in mine),
                    "wrong": wrong,
                    "verdict": "failed" if wrong else "passed",
                }
            )
    return rows


def summary(rounds: Sequence[Round]) -> str:
    """The verdict in words."""
    injected = sum(done.found.hit for done in rounds)
    kinds = len({done.kind for done in rounds if done.found.hit})
    wrong = sum(bool(done.found.fault) for done in rounds)
    return (
        f"{injected} faults of {kinds} kinds injected; {wrong} times a row was lost, done twice or"
        f" wrong, an answer was wrong, or a run took more than {BOUND:g} s to end"
    )


app = typer.Typer(add_completion=False, rich_markup_mode=None)


@app.command()
def faults(
    rounds: Annotated[
        int | None, typer.Option(min=1, help="Faults to inject, 77 unless given.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of kinds, victims and moments.")] = 0,
    minutes: Annotated[float, typer.Option(min=0.0, help="No round begins later.")] = 30.0,
    only: Annotated[
        list[str] | None, typer.Option(metavar="KIND", help="A kind of the table, alone.")
    ] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="DIR", help="Write faults.csv there.")
    ] = None,
) -> int:
    """Disturb runs at random and see whether anything is lost, wrong or done twice.

    Signals to a run alone, to worker, master and mpiexec; full disks, replaced files, failing
    samples. Exit code 0 if as many faults as asked for were injected and nothing was wrong, else 1.
    """
    wanted, done = rounds or ROUNDS, []
    with tempfile.TemporaryDirectory() as folder:
        for interrupted in campaign(
            Path(folder), wanted, seed=seed, kinds=only or tuple(KINDS), minutes=minutes
        ):
            done.append(interrupted)
            typer.echo(f"{len(done):3} {interrupted.line()}")
    typer.echo(summary(done))
    if output is not None:
        write_rows(output / "faults.csv", by_kind(done))
    missed = wanted - sum(interrupted.found.hit for interrupted in done)
    if missed > 0:
        typer.echo(f"{missed} of {wanted} faults could not be injected")
    return 1 if missed > 0 or any(interrupted.found.fault for interrupted in done) else 0


def main(arguments: Sequence[str]) -> int:
    """Run one command line; return its exit code."""
    return command_line.main(app, arguments, "faults", alone=True)


if __name__ == "__main__":
    command_line.start(default_sigint=False)
    code = main(sys.argv[1:])
    farm.leave()
    sys.exit(code)
