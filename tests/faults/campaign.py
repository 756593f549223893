"""The campaign: one disturbance after the other, each with its verdict."""

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gen.runtime.errors import InputError
from tests.faults import places, samples, signals, storage
from tests.faults.rows import count_finished, difference, finished, row_fault
from tests.faults.runs import BOUND, Hang
from tests.faults.stage import SAMPLES, Found, NotPossible, Stage

KINDS: dict[str, Callable[[Stage], Found]] = {
    "SIGKILL to a run alone": signals.kill_alone,
    "SIGKILL to a worker": signals.kill_worker,
    "SIGKILL to the master": signals.kill_master,
    "SIGKILL to mpiexec": signals.kill_launcher,
    "SIGTERM": signals.terminate,
    "SIGINT": signals.interrupt,
    "SIGUSR1": signals.warn,
    "SIGSTOP, then SIGCONT": signals.stop_worker,
    "files may not grow": storage.disk_full_midway,
    "full disk": storage.disk_full_for_real,
    "file cut off": storage.file_cut_off,
    "second writer": storage.second_writer,
    "second writer by a link": places.writer_by_link,
    "file replaced": places.file_replaced,
    "file moved": places.file_moved,
    "file made read-only": places.file_read_only,
    "full disk under stderr": places.deaf_terminal,
    "pipe for a file": places.named_pipe,
    "wrong option on all ranks": places.wrong_option,
    "sample raises": samples.sample_raises,
    "sample returns NaN": samples.sample_returns_nan,
    "sample does not converge": samples.sample_does_not_converge,
    "sample never ends": samples.sample_never_ends,
    "sample has a bug": samples.sample_has_a_bug,
}
"""The kinds of disturbances, by the names in the report."""

ROUNDS = 168
"""Disturbances of a whole campaign: each kind seven times."""

MISSES = 4
"""Rounds for each disturbance that is asked for, at most: some come when the run is over."""


@dataclass(frozen=True)
class Round:
    """One disturbed run.

    Attributes
    ----------
    kind : of the disturbance
    detail : what was done
    hit : whether the run was there to be disturbed; if not, the round does not count
    before, after : finished rows of the database under attack
    seconds : from the disturbance to the end of the run [s]
    fault : what was wrong, "" if nothing was
    """

    kind: str
    detail: str
    hit: bool
    before: int
    after: int
    seconds: float
    fault: str


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
        try:
            done = _disturbed(stage, kind)
        except NotPossible as reason:
            remark(f"left out: {kind}: {reason}")
            open_kinds.remove(kind)
            continue
        tried += 1
        hits += done.hit
        yield done
    yield _completed(stage)


def _disturbed(stage: Stage, kind: str) -> Round:
    """Disturb the database under attack, begun anew where it is finished."""
    before = stage.columns()
    if before is not None and finished(before).all():
        stage.path.unlink()
        before = None
    found = _outcome(lambda: KINDS[kind](stage))
    now = stage.columns()
    fault = found.fault or row_fault(before, now, stage.reference)
    if not fault and now is not None and finished(now).all():
        fault = difference(now, stage.reference)
    counts = count_finished(before), count_finished(now)
    return Round(kind, found.detail, found.hit, *counts, found.seconds, fault)


def _completed(stage: Stage) -> Round:
    """Let the last database finish; it has to equal the undisturbed one."""
    before = stage.columns()

    def complete() -> Found:
        began = time.monotonic()
        with stage.run(0) as run:
            ended = run.wait()
        fault = f"exit code {ended.code}" if ended.code else ""
        return Found("the rest", fault, seconds=time.monotonic() - began)

    found = _outcome(complete)
    now = stage.columns()
    fault = found.fault or row_fault(before, now, stage.reference)
    fault = fault or difference(now, stage.reference)
    counts = count_finished(before), count_finished(now)
    return Round("", found.detail, False, *counts, found.seconds, fault)


def _outcome(act: Callable[[], Found]) -> Found:
    """What came of an act; one that hangs is a fault too."""
    try:
        return act()
    except Hang:
        return Found("", f"no end within {BOUND:g} s", seconds=BOUND)
