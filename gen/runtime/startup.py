"""What every program of the project does before its command: threads, signals, standard streams."""

import io
import os
import signal
import sys
from typing import Any, TextIO

OUTPUT = "standard output"
"""What stands for a file's name in errors of standard output."""


def start(*, deaf: bool) -> None:
    """Make this process ready for a command; called before NumPy is imported.

    Parameters
    ----------
    deaf : True if Ctrl-C is to end the process until a run listens: a KeyboardInterrupt on one
        rank alone would leave the others waiting for it
    """
    # One thread a process: more would fight for cores, and sums could depend on their number.
    for library in ("OMP", "OPENBLAS", "MKL", "BLIS", "VECLIB_MAXIMUM"):
        os.environ[f"{library}_NUM_THREADS"] = "1"
    if deaf:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    _open_closed_descriptors()
    sys.stdout = _text(_Output(1, "w", closefd=False), sys.stdout, "replace")
    sys.stderr = _text(_Remarks(2, "w", closefd=False), sys.stderr, "backslashreplace")


def _open_closed_descriptors() -> None:
    """Open standard streams that were closed: else a database would become one, and be spoilt."""
    for descriptor in range(3):
        try:
            os.fstat(descriptor)
        except OSError:  # open takes the lowest number that is free: this one
            os.open(os.devnull, os.O_RDWR)


class _Output(io.FileIO):
    """Standard output, named in what it raises."""

    def write(self, data: Any) -> int:
        """Write some bytes; return their number."""
        try:
            return super().write(data) or 0
        except OSError as error:
            raise OSError(error.errno, error.strerror, OUTPUT) from None


class _Remarks(io.FileIO):
    """Standard error: its device may be full, or its reader gone, and nothing ends for that."""

    def write(self, data: Any) -> int:
        """Write what can be written, and take the rest for written."""
        try:
            return super().write(data) or 0
        except OSError:
            return memoryview(data).nbytes


def _text(raw: io.FileIO, like: TextIO | None, errors: str) -> io.TextIOWrapper:
    """Text on a descriptor, encoded as in the stream that Python has opened on it.

    A character that this encoding lacks, of a title or a file's name, ends no command.
    """
    return io.TextIOWrapper(
        io.BufferedWriter(raw),
        getattr(like, "encoding", None) or "utf-8",
        errors,
        line_buffering=getattr(like, "line_buffering", False),
    )
