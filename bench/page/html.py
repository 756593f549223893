"""One self-contained page: pictures and tables stand in the file itself."""

import base64
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Any

from bench.circumstances import circumstances
from bench.files import content_of
from bench.page.content import Absent, Content, Figure, Table, tables_of
from bench.page.goals import lines
from bench.page.inputs import Inputs
from bench.page.parts import Part
from bench.page.record import Record, read
from bench.page.table import tabulated
from bench.template import rendered
from gen.runtime.errors import InputError
from gen.runtime.files import write

PAGE = "index.html"


@dataclass(frozen=True)
class Shown:
    """A part as the template needs it: how it was made, its contents, or why there are none."""

    part: Part
    record: Record | None
    command: str = ""  # that made it, by its record
    contents: Sequence[dict[str, Any]] = ()
    failure: str = ""  # why what was made cannot be shown

    @property
    def missing(self) -> bool:
        """Whether there is nothing to show and nothing failed."""
        return not self.contents and not self.failure

    @property
    def verdicts(self) -> list[bool]:
        """Of each judged row in its tables, whether it failed."""
        tables = [values["lines"].failed for values in self.contents if "lines" in values]
        return [failed for table in tables for failed in table if failed is not None]

    @property
    def failures(self) -> int:
        """Number of rows with a failed verdict."""
        return sum(self.verdicts)


def write_page(parts: Sequence[Part], inputs: Inputs) -> Path:
    """Write the page of a folder's reports into that folder; return the file."""
    path = inputs.output / PAGE
    write(path, page_of(parts, inputs))
    return path


def page_of(parts: Sequence[Part], inputs: Inputs) -> str:
    """Return the page of a folder's reports."""
    present = [part for part in parts if not part.retired or read(inputs.making(part).path)]
    shown = [_shown(part, inputs) for part in present]
    there = [each for each in shown if not each.missing]
    chapters = groupby(there, key=lambda each: each.part.chapter)
    said: dict[str, Any] = {"chapters": {chapter: list(each) for chapter, each in chapters}}
    said["missing"] = [each.part for each in shown if each.missing]
    said |= {"output": inputs.output, "asked": lines(parts, inputs)}
    said["states"] = states(
        [each.record for each in there if each.contents and not each.part.retired]
    )
    said |= {"made": circumstances(), "judged": [each for each in there if each.verdicts]}
    said |= {"failures": sum(each.failures for each in there)}
    return rendered("page/page.html", said, markup=True)


def states(records: Sequence[Record | None]) -> str:
    """Say in one line whether all parts are of one state of the code, or which are of another.

    None stands for a part without a record; nothing is said where there is no part.
    """
    found = Counter(record.state if record else "" for record in records)
    known = [(state, number) for state, number in found.most_common() if state]
    unknown = f"{found['']} of an unknown one" if found[""] else ""
    if not known:
        return "The state of the code is unknown of all parts." if records else ""
    (state, number), *others = known
    if number == len(records):
        return f"All parts are of one state of the code, {state[:10]}."
    told = [f"{number} of the state {state[:10]}" for state, number in others]
    return (
        f"{number} of {len(records)} parts are of the state {state[:10]} of the code,"
        f" {', '.join([*told, unknown] if unknown else told)}."
    )


def _shown(part: Part, inputs: Inputs) -> Shown:
    """Return a part with its contents; a part that cannot be shown does not hide the others."""
    found = read(inputs.making(part).path)
    if found is not None and not found.finished:
        told = found.told[-1] if found.told else "it said nothing"
        return Shown(part, found, failure=f"{found.command}: code {found.code}, {told}")
    try:
        contents = [_prepared(each, part, inputs) for each in part.show(inputs.folder(part))]
    except (InputError, ModuleNotFoundError) as error:
        return Shown(part, found, failure=str(error) if found else "")
    if all(each["kind"] == Absent.__name__ for each in contents):
        return Shown(part, None)
    command = inputs.command(part, found.command) if found else ""
    return Shown(part, found, command, contents)


def _prepared(content: Content, part: Part, inputs: Inputs) -> dict[str, Any]:
    """Return the kind of a content and its values, with all files in it."""
    values = {**vars(content), "kind": type(content).__name__}
    if isinstance(content, Figure | Table):
        values["command"] = inputs.command(part, content.command)
    if isinstance(content, Figure):
        start = content_of(content.picture)[16:24]  # width and height in a PNG file's header
        values["size"] = int.from_bytes(start[:4]), int.from_bytes(start[4:])
        values["source"] = _embedded(content.picture, "image/png")
    elif isinstance(content, Table):
        values["lines"] = tabulated(content)
    files = [{"name": e.name, "source": _embedded(e, "text/csv")} for e in tables_of(content)]
    return {**values, "files": files}


def _embedded(path: Path, kind: str) -> str:
    """Return an address that holds the file itself."""
    return f"data:{kind};base64,{base64.b64encode(content_of(path)).decode()}"
