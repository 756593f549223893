"""The manual's walk from the paper's tables and figures to the code names what there is."""

import re
from pathlib import Path
from pkgutil import resolve_name

import pytest
import typer

from bench.commands import app as bench
from bench.report import part_of
from learn.cli import app as learn

PAGE = Path(__file__).resolve().parents[3] / "docs" / "results" / "models.md"
WALK = PAGE.read_text(encoding="utf-8").split("## From the paper's")[1].split("\n## ")[0]
"""The section with the walk."""

ROWS = [
    [cell.strip() for cell in line.strip("|").split(" | ")]
    for line in WALK.splitlines()
    if line.startswith("| ") and "made by" not in line
]


def quoted(cell: str) -> list[str]:
    return re.findall(r"`([^`]+)`", cell)


def test_every_function_that_the_walk_names_exists():
    names = re.findall(r"`((?:bem|gen|learn|bench)\.[\w.]+)`", WALK)
    assert len(names) > len(ROWS)
    assert all(quoted(functions) for *_, functions in ROWS)
    for name in names:
        assert resolve_name(name) is not None


@pytest.mark.parametrize(("program", "app"), [("bench", bench), ("learn", learn)])
def test_every_command_that_the_walk_names_exists(program, app):
    command = typer.main.get_command(app)
    named = {word for _, commands, *_ in ROWS for word in quoted(commands)}
    used = {word.split()[1] for word in named if word.startswith(f"{program} ")}
    assert used
    assert used <= set(getattr(command, "commands", {}))


def test_the_walk_has_every_table_and_every_picture_of_the_paper():
    places = " ".join(place for place, *_ in ROWS)
    assert all(f"Table {number}" in places for number in range(1, 6))
    files = " ".join(files for _, _, files, _ in ROWS)
    shown = part_of("paper").contents
    stems = {Path(entry.get("figure", entry.get("table"))).stem for entry in shown}
    assert {stem for stem in stems if stem not in files} == set()
