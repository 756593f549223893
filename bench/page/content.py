"""What a page shows: pictures, tables and words, each with the files behind it."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path


@dataclass(frozen=True)
class Figure:
    """A picture with what to see in it.

    Attributes
    ----------
    picture : Path
        The PNG file.
    caption : str
        What it shows and what to see, in a sentence or two; plain text.
    command : str
        The command that makes it, as a user types it; empty for that of the part.
    data : tuple of Path
        The tables (CSV) behind it.
    """

    picture: Path
    caption: str
    command: str = ""
    data: tuple[Path, ...] = ()


@dataclass(frozen=True)
class Table:
    """A table with what to see in it.

    Attributes
    ----------
    data : Path
        The CSV file, with the names of the columns first.
    caption : str
        What it shows and what to see; plain text.
    command : str
        The command that makes it; empty for that of the part.
    columns : tuple of str
        The columns that are shown, in this order; all of them if empty.
    verdict : str
        The column whose value is `passed` where all is well: other rows are red.
    """

    data: Path
    caption: str
    command: str = ""
    columns: tuple[str, ...] = ()
    verdict: str = ""


@dataclass(frozen=True)
class Words:
    """Plain text.

    Attributes
    ----------
    text : str
        A paragraph.
    typed : bool
        Whether its lines and blanks are kept, as a program printed them.
    """

    text: str
    typed: bool = False


@dataclass(frozen=True)
class Absent:
    """Something that was left out.

    Attributes
    ----------
    what : str
        What is not there.
    how : str
        How to get it, in one line.
    """

    what: str
    how: str


Content = Figure | Table | Words | Absent


def files_of(content: Content) -> tuple[Path, ...]:
    """Return the pictures and tables of a content."""
    if isinstance(content, Figure):
        return content.picture, *content.data
    return (content.data,) if isinstance(content, Table) else ()


def moved(content: Content, place: Callable[[Path], Path]) -> Content:
    """Return a content whose files are elsewhere."""
    if isinstance(content, Figure):
        data = tuple(place(file) for file in content.data)
        return replace(content, picture=place(content.picture), data=data)
    return replace(content, data=place(content.data)) if isinstance(content, Table) else content


def commanded(content: Content, command: str) -> Content:
    """Return a content that names a command, where it names none of its own."""
    if isinstance(content, Figure | Table) and not content.command:
        return replace(content, command=command)
    return content
