"""The page of all reports, and the contents of one report for a page of the manual.

`part_to_show` reads how a part was made, and its contents. The page is one HTML file that needs no
other file: it holds the pictures and tables. The manual gets the same contents as Markdown.
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

LONG = 25
"""Largest number of rows of a table that fills a page of the manual; a longer table scrolls."""

LONGEST = 1000
"""Largest number of rows of a table in the manual. The page of all reports has all rows."""


@dataclass(frozen=True)
class PartToShow:
    """A part with its contents, or with the reason why they cannot be shown."""

    part: Part
    record: Record | None  # how the part was made; None if no record says it
    command: str = ""  # the command of the record; empty without a record
    contents: Sequence[Content] = ()  # empty if nothing was made or can be shown
    failure: str = ""  # why an existing part cannot be shown; empty otherwise

    @property
    def is_missing(self) -> bool:
        """Whether the part was not made, so that there is nothing to show or to report."""
        return not self.contents and not self.failure


@dataclass(frozen=True)
class FilledPart:
    """A part for the template of the page, which holds the files of its contents."""

    part: Part
    record: Record | None
    command: str
    failure: str
    contents: list[
        dict[str, Any]
    ]  # fields of the contents, as `_filled_content` returns them
    verdicts: list[bool]  # of all rows with a verdict: True if the row failed

    @property
    def failures(self) -> int:
        """The number of rows that failed."""
        return self.verdicts.count(True)


def part_to_show(part: Part, inputs: Inputs) -> PartToShow:
    """Read how a part was made, and its contents.

    Parameters
    ----------
    part : Part
        The part.
    inputs : Inputs
        The folders of the run.

    Returns
    -------
    PartToShow
        The part. If its files cannot be shown, the reason is its `failure`, so that one part does
        not hide the others.
    """
    record = read(inputs.path(part))
    if record is not None and not record.finished:
        last_line = "it said nothing"
        if record.told:
            last_line = record.told[-1]
        failure = f"{record.command}: code {record.code}, {last_line}"
        return PartToShow(part=part, record=record, failure=failure)
    try:
        contents = part.show(inputs.folder(part))
        for content in contents:
            _require_readable(content)
    except (InputError, ModuleNotFoundError) as error:
        # Without a record the part was simply not made: its missing files are no failure.
        failure = str(error) if record is not None else ""
        return PartToShow(part=part, record=record, failure=failure)
    if not contents:
        return PartToShow(part=part, record=None)
    command = ""
    if record is not None:
        command = inputs.portable(part, record.command)
    return PartToShow(part=part, record=record, command=command, contents=contents)


def _require_readable(content: Content) -> None:
    """Raise InputError if the file of a table or figure cannot be read."""
    if isinstance(content, Table):
        tabulated(content)
    elif isinstance(content, Figure):
        content_of(content.picture)


def write_page(parts: Sequence[Part], inputs: Inputs) -> Path:
    """Write the page of all reports into the folder of a run.

    Parameters
    ----------
    parts : sequence of Part
        The parts, in the order of the page.
    inputs : Inputs
        The folders of the run.

    Returns
    -------
    Path
        The written file, `index.html` in the folder of the run.
    """
    path = inputs.output / PAGE
    write(path, page_of(parts, inputs))
    return path


def page_of(parts: Sequence[Part], inputs: Inputs) -> str:
    """Fill the template of the page.

    Parameters
    ----------
    parts : sequence of Part
        The parts, in the order of the page.
    inputs : Inputs
        The folders of the run.

    Returns
    -------
    str
        The page (HTML). Retired parts are on it only if they have a record.
    """
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("bench", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template("page.html").render(_page_values(parts, inputs))


def _page_values(parts: Sequence[Part], inputs: Inputs) -> dict[str, Any]:
    """Return the values of the template by their names in it."""
    shown = [part_to_show(part, inputs) for part in _present(parts, inputs)]
    filled = [_filled(part) for part in shown if not part.is_missing]
    chapters = groupby(filled, key=lambda filled_part: filled_part.part.chapter)
    return {
        "output": inputs.output,
        "circumstances": circumstances(),
        "states": states(_records_of_todays_parts(filled)),
        "judged": [part for part in filled if part.verdicts],
        "failures": sum(part.failures for part in filled),
        "answers": lines(parts, inputs),
        "chapters": {chapter: list(group) for chapter, group in chapters},
        "missing": [missing.part for missing in shown if missing.is_missing],
    }


def _present(parts: Sequence[Part], inputs: Inputs) -> list[Part]:
    """Return the parts without the retired ones that have no record."""
    return [part for part in parts if not part.retired or read(inputs.path(part))]


def _records_of_todays_parts(filled: list[FilledPart]) -> list[Record | None]:
    """Return the records of the parts with contents that the code of today can make."""
    return [part.record for part in filled if part.contents and not part.part.retired]


def states(records: Sequence[Record | None]) -> str:
    """Say how many parts were made by which state of the code.

    Parameters
    ----------
    records : sequence of Record or None
        The records of the parts; None for a part without a record.

    Returns
    -------
    str
        A sentence with the first ten digits of each state's hash, or "" without any part.
    """
    if not records:
        return ""
    names = [
        record.state[:10] if record and record.state else "an unknown one"
        for record in records
    ]
    counts = [f"{number} of {name}" for name, number in Counter(names).most_common()]
    return f"Parts by the state of the code: {', '.join(counts)}."


def _filled(shown: PartToShow) -> FilledPart:
    """Read the files of a part into it."""
    contents = [_filled_content(content) for content in shown.contents]
    verdicts: list[bool] = []
    for values in contents:
        if "lines" in values:
            verdicts += [row for row in values["lines"].failed if row is not None]
    return FilledPart(
        part=shown.part,
        record=shown.record,
        command=shown.command,
        failure=shown.failure,
        contents=contents,
        verdicts=verdicts,
    )


def _filled_content(content: Content) -> dict[str, Any]:
    """Return the fields of a content for the template, with its files.

    Further keys are `kind`, the name of the class; `files`, name and address of its tables; for a
    figure `size`, width and height [pixels], and `source`, its address; for a table `lines`, the
    formatted table. Addresses hold the whole file.
    """
    values = {**vars(content), "kind": type(content).__name__}
    if isinstance(content, Figure):
        # A PNG file has its width and height in bytes 16 to 24, four bytes for each.
        header = content_of(content.picture)[16:24]
        values["size"] = (int.from_bytes(header[:4]), int.from_bytes(header[4:]))
        values["source"] = _address(content.picture, "image/png")
    elif isinstance(content, Table):
        values["lines"] = tabulated(content)
    values["files"] = [
        {"name": path.name, "source": _address(path, "text/csv")}
        for path in tables_of(content)
    ]
    return values


def _address(path: Path, media_type: str) -> str:
    """Return a `data:` address that holds the content of a file."""
    content = base64.b64encode(content_of(path)).decode()
    return f"data:{media_type};base64,{content}"


PUBLISHED = Inputs(
    output=RESULTS,
    database=RESULTS / "none.h5",
    comparison=RESULTS / "comparison",
    full=True,
)
"""The published results, which the manual shows. They have no database."""


def fragment(name: str, folder: Path) -> str:
    """Format the contents of a published report for a page of the manual.

    Parameters
    ----------
    name : str
        Name of the report.
    folder : Path
        Folder of the page, which pictures are linked from.

    Returns
    -------
    str
        Markdown. It says so if the report has not been published yet.

    Raises
    ------
    InputError
        If the report was made and cannot be shown.
    """
    part = {part.name: part for part in PARTS}[name]
    shown = part_to_show(part, PUBLISHED)
    if shown.failure:
        raise InputError(shown.failure)
    blocks = [_how_made(shown)]
    for content in shown.contents:
        blocks += _blocks_of(content, part, folder)
    if not shown.contents:
        blocks.append("It has not been published yet.")
    return "\n\n".join(blocks)


def _blocks_of(content: Content, part: Part, folder: Path) -> list[str]:
    """Return the paragraphs (Markdown) of one content, for a page in a folder."""
    if isinstance(content, Figure):
        picture = relpath(content.picture, folder)
        caption = f":alt: {part.title}\n\n{content.caption}"
        return [f":::{{figure}} {picture}\n{caption}\n:::"]
    if isinstance(content, Table):
        return [_escaped(content.caption), _markdown_table(content)]
    if content.typed:
        return [f"```text\n{content.text}\n```"]
    return [_escaped(content.text)]


def _how_made(shown: PartToShow) -> str:
    """Say how a report was made: its command, and the processor, day and commit of its record."""
    record = shown.record
    part = shown.part
    if record is None:
        command = PUBLISHED.typed(part).replace(str(RESULTS), "report")
        return f"Made by `{command.replace('report/none.h5', 'paper.h5')}`."
    retired = ""
    if part.retired:
        retired = f" The code up to commit {part.retired} has the command."
    return (
        f"Made by `{PUBLISHED.portable(part, record.command)}` on {record.machine.processor},"
        f" {record.created[:10]}, commit {record.commit[:7]}.{retired}"
    )


def _markdown_table(content: Table) -> str:
    """Return a table as Markdown, which scrolls if it is long.

    It has the first `LONGEST` rows, and says how many rows the file has in addition.
    """
    table = tabulated(content)
    titles = [title.text for title in table.titles]
    rows = [[_escaped(cell.text) for cell in row] for row in table.rows[:LONGEST]]
    style = "long" if len(rows) > LONG else "wide"
    text = f":::{{container}} {style}-table\n\n{markdown(titles, rows)}\n:::"
    left_out = len(table.rows) - len(rows)
    if left_out:
        text += f"\n\n{left_out:,} further rows are in `{content.data.name}`."
    return text


def _escaped(text: str) -> str:
    """Return a text in which characters with a meaning in Markdown are escaped."""
    return re.sub(r"([\\`*_|<>\[\]$~])", r"\\\1", text)
