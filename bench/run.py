"""The runner: it makes each part by the command that a user would type, and writes its record.

Parts that measure times are made alone, so that no other part disturbs them; other parts are made
side by side. A part stays as long as its record has today's command, inputs, code, packages and
machine. So the same `bench run` goes on where it was interrupted.
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

LANES = min(2, os.cpu_count() or 1)
"""Largest number of parts that are made side by side."""

ROWS = 1500
"""Rows of the paper preset that a short run generates. A full run generates all 15,878."""

PATIENCE = 60.0
"""Time that a command has to end after a signal, before it is killed [s]."""

AWAKE = 0.5
"""Longest sleep of the main thread, which alone can handle signals [s]."""

LONGEST = 7200.0
"""Time after which the command of a part counts as hanging, and is interrupted [s]."""

LAST_LINES = 5
"""Number of the last lines of standard error that a record keeps."""

DATABASE = 300
"""Approximate time for all rows of the paper preset, for the plan [s]."""


@dataclass(frozen=True)
class Outcome:
    """The end of a run."""

    failed: tuple[
        str, ...
    ] = ()  # names of the parts that failed, in this run or an earlier one
    signal: int = 0  # number of the signal that interrupted the run; 0 without one


def run(inputs: Inputs, only: Sequence[str] = ()) -> tuple[Path, Outcome]:
    """Make the parts that are missing or stale, then the page of all parts.

    The folder of the run is locked meanwhile. The database of the paper preset is generated first
    if a part reads it.

    Parameters
    ----------
    inputs : Inputs
        The folders of the run.
    only : sequence of str
        Names of the parts to make; all parts of the run if it is empty.

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
    """
    parts = _chosen(only, inputs)
    check_folder(inputs.output, PAGE)
    with lock_folder(inputs.output):
        if any("{database}" in inputs.template(part) for part in parts):
            rows = load("paper").samples if inputs.full else ROWS
            of_the_paper(inputs.database, inputs.files["database"].parent, rows)
        outcome = make(parts, inputs, lambda: write_page(PARTS, inputs))
        return write_page(PARTS, inputs), outcome


def make(parts: Iterable[Part], inputs: Inputs, after: Callable[[], object]) -> Outcome:
    """Make the parts that are missing or stale, until a signal comes.

    Parameters
    ----------
    parts : iterable of Part
        The parts. Those that the run leaves out are skipped.
    inputs : Inputs
        The folders of the run.
    after : callable
        Called without arguments whenever a part has been made, never twice at the same time.

    Returns
    -------
    Outcome
        The failed parts; none of them if a signal interrupted the run.
    """
    ordered = _in_turn(parts, inputs)
    with Interruption(listening=True) as interruption:
        job = _Job(ordered, inputs, after, interruption)
        for side_by_side, group in groupby(ordered, key=lambda part: part.beside):
            job.make_all(list(group), lanes=LANES if side_by_side else 1)
    if interruption.signal:
        return Outcome(signal=interruption.signal)
    failed = tuple(part.name for part in ordered if part.name in job.failed)
    return Outcome(failed=failed)


class _Job:
    """The making of the parts of a run, of which `failed` has the names of the failed ones."""

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
        self._one_page = threading.Lock()
        self._interruption = interruption
        self.failed: set[str] = set()

    def make_all(self, parts: list[Part], lanes: int) -> None:
        """Make some of the parts, at most `lanes` at the same time, and wait for their end."""
        with ThreadPoolExecutor(lanes) as pool:
            futures = [pool.submit(self._make, part) for part in parts]
            while wait(futures, timeout=AWAKE).not_done:
                pass
            for future in futures:
                future.result()  # raises the error of the thread, if there was one

    def _make(self, part: Part) -> None:
        """Make one part unless it can stay or a signal came; remember whether it failed."""
        if self._interruption.requested():
            return
        heading = f"[{self._parts.index(part) + 1}/{len(self._parts)}] {part.name}"
        record = _record_to_keep(part, self._inputs)
        if record is not None:
            remark(f"{heading}: is there")
            code = record.code
        else:
            duration = in_words(expected_seconds(part, self._inputs))
            remark(f"{heading} ({duration}): {self._inputs.typed(part)}")
            code = _run(part, self._inputs, self._interruption)
            with self._one_page:
                self._after()
        if code:
            self.failed.add(part.name)


def _in_turn(parts: Iterable[Part], inputs: Inputs) -> list[Part]:
    """Return the parts of this run in the order of the work.

    Parts that are made alone come first, then those that are made side by side, the longest first.
    Parts that read the comparison come last, because other parts add to it.
    """

    def turn(part: Part) -> tuple[bool, bool, float]:
        reads_comparison = "comparison" in inputs.sources(part)
        duration = 0.0
        if part.beside:
            duration = expected_seconds(part, inputs) or 0.0
        return reads_comparison, part.beside, -duration

    return sorted((part for part in parts if inputs.arguments(part)), key=turn)


def _chosen(only: Sequence[str], inputs: Inputs) -> list[Part]:
    """Return the named parts, or all if no name is given; raise InputError for a wrong input.

    Parts that write into the comparison are left out if the user gave it.
    """
    for name in only:
        _require_in_run(name, inputs)
    comparison = inputs.comparison
    if comparison is not None and not comparison.is_dir():
        raise InputError(
            f"--comparison {comparison}: give a folder of learn compare or learn tune"
        )
    chosen = [part for part in PARTS if not only or part.name in only]
    return [part for part in chosen if inputs.folder(part) != comparison]


def _require_in_run(name: str, inputs: Inputs) -> None:
    """Raise InputError if a name is not that of a part which this run can make."""
    parts = {part.name: part for part in PARTS}
    if name not in parts:
        raise InputError(f"{name}: give one of {', '.join(parts)}")
    part = parts[name]
    if inputs.template(part):
        return
    if part.retired:
        raise InputError(f"{name}: left with commit {part.retired}")
    raise InputError(f"{name}: takes long, and needs --full")


def _record_to_keep(part: Part, inputs: Inputs) -> Record | None:
    """Return the record of a part that need not be made, or None.

    A short run also keeps a part that a full run has made, even if it is stale.
    """
    record = read(inputs.path(part))
    if record is None or not record.finished:
        return None
    full_command = replace(inputs, full=True).typed(part)
    of_full_run = record.command == full_command != inputs.typed(part)
    if of_full_run and not inputs.full:
        return record
    if inputs.stale(part):
        return None
    return record


def _run(part: Part, inputs: Inputs, interruption: Interruption) -> int:
    """Run the command of a part to its end or a signal, and return its exit code.

    Its output goes into files beside the record. The record is written at the end, but not after a
    signal.
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
        code = _run_command(command, output_file, error_file, interruption)
        last_lines = error_file.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError as error:
        raise InputError(
            f"{path.parent} cannot be written to: {error.strerror or error}"
        ) from None
    if interruption.requested():
        return code
    crashed = any(line.startswith("Traceback") for line in last_lines)
    check_failed = code == 1 and part.judges and not crashed
    code_changed = code_state() != state
    if code_changed:
        last_lines.append("the code changed meanwhile: the same command makes it anew")
    if code or code_changed:
        reason = last_lines[-1] if last_lines else f"exit code {code}"
        remark(f"    {part.name}: {reason}")
    inputs.write(
        part,
        code=code,
        finished=not code_changed and (code == 0 or check_failed),
        seconds=round(time.monotonic() - began, 1),
        told=last_lines[-LAST_LINES:],
        load=load_before,
    )
    return code


