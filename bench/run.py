"""The runner: it makes each part by the command that a user would type, and writes its record.

Parts that measure times are made alone, so that no other part disturbs them; other parts are made
side by side. A part is not made again while its record has the present command, inputs, code,
packages and machine. So the same `bench run` goes on where it was interrupted.
"""

import math
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

LANES = min(2, os.cpu_count() or 1)
"""Largest number of parts that are made side by side."""

ROWS = 1500
"""Rows of the paper preset that a short run generates. A full run generates all of its rows."""

END_LIMIT = 60.0
"""Time within which a command has to end after a signal; then it is killed [s]."""

LONGEST_SLEEP = 0.5
"""Longest sleep of the main thread, which alone can handle signals [s]."""

COMMAND_LIMIT = 7200.0
"""Time after which the command of a part is taken to hang, and is interrupted [s]. A part that
runs only if it is named may take as long as it needs."""

LAST_LINES = 5
"""Number of the last lines of standard error that a record keeps."""

SECONDS_PER_ROW = 0.019
"""Approximate time of generating a row of the paper preset, for the plan [s]."""


@dataclass(frozen=True)
class Outcome:
    """The end of a run."""

    # Names of the parts that failed, in this run or in an earlier one whose record is kept.
    failed: tuple[str, ...] = ()
    signal: int = 0  # number of the signal that interrupted the run; 0 without one


def run(inputs: Inputs, only: Sequence[str] = ()) -> tuple[Path, Outcome]:
    """Make the parts that are missing or stale, then the page of all parts.

    The folder of the run is locked meanwhile. If a part reads the database of the paper preset, it
    is generated first, or the one that the user gave is checked.

    Parameters
    ----------
    inputs : Inputs
        The folders of the run.
    only : sequence of str
        Names of the parts to make; if it is empty, all parts of the run but those that have to be
        named (`Part.named`).

    Returns
    -------
    path : Path
        The file of the page.
    outcome : Outcome
        The failed parts, and the signal that interrupted the run.

    Raises
    ------
    InputError
        If a name is not that of a part of this run, or a folder or database cannot be used.
    KeyboardInterrupt
        If a signal interrupted the generation of the database.
    """
    parts = _chosen(only, inputs)
    check_folder(inputs.output, PAGE)
    with lock_folder(inputs.output):
        if _reads_database(parts, inputs):
            folder = inputs.files["database"].parent
            of_the_paper(inputs.database, folder, _rows_of_database(inputs))
        outcome = make(parts, inputs, after=lambda: write_page(PARTS, inputs))
        return write_page(PARTS, inputs), outcome


def _reads_database(parts: Iterable[Part], inputs: Inputs) -> bool:
    """Return whether the command of any part reads the database of the paper preset."""
    return any("{database}" in inputs.template(part) for part in parts)


def _rows_of_database(inputs: Inputs) -> int:
    """Return the number of rows of the paper preset that a full or short run generates."""
    return load("paper").samples if inputs.full else ROWS


def make(parts: Iterable[Part], inputs: Inputs, after: Callable[[], object]) -> Outcome:
    """Make the parts that are missing or stale, until a signal comes.

    Parameters
    ----------
    parts : iterable of Part
        The parts. A part that has no command in this run (short or full) is skipped.
    inputs : Inputs
        The folders of the run.
    after : callable
        Called without arguments whenever the command of a part has ended. Two calls never overlap.

    Returns
    -------
    Outcome
        The failed parts. If a signal interrupted the run, it has only the signal.

    Raises
    ------
    InputError
        If a folder cannot be written to, or a record is damaged.
    """
    ordered = _in_turn(parts, inputs)
    with Interruption(listening=True) as interruption:
        job = _Job(ordered, inputs, after, interruption)
        for may_run_beside, group in groupby(ordered, key=lambda part: part.beside):
            job.make_all(list(group), lanes=LANES if may_run_beside else 1)
    if interruption.signal:
        return Outcome(signal=interruption.signal)
    failed = tuple(part.name for part in ordered if part.name in job.failed)
    return Outcome(failed=failed)


