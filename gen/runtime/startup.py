"""Prepare a process for a command of any program: threads, signals, standard streams."""

import io
import os
import signal
import sys
from typing import Any, TextIO

OUTPUT = "standard output"
"""Name of standard output in place of a file's name in errors."""


def start(*, default_sigint: bool) -> None:
    """Prepare this process for a command; to be called before NumPy is imported.

    Parameters
    ----------
    default_sigint : bool
        Let Ctrl-C end the process until a run listens to signals; a KeyboardInterrupt on one rank
        alone would leave the other ranks waiting.
    """
    # More threads would compete for the cores, and sums could depend on their number.
    for library in ("OMP", "OPENBLAS", "MKL", "BLIS", "VECLIB_MAXIMUM"):
        os.environ[f"{library}_NUM_THREADS"] = "1"
    if default_sigint:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    _open_closed_descriptors()
    sys.stdout = _text(_Output(1, "w", closefd=False), sys.stdout, "replace")
    sys.stderr = _text(_Remarks(2, "w", closefd=False), sys.stderr, "backslashreplace")


def _open_closed_descriptors() -> None:
    """Open closed standard streams on /dev/null; a database could otherwise get their number."""
    for descriptor in range(3):
        try:
            os.fstat(descriptor)
        except OSError:  # open takes the lowest free number, which is this one
            os.open(os.devnull, os.O_RDWR)


class _Output(io.FileIO):
    """Standard output, named in the errors that it raises."""

    def write(self, data: Any) -> int:
        """Write bytes and return their number."""
        try:
            return super().write(data) or 0
        except OSError as error:
            raise OSError(error.errno, error.strerror, OUTPUT) from None


class _Remarks(io.FileIO):
    """Standard error, whose errors are ignored: a full device or a lost reader ends no command."""

    def write(self, data: Any) -> int:
        """Write bytes; on an error, pretend that all of them were written."""
        try:
            return super().write(data) or 0
        except OSError:
            return memoryview(data).nbytes


def _text(raw: io.FileIO, like: TextIO | None, errors: str) -> io.TextIOWrapper:
    """Open a text stream on a descriptor with the encoding of Python's own stream.

    Characters that the encoding lacks, for example in a title, are replaced.
    """
    return io.TextIOWrapper(
        io.BufferedWriter(raw),
        getattr(like, "encoding", None) or "utf-8",
        errors,
        line_buffering=getattr(like, "line_buffering", False),
    )
