"""Options that several commands share, and how commands print their results."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import typer

from gen.runtime.errors import InputError
from gen.runtime.figure import new_figure
from gen.runtime.files import check_folder

if TYPE_CHECKING:
    from bench.report import Report

Number = TypeVar("Number", int, float)


def option(default: Any, words: str, *names: str, **settings: Any) -> Any:
    """Declare an option: its default, what `--help` says, its names, and typer's settings."""
    return typer.Option(default, *names, help=words, **settings)


_output = typer.Option("--output", "-o", metavar="DIR", help="The folder to write into.")
Folder = Annotated[Path, _output]
FolderIfAny = Annotated[Path | None, _output]

PAPER_ROWS = option(15_878, "Rows of the paper preset; all of them unless given.", min=1)
PAPER_DATABASE = option(None, "A database of the paper preset, not generated anew.", metavar="FILE")
AREA_MAX = option(16.56, "Rows of larger area are left out; the paper's range.", metavar="PERCENT")
PARTS = option(None, "May be repeated; all if left out.", metavar="PART")


def numbers(name: str, text: str, kind: type[Number]) -> list[Number]:
    """Parse numbers with commas between them."""
    try:
        return [kind(part) for part in text.split(",")]
    except ValueError:
        raise InputError(f"{name} {text!r}: give numbers with commas between them") from None


def require_place(folder: Path | None, *names: str) -> None:
    """Refuse a folder, or pictures without matplotlib, before any work is done for a report."""
    if folder is None:
        return
    if any(name.endswith(".png") for name in names):
        new_figure(1.0, 1.0)
    check_folder(folder, *names)


def tell(folder: Path | None, report: Report) -> None:
    """Print a report's text, and write its files into a folder if one is given."""
    if report.text:
        typer.echo(report.text)
    if folder is not None:
        for path in report.write(folder):
            typer.echo(path)
