"""The runner: parts made by the commands that a user would type, each with a record beside it.

Parts that take times are made alone, so that nothing of ours disturbs them; others side by side. A
part stays while its record names the same command, inputs, code, packages and machine, so that the
same `bench run` goes on where it was interrupted.
"""

import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path

from bench.databases import of_the_paper
from bench.page import write_page
from bench.record import PAGE, RECORD, RESULTS, Inputs, Record, code_state, read
from bench.report import PARTS, Part, remark
from gen.runtime.errors import InputError
from gen.runtime.farm import Interruption
from gen.runtime.files import check_folder, lock_folder
from gen.runtime.installation import versions
from gen.scene import load

LANES = min(2, os.cpu_count() or 1)  # parts that are made side by side
ROWS = 1500  # rows of the paper preset that a short run generates; a full one generates all 15,878
PATIENCE = 60.0  # seconds that a part has to end after a signal, before it is killed
AWAKE = 0.5  # seconds after which the main thread, which alone handles signals, wakes at the latest
LONGEST = (
    7200.0  # seconds after which a part counts as hanging, and is ended as by a signal
)
DATABASE = 300  # seconds that all rows of the paper preset take, about


@dataclass(frozen=True)
class Outcome:
    """The end of a run: the parts that failed, now or when they were made, and the signal or 0."""

    failed: tuple[str, ...] = ()
    signal: int = 0


def run(inputs: Inputs, only: Sequence[str] = ()) -> tuple[Path, Outcome]:
    """Make the missing parts, or those of them that are named, then the page of all parts."""
    parts = _chosen(only, inputs)
    check_folder(inputs.output, PAGE)
    with lock_folder(inputs.output):
        if any("{database}" in inputs.template(part) for part in parts):
            rows = load("paper").samples if inputs.full else ROWS
            of_the_paper(inputs.database, inputs.files["database"].parent, rows)
        outcome = make(parts, inputs, lambda: write_page(PARTS, inputs))
        return write_page(PARTS, inputs), outcome


def make(parts: Iterable[Part], inputs: Inputs, after: Callable[[], object]) -> Outcome:
    """Make the parts that are not there yet; `after` is called when a part has been made."""
    wanted = _in_turn(parts, inputs)
    one_page, failed = threading.Lock(), set[str]()

    def ensure(part: Part) -> None:
        if interruption.requested():
            return
        heading, kept = (
            f"[{wanted.index(part) + 1}/{len(wanted)}] {part.name}",
            _kept(part, inputs),
        )
        if kept is None:
            time = told(seconds(part, inputs))
            remark(f"{heading} ({time}): {inputs.typed(part)}")
            code = _run(part, inputs, interruption)
            with one_page:
                after()
        else:
            remark(f"{heading}: is there")
            code = kept.code
        if code:
            failed.add(part.name)

    with Interruption(listening=True) as interruption:
        for together, those in groupby(wanted, key=lambda part: part.beside):
            with ThreadPoolExecutor(LANES if together else 1) as lanes:
                jobs = [lanes.submit(ensure, part) for part in those]
                while wait(jobs, timeout=AWAKE).not_done:
                    pass
                for job in jobs:
                    job.result()
    named = tuple(part.name for part in wanted if part.name in failed)
    return Outcome(() if interruption.signal else named, interruption.signal)


def _in_turn(parts: Iterable[Part], inputs: Inputs) -> list[Part]:
    """Return the parts in the order of the work: alone, then side by side, the longest first.

    Those that read the comparison, to which some of the others add, come last.
    """

    def turn(part: Part) -> tuple[bool, bool, float]:
        last = "comparison" in inputs.sources(part)
        return last, part.beside, -(seconds(part, inputs) or 0.0) if part.beside else 0.0

    return sorted((part for part in parts if inputs.arguments(part)), key=turn)


def _chosen(only: Sequence[str], inputs: Inputs) -> list[Part]:
    """Return the parts of this run; a comparison that was given is not ours to add to."""
    names = {part.name: part for part in PARTS}
    for name in only:
        if name not in names:
            raise InputError(f"{name}: give one of {', '.join(names)}")
        if not inputs.template(names[name]):
            gone = (
                f"left with commit {names[name].retired}" if names[name].retired else ""
            )
            raise InputError(f"{name}: {gone or 'takes long, and needs --full'}")
    given = inputs.comparison
    if given is not None and not given.is_dir():
        raise InputError(
            f"--comparison {given}: give a folder of learn compare or learn tune"
        )
    wanted = [part for part in PARTS if not only or part.name in only]
    return [part for part in wanted if inputs.folder(part) != given]