class _Job:
    """Makes the parts of a run; `failed` has the names of the parts that failed so far.

    `parts` are all parts of the run, which are numbered on standard error. `after` is called
    whenever a part has been made.
    """

    def __init__(
        self,
        parts: list[Part],
        inputs: Inputs,
        after: Callable[[], object],
        interruption: Interruption,
    ) -> None:
        self._parts = parts
        self._inputs = inputs
        self._after = after
        self._after_lock = threading.Lock()
        self._interruption = interruption
        self.failed: set[str] = set()

    def make_all(self, parts: list[Part], lanes: int) -> None:
        """Make some of the parts, at most `lanes` at the same time, and wait for their end."""
        with ThreadPoolExecutor(lanes) as pool:
            futures = [pool.submit(self._make, part) for part in parts]
            while wait(futures, timeout=LONGEST_SLEEP).not_done:
                pass  # the main thread handles signals between two waits
            for future in futures:
                future.result()  # raises the error of the thread, if there was one

    def _make(self, part: Part) -> None:
        """Make one part, and remember whether it failed; print its progress on standard error.

        A part whose record is kept is not made, but its recorded failure counts. Nothing is done
        after a signal.
        """
        if self._interruption.requested():
            return
        number = self._parts.index(part) + 1
        heading = f"[{number}/{len(self._parts)}] {part.name}"
        record = _record_to_keep(part, self._inputs)
        if record is not None:
            remark(f"{heading}: is there")
            code = record.code
        else:
            duration = in_words(expected_seconds(part, self._inputs))
            remark(f"{heading} ({duration}): {self._inputs.typed(part)}")
            code = _run(part, self._inputs, self._interruption)
            with self._after_lock:
                self._after()
        if code:
            self.failed.add(part.name)


def _in_turn(parts: Iterable[Part], inputs: Inputs) -> list[Part]:
    """Return the parts that this run has a command for, in the order in which they are made.

    Parts that read the comparison come after all other parts, because some of these write into it.
    Before and after this border, parts that are made alone come first, as given, and parts that are
    made side by side follow, the longest first.
    """

    def turn(part: Part) -> tuple[bool, bool, float]:
        """Return the sort key of a part."""
        reads_comparison = "comparison" in inputs.sources(part)
        duration = 0.0
        if part.beside:
            duration = expected_seconds(part, inputs) or 0.0
        return reads_comparison, part.beside, -duration

    return sorted((part for part in parts if inputs.arguments(part)), key=turn)


def _chosen(only: Sequence[str], inputs: Inputs) -> list[Part]:
    """Return the parts with these names, or without names all parts that need not be named.

    Parts that write into the comparison are left out if the user gave its folder. Raises InputError
    if this run cannot make a named part, or the user's folder of the comparison does not exist.
    """
    for name in only:
        _require_in_run(name, inputs)
    comparison = inputs.comparison
    if comparison is not None and not comparison.is_dir():
        raise InputError(
            f"--comparison {comparison}: give a folder of learn compare or learn tune"
        )
    chosen = [part for part in PARTS if part.name in only]
    if not only:
        chosen = [part for part in PARTS if not part.named]
    return [part for part in chosen if inputs.folder(part) != comparison]


def _require_in_run(name: str, inputs: Inputs) -> None:
    """Raise InputError if no part has this name, or this run has no command for the part."""
    parts = {part.name: part for part in PARTS}
    if name not in parts:
        raise InputError(f"{name}: give one of {', '.join(parts)}")
    if not inputs.template(parts[name]):
        raise InputError(f"{name}: takes long, and needs --full")


def _record_to_keep(part: Part, inputs: Inputs) -> Record | None:
    """Return the record of a part that need not be made; None if the part has to be made.

    A short run also keeps a part that a full run has finished, even if it is stale: its results are
    better than those of a short run.
    """
    record = read(inputs.path(part))
    if record is None or not record.finished:
        return None
    if not inputs.full:
        full_command = replace(inputs, full=True).typed(part)
        has_own_short_command = inputs.typed(part) != full_command
        if has_own_short_command and record.command == full_command:
            return record
    if inputs.stale(part):
        return None
    return record


