"""The error for input that cannot be used."""

from collections.abc import Sequence


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
