"""Text for a terminal: nothing that stands in somebody's file may drive it.

Titles, names of files and texts of libraries come from strangers. An escape sequence in one of them
could clear the screen, rename the window or forge a line of our own. Every line that a command
prints goes through `echo`, through `gen.runtime.console`, or through `printable` where it is made.
"""

import typer

LETTERS = 110
"""Letters of a name that fit into a line of a picture's title."""


def printable(text: str) -> str:
    """Replace every character that cannot be printed, the end of a line too, by a question mark.

    Escape, bell and the other control characters go, and those that turn the direction of writing.

    Parameters
    ----------
    text : one line
    """
    return "".join(character if character.isprintable() else "?" for character in text)


def echo(line: str, *, err: bool = False) -> None:
    """Print one line on standard output, or on standard error if `err`."""
    typer.echo(printable(line), err=err)


def shortened(name: str) -> str:
    """Return a file's name with its middle left out if it is too long for a line."""
    return name if len(name) <= LETTERS else f"{name[: LETTERS // 3]} ... {name[-LETTERS // 2 :]}"
