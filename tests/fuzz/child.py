"""One command line in a process of its own: forked, bounded in time and memory, and judged.

A fork of a process that has loaded the packages starts in milliseconds where an interpreter takes
a second, and whatever a command does to its process is gone with it.
"""

import importlib
import multiprocessing
import os
import re
import resource
import signal
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, NoReturn

BOUND = 30.0
"""Seconds that a command may take: a hundred times what it takes of files that nobody damaged."""

MEMORY = 3 * 2**30
"""Bytes of address space that a command may ask for on top of what the packages take."""

LARGEST_FILE = 256 * 2**20
"""Bytes that a command may write into one file."""

LOADED = {
    "gen": ("bem", "gen.generation.check", "gen.commands.printer", "gen.generation.run"),
    "learn": (
        "learn.comparison.jobs",
        "learn.surrogate.fitting",
        "sklearn.ensemble",
        "xgboost",
    ),
    "bench": ("bench.run",),
}
"""Modules that commands import when they need them: loaded once here, not once in every case."""

PROGRAMS = {"gen": "gen.cli", "learn": "learn.cli", "bench": "bench.commands"}
"""The module whose `main` takes the command line of each program."""

WARNING = re.compile(r"\.py:\d+: \w*Warning")
"""What a library has to say about a line of code: nothing that helps a user."""


@dataclass(frozen=True)
class Ended:
    """How a command ended: its exit code (minus a signal that ended it), and what it wrote."""

    code: int
    output: str
    errors: str
    hung: bool = False


def load(program: str) -> None:
    """Load what the commands of a program need, so that forks find it in memory."""
    for module in (PROGRAMS[program], *LOADED[program]):
        importlib.import_module(module)


def run(
    command: Sequence[str],
    folder: Path,
    bound: float = BOUND,
    memory: int | None = MEMORY,
) -> Ended:
    """Run a command line in a folder, in a fork of this process.

    It is killed after `bound` seconds; `memory` is what it may ask for on top of what this process
    has [bytes], None for no bound.
    """
    with tempfile.TemporaryFile() as output, tempfile.TemporaryFile() as errors:
        arguments = (command, folder, output, errors, memory)
        process = multiprocessing.get_context("fork").Process(
            target=_become, args=arguments
        )
        process.start()
        process.join(bound)
        hung = process.exitcode is None
        if hung:
            process.kill()
            process.join()
        assert process.exitcode is not None
        for file in (output, errors):
            file.seek(0)
        said, told = (file.read().decode(errors="replace") for file in (output, errors))
        return Ended(process.exitcode, said, told, hung)


def fault(command: Sequence[str], ended: Ended) -> str:
    """What is wrong with the way in which a command ended, "" if nothing is.

    Right are 0, 2 with one line about the input, and 1 of a check; never a traceback or a warning.
    """
    lines = ended.errors.splitlines()
    refusals = [line for line in lines if line.startswith(f"{command[0]}: ")]
    right = {0, 1, 2} if list(command[:2]) == ["gen", "check"] else {0, 2}
    wrong = {
        "hang": ended.hung,
        f"signal {-ended.code}": ended.code < 0,
        f"traceback: {lines[-1][:200] if lines else ''}": "Traceback (most"
        in ended.errors,
        "a library's warning": WARNING.search(ended.errors) is not None,
        f"exit code {ended.code}": ended.code not in right,
        f"{len(refusals)} lines of refusal in place of one": ended.code == 2
        and len(refusals) != 1,
        "lines below the refusal": ended.code == 2 and lines[-1:] != refusals,
    }
    return next((fault for fault, found in wrong.items() if found), "")


def _become(
    command: Sequence[str],
    folder: Path,
    output: IO[bytes],
    errors: IO[bytes],
    memory: int | None,
) -> NoReturn:
    """Be the command, in the fork."""
    if memory is not None:
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
        _limit(resource.RLIMIT_AS, pages * os.sysconf("SC_PAGE_SIZE") + memory)
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    os.chdir(folder)
    os.dup2(output.fileno(), 1)
    os.dup2(errors.fileno(), 2)
    sys.stdout = open(1, "w", encoding="utf-8", closefd=False)  # noqa: SIM115
    sys.stderr = open(  # noqa: SIM115 - as the interpreter has it
        2, "w", encoding="utf-8", errors="backslashreplace", closefd=False, buffering=1
    )
    _limit(resource.RLIMIT_FSIZE, LARGEST_FILE)
    _limit(resource.RLIMIT_CORE, 0)
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    sys.exit(importlib.import_module(PROGRAMS[command[0]]).main(command[1:]))


def _limit(kind: int, most: int) -> None:
    resource.setrlimit(kind, (most, resource.getrlimit(kind)[1]))
