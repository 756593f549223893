"""The contents of a page: pictures, tables and words, each with the files behind it."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path


@dataclass(frozen=True)
class Figure:
    """A PNG file, a caption in plain text that says what to see in it, and the tables behind it.

    The command that makes it is that of the part if it is empty.
    """

    picture: Path
    caption: str
    command: str = ""
    data: tuple[Path, ...] = ()


@dataclass(frozen=True)
class Table:
    """A CSV file, with the names of its columns first, and a caption as that of a figure."""

    data: Path
    caption: str
    command: str = ""
    columns: tuple[str, ...] = ()  # that are shown, in this order; all of them if empty
    verdict: str = ""  # the column whose value is `passed` where all is well: other rows are red


@dataclass(frozen=True)
class Words:
    """A paragraph; its lines and blanks are kept if a program `typed` it."""

    text: str
    typed: bool = False


@dataclass(frozen=True)
class Absent:
    """Something that was left out, and how to get it in one line."""

    what: str
    how: str


Content = Figure | Table | Words | Absent


def tables_of(content: Content) -> tuple[Path, ...]:
    """Return the CSV files of a content."""
    match content:
        case Figure():
            return content.data
        case Table():
            return (content.data,)
    return ()


def files_of(content: Content) -> tuple[Path, ...]:
    """Return the pictures and tables of a content."""
    picture = (content.picture,) if isinstance(content, Figure) else ()
    return *picture, *tables_of(content)


def moved(content: Content, place: Callable[[Path], Path]) -> Content:
    """Return a content whose files are elsewhere."""
    match content:
        case Figure():
            data = tuple(map(place, content.data))
            return replace(content, picture=place(content.picture), data=data)
        case Table():
            return replace(content, data=place(content.data))
    return content
