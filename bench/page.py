"""The page of all reports, and the contents of one report for a page of the manual.

`part_to_show` reads how a part was made, and its contents. The page is one HTML file that needs no
other file: it holds the pictures and tables. The manual gets the same contents as Markdown.
"""

import base64
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from os.path import relpath
from pathlib import Path
from typing import Any

from bench.answers import FIRST, FURTHER, Line, lines
from bench.contents import Content, Figure, Table, Words, tables_of, tabulated
from bench.files import content_of, markdown
from bench.record import (
    PAGE,
    RESULTS,
    Inputs,
    Record,
    circumstances,
    missing_packages,
    read,
)
from bench.report import PARTS, Part
from gen.runtime.errors import InputError
from gen.runtime.files import write

LONG = 25
"""Largest number of rows of a table that fills a page of the manual; a longer table scrolls."""

LONGEST = 1000
"""Largest number of rows of a table in the manual. The page of all reports has all rows."""

WIDE = 900
"""Width of a picture above which pages of the manual scroll it sideways on a phone [pixels]."""

FIRST_PART = "accuracy"
"""Name of the part whose first picture is at the top of the page."""

FIRST_CAPTION = """
Error of the contact area over the CPU time, ours and that of other solvers, on the same surfaces;
down and to the left is better. Hollow circles are what each solver gives by default.
"""
"""Caption of the picture at the top of the page, before the command that makes it."""


@dataclass(frozen=True)
class PartToShow:
    """A part with its contents, or with the reason why they cannot be shown."""

    part: Part
    record: Record | None  # how the part was made; None without a record
    # The command of the record, without the folder of another run. Empty if there are no contents
    # or no record.
    command: str = ""
    contents: Sequence[Content] = ()  # empty if the part is missing or cannot be shown
    failure: str = ""  # why a part that was made cannot be shown; empty otherwise

    @property
    def is_missing(self) -> bool:
        """Whether the part has neither contents nor a failure, because it was not made."""
        return not self.contents and not self.failure


@dataclass(frozen=True)
class FilledPart:
    """A part for the template of the page, with the content of its files."""

    part: Part
    record: Record | None  # as in `PartToShow`
    command: str  # as in `PartToShow`
    failure: str  # as in `PartToShow`
    # Values of each content by their names in the template, from `_filled_content`.
    contents: list[dict[str, Any]]
    row_failed: list[bool]  # for each row with a verdict: True if the row failed

    @property
    def has_verdicts(self) -> bool:
        """Whether any row of the part's tables has a verdict."""
        return bool(self.row_failed)

    @property
    def failures(self) -> int:
        """The number of rows that failed."""
        return self.row_failed.count(True)


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
        The part. If its files cannot be shown, `failure` has the reason: an exception would keep
        the other parts from the page.

    Raises
    ------
    InputError
        If the record is damaged or cannot be read.
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
        # Without a record the part was not made, so that missing files are no failure.
        failure = str(error) if record is not None else ""
        return PartToShow(part=part, record=record, failure=failure)
    if not contents:  # all files are optional, and none of them exists
        return PartToShow(part=part, record=None)
    if record is None:
        return PartToShow(part=part, record=None, contents=contents)
    missing = missing_packages(part, record)
    if missing:
        without = f"Without {' and '.join(missing)}: not installed where this was made."
        contents = [_with_sentence(content, without) for content in contents]
    command = inputs.portable(part, record.command)
    return PartToShow(part=part, record=record, command=command, contents=contents)


def _with_sentence(content: Content, sentence: str) -> Content:
    """Return a content with a sentence at the end of its caption; words have no caption."""
    if isinstance(content, Words):
        return content
    return replace(content, caption=f"{content.caption} {sentence}".strip())


