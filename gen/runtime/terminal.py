"""Print lines, tables and progress, and write commands as the user can type them.

Titles, names of files and messages of libraries come from strangers. An escape sequence in them
could forge a line of this program, so every printed text passes through `printable`.
"""

import os
import shutil
import sys
import time
from collections.abc import Collection, Iterable, Sequence
from contextlib import AbstractContextManager, suppress
from datetime import timedelta
from pathlib import Path
from types import TracebackType
from typing import Any

from gen.runtime.errors import InputError

OUTPUT = "standard output"  # the file's name in errors of standard output
LONGEST_NAME = 110
"""Largest number of letters of a file's name in the title of a picture."""

ENDLESS = 1000
"""Width of a table in a file or a pipe [letters]; it is so large that no line is broken."""

LINE_SECONDS = 30.0  # shortest time between two lines of progress in a batch log [s]
RENEWAL = 0.1  # shortest time between two states of the progress line on a terminal [s]
CLEAR = "\r\x1b[K"  # moves to the start of a terminal's line and empties the line
COMMAND = "asperity"  # installed command, which runs all programs

OUTPUT_ERRORS: list[OSError] = []
"""Errors of standard output since the command began; `write_stream` appends them."""


def printable(text: str) -> str:
    """Replace every character that a terminal would not print as a letter by "?".

    These are control characters, line ends, and characters that change the direction of writing.

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

    An error of the stream is not raised here; see `write_stream`.

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

    On a terminal, long cells are broken so that the table fits into its width. In a file or a pipe
    no line is broken.

    Parameters
    ----------
    rows : iterable of sequence of str
        Texts of the cells, row by row.
    titles : sequence of str
        Titles of the columns. Without them the table has no header.
    right : collection of str
        Titles of the columns that are aligned at the right; the other columns are aligned at the
        left.
    """
    if sys.stdout is None:  # the user has closed standard output
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
    # Replace control characters in the texts of the segments. The escape sequences of styles stay,
    # because Rich adds them only when it prints the segments.
    segments = []
    for segment in console.render(table):
        lines = map(printable, segment.text.split("\n"))
        segments.append(Segment("\n".join(lines), segment.style))
    with console.capture() as captured:
        console.print(Segments(segments), end="")
    write_stream(captured.get(), sys.stdout)


def write_stream(text: str, stream: Any) -> None:
    """Write a text on a standard stream and flush it, without raising an OSError.

    An error of standard output is appended to `OUTPUT_ERRORS`, and `finish_output` raises it at the
    end. A command thus writes its files even if nobody reads what it prints. Errors of standard
    error are ignored.

    Parameters
    ----------
    text : str
        Text that has passed through `printable`.
    stream : text file or None
        `sys.stdout` or `sys.stderr`. Either is None if the stream was closed before Python began;
        the text is then discarded.
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
        If standard output could not be written; its file name is `OUTPUT`. It is a BrokenPipeError
        if the reader of a pipe has ended.
    """
    write_stream("", sys.stdout)  # flushes
    if OUTPUT_ERRORS:
        raise OUTPUT_ERRORS[0]


def discard_pending(stream: Any) -> None:
    """Redirect a stream to the null device, which discards the text that it still holds.

    Otherwise Python would try to write this text when the process ends, and fail again.

    Parameters
    ----------
    stream : text file or None
        A standard stream. A stream without a file of the system, as in tests, stays as it is.
    """
    with suppress(OSError, ValueError, AttributeError):  # there is no stream or no file
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, stream.fileno())
        os.close(null)