def _run_command(
    command: list[str], output_file: Path, error_file: Path, interruption: Interruption
) -> int:
    """Run a command, and return its exit code; write standard output and error into files.

    The command has a session of its own. So Ctrl-C reaches this process alone, which passes it on
    once, and all processes that the command has started can be killed at its end.
    """
    with (
        output_file.open("w") as output,
        error_file.open("w") as errors,
        subprocess.Popen(
            command, stdout=output, stderr=errors, start_new_session=True
        ) as process,
    ):
        try:
            return _wait(process, interruption)
        finally:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)


def _wait(process: "subprocess.Popen[bytes]", interruption: Interruption) -> int:
    """Wait for the end of a process, and return its exit code.

    A signal is passed on to the process. One that hangs is interrupted, and one that ignores the
    signal is killed.
    """
    limit = time.monotonic() + LONGEST
    while not interruption.requested() and time.monotonic() < limit:
        with suppress(subprocess.TimeoutExpired):
            return process.wait(timeout=0.2)
    process.send_signal(interruption.signal or signal.SIGINT)
    with suppress(subprocess.TimeoutExpired):
        # A process that was interrupted has failed, even if it ended with exit code 0.
        return process.wait(timeout=PATIENCE) or -signal.SIGINT
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
        Time [s], by the first of these sources that there is: the record of the same command in
        this folder, the TOML file of the part, the published record; None without any.
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
        The time [s]; None if nobody knows it.

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
    """List the parts of a run, with the reason and the time to make each of them.

    Parameters
    ----------
    inputs : Inputs
        The folders of the run, which are not written.
    only : sequence of str
        Names of the parts; all parts of the run if it is empty.

    Returns
    -------
    str
        One line for each part, and one for the whole.

    Raises
    ------
    InputError
        If a name is not that of a part of this run, or the folder cannot be used.
    """
    parts = _in_turn(_chosen(only, inputs), inputs)
    check_folder(inputs.output, PAGE)
    to_make = [part for part in parts if _record_to_keep(part, inputs) is None]
    lines = []
    database_is_missing = inputs.full and not inputs.files["database"].exists()
    if database_is_missing:
        duration = in_words(DATABASE)
        lines.append(
            f"database{duration:>21}  alone   {'new':14}  Rows of the paper preset"
        )
    lines += [_planned_line(part, inputs, to_make=part in to_make) for part in parts]
    seconds = _seconds_of_all(to_make, inputs)
    number = len(to_make)
    if database_is_missing:
        seconds += DATABASE
        number += 1
    lines.append(f"{number} parts to make: {in_words(seconds)} by earlier records")
    return "\n".join(lines)


def _planned_line(part: Part, inputs: Inputs, *, to_make: bool) -> str:
    """Return the line of the plan for one part."""
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
    return f"{part.name:20}{duration:>9}  {lane:6}  {reason:14}  {title}"


def _seconds_of_all(parts: list[Part], inputs: Inputs) -> float:
    """Return the time of all parts [s], of which some are made side by side.

    A part of unknown time counts as nothing.
    """
    alone = [expected_seconds(p, inputs) or 0.0 for p in parts if not p.beside]
    side_by_side = [expected_seconds(p, inputs) or 0.0 for p in parts if p.beside]
    in_lanes = max([sum(side_by_side) / LANES, *side_by_side])
    return sum(alone) + in_lanes