def _require_readable(content: Content) -> None:
    """Raise InputError if the file of a table or figure cannot be read.

    The text of words is in `content` already.
    """
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
        The page (HTML).
    """
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("bench", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.globals["parts_of_caption"] = parts_of_caption
    return environment.get_template("page.html").render(_page_values(parts, inputs))


def _page_values(parts: Sequence[Part], inputs: Inputs) -> dict[str, Any]:
    """Return the values of the page's template, by their names in it.

    Parts that were not made are only in "missing". "judged" are the parts with verdicts, and
    "failures" is the number of rows that failed in all parts. "picture" is the content at the top
    of the page, None if its part was not made.
    """
    shown = [part_to_show(part, inputs) for part in parts]
    picture = first_picture(shown)
    filled = [_filled(part) for part in shown if not part.is_missing]
    chapters = groupby(filled, key=lambda filled_part: filled_part.part.chapter)
    return {
        "output": inputs.output,
        "circumstances": circumstances(),
        "states": states([part.record for part in filled if part.contents]),
        "judged": [part for part in filled if part.has_verdicts],
        "failures": sum(part.failures for part in filled),
        "picture": _filled_content(picture) if picture else None,
        "first_answers": lines(parts, inputs, FIRST),
        "further_answers": lines(parts, inputs, FURTHER),
        "chapters": {chapter: list(group) for chapter, group in chapters},
        "missing": [missing.part for missing in shown if missing.is_missing],
    }


def first_picture(shown: Sequence[PartToShow]) -> Figure | None:
    """Return the picture at the top of the page, with its short caption.

    Parameters
    ----------
    shown : sequence of PartToShow
        Parts of the page.

    Returns
    -------
    Figure or None
        The first picture of the part `FIRST_PART`; None if the part was not made or has no picture.
    """
    for part in shown:
        if part.part.name != FIRST_PART:
            continue
        for content in part.contents:
            if isinstance(content, Figure):
                caption = f"{FIRST_CAPTION.strip()} By `{part.command}`."
                return replace(content, caption=" ".join(caption.split()), data=())
    return None


def states(records: Sequence[Record | None]) -> str:
    """Say how many parts were made by which state of the code.

    Parameters
    ----------
    records : sequence of Record or None
        The records of the parts; None for a part without a record.

    Returns
    -------
    str
        A sentence with the number of parts and the first ten digits of the hash of each state of
        the code, the most frequent state first; "" if there are no parts.
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
    """Return a part with the content of its files, for the template."""
    contents = [_filled_content(content) for content in shown.contents]
    row_failed: list[bool] = []
    for values in contents:
        if values["kind"] == Table.__name__:
            verdicts = values["table"].failed  # None for a row without a verdict
            row_failed += [failed for failed in verdicts if failed is not None]
    return FilledPart(
        part=shown.part,
        record=shown.record,
        command=shown.command,
        failure=shown.failure,
        contents=contents,
        row_failed=row_failed,
    )


def _filled_content(content: Content) -> dict[str, Any]:
    """Return the values of a content by their names in the template: its fields, and further keys.

    `kind` is the name of its class. `files` is a list of its CSV files, each with `name` and
    `source`. A figure has `size`, its width and height [pixels], and `source`. A table has `table`,
    the `TableToShow`. Each `source` is an address that holds the whole file.
    """
    values = {**vars(content), "kind": type(content).__name__}
    if isinstance(content, Figure):
        values["size"] = picture_size(content.picture)
        values["source"] = _address(content.picture, "image/png")
    elif isinstance(content, Table):
        values["table"] = tabulated(content)
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
"""The published results, which the manual shows. They have no database: the file does not exist."""


