"""One self-contained page: pictures and tables stand in the file itself."""

import base64
import csv
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bench.circumstances import circumstances
from bench.page.content import Absent, Content, Figure, Table, Words
from bench.page.part import Part
from bench.page.run import FINISHED, Inputs, record, typed
from gen.errors import InputError

PAGE = "index.html"
DIGITS = 4
"""Significant digits of numbers on the page; the files have all of them."""

PASSED = "passed"


@dataclass(frozen=True)
class Cell:
    """A value of a table as it is shown."""

    text: str
    number: bool


@dataclass(frozen=True)
class Row:
    """A line of a table; `failed` lines are red."""

    cells: tuple[Cell, ...]
    failed: bool


@dataclass(frozen=True)
class Shown:
    """A part as the template needs it.

    Attributes
    ----------
    part : what it is
    record : how it was made
    contents : kind and what the template shows of it
    absent : why there is nothing; empty where there is something
    """

    part: Part
    record: dict[str, Any]
    contents: tuple[tuple[str, dict[str, Any]], ...] = ()
    absent: str = ""

    @property
    def failures(self) -> int:
        """Lines of its tables with a failed verdict."""
        return sum(values.get("failures", 0) for _, values in self.contents)


def write_page(parts: Sequence[Part], inputs: Inputs) -> Path:
    """Write the page of what a folder holds.

    Parameters
    ----------
    parts : in the page's order
    inputs : where their files are

    Returns
    -------
    The page

    Raises
    ------
    InputError
        If jinja2 is not installed, or the page cannot be written.
    """
    try:
        from jinja2 import Environment, PackageLoader, StrictUndefined
    except ImportError:
        raise InputError("the page needs jinja2: install the extra 'bench'") from None
    environment = Environment(
        loader=PackageLoader("bench.page", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    shown = [_shown(part, inputs) for part in parts]
    chapters: dict[str, list[Shown]] = {}
    for each in shown:
        chapters.setdefault(each.part.chapter, []).append(each)
    text = environment.get_template("page.html").render(
        chapters=chapters,
        made=circumstances(),
        judged=sum(v.get("judged", 0) for each in shown for _, v in each.contents),
        failures=sum(each.failures for each in shown),
    )
    path, unfinished = inputs.output / PAGE, inputs.output / f".{PAGE}"
    try:
        unfinished.write_text(text, encoding="utf-8")
        unfinished.replace(path)
    except OSError as error:
        raise InputError(f"{path} cannot be written: {error.strerror or error}") from None
    return path


def _shown(part: Part, inputs: Inputs) -> Shown:
    folder = inputs.folder(part)
    found = record(folder)
    if found is None and part.name != "comparison":
        arguments = inputs.arguments(part)
        how = typed(arguments) if arguments else "python -m bench run --full"
        return Shown(part, {}, absent=f"Not here. It is made by: {how}")
    if found is not None and found["code"] not in FINISHED:
        told = found["told"][-1] if found["told"] else "it said nothing"
        return Shown(part, found, absent=f"{found['command']}: code {found['code']}, {told}")
    contents = tuple(_prepared(each) for each in part.show(folder))
    if not contents:
        return Shown(part, {}, absent=f"{folder} holds nothing to show")
    return Shown(part, found or {}, contents)


def _prepared(content: Content) -> tuple[str, dict[str, Any]]:
    """Kind of a content, and what the template needs to show it."""
    match content:
        case Figure():
            source = base64.b64encode(_bytes(content.picture)).decode()
            return "figure", {
                "source": f"data:image/png;base64,{source}",
                "size": _size(content.picture),
                "caption": content.caption,
                "command": content.command,
                "files": [_download(path) for path in content.data],
            }
        case Table():
            return "table", _table(content)
        case Words():
            return "words", {"text": content.text, "typed": content.typed}
        case Absent():
            return "absent", {"what": content.what, "how": content.how}


def _table(table: Table) -> dict[str, Any]:
    header, *lines = csv.reader(_bytes(table.data).decode().splitlines())
    columns = table.columns or tuple(header)
    if missing := set(columns) - set(header):
        raise InputError(f"{table.data}: has no column {', '.join(sorted(missing))}")
    places = [header.index(name) for name in columns]
    verdicts = [line[header.index(table.verdict)] for line in lines] if table.verdict else []
    failed = [verdict != PASSED for verdict in verdicts] or [False] * len(lines)
    return {
        "header": [_title(name) for name in columns],
        "rows": [
            Row(tuple(_cell(line[place]) for place in places), bad)
            for line, bad in zip(lines, failed, strict=True)
        ],
        "caption": table.caption,
        "command": table.command,
        "files": [_download(table.data)],
        "judged": len(verdicts),
        "failures": sum(failed) if verdicts else 0,
    }


def _title(name: str) -> str:
    """A column's name for people, its unit in brackets where it ends in one."""
    words = name.split("_")
    units = {"um": "µm", "s": "s", "seconds": "s", "percent": "%", "uN": "µN"}
    if len(words) > 1 and words[-1] in units:
        return f"{' '.join(words[:-1])} [{units[words[-1]]}]"
    return " ".join(words)


def _cell(text: str) -> Cell:
    try:
        value = float(text)
    except ValueError:
        return Cell(text, number=False)
    if not math.isfinite(value):
        return Cell("" if math.isnan(value) else text.replace("inf", "∞"), number=True)
    if value.is_integer() and abs(value) < 1e7:
        return Cell(f"{value:,.0f}" if abs(value) >= 1e4 else f"{value:.0f}", number=True)
    return Cell(f"{value:.{DIGITS}g}", number=True)


def _download(path: Path) -> dict[str, str]:
    """A file as a link that holds it."""
    source = base64.b64encode(_bytes(path)).decode()
    return {"name": path.name, "source": f"data:text/csv;base64,{source}"}


def _size(picture: Path) -> tuple[int, int]:
    """Width and height of a PNG file, from its header [pixels]."""
    start = _bytes(picture)[16:24]
    return int.from_bytes(start[:4]), int.from_bytes(start[4:])


def _bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}") from None
