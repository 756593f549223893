"""`python -m tests.faults`: the fault campaign, from 77 faults down to a single kind."""

import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
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


def campaign(
    folder: Path,
    rounds: int = ROUNDS,
    *,
    seed: int = 0,
    samples: int = SAMPLES,
    kinds: Sequence[str] = tuple(KINDS),
    minutes: float = float("inf"),
) -> Iterator[Found]:
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
        hits += done.hit
        yield done
    yield _round(stage, "", _completed)


def _round(stage: Stage, kind: str, act: Callable[[Stage], Found]) -> Found:
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
    rows = [int(finished(columns).sum()) for columns in (before, now)]
    return replace(found, kind=kind, fault=fault, before=rows[0], after=rows[1])


def _completed(stage: Stage) -> Found:
    """Let the last database finish."""
    with stage.run(0) as run:
        ended = run.wait()
    fault = f"exit code {ended.code}" if ended.code else ""
    return Found("the rest", fault, hit=False, seconds=ended.seconds)


def by_kind(rounds: Sequence[Found]) -> list[dict[str, Any]]:
    """Rows of a table: faults of each kind, and what came of them."""
    most = max((done.after for done in rounds), default=0)
    rows: list[dict[str, Any]] = []
    for kind in filter({done.kind for done in rounds}.__contains__, KINDS):
        mine = [done for done in rounds if done.kind == kind]
        hits = [done for done in mine if done.hit]
        wrong = sum(bool(done.fault) for done in mine)
        row = {"kind": kind, "injected": len(hits)}
        row["partly_done"] = sum(
            0 < done.before < most or 0 < done.after < most for done in hits
        )
        row["longest_end_s"] = max(done.seconds for done in mine)
        rows.append({**row, "wrong": wrong, "verdict": "failed" if wrong else "passed"})
    return rows


app = typer.Typer(add_completion=False, rich_markup_mode=None)


@app.command()
def faults(
    rounds: Annotated[int, typer.Option(min=1, help="Faults to inject.")] = ROUNDS,
    seed: Annotated[
        int, typer.Option(min=0, help="Seed of kinds, victims and moments.")
    ] = 0,
    minutes: Annotated[
        float, typer.Option(min=0.0, help="No round begins later.")
    ] = 30.0,
    only: Annotated[
        list[str] | None, typer.Option(metavar="KIND", help="A kind of the table, alone.")
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="DIR", help="Write faults.csv there."),
    ] = None,
) -> int:
    """Disturb runs at random and see whether anything is lost, wrong or done twice.

    Signals to a run alone, to worker, master and mpiexec; full disks, replaced files, failing
    samples. Exit code 0 if as many faults as asked for were injected and nothing was wrong, else 1.
    """
    done: list[Found] = []
    kinds = only or tuple(KINDS)
    with tempfile.TemporaryDirectory() as folder:
        for found in campaign(
            Path(folder), rounds, seed=seed, kinds=kinds, minutes=minutes
        ):
            done.append(found)
            typer.echo(f"{len(done):3} {found.line()}")
    injected, wrong = (
        sum(found.hit for found in done),
        sum(bool(found.fault) for found in done),
    )
    typer.echo(
        f"{injected} of {rounds} faults injected; {wrong} times a row was lost, done twice or"
        f" wrong, an answer was wrong, or a run took more than {BOUND:g} s to end"
    )
    if output is not None:
        write_rows(output / "faults.csv", by_kind(done))
    return 1 if injected < rounds or wrong else 0


if __name__ == "__main__":
    with farm.process():
        code = command_line.main(app, sys.argv[1:], "faults", single_process=True)
    sys.exit(code)
