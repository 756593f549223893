"""One self-contained page: pictures and tables stand in the file itself."""

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bench.circumstances import circumstances
from bench.files import content_of
from bench.page.content import Absent, Content, Figure, Table, Words
from bench.page.inputs import Inputs, typed
from bench.page.part import Part
from bench.page.record import Record, read
from bench.page.table import Row, tabulated
from gen.runtime.errors import InputError
from gen.runtime.output import write

PAGE = "index.html"


@dataclass(frozen=True)
class Shown:
    """A part as the template needs it.

    Attributes
    ----------
    part : Part
        What it is.
    record : Record or None
        How it was made.
    contents : tuple of (str, dict)
        Kinds of its contents, and the values that the template shows of each.
    absent : str
        Why there is nothing; empty where there is something.
    """

    part: Part
    record: Record | None
    contents: tuple[tuple[str, dict[str, Any]], ...] = ()
    absent: str = ""

    @property
    def failures(self) -> int:
        """Number of rows with a failed verdict in its tables."""
        return sum(row.failed for row in self.judged)

    @property
    def judged(self) -> list[Row]:
        """Rows of its tables that have a verdict."""
        tables = (values["lines"] for kind, values in self.contents if kind == "table")
        return [row for table in tables if table.judges for row in table.rows]


def write_page(parts: Sequence[Part], inputs: Inputs) -> Path:
    """Write the page of what a folder holds into that folder; return the file.

    Raises
    ------
    InputError
        If jinja2 is not installed, or the page cannot be written.
    """
    path = inputs.output / PAGE
    write(path, page_of(parts, inputs))
    return path


def page_of(parts: Sequence[Part], inputs: Inputs) -> str:
    """Return the page of what a folder holds.

    Parameters
    ----------
    parts : sequence of Part
        The reports, in the page's order.
    inputs : Inputs
        Where their files are.

    Raises
    ------
    InputError
        If jinja2 is not installed.
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
    return environment.get_template("page.html").render(
        chapters=chapters,
        made=circumstances(),
        judged=sum(len(each.judged) for each in shown),
        failures=sum(each.failures for each in shown),
    )


def _shown(part: Part, inputs: Inputs) -> Shown:
    """What a part holds; what cannot be shown does not keep the others from it."""
    found = read(inputs.making(part).path)
    given = inputs.folder(part) == inputs.comparison and inputs.comparison.is_dir()
    if found is None and not given:
        return Shown(part, None, absent=f"Not here. It is made by: {_how(part, inputs)}")
    if found is not None and not found.finished:
        told = found.told[-1] if found.told else "it said nothing"
        return Shown(part, found, absent=f"{found.command}: code {found.code}, {told}")
    try:
        contents = tuple(_prepared(each) for each in part.show(inputs.folder(part)))
    except (InputError, ModuleNotFoundError) as error:
        return Shown(part, found, absent=str(error))
    if not contents:
        return Shown(part, None, absent=f"{inputs.folder(part)} holds nothing to show")
    return Shown(part, found, contents)


def _how(part: Part, inputs: Inputs) -> str:
    """The command that makes a part."""
    arguments = inputs.arguments(part)
    if arguments:
        return typed(arguments)
    return f"python -m bench run --full --only {part.name} -o {inputs.output}"


def _prepared(content: Content) -> tuple[str, dict[str, Any]]:
    """Kind of a content, and what the template needs to show it."""
    match content:
        case Figure():
            source = base64.b64encode(content_of(content.picture)).decode()
            return "figure", {
                "source": f"data:image/png;base64,{source}",
                "size": _size(content.picture),
                "caption": content.caption,
                "command": content.command,
                "files": [_download(path) for path in content.data],
            }
        case Table():
            return "table", {
                "lines": tabulated(content),
                "caption": content.caption,
                "command": content.command,
                "files": [_download(content.data)],
            }
        case Words():
            return "words", {"text": content.text, "typed": content.typed}
        case Absent():
            return "absent", {"what": content.what, "how": content.how}


def _download(path: Path) -> dict[str, str]:
    """A file as a link that holds it."""
    source = base64.b64encode(content_of(path)).decode()
    return {"name": path.name, "source": f"data:text/csv;base64,{source}"}


def _size(picture: Path) -> tuple[int, int]:
    """Width and height of a PNG file, from its header [pixels]."""
    start = content_of(picture)[16:24]
    return int.from_bytes(start[:4]), int.from_bytes(start[4:])
