"""Numbers of the manual, put into its pages when they are built: a Sphinx extension.

A page says `{result} NAME` for a table of `tables`, or `{report} NAME` for everything that a report
of `bench` shows: its command, machine and commit, pictures, and tables; `{first} screen` for the
picture and the answers that the page of reports begins with; `{rooms} PACKAGE` and `{walk} NAME`
for what `house` draws, `{picture} NAME` for a picture of `pictures`, and `{notebook} NAME` for an
executed notebook. The lines between the fences name the files, for readers of the page's source;
those of a picture describe it for readers who do not see it.
"""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import house
import notebooks
import pictures
import tables
from sphinx.application import Sphinx

from bench.page import first_screen, fragment

ROOT = Path(__file__).resolve().parents[2]
BLOCK = re.compile(
    r"^```\{(result|report|first|rooms|walk|picture|notebook)\} (\S+)\n(.*?)^```$",
    flags=re.DOTALL | re.MULTILINE,
)


def result(name: str, listed: list[str], _: Path) -> str:
    """Return a table of the manual."""
    if name in tables.TABLES:
        made_of = [f"bench/results/{source}" for source in tables.TABLES[name].sources]
        if listed != made_of:
            raise ValueError(f"the page lists {listed}, the table is made of {made_of}")
    return tables.markdown_of(name)


def report(name: str, _: list[str], folder: Path) -> str:
    """Return everything that a report shows, as Markdown for a page in a folder."""
    return fragment(name, folder)


def first(_: str, __: list[str], folder: Path) -> str:
    """Return the picture and the answers that the page of reports begins with."""
    return first_screen(folder)


KINDS: dict[str, Callable[[str, list[str], Path], str]] = {
    "result": result,
    "report": report,
    "first": first,
    "rooms": house.rooms,
    "walk": house.walk,
    "picture": pictures.picture,
    "notebook": notebooks.notebook,
}


def fill(app: Sphinx, document: str, source: list[str]) -> None:
    """Put the tables and reports of a page in the place of the blocks that name them."""
    folder = Path(app.env.doc2path(document)).parent

    def filled(block: re.Match[str]) -> str:
        kind, name, listed = block.groups()
        paths = [] if kind == "picture" else listed.split()
        for path in paths:
            if not (ROOT / path).exists():
                raise ValueError(f"{document}: {path} is not there")
            app.env.note_dependency(str(ROOT / path), docname=document)
        return KINDS[kind](name, listed.split(), folder)

    source[0] = BLOCK.sub(filled, source[0])


def setup(app: Sphinx) -> dict[str, Any]:
    """Let Sphinx fill the pages before it reads them."""
    app.connect("source-read", fill)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