def fragment(name: str, folder: Path) -> str:
    """Format the contents of a published report for a page of the manual.

    Parameters
    ----------
    name : str
        Name of the report.
    folder : Path
        Folder of the manual's page, which the links to pictures are relative to.

    Returns
    -------
    str
        Markdown: how the report was made, then its contents, or a sentence that it has not been
        published yet.

    Raises
    ------
    InputError
        If the report was published and cannot be shown.
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


def first_screen(folder: Path) -> str:
    """Format what a reader sees first: one picture, and six answers with their commands.

    Parameters
    ----------
    folder : Path
        Folder of the manual's page, which the link to the picture is relative to.

    Returns
    -------
    str
        Markdown, made of the published results.
    """
    picture = first_picture([part_to_show(part, PUBLISHED) for part in PARTS])
    blocks = []
    if picture is not None:
        blocks.append(
            _figure_block(picture, "Error over time, ours and other solvers'", folder)
        )
    answers = answer_table(lines(PARTS, PUBLISHED, FIRST))
    blocks.append(f":::{{container}} answers\n\n{answers}\n:::")
    return "\n\n".join(blocks)


def answer_table(answers: Sequence[Line]) -> str:
    """Format answers as a table in Markdown.

    Parameters
    ----------
    answers : sequence of Line
        The answers.

    Returns
    -------
    str
        A line for each question, with its answer and its command.
    """
    rows = []
    for line in answers:
        command = f"`{line.command}`" if line.command else ""
        rows.append([line.question, _escaped(line.answer), command])
    return markdown(["asked", "measured", "by"], rows)


def _figure_block(figure: Figure, title: str, folder: Path) -> str:
    """Return a picture with its caption as Markdown, for a page of the manual in a folder."""
    picture = relpath(figure.picture, folder)
    style = ":class: wide\n" if is_wide(figure.picture) else ""
    return (
        f":::{{figure}} {picture}\n:alt: {title}\n{style}\n{_prose(figure.caption)}\n:::"
    )


def is_wide(picture: Path) -> bool:
    """Return whether a PNG file is so wide that a phone cannot show its letters legibly.

    Parameters
    ----------
    picture : Path
        The file.

    Returns
    -------
    bool
        Whether it has more than `WIDE` pixels across.
    """
    return picture_size(picture)[0] > WIDE


def picture_size(picture: Path) -> tuple[int, int]:
    """Return the width and the height of a PNG file [pixels].

    Parameters
    ----------
    picture : Path
        The file.

    Returns
    -------
    tuple of int
        Width and height.
    """
    # Bytes 16 to 24 of a PNG file are its width and its height, four bytes each.
    header = content_of(picture)[16:24]
    return int.from_bytes(header[:4]), int.from_bytes(header[4:])


def _blocks_of(content: Content, part: Part, folder: Path) -> list[str]:
    """Return the paragraphs (Markdown) of one content, for a page of the manual in a folder."""
    if isinstance(content, Figure):
        return [_figure_block(content, part.title, folder)]
    if isinstance(content, Table):
        return [_prose(content.caption), _markdown_table(content)]
    if content.typed:
        return [f"```none\n{content.text}\n```"]
    return [_prose(content.text)]


def _how_made(shown: PartToShow) -> str:
    """Say how a report was made: its command, and the processor, day and commit of its record.

    Without a record it is the command that makes the report.
    """
    record = shown.record
    part = shown.part
    if record is None:
        command = PUBLISHED.portable(part, PUBLISHED.typed(part))
        command = command.replace(str(RESULTS), "report")
        # `PUBLISHED` names a database that does not exist. A user gives one of the paper preset.
        command = command.replace("report/none.h5", "paper.h5")
        return f"Made by `{command}`."
    return (
        f"Made by `{PUBLISHED.portable(part, record.command)}` on {record.machine.processor},"
        f" {record.created[:10]}, commit {record.commit[:7]}."
    )


def _markdown_table(content: Table) -> str:
    """Return a table as Markdown, in a container that scrolls if there are more than `LONG` rows.

    It has the first `LONGEST` rows, and says how many further rows the file has.
    """
    table = tabulated(content)
    titles = [title.text for title in table.titles]
    rows = [[_escaped(cell.text) for cell in row] for row in table.rows[:LONGEST]]
    style = "long" if len(rows) > LONG else "wide"
    right = [title.number for title in table.titles]
    text = f":::{{container}} {style}-table\n\n{markdown(titles, rows, right)}\n:::"
    left_out = len(table.rows) - len(rows)
    if left_out:
        text += f"\n\n{left_out:,} further rows are in `{content.data.name}`."
    return text


def _prose(text: str) -> str:
    """Return a text for a page of the manual: code stays code, other characters are escaped."""
    return "".join(
        f"`{words}`" if is_code else _escaped(words)
        for words, is_code in parts_of_caption(text)
    )


def parts_of_caption(text: str) -> list[tuple[str, bool]]:
    """Split a caption into its parts, and tell which of them are code.

    Parameters
    ----------
    text : str
        Plain text with code between backticks.

    Returns
    -------
    list of (str, bool)
        The parts without backticks, in their order, and whether each is code.
    """
    parts = text.split("`")
    return [(part, place % 2 == 1) for place, part in enumerate(parts) if part]


def _escaped(text: str) -> str:
    """Return a text in which characters with a meaning in Markdown are escaped."""
    return re.sub(r"([\\`*_|<>\[\]$~])", r"\\\1", text)
