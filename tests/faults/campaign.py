"""The campaign: one disturbance after the other, each with its verdict."""

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gen.runtime.errors import InputError
from tests.faults.kinds import KINDS
from tests.faults.runs import BOUND, Hang
from tests.faults.stage import SAMPLES, Found, NotPossible, Stage, difference, finished, row_fault

ROUNDS = 7 * len(KINDS)
"""Disturbances of a whole campaign: each kind seven times."""

MISSES = 4
"""Rounds for each disturbance that is asked for, at most: some come when the run is over."""


@dataclass(frozen=True)
class Round:
    """One disturbed run.

    Attributes
    ----------
    kind : of the disturbance, "" where the database is only finished
    found : what came of it, with what is wrong with the rows as well
    before, after : finished rows of the database under attack
    """

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
    remark: Callable[[str], None] = lambda line: None,
) -> Iterator[Round]:
    """Disturb runs until all rounds have hit; finished databases are compared and begun anew.

    Parameters
    ----------
    folder : an empty folder to work in
    rounds : number of disturbances that have to hit
    seed : of kinds, victims and moments
    samples : rows of the database
    kinds : what to do to it, names of `KINDS`, in turn and in random order
    minutes : no round begins later
    remark : told what is not possible on this machine

    Yields
    ------
    All rounds, and at last one of the kind "" in which the database is finished and compared
    """
    if unknown := set(kinds) - set(KINDS):
        raise InputError(f"no kind {sorted(unknown)[0]!r}; there are {', '.join(KINDS)}")
    random = np.random.default_rng(seed)
    stage = Stage(folder, samples, random)
    limit = time.monotonic() + 60.0 * minutes
    open_kinds = list(kinds)
    deck: list[str] = []
    hits = tried = 0
    while hits < rounds and tried < MISSES * rounds and open_kinds and time.monotonic() < limit:
        deck = deck or [str(kind) for kind in random.permutation(open_kinds)]
        kind = deck.pop()
        columns = stage.columns()
        if columns is not None and finished(columns).all():
            stage.path.unlink()
        try:
            done = _round(stage, kind, KINDS[kind])
        except NotPossible as reason:
            remark(f"left out: {kind}: {reason}")
            open_kinds.remove(kind)
            continue
        tried += 1
        hits += done.found.hit
        yield done
    yield _round(stage, "", _completed)


def _round(stage: Stage, kind: str, act: Callable[[Stage], Found]) -> Round:
    """Disturb the database, and judge the rows that it has then."""
    before = stage.columns()
    try:
        found = act(stage)
    except Hang:
        found = Found("", f"no end within {BOUND:g} s", seconds=BOUND)
    now = stage.columns()
    fault = found.fault or row_fault(before, now, stage.reference)
    if not fault and not kind:
        fault = difference(now, stage.reference)
    judged = Found(found.detail, fault, found.hit, found.seconds)
    return Round(kind, judged, int(finished(before).sum()), int(finished(now).sum()))


def _completed(stage: Stage) -> Found:
    """Let the last database finish."""
    began = time.monotonic()
    with stage.run(0) as run:
        ended = run.wait()
    fault = f"exit code {ended.code}" if ended.code else ""
    return Found("the rest", fault, hit=False, seconds=time.monotonic() - began)


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