def _run(part: Part, inputs: Inputs, interruption: Interruption) -> int:
    """Run the command of a part to its end or a signal, and return its exit code.

    Its output goes into files beside the record. A command that takes longer than `COMMAND_LIMIT`
    is interrupted, unless the part has to be named. A failure is printed on standard error. Raises
    InputError if the folder cannot be written to.

    An earlier record is removed first. The new record is written at the end, but not after a signal
    to this run, so that the part is made again. The record is unfinished if the command failed, or
    if the code changed while it ran; a failed check of a part that judges is no such failure.
    """
    path = inputs.path(part)
    output_file = path.with_name(f"{part.name}.printed.txt")
    error_file = path.with_name(f"{part.name}.said.txt")
    state = code_state()
    load_before = round(os.getloadavg()[0], 2)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.unlink(missing_ok=True)
        began = time.monotonic()
        command = [sys.executable, *inputs.arguments(part)]
        limit = math.inf if part.named else COMMAND_LIMIT
        code = _run_command(command, output_file, error_file, interruption, limit)
        errors = error_file.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError as error:
        raise InputError(
            f"{path.parent} cannot be written to: {error.strerror or error}"
        ) from None
    if interruption.requested():
        return code
    # A part that judges ends with code 1 if its check failed; its results are then complete. Python
    # ends with the same code after an uncaught exception.
    crashed = any(line.startswith("Traceback") for line in errors)
    check_failed = code == 1 and part.judges and not crashed
    code_changed = code_state() != state
    if code_changed:
        errors.append("the code changed meanwhile: the same command makes it anew")
    if code or code_changed:
        reason = errors[-1] if errors else f"exit code {code}"
        remark(f"    {part.name}: {reason}")
    inputs.write(
        part,
        code=code,
        finished=not code_changed and (code == 0 or check_failed),
        seconds=round(time.monotonic() - began, 1),
        told=errors[-LAST_LINES:],
        load=load_before,
    )
    return code


def _run_command(
    command: list[str],
    output_file: Path,
    error_file: Path,
    interruption: Interruption,
    limit: float,
) -> int:
    """Run a command, and return its exit code; write its standard output and error into files.

    It is interrupted after the time `limit` [s]. The command runs in a new session. So Ctrl-C
    reaches only this process, which passes it on once, and all processes that the command has
    started can be killed at its end.
    """
    with (
        output_file.open("w") as output,
        error_file.open("w") as errors,
        subprocess.Popen(
            command, stdout=output, stderr=errors, start_new_session=True
        ) as process,
    ):
        try:
            return _wait(process, interruption, limit)
        finally:
            with suppress(ProcessLookupError):  # no process of the session is left
                os.killpg(process.pid, signal.SIGKILL)


def _wait(
    process: "subprocess.Popen[bytes]", interruption: Interruption, limit: float
) -> int:
    """Wait for the end of a process, and return its exit code, never 0 if it was interrupted.

    A signal to this process is passed on. A process that runs longer than `limit` [s] is
    interrupted by SIGINT. A process that has not ended within `END_LIMIT` after its signal is
    killed.
    """
    deadline = time.monotonic() + limit
    while not interruption.requested() and time.monotonic() < deadline:
        with suppress(subprocess.TimeoutExpired):
            return process.wait(timeout=0.2)
    process.send_signal(interruption.signal or signal.SIGINT)
    with suppress(subprocess.TimeoutExpired):
        # A process that was interrupted has failed, even if it ended with exit code 0.
        return process.wait(timeout=END_LIMIT) or -signal.SIGINT
    process.kill()
    return process.wait()


