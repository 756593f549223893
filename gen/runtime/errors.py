"""The error for input that cannot be used, and the number and the file in errors of the system."""

import os
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

HDF5_NUMBER = re.compile(r"errno = (\d+)")
"""Number of the system's error in HDF5's message about a failed call of the system."""

HDF5_FILE = re.compile(r"name = '(.*?)', ", re.DOTALL)
"""Name of the file in the same message."""


class InputError(ValueError):
    """Input that cannot be used; a command prints the message and exits with code 2.

    Parameters
    ----------
    message : str
        One line that names the value, what is allowed, and where it stands.
    details : sequence of str
        Entries of a list that belongs to the message; a command prints one a line below it.
    """

    def __init__(self, message: str = "", details: Sequence[str] = ()) -> None:
        super().__init__(message)
        self.details = tuple(details)

    def __str__(self) -> str:
        """Return the message and the list below it."""
        return "\n  ".join([str(self.args[0]), *self.details])


class SourceError(InputError):
    """The error of a map or function that a scene names, which ends the run.

    The file or the function is missing, has changed since the database was made, or fails.
    """


@contextmanager
def input_errors(place: str = "") -> Iterator[None]:
    """Turn a ValueError of the block, such as one of `bem.checks`, into an InputError.

    Parameters
    ----------
    place : str
        File or option that the input comes from, such as "rough.npy"; the message begins with it.

    Yields
    ------
    None

    Raises
    ------
    InputError
        In place of any ValueError of the block.
    """
    try:
        yield
    except ValueError as error:
        message = f"{place}: {error}" if place else str(error)
        raise InputError(message) from None


def errno_of(error: BaseException) -> int:
    """Return the number of the system's error behind an exception, 0 if there is none.

    Parameters
    ----------
    error : BaseException
        An OSError, or what h5py raises: one of several types, with the number in HDF5's text.

    Returns
    -------
    int
        A number of the module `errno`, such as EIO of a disk that fails, or ESTALE of a file
        server that has been restarted; 0 for an error that is not the system's.
    """
    if isinstance(error, OSError) and error.errno:
        return error.errno
    number = HDF5_NUMBER.search(str(error))
    if number is None:
        return 0
    return int(number[1])


def file_of(error: BaseException) -> str:
    """Return the name of the file that an error of the system is about.

    Parameters
    ----------
    error : BaseException
        An OSError, or what h5py raises.

    Returns
    -------
    str
        Name or path as the caller of the system wrote it; empty if the error names no file.
    """
    name = getattr(error, "filename", None)
    if isinstance(name, str | bytes):
        return os.fsdecode(name)
    match = HDF5_FILE.search(str(error))
    if match is None:
        return ""
    return match[1]
