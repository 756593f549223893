"""The renderer: what a report shows, for the page of all reports and for the manual alike.

`shown` prepares a part once: how it was made and its contents. The page is one self-contained HTML
file, pictures and tables stand in it; the manual takes the same as Markdown.
"""

import base64
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from os.path import relpath
from pathlib import Path
from typing import Any

from bench.answers import lines
from bench.contents import Content, Figure, Table, tables_of, tabulated
from bench.files import content_of, markdown
from bench.record import PAGE, RESULTS, Inputs, Record, circumstances, read
from bench.report import PARTS, Part
from gen.runtime.errors import InputError
from gen.runtime.files import write

LONG = 25  # rows from which on a table of the manual scrolls instead of filling the page
LONGEST = 1000  # rows of a table in the manual at most; the page of all reports has all


@dataclass(frozen=True)
class Shown:
    """A part as it is shown: how it was made, its contents, or why there are none."""

    part: Part
    record: Record | None
    command: str = ""  # that made it, by its record
    contents: Sequence[Content] = ()
    failure: str = ""  # why what was made cannot be shown


def shown(part: Part, inputs: Inputs) -> Shown:
    """Return a part with its contents; a part that cannot be shown does not hide the others."""
    found = read(inputs.path(part))
    if found is not None and not found.finished:
        told = found.told[-1] if found.told else "it said nothing"
        return Shown(part, found, failure=f"{found.command}: code {found.code}, {told}")
    try:
        contents = part.show(inputs.folder(part))
        for each in contents:
            if isinstance(each, Table):
                tabulated(each)
            elif isinstance(each, Figure):
                content_of(each.picture)
    except (InputError, ModuleNotFoundError) as error:
        return Shown(part, found, failure=str(error) if found else "")
    if not contents:
        return Shown(part, None)
    return Shown(
        part, found, inputs.command(part, found.command) if found else "", contents
    )


def write_page(parts: Sequence[Part], inputs: Inputs) -> Path:
    """Write the page of a folder's reports into that folder; return the file."""
    path = inputs.output / PAGE
    write(path, page_of(parts, inputs))
    return path


def page_of(parts: Sequence[Part], inputs: Inputs) -> str:
    """Return the page of a folder's reports."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    present = [part for part in parts if not part.retired or read(inputs.path(part))]
    every = [shown(part, inputs) for part in present]
    there = [_filled(each) for each in every if each.contents or each.failure]
    chapters = groupby(there, key=lambda each: each["part"].chapter)
    said: dict[str, Any] = {
        "chapters": {chapter: list(each) for chapter, each in chapters}
    }
    said["missing"] = [
        each.part for each in every if not each.contents and not each.failure
    ]
    said |= {
        "output": inputs.output,
        "asked": lines(parts, inputs),
        "made": circumstances(),
    }
    of_today = [each for each in there if each["contents"] and not each["part"].retired]
    said["states"] = states([each["record"] for each in of_today])
    said["judged"] = [each for each in there if each["verdicts"]]
    said["failures"] = sum(each["failures"] for each in there)
    environment = Environment(
        loader=PackageLoader("bench", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template("page.html").render(said)


def states(records: Sequence[Record | None]) -> str:
    """Say how many parts are of which state of the code; "" where there is no part."""
    known = (
        record.state[:10] if record and record.state else "an unknown one"
        for record in records
    )
    told = [f"{number} of {state}" for state, number in Counter(known).most_common()]
    return f"Parts by the state of the code: {', '.join(told)}." if told else ""


def _filled(each: Shown) -> dict[str, Any]:
    """Return a part as the template of the page needs it, with all files in it."""
    contents = [_prepared(content) for content in each.contents]
    tables = [values["lines"].failed for values in contents if "lines" in values]
    verdicts = [failed for table in tables for failed in table if failed is not None]
    more = {"contents": contents, "verdicts": verdicts, "failures": sum(verdicts)}
    return {**vars(each), **more}


def _prepared(content: Content) -> dict[str, Any]:
    """Return the kind of a content and its values, with all files in it."""
    values = {**vars(content), "kind": type(content).__name__}
    if isinstance(content, Figure):
        start = content_of(content.picture)[
            16:24
        ]  # width and height in a PNG file's header
        values["size"] = int.from_bytes(start[:4]), int.from_bytes(start[4:])
        values["source"] = _embedded(content.picture, "image/png")
    elif isinstance(content, Table):
        values["lines"] = tabulated(content)
    files = [
        {"name": e.name, "source": _embedded(e, "text/csv")} for e in tables_of(content)
    ]
    return {**values, "files": files}


def _embedded(path: Path, kind: str) -> str:
    """Return an address that holds the file itself."""
    return f"data:{kind};base64,{base64.b64encode(content_of(path)).decode()}"


PUBLISHED = Inputs(RESULTS, RESULTS / "none.h5", RESULTS / "comparison", full=True)
"""The published results, which the manual shows."""


def fragment(name: str, folder: Path) -> str:
    """Return everything that a published report shows, as Markdown for a page in a folder.

    An InputError is raised if it was made and cannot be shown.
    """
    part = {each.name: each for each in PARTS}[name]
    each = shown(part, PUBLISHED)
    if each.failure:
        raise InputError(each.failure)
    blocks = [_made(each)]
    for content in each.contents:
        if isinstance(content, Figure):
            picture = relpath(content.picture, folder)
            blocks.append(
                f":::{{figure}} {picture}\n:alt: {part.title}\n\n{content.caption}\n:::"
            )
        elif isinstance(content, Table):
            blocks += [_plain(content.caption), _rows(content)]
        else:
            fenced = f"```text\n{content.text}\n```"
            blocks.append(fenced if content.typed else _plain(content.text))
    return "\n\n".join(
        blocks if each.contents else [*blocks, "It has not been published yet."]
    )


def _made(each: Shown) -> str:
    """Return how a report was made: its command, processor, day and commit."""
    found, part = each.record, each.part
    if found is None:
        command = PUBLISHED.typed(part).replace(str(RESULTS), "report")
        return f"Made by `{command.replace('report/none.h5', 'paper.h5')}`."
    left = (
        f" The code up to commit {part.retired} has the command." if part.retired else ""
    )
    return (
        f"Made by `{PUBLISHED.command(part, found.command)}` on {found.machine.processor},"
        f" {found.created[:10]}, commit {found.commit[:7]}.{left}"
    )


def _rows(content: Table) -> str:
    """Return a table; its file can be downloaded, and a long one scrolls."""
    table = tabulated(content)
    rows = [[_plain(cell.text) for cell in row] for row in table.rows[:LONGEST]]
    text = markdown([cell.text for cell in table.titles], rows)
    name = "long" if len(rows) > LONG else "wide"
    more = len(table.rows) - len(rows)
    left_out = f"\n\n{more:,} further rows are in `{content.data.name}`." if more else ""
    return f":::{{container}} {name}-table\n\n{text}\n:::{left_out}"


def _plain(text: str) -> str:
    """Return a text whose characters Markdown would read as its own are escaped."""
    return re.sub(r"([\\`*_|<>\[\]$~])", r"\\\1", text)