def expected_seconds(part: Part, inputs: Inputs) -> float | None:
    """Estimate the time that the command of a part takes.

    Parameters
    ----------
    part : Part
        The part.
    inputs : Inputs
        The folders of the run.

    Returns
    -------
    float or None
        Time [s] in the record of the same command in this folder. Without this record it is
        `part.seconds` in a short run. In a full run it is `part.minutes`, or if these are 0, the
        time in the published record. None if the time is not known.
    """
    record = read(inputs.path(part))
    if record is not None and record.finished and record.command == inputs.typed(part):
        return record.seconds
    if not inputs.full:
        return part.seconds
    if part.minutes:
        return 60 * part.minutes
    published = read(RESULTS / (part.folder or part.name) / f"{part.name}{RECORD}")
    if published is None:
        return None
    return published.seconds


def in_words(seconds: float | None) -> str:
    """Write a time in a few characters.

    Parameters
    ----------
    seconds : float or None
        The time [s]; None if it is not known.

    Returns
    -------
    str
        Seconds or minutes with their unit, or "not known".
    """
    if seconds is None:
        return "not known"
    if seconds < 100:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min"


def planned(inputs: Inputs, only: Sequence[str] = ()) -> str:
    """List the parts of a run, with the time and the reason to make each of them.

    Parameters
    ----------
    inputs : Inputs
        The folders of the run, which are not written.
    only : sequence of str
        Names of the parts, as for `run`.

    Returns
    -------
    str
        One line for the database if it is to be generated, one line for each part, and one line
        with the number of parts to make, the database among them, and their time.

    Raises
    ------
    InputError
        If a name is not that of a part of this run, or the folder cannot be used.
    """
    parts = _in_turn(_chosen(only, inputs), inputs)
    check_folder(inputs.output, PAGE)
    to_make = [part for part in parts if _record_to_keep(part, inputs) is None]
    number = len(to_make)
    seconds = _seconds_of_all(to_make, inputs)
    lines = []
    if _makes_database(parts, inputs):
        database_seconds = SECONDS_PER_ROW * _rows_of_database(inputs)
        lines.append(
            _planned_line(
                name="database",
                duration=in_words(database_seconds),
                lane="alone",
                reason="new",
                title="Rows of the paper preset",
            )
        )
        number += 1
        seconds += database_seconds
    lines += [_line_of_part(part, inputs, to_make=part in to_make) for part in parts]
    lines.append(f"{number} parts to make: {in_words(seconds)} by earlier records")
    return "\n".join(lines)


def _makes_database(parts: Iterable[Part], inputs: Inputs) -> bool:
    """Return whether the run of these parts generates a new database of the paper preset."""
    is_given = inputs.database is not None
    exists = inputs.files["database"].exists()
    return not is_given and not exists and _reads_database(parts, inputs)


def _planned_line(*, name: str, duration: str, lane: str, reason: str, title: str) -> str:
    """Return a line of the plan, in columns."""
    return f"{name:20}{duration:>9}  {lane:6}  {reason:14}  {title}"


def _line_of_part(part: Part, inputs: Inputs, *, to_make: bool) -> str:
    """Return the line of the plan for one part.

    Its title is followed by the programs and packages that the part needs and that are missing.
    """
    duration = "-"
    reason = "is there"
    if to_make:
        duration = in_words(expected_seconds(part, inputs))
        reason = inputs.stale(part)
    lane = "beside" if part.beside else "alone"
    installed = {*versions(part.needs), *filter(shutil.which, part.needs)}
    missing = ", ".join(name for name in part.needs if name not in installed)
    title = part.title
    if missing:
        title += f" (WITHOUT {missing}: not installed)"
    return _planned_line(
        name=part.name, duration=duration, lane=lane, reason=reason, title=title
    )


def _seconds_of_all(parts: list[Part], inputs: Inputs) -> float:
    """Return the time of all parts [s]. A part of unknown time adds nothing.

    Parts that are made side by side share `LANES` lanes, but take at least as long as the longest
    of them.
    """
    alone = [expected_seconds(p, inputs) or 0.0 for p in parts if not p.beside]
    side_by_side = [expected_seconds(p, inputs) or 0.0 for p in parts if p.beside]
    in_lanes = max([sum(side_by_side) / LANES, *side_by_side])
    return sum(alone) + in_lanes
