"""Show the progress of a run: a bar on a terminal, plain lines in a batch log."""

import time
from contextlib import suppress
from typing import Self

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

from gen.runtime.console import console
from gen.runtime.errors import InputError

LINE_SECONDS = 30.0
"""Time between two lines of a batch log [s]."""


HEEDLESS = suppress(OSError, ValueError)
"""Guard of everything that is shown: a full, closed or vanished stream must not end a run."""


class RunProgress:
    """A display of finished and failed rows, rate and remaining time on standard error.

    Parameters
    ----------
    total : int
        Number of rows of this run.
    noun : str
        Plural noun for the rows, which words that tell it from others may follow.
    work : float, optional
        Expected cost of all rows in any unit, from which the remaining time follows; by default
        all rows cost the same.
    """

    def __init__(self, total: int, noun: str = "samples", work: float | None = None) -> None:
        self._console = console(stderr=True)
        self._total, self._noun = total, noun
        self._here = self._failed = 0
        self._work, self._worked = float(total if work is None else work), 0.0
        self._began = self._last_line = time.monotonic()
        self._bar = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("{task.fields[pace]}"),
            console=self._console,
            disable=not self._console.is_terminal,
        )
        self._task = self._bar.add_task(noun, total=total, pace="")

    def __enter__(self) -> Self:
        """Start the clock and the bar."""
        self._began = self._last_line = time.monotonic()
        with HEEDLESS:
            self._bar.start()
        return self

    def __exit__(self, *error: object) -> None:
        """Stop the bar; print a last line in a batch log, but not above a refusal of the input."""
        with HEEDLESS:
            self._bar.stop()
        refused = isinstance(error[1], InputError)
        if not self._console.is_terminal and self._here and not refused:
            self._print_line()

    def advance(self, rows: int, failed: int, work: float | None = None) -> None:
        """Count rows that have been written.

        Parameters
        ----------
        rows : int
            Number of rows, failed ones included.
        failed : int
            Number of failed rows.
        work : float, optional
            Cost of the rows, in the unit of the total; their number by default.
        """
        self._here += rows
        self._failed += failed
        self._worked += rows if work is None else work
        with HEEDLESS:
            self._bar.update(self._task, completed=self._here, pace=self._pace())
        if not self._console.is_terminal and time.monotonic() > self._last_line + LINE_SECONDS:
            self._print_line()

    def say(self, message: str) -> None:
        """Print a line above the bar.

        Parameters
        ----------
        message : str
            The line.
        """
        with HEEDLESS:
            self._console.print(message, markup=False, highlight=False, soft_wrap=True)

    def _print_line(self) -> None:
        """Print the state as a line of a batch log."""
        self._last_line = time.monotonic()
        share = 100 * self._here / self._total
        self.say(f"{self._here} of {self._total} {self._noun} ({share:.1f} %), {self._pace()}")

    def _pace(self) -> str:
        """Return rate, failures and remaining time in words."""
        elapsed = max(time.monotonic() - self._began, 1e-9)
        left = elapsed * (self._work / self._worked - 1) if self._worked else 0.0
        rate = f"{self._here / elapsed:.3g} {self._noun.partition(' ')[0]}/s"
        return f"{rate}, {self._failed} failed, {_duration(max(left, 0.0))} left"


def _duration(seconds: float) -> str:
    """Format a time as minutes and seconds, with hours if there are any."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"
