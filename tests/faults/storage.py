"""Disturbances of the file: a disk that is full, an end that is missing, a second writer."""

import shutil
import signal
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from gen.scene.columns import row_bytes
from tests.faults.rows import columns_of, difference, row_fault
from tests.faults.runs import Ended, await_lock, is_locked
from tests.faults.stage import Found, NotPossible, Stage, code_fault, refusal_fault

PAGE = 4096
SMALLEST = 64 * 1024
"""Smallest limit on the size of files: below it, the run could not even write down its output."""


def disk_full_midway(stage: Stage) -> Found:
    """From a random moment on, no file may be written beyond a random size.

    The kernel reports that as it reports a full disk.
    """
    rows = stage.scene.samples * row_bytes(stage.scene)
    size = int(stage.random.integers(SMALLEST, max(rows, SMALLEST + 1)))
    ranks = stage.ranks()
    with stage.run(ranks) as run:
        if ranks:  # MPI needs room for its own files until it has started
            stage.await_rows(run, 1)
        stage.await_moment(run)
        hit = run.limit_files(size)
        began = time.monotonic()
        ended = run.wait()
        await_lock(stage.path)
        seconds = time.monotonic() - began
    fault = code_fault(ended, stage.columns())
    hit = hit and ended.code != 0
    if hit and not fault:
        fault = refusal_fault(ended, "disk is full")
    return Found(f"beyond {size} bytes", fault, hit, seconds)


def disk_full_for_real(stage: Stage) -> Found:
    """A small file system runs full: in the making of a file, or in its midst where it has holes.

    A finished database has its disk space. Copied, it may lose what holds only zeros, so that a
    later run can meet a full disk at any row.
    """
    before = stage.columns()
    rows = stage.scene.samples * row_bytes(stage.scene)
    midway = before is not None and stage.random.random() < 0.7
    with _small_disk(stage.folder / "disk", 2 * rows + 64 * PAGE) as disk:
        path = disk / "rows.h5"
        if midway:
            copy_with_holes(stage.path, path)
        spare = PAGE * int(stage.random.integers(1, 8)) + (0 if midway else rows)
        fill(disk, spare)
        began = time.monotonic()
        ended = _ended(stage, path)
        seconds = time.monotonic() - began
        now = columns_of(path)
        known = before if midway else None
        fault = code_fault(ended, now) or row_fault(known, now, stage.reference)
        hit = ended.code != 0
        if hit and not fault:  # foreseen before a file is made, or met on the way
            fault = refusal_fault(ended, "are free" if "are free" in ended.text else "disk is full")
        (disk / "filler").unlink()
        again = _ended(stage, path)
        if not fault and again.code:
            fault = f"exit code {again.code} after room was made"
        fault = fault or difference(columns_of(path), stage.reference)
    what = "in its midst" if midway else "in the making"
    return Found(f"{what}, {spare} bytes free", fault, hit, seconds)


def file_cut_off(stage: Stage) -> Found:
    """A copy loses its end between two runs: refused, and left as it is."""
    source = stage.path if stage.path.exists() else stage.folder / "reference.h5"
    path = stage.folder / "cut.h5"
    whole = source.read_bytes()
    size = int(stage.random.choice((0, len(whole) - 1, int(stage.random.integers(1, len(whole))))))
    path.write_bytes(whole[:size])
    began = time.monotonic()
    ended = _ended(stage, path)
    seconds = time.monotonic() - began
    fault = refusal_fault(ended, "cut.h5")
    if not fault and path.read_bytes() != whole[:size]:
        fault = "the rest of a file that was cut off has been changed"
    leftovers = [entry.name for entry in stage.folder.glob("cut.h5.*")]
    path.unlink()
    return Found(
        f"{size} of {len(whole)} bytes left",
        fault or (f"left behind: {', '.join(leftovers)}" if leftovers else ""),
        seconds=seconds,
    )


def second_writer(stage: Stage) -> Found:
    """A second run on the same file is refused; one after the first has ended is not."""
    killed = bool(stage.random.random() < 0.5)
    with stage.run(stage.ranks()) as first:
        stage.await_rows(first, 1)
        first.send("everybody", signal.SIGSTOP)  # or it might end before the second begins
        hit = is_locked(stage.path)
        with stage.run(stage.ranks()) as second:
            began = time.monotonic()
            ended = second.wait()
            seconds = time.monotonic() - began
        first.send("everybody", signal.SIGKILL if killed else signal.SIGCONT)
        first.wait()
        await_lock(stage.path)
    fault = refusal_fault(ended, "is being written by") if hit else ""
    left = stage.path.with_name(stage.path.name + ".lock")
    left.write_text("host elsewhere, process 1, since long ago\n")  # as a dead job leaves it
    with stage.run(0) as third:
        third_ended = third.wait()
    if not fault and third_ended.code:
        fault = f"a dead job's lock: exit code {third_ended.code}"
    fault = fault or difference(stage.columns(), stage.reference)
    return Found(f"the first {'killed' if killed else 'goes on'}", fault, hit, seconds)


def copy_with_holes(source: Path, target: Path) -> None:
    """Copy a file and leave out pages of zeros, as `cp --sparse=always` does."""
    content = source.read_bytes()
    with target.open("wb") as file:
        for start in range(0, len(content), PAGE):
            page = content[start : start + PAGE]
            if page.strip(b"\0"):
                file.seek(start)
                file.write(page)
        file.truncate(len(content))


def fill(disk: Path, spare: int) -> None:
    """Fill a file system until some bytes are left."""
    free = shutil.disk_usage(disk).free
    (disk / "filler").write_bytes(bytes(max(free - spare, 0)))


@contextmanager
def _small_disk(folder: Path, size: int) -> Iterator[Path]:
    """A file system of some bytes, in memory; only a machine's administrator may have one."""
    folder.mkdir(exist_ok=True)
    mount = shutil.which("mount")
    command = [mount or "mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(folder)]
    if mount is None or subprocess.run(command, capture_output=True, check=False).returncode:
        raise NotPossible("no right to mount a small file system")
    try:
        yield folder
    finally:
        subprocess.run(["umount", "--lazy", str(folder)], capture_output=True, check=False)


def _ended(stage: Stage, path: Path) -> Ended:
    """Run on a file elsewhere, to the end."""
    with stage.run(stage.ranks(), output=str(path)) as run:
        return run.wait()
