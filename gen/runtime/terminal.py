"""Everything that a command prints: lines, tables, progress, and commands as the user types them.

Titles, names of files and messages of libraries come from strangers, and an escape sequence in one
could forge a line of ours. Every text that is printed therefore passes through `printable`.
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

OUTPUT = "standard output"  # stands in errors where a file's name would stand
LONGEST_NAME = 110  # letters of a name that fit into a line of a picture's title

ENDLESS = (
    1000  # width of a table that no terminal limits, so that no line is broken [letters]
)
LINE_SECONDS = 30.0  # time between two lines of progress in a batch log [s]
RENEWAL = 0.1  # shortest time between two states of the line on a terminal [s]
CLEAR = "\r\x1b[K"  # returns to the start of a terminal's line and empties it
COMMAND = "asperity"  # installed command, which runs all programs

OUTPUT_ERRORS: list[OSError] = []
"""Errors of standard output since the command began; `write_stream` adds to them."""


def printable(text: str) -> str:
    """Replace characters that control, end a line or turn the direction of writing by "?".

    Parameters
    ----------
    text : str
        Text of any origin.

    Returns
    -------
    str
        Text of the same length.
    """
    return "".join(character if character.isprintable() else "?" for character in text)


def echo(line: str, *, err: bool = False) -> None:
    """Print one line.

    Parameters
    ----------
    line : str
        Text without a line end; characters that are not `printable` become "?".
    err : bool
        Whether to print on standard error instead of standard output.
    """
    stream = sys.stderr if err else sys.stdout
    write_stream(f"{printable(line)}\n", stream)


def print_columns(
    rows: Iterable[Sequence[str]], titles: Sequence[str] = (), right: Collection[str] = ()
) -> None:
    """Print rows of texts as a table on standard output.

    The table is as wide as the terminal; in a file or a pipe it is as wide as it needs to be.

    Parameters
    ----------
    rows : iterable of sequence of str
        Texts of the cells, row by row.
    titles : sequence of str
        Titles of the columns. Without them the table has no header.
    right : collection of str
        Titles of the columns that are aligned at the right.
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
    width = None if sys.stdout.isatty() else ENDLESS
    console = Console(width=width, markup=False, emoji=False)
    segments = []
    for segment in console.render(table):
        lines = map(printable, segment.text.split("\n"))
        segments.append(Segment("\n".join(lines), segment.style))
    with console.capture() as captured:
        console.print(Segments(segments), end="")
    write_stream(captured.get(), sys.stdout)


def write_stream(text: str, stream: Any) -> None:
    """Write a text on a standard stream and flush it, without raising an OSError.

    An error of standard output is added to `OUTPUT_ERRORS`, so that a command writes its files
    although nobody reads what it prints; `finish_output` raises it. Errors of standard error are
    ignored.

    Parameters
    ----------
    text : str
        Text that has passed through `printable`.
    stream : text file or None
        `sys.stdout` or `sys.stderr`; None, as Python sets a closed stream, discards the text.
    """
    if stream is None:
        return
    try:
        stream.write(text)
        stream.flush()
    except OSError as error:
        discard_pending(stream)
        if stream is not sys.stderr:
            OUTPUT_ERRORS.append(OSError(error.errno, error.strerror, OUTPUT))


def finish_output() -> None:
    """Flush standard output, and raise the first of its errors since the command began.

    Raises
    ------
    OSError
        With `OUTPUT` in place of a file's name; a BrokenPipeError if the reader has ended.
    """
    write_stream("", sys.stdout)
    if OUTPUT_ERRORS:
        raise OUTPUT_ERRORS[0]


def discard_pending(stream: Any) -> None:
    """Discard the text that a stream still holds, which Python would try to write at its exit.

    Parameters
    ----------
    stream : text file or None
        A standard stream; it leads to the null device from then on.
    """
    with suppress(OSError, ValueError, AttributeError):
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, stream.fileno())
        os.close(null)


def shortened(name: str) -> str:
    """Return a file's name, with its middle left out if it is too long for a line.

    Parameters
    ----------
    name : str
        Name of any length.

    Returns
    -------
    str
        Name of at most about `LONGEST_NAME` letters.
    """
    if len(name) <= LONGEST_NAME:
        return name
    return f"{name[: LONGEST_NAME // 3]} ... {name[-LONGEST_NAME // 2 :]}"


