"""Print lines on a terminal without control characters of their content.

Titles, names of files and messages of libraries come from strangers. An escape sequence in one of
them could clear the screen, rename the window or forge a line of ours. Every line that a command
prints goes through `echo`, through `gen.runtime.console`, or through `printable`.
"""

import typer

LETTERS = 110
"""Letters of a name that fit into a line of a picture's title."""


def printable(text: str) -> str:
    """Replace every character that is not printable by a question mark.

    These are control characters, ends of lines, and characters that turn the direction of writing.

    Parameters
    ----------
    text : str
        One line.
    """
    return "".join(character if character.isprintable() else "?" for character in text)


def echo(line: str, *, err: bool = False) -> None:
    """Print one line.

    Parameters
    ----------
    line : str
        Text of the line.
    err : bool
        Print on standard error instead of standard output.
    """
    typer.echo(printable(line), err=err)


def shortened(name: str) -> str:
    """Return a file's name with its middle left out if it is too long for a line."""
    return name if len(name) <= LETTERS else f"{name[: LETTERS // 3]} ... {name[-LETTERS // 2 :]}"


def brief(reasons: str) -> str:
    """Shorten reasons to the first one and the number of the others, for a narrow column."""
    first, _, others = reasons.partition("; ")
    return f"{first}; and {others.count('; ') + 1} more" if others else first
