"""Parts of a page that are made in no time, for the tests of the page."""

import csv
from pathlib import Path

from bench.contents import Content, Words
from bench.record import Inputs, Record, read
from bench.report import Part
from bench.run import Outcome, make

WRITE = "-c open('{folder}/made.txt','a').write('x')"


def written(name: str, rows: list[list[object]], folder: Path) -> Path:
    path = folder / name
    folder.mkdir(parents=True, exist_ok=True)
    with path.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file).writerows(rows)
    return path


def shows_made(folder: Path) -> list[Content]:
    return [Words((folder / "made.txt").read_text())]


def part(name: str, quick: str, full: str = "") -> Part:
    return Part(name, "Chapter", f"Title of {name}", quick, full or quick, shows_made)


def inputs(folder: Path, *, full: bool = False) -> Inputs:
    return Inputs(folder, folder / "paper.h5", folder / "comparison", full)


def record(part: Part, folder: Path) -> Record:
    found = read(inputs(folder).path(part))
    assert found is not None
    return found


def makes(folder: Path, parts: list[Part], *, full: bool = False) -> Outcome:
    return make(parts, inputs(folder, full=full), lambda: None)
