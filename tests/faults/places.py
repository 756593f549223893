"""Disturbances of places: files replaced, moved, read-only, linked; pipes, a deaf terminal."""

import os
import shutil
import signal
import time
from collections.abc import Callable
from pathlib import Path

from tests.faults.rows import Columns, columns_of, difference, finished, row_fault
from tests.faults.runs import Ended, await_lock, is_locked
from tests.faults.stage import RANKS, Found, NotPossible, Stage, code_fault, refusal_fault

FULL = Path("/dev/full")
"""A device that is always full."""

REFUSED = (
    ("--rows", "9:3"),
    ("--rows", "0:" + "9" * 5000),
    ("--sample-limit", "-1"),
    ("--sample-limit", "1e10"),
    ("--writer", "nobody"),
    ("--force", "--again"),
)
"""Options that no run takes."""


def file_replaced(stage: Stage) -> Found:
    """Another file takes the name of the database: nothing is written to it, the run ends."""

    def replace() -> None:
        copy = stage.folder / "copy.h5"
        shutil.copyfile(stage.path, copy)
        copy.replace(stage.path)

    return _in_its_midst(stage, replace, "replaced by another file")


def file_moved(stage: Stage) -> Found:
    """The database gets another name: the run ends, the rows are where the file is."""
    moved = stage.folder / "moved.h5"
    found = _in_its_midst(stage, lambda: stage.path.rename(moved), "while it was being written")
    if moved.exists():
        moved.replace(stage.path)
    return found


def file_read_only(stage: Stage) -> Found:
    """The database is made read-only: this run may go on, the next leaves it alone."""
    with stage.run(stage.ranks()) as run:
        stage.await_rows(run, 1)
        hit = run.alive() and stage.path.exists()
        stage.path.chmod(0o444)
        began = time.monotonic()
        ended = run.wait()
        seconds = time.monotonic() - began
    fault = code_fault(ended, stage.columns())
    if ended.code and not fault:
        fault = refusal_fault(ended, "read-only")
    stage.path.chmod(0o644)
    path = stage.folder / "kept.h5"  # unfinished, so that there is something to write
    with stage.run(0, "--rows", "0:3", output="kept.h5") as first:
        first.wait()
    path.chmod(0o444)
    content = path.read_bytes()
    with stage.run(stage.ranks(), output="kept.h5") as second:
        fault = fault or refusal_fault(second.wait(), "read-only")
    if not fault and path.read_bytes() != content:
        fault = "a read-only file has been changed"
    path.unlink()
    return Found("", fault, hit, seconds)


def deaf_terminal(stage: Stage) -> Found:
    """Standard error is on a full disk: nobody hears of the run, which computes all rows.

    Alone: mpiexec itself ends a job whose lines it cannot pass on.
    """
    if not FULL.exists():
        raise NotPossible(f"no {FULL}")
    with FULL.open("wb") as full:
        began = time.monotonic()
        with stage.run(0, errors=full) as run:
            ended = run.wait()
        seconds = time.monotonic() - began
    fault = f"exit code {ended.code}" if ended.code else ""
    return Found("", fault or difference(stage.columns(), stage.reference), seconds=seconds)


def named_pipe(stage: Stage) -> Found:
    """A pipe in place of the scene or the database: refused at once, not waited for."""
    scene = bool(stage.random.random() < 0.5)
    pipe = stage.folder / ("pipe.toml" if scene else "pipe.h5")
    os.mkfifo(pipe)
    files = (pipe.name, "unused.h5") if scene else ("scene.toml", pipe.name)
    began = time.monotonic()
    with stage.run(stage.ranks(), scene=files[0], output=files[1]) as run:
        fault = refusal_fault(run.wait(), pipe.name)
    seconds = time.monotonic() - began
    pipe.unlink()
    return Found("scene" if scene else "database", fault, seconds=seconds)


def writer_by_link(stage: Stage) -> Found:
    """A second run on the same file, under another of its names, is refused."""
    link = stage.folder / "link.h5"
    with stage.run(stage.ranks()) as first:
        stage.await_rows(first, 1)
        first.send("everybody", signal.SIGSTOP)
        hit = is_locked(stage.path)
        link.symlink_to(stage.path)
        began = time.monotonic()
        with stage.run(stage.ranks(), output="link.h5") as second:
            ended = second.wait()
        seconds = time.monotonic() - began
        first.send("everybody", signal.SIGCONT)
        first_ended = first.wait()
        await_lock(stage.path)
    link.unlink()
    fault = refusal_fault(ended, "is being written by") if hit else ""
    return Found("", fault or code_fault(first_ended, stage.columns()), hit, seconds)


def wrong_option(stage: Stage) -> Found:
    """A wrong option reaches all ranks: they all end, and one of them says why."""
    option, value = REFUSED[int(stage.random.integers(len(REFUSED)))]
    began = time.monotonic()
    with stage.run(RANKS, option, value) as run:
        fault = refusal_fault(run.wait(), value[:8] if option == "--force" else option)
    seconds = time.monotonic() - began
    return Found(f"{option} {value[:10]}", fault, seconds=seconds)


def _in_its_midst(stage: Stage, change: Callable[[], object], words: str) -> Found:
    """Change something while a run is held up, and let it go on: it has to end and say so."""
    with stage.run(stage.ranks()) as run:
        stage.await_rows(run, 1)
        run.send("everybody", signal.SIGSTOP)
        hit = is_locked(stage.path)
        before = columns_of(stage.path)
        if hit:
            change()
        began = time.monotonic()
        run.send("everybody", signal.SIGCONT)
        ended = run.wait()
        seconds = time.monotonic() - began
    return Found("", _ended_fault(stage, ended, before, words) if hit else "", hit, seconds)


def _ended_fault(stage: Stage, ended: Ended, before: Columns | None, words: str) -> str:
    """What is wrong with the end of a run whose file is gone: after its last row, nothing is."""
    if ended.code == 0:
        complete = before is not None and finished(before).all()
        return "" if complete else "exit code 0 although the file is gone"
    now = stage.columns()
    return refusal_fault(ended, words) or (row_fault(before, now, stage.reference) if now else "")