def shortened(name: str) -> str:
    """Shorten the name of a file so that it fits into the title of a picture.

    Parameters
    ----------
    name : str
        Name of any length.

    Returns
    -------
    str
        The name itself if it has at most `LONGEST_NAME` letters. Otherwise its beginning and its
        end, with " ... " between them; at most `LONGEST_NAME` letters too.
    """
    if len(name) <= LONGEST_NAME:
        return name
    beginning = name[: LONGEST_NAME // 3]
    end = name[-LONGEST_NAME // 2 :]
    return f"{beginning} ... {end}"


def quoted(text: str, longest: int = 60) -> str:
    """Put a text of the user's in quotation marks, and shorten it if it is long.

    Parameters
    ----------
    text : str
        Text of any length.
    longest : int
        Largest number of letters that are quoted.

    Returns
    -------
    str
        The text as a literal of Python, as "'abc'". Of a text that is longer than `longest`, its
        first letters and its length, as "'abc'... (300 characters)".
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
        Text for a narrow column, such as "not resolved; and 2 more"; a single reason as it is.
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
        "asperity WORDS" if this process runs as the command asperity, otherwise "python -m WORDS".
        Words that begin with asperity are returned as they are.
    """
    program = words.partition(" ")[0]
    if program == COMMAND:
        return words
    # The installed script .../bin/asperity, or .../asperity/__main__.py of python -m asperity.
    script = Path(sys.argv[0])
    if COMMAND in {script.name, script.parent.name}:
        return f"{COMMAND} {words}"
    return f"python -m {words}"


class RunProgress(AbstractContextManager["RunProgress"]):
    """Print the progress of a command on standard error.

    A terminal has one line, which is overwritten every `RENEWAL` seconds. Any other file gets a new
    line every `LINE_SECONDS`. When the block of this context manager ends, a last line is printed
    if any row has been counted.

    Parameters
    ----------
    total : int
        Number of rows to compute, at least 1 if any row is counted.
    noun : str
        What a row is called, in the plural, such as "samples". Further words may follow, as in
        "fits of ridge".
    work : float, optional
        Cost of all rows, in any unit. The remaining time is estimated from it. By default every
        row costs 1.
    """

    def __init__(
        self, total: int, noun: str = "samples", work: float | None = None
    ) -> None:
        self._total = total
        self._noun = noun
        self._rows = 0  # counted until now
        self._failed = 0  # failed rows among them
        self._total_work = float(total)
        if work is not None:
            self._total_work = float(work)
        self._work_done = 0.0
        self._began = time.monotonic()  # [s]
        self._last_printed = self._began  # [s]
        self._renews = sys.stderr is not None and sys.stderr.isatty()

    def __exit__(
        self,
        error_type: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Print a last line, unless an InputError ends the block: its message is enough."""
        if self._rows and not isinstance(error, InputError):
            self.say(self._summary())

    def advance(self, rows: int, *, failed: int = 0, work: float | None = None) -> None:
        """Count rows that are finished, and print the progress unless it was printed just before.

        Parameters
        ----------
        rows : int
            Number of new rows, failed ones included.
        failed : int, optional
            Number of failed rows among them; none by default.
        work : float, optional
            Cost of the new rows, in the unit of the constructor's `work`. By default every row
            costs 1.
        """
        self._rows += rows
        self._failed += failed
        if work is None:
            work = rows
        self._work_done += work
        pause = RENEWAL if self._renews else LINE_SECONDS
        now = time.monotonic()
        if now < self._last_printed + pause:
            return
        self._last_printed = now
        if self._renews:
            # A line as wide as the terminal could move the cursor to the next line.
            width = shutil.get_terminal_size().columns - 1
            self._print(self._summary()[:width])
        else:
            self.say(self._summary())

    def expect(self, total: int) -> None:
        """Change the number of rows, each of which costs 1, as further ones are planned.

        Parameters
        ----------
        total : int
            Number of rows to compute, those included that are finished.
        """
        self._total = total
        self._total_work = float(total)

    def say(self, message: str) -> None:
        """Print a message as a line that stays; on a terminal it overwrites the progress line.

        Parameters
        ----------
        message : str
            Text without a line end.
        """
        self._print(message, end="\n")

    def _print(self, line: str, end: str = "") -> None:
        """Print a text and then `end`; on a terminal the text overwrites the progress line."""
        start = CLEAR if self._renews else ""
        with suppress(ValueError):  # standard error has been closed
            write_stream(f"{start}{printable(line)}{end}", sys.stderr)

    def _summary(self) -> str:
        """Return the progress as one line: rows, share, rate, failed rows and remaining time."""
        elapsed = max(time.monotonic() - self._began, 1e-9)  # [s], never 0
        seconds_left = 0.0
        if self._work_done:
            remaining_work = self._total_work - self._work_done
            seconds_left = elapsed * remaining_work / self._work_done
        remaining = timedelta(seconds=round(max(seconds_left, 0.0)))
        percent = 100 * self._rows / self._total
        rate = self._rows / elapsed
        plural = self._noun.partition(" ")[0]
        return (
            f"{self._rows} of {self._total} {self._noun} ({percent:.1f} %),"
            f" {rate:.3g} {plural}/s, {self._failed} failed, {remaining} left"
        )
