"""How the user types commands: `asperity gen info FILE`, or `python -m gen info FILE`."""

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

COMMAND = "asperity"
"""Name of the installed command, under which all programs run too."""

_start: ContextVar[str] = ContextVar("_start", default="python -m")
"""The words before the name of a program on the command line."""


@contextmanager
def started_as(name: str) -> Iterator[None]:
    """Let messages name commands as the user has typed the running one.

    Parameters
    ----------
    name : str
        Name of the program: "gen", or "asperity gen".
    """
    own = _start.set(COMMAND if name.partition(" ")[0] == COMMAND else "python -m")
    try:
        yield
    finally:
        _start.reset(own)


def to_type(words: str) -> str:
    """Return a command as the user can type it.

    Parameters
    ----------
    words : str
        Program, command and arguments, as "gen info FILE"; also "asperity gen info FILE".
    """
    return words if words.partition(" ")[0] == COMMAND else f"{_start.get()} {words}"
