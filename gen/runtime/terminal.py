"""Everything that a command prints: lines, tables, progress, and commands as the user types them.

Titles, names of files and messages of libraries come from strangers, and an escape sequence in one
could forge a line of ours: every text that is printed passes through `printable`.
"""

import os
import shutil
import sys
import time
from collections.abc import Collection, Iterable, Sequence
from contextlib import AbstractContextManager, suppress
from datetime import timedelta
from pathlib import Path
from typing import Any

from gen.runtime.errors import InputError

OUTPUT = "standard output"  # name of standard output in place of a file's name in errors
LETTERS = 110  # letters of a name that fit into a line of a picture's title

ENDLESS = (
    1000  # width of a table in a file or a pipe, where no line is broken [characters]
)
LINE_SECONDS = 30.0  # time between two lines of progress in a batch log [s]
RENEWAL = 0.1  # least time between two states of a line of progress on a terminal [s]
CLEAR = "\r\x1b[K"  # what empties a terminal's line
COMMAND = "asperity"  # name of the installed command, under which all programs run too

LOST: list[OSError] = []
"""Errors of standard output since the command began."""


def printable(text: str) -> str:
    """Replace characters that control, end lines or turn the direction of writing by ?."""
    return "".join(character if character.isprintable() else "?" for character in text)


def echo(line: str, *, err: bool = False) -> None:
    """Print one line, on standard error if wanted."""
    put(f"{printable(line)}\n", sys.stderr if err else sys.stdout)


def print_columns(
    rows: Iterable[Sequence[str]], titles: Sequence[str] = (), right: Collection[str] = ()
) -> None:
    """Print rows of texts in columns; those whose titles are in `right` end at the right.

    The table is as wide as the terminal or, without one, as it needs.
    """
    if sys.stdout is None:
        return
    from rich.console import Console
    from rich.segment import Segment, Segments
    from rich.table import Table

    table = Table(box=None, pad_edge=False, show_header=bool(titles))
    for title in titles:
        table.add_column(title, justify="right" if title in right else "left")
    for row in rows:
        table.add_row(*row)
    console = Console(
        width=None if sys.stdout.isatty() else ENDLESS, markup=False, emoji=False
    )
    pieces = [
        Segment("\n".join(map(printable, piece.text.split("\n"))), piece.style)
        for piece in console.render(table)
    ]
    with console.capture() as captured:
        console.print(Segments(pieces), end="")
    put(captured.get(), sys.stdout)


def put(text: str, stream: Any, *, last: bool = False) -> None:
    """Write a text without strangers' control characters on a standard stream, if there is one.

    Errors of standard error are ignored. The first one of standard output is raised by the `last`
    call of a command, so that it writes its files although nobody reads what it prints any more.
    """
    if stream is None:
        return
    try:
        stream.write(text)
        stream.flush()
    except OSError as error:
        drop(stream)
        if stream is not sys.stderr:
            LOST.append(OSError(error.errno, error.strerror, OUTPUT))
    if last and LOST:
        raise LOST[0]


def drop(stream: Any) -> None:
    """Discard what a stream still holds, which Python would try to write again as it exits."""
    with suppress(OSError, ValueError, AttributeError):
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, stream.fileno())
        os.close(null)


def shortened(name: str) -> str:
    """Return a file's name with its middle left out if it is too long for a line."""
    return (
        name
        if len(name) <= LETTERS
        else f"{name[: LETTERS // 3]} ... {name[-LETTERS // 2 :]}"
    )


def quoted(text: str, most: int = 60) -> str:
    """Quote a text of the user's, shortened if it is too long to be typed by hand."""
    return (
        repr(text)
        if len(text) <= most
        else f"{text[:most]!r}... ({len(text)} characters)"
    )


def first_reason(reasons: str) -> str:
    """Shorten reasons to the first one and the number of the others, for a narrow column."""
    first, _, others = reasons.partition("; ")
    return f"{first}; and {others.count('; ') + 1} more" if others else first


def command_to_type(words: str) -> str:
    """Return a command, as "gen info FILE" or "asperity gen info FILE", as the user can type it."""
    started = Path(sys.argv[0])
    if words.partition(" ")[0] == COMMAND:
        return words
    return f"{COMMAND if COMMAND in {started.name, started.parent.name} else 'python -m'} {words}"


class RunProgress(AbstractContextManager["RunProgress"]):
    """Progress on standard error: on a terminal a line that renews itself, else one now and then.

    `noun` is the plural of a row, which words that tell it from others may follow; `work` is the
    cost of all rows in any unit, from which the remaining time follows, by default their number.
    """

    def __init__(
        self, total: int, noun: str = "samples", work: float | None = None
    ) -> None:
        self._total, self._noun = total, noun
        self._here = self._failed = 0
        self._work, self._worked = float(total if work is None else work), 0.0
        self._began = self._last = time.monotonic()
        self._renews = sys.stderr is not None and sys.stderr.isatty()

    def __exit__(self, *error: object) -> None:
        """Print a last line, but not above a refusal of the input."""
        if self._here and not isinstance(error[1], InputError):
            self.say()

    def advance(self, rows: int, failed: int, work: float | None = None) -> None:
        """Count rows that have been written, failed ones, and their cost (by default, 1 each)."""
        self._here += rows
        self._failed += failed
        self._worked += rows if work is None else work
        if time.monotonic() >= self._last + (RENEWAL if self._renews else LINE_SECONDS):
            self._last = time.monotonic()
            self.say(renewed=self._renews)

    def say(self, message: str = "", *, renewed: bool = False) -> None:
        """Print a line, by default of rows, rate, failures and remaining time; or renew it."""
        elapsed = max(time.monotonic() - self._began, 1e-9)
        left = elapsed * (self._work / self._worked - 1) if self._worked else 0.0
        line = message or (
            f"{self._here} of {self._total} {self._noun} ({100 * self._here / self._total:.1f} %),"
            f" {self._here / elapsed:.3g} {self._noun.partition(' ')[0]}/s,"
            f" {self._failed} failed, {timedelta(seconds=round(max(left, 0.0)))} left"
        )
        room = shutil.get_terminal_size().columns - 1 if renewed else None
        with suppress(ValueError):
            clear, end = CLEAR if self._renews else "", "" if renewed else "\n"
            put(f"{clear}{printable(line)[:room]}{end}", sys.stderr)
