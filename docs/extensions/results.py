"""Numbers of the manual, put into its pages when they are built: a Sphinx extension.

A page says `{result} NAME` for a table of `tables`, or `{report} NAME` for everything that a report
of `bench` shows: its command, machine and commit, pictures, and tables. The lines between the
fences name the files, for readers of the page's source.
"""

import re
from collections.abc import Callable, Iterator
from os.path import relpath
from pathlib import Path
from typing import Any

import tables
from sphinx.application import Sphinx

from bench.page.content import Figure, Table, Words
from bench.page.inputs import Inputs, typed
from bench.page.parts import PARTS, Part
from bench.page.record import read
from bench.page.table import tabulated
from gen.runtime.errors import InputError

ROOT = Path(__file__).resolve().parents[2]
RESULTS = tables.RESULTS
INPUTS = Inputs(RESULTS, RESULTS / "none.h5", RESULTS / "comparison", full=True)
BLOCK = re.compile(r"^```\{(result|report)\} (\S+)\n(.*?)^```$", flags=re.DOTALL | re.MULTILINE)

LONG = 25  # rows from which on a table of a report scrolls instead of filling the page
LONGEST = 1000  # rows of a table that are put into a page at most; the page of all reports has all


def result(name: str, listed: list[str], _: Path) -> str:
    """Return a table of the manual."""
    if name != "columns":
        made_of = [f"bench/results/{source}" for source in tables.TABLES[name].sources]
        if listed != made_of:
            raise ValueError(f"the page lists {listed}, the table is made of {made_of}")
    return tables.markdown_of(name)


def report(name: str, _: list[str], folder: Path) -> str:
    """Return everything that a report shows, as Markdown for a page in a folder."""
    part = next((part for part in PARTS if part.name == name), None)
    if part is None:
        raise KeyError(name)
    blocks = [_made(part)]
    try:
        return "\n\n".join([*blocks, *_shown(part, folder)])
    except InputError:
        if read(INPUTS.making(part).path) is not None:
            raise
        return "\n\n".join([*blocks, "It has not been published yet."])


def _shown(part: Part, folder: Path) -> list[str]:
    """Return the contents of a report."""
    blocks = []
    for content in part.show(INPUTS.folder(part)):
        if isinstance(content, Figure):
            picture = relpath(content.picture, folder)
            blocks.append(f":::{{figure}} {picture}\n:alt: {part.title}\n\n{content.caption}\n:::")
            blocks.extend(_made_by(part, content.command))
        elif isinstance(content, Table):
            blocks += [_plain(content.caption), *_made_by(part, content.command), _rows(content)]
        elif isinstance(content, Words):
            fenced = f"```text\n{content.text}\n```"
            blocks.append(fenced if content.typed else _plain(content.text))
    return blocks


def _made(part: Part) -> str:
    """Return how a report was made: its command, processor, day and commit."""
    found = read(INPUTS.making(part).path)
    if found is None:
        command = typed(INPUTS.arguments(part)).replace(str(RESULTS), "report")
        return f"Made by `{command.replace('report/none.h5', 'paper.h5')}`."
    left = f" The code up to commit {part.retired} has the command." if part.retired else ""
    return (
        f"Made by `{INPUTS.command(part, found.command)}` on {found.machine.processor},"
        f" {found.created[:10]}, commit {found.commit[:7]}.{left}"
    )


def _made_by(part: Part, command: str) -> Iterator[str]:
    """Yield the command of a content, where it has one of its own."""
    if command:
        yield f"Made by `{INPUTS.command(part, command)}`."


def _rows(content: Table) -> str:
    """Return a table; its file can be downloaded, and a long one scrolls."""
    lines = tabulated(content)
    header = [cell.text for cell in lines.titles]
    rows = [[_plain(cell.text) for cell in row] for row in lines.rows[:LONGEST]]
    text = "\n".join(f"| {' | '.join(row)} |" for row in [header, ["---"] * len(header), *rows])
    name = "long" if len(rows) > LONG else "wide"
    more = len(lines.rows) - len(rows)
    left_out = f"\n\n{more:,} further rows are in `{content.data.name}`." if more else ""
    return f":::{{container}} {name}-table\n\n{text}\n:::{left_out}"


def _plain(text: str) -> str:
    """Return a text whose characters Markdown would read as its own are escaped."""
    return re.sub(r"([\\`*_|<>\[\]$~])", r"\\\1", text)


KINDS: dict[str, Callable[[str, list[str], Path], str]] = {"result": result, "report": report}


def fill(app: Sphinx, document: str, source: list[str]) -> None:
    """Put the tables and reports of a page in the place of the blocks that name them."""
    folder = Path(app.env.doc2path(document)).parent

    def filled(found: re.Match[str]) -> str:
        kind, name, listed = found.groups()
        for path in listed.split():
            if not (ROOT / path).exists():
                raise ValueError(f"{document}: {path} is not there")
            app.env.note_dependency(str(ROOT / path), docname=document)
        return KINDS[kind](name, listed.split(), folder)

    source[0] = BLOCK.sub(filled, source[0])


def setup(app: Sphinx) -> dict[str, Any]:
    """Let Sphinx fill the pages before it reads them."""
    app.connect("source-read", fill)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
