"""The error for input that cannot be used."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager


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
