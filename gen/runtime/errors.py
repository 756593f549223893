"""The error for input that cannot be used, and what errors of the system are about."""

import os
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

HDF5_NUMBER = re.compile(r"errno = (\d+)")
"""Number of the system's error in HDF5's message about a system call that failed."""

HDF5_FILE = re.compile(r"name = '(.*?)', ", re.DOTALL)
"""Name of the file in HDF5's message about a system call that failed."""


class InputError(ValueError):
    """Input that cannot be used; a command prints the message and exits with code 2.

    Parameters
    ----------
    message : str
        One line that names the value, its place, and what is allowed.
    details : sequence of str
        Lines of a list that belongs to the message; a command prints them below it.
    """

    def __init__(self, message: str = "", details: Sequence[str] = ()) -> None:
        super().__init__(message)
        self.details = tuple(details)

    def __str__(self) -> str:
        """Return the message and, on further lines, the list of details."""
        return "\n  ".join([str(self.args[0]), *self.details])


class SourceError(InputError):
    """A map or a function that a scene names cannot be used; this ends a run.

    Its file or the function is missing, has changed since the database was made, is not trusted, or
    fails.
    """


@contextmanager
def input_errors(place: str = "") -> Iterator[None]:
    """Turn a ValueError of the block, such as one of `bem.checks`, into an InputError.

    Parameters
    ----------
    place : str
        File or option that the input comes from, such as "rough.npy", with which the message
        begins; "" for none.

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
    """Find the number of the system's error that caused an exception.

    Parameters
    ----------
    error : BaseException
        Any exception. For errors of the system, h5py raises exceptions of several types, with the
        number in their text.

    Returns
    -------
    int
        A number of the module `errno`, such as EIO of a disk that fails, or ESTALE of a file
        server that has been restarted; 0 if the exception has no such number.
    """
    if isinstance(error, OSError) and error.errno:
        return error.errno
    number = HDF5_NUMBER.search(str(error))
    if number is None:
        return 0
    return int(number[1])


def file_of(error: BaseException) -> str:
    """Find the name of the file that an error of the system is about.

    Parameters
    ----------
    error : BaseException
        An OSError, or an exception of h5py, which has the name in its text.

    Returns
    -------
    str
        Name or path as it was passed to the system; "" if the error names no file.
    """
    name = getattr(error, "filename", None)
    if isinstance(name, str | bytes):
        return os.fsdecode(name)
    match = HDF5_FILE.search(str(error))
    if match is None:
        return ""
    return match[1]