def quoted(text: str, longest: int = 60) -> str:
    """Put a text of the user's in quotation marks, and shorten a long one.

    Parameters
    ----------
    text : str
        Text of any length.
    longest : int
        Number of letters from which on only the beginning and the number of letters are given.

    Returns
    -------
    str
        The text as Python writes it.
    """
    if len(text) <= longest:
        return repr(text)
    return f"{text[:longest]!r}... ({len(text)} characters)"


def first_reason(reasons: str) -> str:
    """Shorten a list of reasons to the first one and the number of the others.

    Parameters
    ----------
    reasons : str
        Reasons, joined by "; ".

    Returns
    -------
    str
        Text for a narrow column, such as "not resolved; and 2 more".
    """
    first, _, remaining = reasons.partition("; ")
    if not remaining:
        return first
    return f"{first}; and {remaining.count('; ') + 1} more"


def command_to_type(words: str) -> str:
    """Return a command as the user can type it where this process was started.

    Parameters
    ----------
    words : str
        Program, command and arguments, such as "gen info FILE" or "asperity gen info FILE".

    Returns
    -------
    str
        The words after "asperity" if this process runs as that command, otherwise after
        "python -m".
    """
    program = words.partition(" ")[0]
    if program == COMMAND:
        return words
    script = Path(sys.argv[0])
    if COMMAND in {script.name, script.parent.name}:
        return f"{COMMAND} {words}"
    return f"python -m {words}"


class RunProgress(AbstractContextManager["RunProgress"]):
    """Progress on standard error: one line that renews itself on a terminal, else a line at times.

    Parameters
    ----------
    total : int
        Number of rows to compute.
    noun : str
        Plural of a row, such as "samples"; further words may follow it, as "fits of ridge".
    work : float, optional
        Cost of all rows, in any unit, from which the remaining time follows; by default `total`.
    """

    def __init__(
        self, total: int, noun: str = "samples", work: float | None = None
    ) -> None:
        self._total = total
        self._noun = noun
        self._rows = 0
        self._failed = 0
        self._work = float(total)
        if work is not None:
            self._work = float(work)
        self._worked = 0.0
        self._began = time.monotonic()
        self._printed = self._began
        self._renews = sys.stderr is not None and sys.stderr.isatty()

    def __exit__(self, *error: object) -> None:
        """Print a last line, but not above a refusal of the input."""
        if self._rows and not isinstance(error[1], InputError):
            self.say(self._summary())

    def advance(self, rows: int, failed: int, work: float | None = None) -> None:
        """Count rows that have been written, and print the progress if it is time to.

        Parameters
        ----------
        rows : int
            Number of new rows, failed ones included.
        failed : int
            Number of failed rows among them.
        work : float, optional
            Cost of the rows in the unit of the whole work; by default 1 a row.
        """
        self._rows += rows
        self._failed += failed
        if work is None:
            work = rows
        self._worked += work
        pause = RENEWAL if self._renews else LINE_SECONDS
        now = time.monotonic()
        if now < self._printed + pause:
            return
        self._printed = now
        if self._renews:
            columns = shutil.get_terminal_size().columns - 1
            self._print(self._summary()[:columns])
        else:
            self.say(self._summary())

    def say(self, message: str) -> None:
        """Print a message as a line of its own, in place of the line that renews itself.

        Parameters
        ----------
        message : str
            Text without a line end.
        """
        self._print(message, end="\n")

    def _print(self, line: str, end: str = "") -> None:
        """Print a text at the start of a line; on a terminal it replaces what stands there."""
        start = CLEAR if self._renews else ""
        with suppress(ValueError):  # standard error has been closed
            write_stream(f"{start}{printable(line)}{end}", sys.stderr)

    def _summary(self) -> str:
        """Return rows, share, rate, failures and remaining time as one line."""
        elapsed = max(time.monotonic() - self._began, 1e-9)
        seconds = 0.0
        if self._worked:
            seconds = elapsed * (self._work / self._worked - 1)
        remaining = timedelta(seconds=round(max(seconds, 0.0)))
        percent = 100 * self._rows / self._total
        rate = self._rows / elapsed
        row = self._noun.partition(" ")[0]
        return (
            f"{self._rows} of {self._total} {self._noun} ({percent:.1f} %),"
            f" {rate:.3g} {row}/s, {self._failed} failed, {remaining} left"
        )
