"""The error for input that cannot be used, and what errors of the system say."""

import os
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

HDF5_NUMBER = re.compile(
    r"errno = (\d+)"
)  # in what HDF5 says of a call of the system that failed
HDF5_FILE = re.compile(r"name = '(.*?)', ", re.DOTALL)


class InputError(ValueError):
    """Unusable input: one line with the given and the allowed value; commands then exit with 2.

    Parameters
    ----------
    message : str
        The line.
    details : sequence of str
        A list that belongs to it, which a command prints below it, an entry a line.
    """

    def __init__(self, message: str = "", details: Sequence[str] = ()) -> None:
        super().__init__(message)
        self.details = tuple(details)

    def __str__(self) -> str:
        """Return the line and the list below it."""
        return "\n  ".join([str(self.args[0]), *self.details])


class SourceError(InputError):
    """A map or function that a scene names is missing, has changed or fails: the run ends."""


@contextmanager
def input_errors(place: str = "") -> Iterator[None]:
    """Turn the ValueError of a check, as of `bem.checks`, into an InputError at a place.

    Parameters
    ----------
    place : str
        What the input belongs to, as "rough.npy"; the message begins with it.

    Raises
    ------
    InputError
        Instead of any ValueError of the block.
    """
    try:
        yield
    except ValueError as error:
        raise InputError(f"{place}: {error}" if place else str(error)) from None


def errno_of(error: BaseException) -> int:
    """Return the number of the system's error behind an exception, 0 if there is none.

    Parameters
    ----------
    error : BaseException
        An OSError, or what h5py raises: one of several types, with the number in HDF5's text.

    Returns
    -------
    int
        A number of the module `errno`, such as EIO of a disk that fails, or ESTALE of a server of
        files that has been restarted; 0 for an error that is not the system's.
    """
    if isinstance(error, OSError) and error.errno:
        return error.errno
    number = HDF5_NUMBER.search(str(error))
    return int(number[1]) if number else 0


def file_of(error: BaseException) -> str:
    """Return the name of the file that an error of the system is about, "" if it is unknown.

    Parameters
    ----------
    error : BaseException
        As of `errno_of`.

    Returns
    -------
    str
        Name or path as it was given.
    """
    name = getattr(error, "filename", None)
    if isinstance(name, str | bytes):
        return os.fsdecode(name)
    match = HDF5_FILE.search(str(error))
    return match[1] if match else ""