def _kept(part: Part, inputs: Inputs) -> Record | None:
    """Return the record of a part that need not be made.

    A short run also leaves alone what a full one has made.
    """
    found, full = read(inputs.path(part)), replace(inputs, full=True).typed(part)
    if found is None or not found.finished:
        return None
    longer = not inputs.full and found.command == full != inputs.typed(part)
    return found if longer or not inputs.stale(part) else None


def _run(part: Part, inputs: Inputs, interruption: Interruption) -> int:
    """Run one command to its end or a signal; write down how it ended, return its exit code.

    It has a session of its own: Ctrl-C reaches us alone, and is passed on once; what the command
    has started ends with it. What it prints goes into files beside its record.
    """
    path, state, busy = inputs.path(part), code_state(), round(os.getloadavg()[0], 2)
    printed, said = (
        path.with_name(f"{part.name}.{kind}.txt") for kind in ("printed", "said")
    )
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.unlink(missing_ok=True)
        began, command = time.monotonic(), [sys.executable, *inputs.arguments(part)]
        with (
            printed.open("w") as out,
            said.open("w") as err,
            subprocess.Popen(
                command, stdout=out, stderr=err, start_new_session=True
            ) as process,
        ):
            try:
                code = _wait(process, interruption)
            finally:
                with suppress(ProcessLookupError):
                    os.killpg(process.pid, signal.SIGKILL)
        told = said.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError as error:
        raise InputError(
            f"{path.parent} cannot be written to: {error.strerror or error}"
        ) from None
    if not interruption.requested():
        checked = (
            code == 1 and part.judges and not any(x.startswith("Traceback") for x in told)
        )
        if changed := code_state() != state:
            told.append("the code changed meanwhile: the same command makes it anew")
        if code or changed:
            remark(f"    {part.name}: {told[-1] if told else f'exit code {code}'}")
        inputs.write(
            part,
            code=code,
            finished=not changed and (code == 0 or checked),
            seconds=round(time.monotonic() - began, 1),
            told=told[-5:],
            load=busy,
        )
    return code


def _wait(process: "subprocess.Popen[bytes]", interruption: Interruption) -> int:
    """Wait for the end; pass a signal on, end what hangs, and kill a process that ignores it."""
    limit = time.monotonic() + LONGEST
    while not interruption.requested() and time.monotonic() < limit:
        with suppress(subprocess.TimeoutExpired):
            return process.wait(timeout=0.2)
    process.send_signal(interruption.signal or signal.SIGINT)
    with suppress(subprocess.TimeoutExpired):
        return process.wait(timeout=PATIENCE) or -signal.SIGINT
    process.kill()
    return process.wait()


def seconds(part: Part, inputs: Inputs) -> float | None:
    """Return the time that a part takes [s]: as here by the same command, else as it says itself.

    Of full runs that do not say it, the published results have records; None where nobody knows.
    """
    here = read(inputs.path(part))
    if here is not None and here.finished and here.command == inputs.typed(part):
        return here.seconds
    if not inputs.full:
        return part.seconds
    there = read(RESULTS / (part.folder or part.name) / f"{part.name}{RECORD}")
    return 60 * part.minutes or (there.seconds if there is not None else None)


def told(time: float | None) -> str:
    """Say a time in a few characters."""
    if time is None:
        return "not known"
    return f"{time:.0f} s" if time < 100 else f"{time / 60:.0f} min"


def planned(inputs: Inputs, only: Sequence[str] = ()) -> str:
    """List all parts of a run, why each is to be made and for how long, and make nothing."""
    parts = _in_turn(_chosen(only, inputs), inputs)
    check_folder(inputs.output, PAGE)
    left = {p.name: seconds(p, inputs) or 0.0 for p in parts if _kept(p, inputs) is None}
    together = [left[part.name] for part in parts if part.beside and part.name in left]
    lines = []
    if inputs.full and not inputs.files["database"].exists():
        left["database"] = DATABASE
        lines.append(
            f"database{told(DATABASE):>21}  alone   {'new':14}  Rows of the paper preset"
        )
    for part in parts:
        to_make, lane = part.name in left, "beside" if part.beside else "alone"
        time = told(seconds(part, inputs)) if to_make else "-"
        why = inputs.stale(part) if to_make else "is there"
        there = {*versions(part.needs), *filter(shutil.which, part.needs)}
        lack = ", ".join(name for name in part.needs if name not in there)
        without = f" (WITHOUT {lack}: not installed)" if lack else ""
        lines.append(
            f"{part.name:20}{time:>9}  {lane:6}  {why:14}  {part.title}{without}"
        )
    lanes = max([sum(together) / LANES, *together])
    known = told(sum(left.values()) - sum(together) + lanes)
    return "\n".join([*lines, f"{len(left)} parts to make: {known} by earlier records"])
