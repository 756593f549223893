"""Make the parts of a page, one after the other, each by the command that a user would type."""

import json
import shlex
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TextIO

from bench.circumstances import circumstances
from bench.page.part import RECORD, Part
from gen.errors import InputError
from gen.interruption import Interruption

PATIENCE = 60.0
"""Seconds that a part has to end after a signal, before it is killed."""

FINISHED = (0, 1)
"""Exit codes of parts that have something to show: 1 says that a check has failed."""

Remark = Callable[[str], None]


@dataclass(frozen=True)
class Inputs:
    """What the commands of parts are filled in with.

    Attributes
    ----------
    output : folder of the page
    database : of the paper preset
    comparison : folder of `learn compare` and `learn tune`
    full : everything, or what fits into ten minutes
    """

    output: Path
    database: Path
    comparison: Path
    full: bool

    def arguments(self, part: Part) -> list[str]:
        """Arguments of the interpreter; none if the part is not in this run."""
        template = part.full if self.full else part.quick
        values = {
            "folder": self.folder(part),
            "database": self.database,
            "comparison": self.comparison,
            "cost": self.output / "cost",
            "fine": self.output / "generalisation" / "databases" / "fine.h5",
        }
        return [word.format_map(values) for word in template.split()]

    def folder(self, part: Part) -> Path:
        """Where a part's files are."""
        return self.comparison if part.name == "comparison" else self.output / part.name


@dataclass(frozen=True)
class Outcome:
    """How the making of parts ended.

    Attributes
    ----------
    failed : parts that ended with another code than 0
    signal : number of the signal that came, 0 if none did
    """

    failed: tuple[str, ...] = ()
    signal: int = 0


def make(
    parts: Iterable[Part], inputs: Inputs, remark: Remark, after: Callable[[], object]
) -> Outcome:
    """Make what is not there yet.

    A part that was made by the same command and commit stays as it is.

    Parameters
    ----------
    parts : in their order
    inputs : what their commands are filled in with
    remark : told how far it is, and what the commands tell
    after : called after each part

    Returns
    -------
    What failed, and whether a signal has come: the same call goes on
    """
    wanted = [part for part in parts if inputs.arguments(part)]
    failed: list[str] = []
    with Interruption(listening=True) as interruption:
        for number, part in enumerate(wanted, 1):
            heading = f"[{number}/{len(wanted)}] {part.name}"
            if made(part, inputs):
                remark(f"{heading}: is there")
                continue
            remark(f"{heading}: {typed(inputs.arguments(part))}")
            code = _run(part, inputs, remark, interruption)
            if interruption.requested():
                return Outcome(tuple(failed), interruption.signal)
            if code != 0:
                failed.append(part.name)
            after()
    return Outcome(tuple(failed))


def made(part: Part, inputs: Inputs) -> bool:
    """Whether a part is there, by the same command and the same commit."""
    found = record(inputs.folder(part))
    return (
        found is not None
        and found["code"] in FINISHED
        and found["command"] == typed(inputs.arguments(part))
        and found["commit"] == circumstances()["commit"]
    )


def record(folder: Path) -> dict[str, Any] | None:
    """How a part was made; None if it was not.

    Raises
    ------
    InputError
        If the record cannot be read.
    """
    path = folder / RECORD
    try:
        found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read ({error}); remove it") from None
    return found


def typed(arguments: Sequence[str]) -> str:
    """The command as a user types it."""
    return shlex.join(["python", *arguments])


def _run(part: Part, inputs: Inputs, remark: Remark, interruption: Interruption) -> int:
    """Run one command to its end, or to a signal's; write down how it ended."""
    folder, arguments = inputs.folder(part), inputs.arguments(part)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / RECORD).unlink(missing_ok=True)
    except OSError as error:
        raise InputError(f"{folder} cannot be written to: {error.strerror or error}") from None
    began = time.monotonic()
    told: list[str] = []
    with (folder / "printed.txt").open("w", encoding="utf-8") as printed:
        code = _call(arguments, printed, told, remark, interruption)
    if not interruption.requested():
        _write_record(folder, arguments, code, time.monotonic() - began, told)
    return code


def _call(
    arguments: Sequence[str],
    printed: TextIO,
    told: list[str],
    remark: Remark,
    interruption: Interruption,
) -> int:
    """Run one command; its exit code.

    In a session of its own: Ctrl-C reaches us alone, and is passed on once.
    """
    with subprocess.Popen(
        [sys.executable, *arguments],
        stdout=printed,
        stderr=subprocess.PIPE,
        text=True,
        errors="replace",
        start_new_session=True,
    ) as process:
        listener = threading.Thread(target=_listen, args=(process, told, remark), daemon=True)
        listener.start()
        code = _wait(process, interruption)
        listener.join(PATIENCE)
        return code


def _listen(process: "subprocess.Popen[str]", told: list[str], remark: Remark) -> None:
    """Pass on what a command tells."""
    for line in process.stderr or ():
        if line.strip():
            told.append(line.rstrip())
            remark(f"    {told[-1]}")


def _wait(process: "subprocess.Popen[str]", interruption: Interruption) -> int:
    """Wait for the end; pass a signal on, and kill what does not heed it."""
    while not interruption.requested():
        try:
            return process.wait(timeout=0.2)
        except subprocess.TimeoutExpired:
            continue
    process.send_signal(interruption.signal)
    try:
        return process.wait(timeout=PATIENCE)
    except subprocess.TimeoutExpired:
        process.kill()
        return process.wait()


def _write_record(
    folder: Path, arguments: Sequence[str], code: int, seconds: float, told: Sequence[str]
) -> None:
    """Write down how a part was made, under the record's name only once it is whole."""
    found = {
        "command": typed(arguments),
        "code": code,
        "seconds": round(seconds, 1),
        "told": list(told[-5:]),
        **circumstances(),
    }
    unfinished = folder / f".{RECORD}"
    unfinished.write_text(json.dumps(found, indent=2) + "\n", encoding="utf-8")
    unfinished.replace(folder / RECORD)
