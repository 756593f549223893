"""Every part is made by a command that there is."""

from pathlib import Path
from typing import Any

import typer
from page_parts import inputs

from bench.__main__ import app as bench
from bench.page.content import files_of
from bench.page.inputs import Inputs
from bench.page.parts import PARTS, Part, contents_of
from learn.cli import app as learn
from tests.faults.__main__ import app as faults


def test_names_of_parts_are_those_of_their_folders() -> None:
    names = [part.name for part in PARTS]
    assert len(names) == len(set(names))
    for each in PARTS:
        assert bool(each.full) != bool(each.retired), each.name
        _assert_a_command(inputs(Path("report")), each)


def _assert_a_command(given: Inputs, each: Part) -> None:
    """Its words are those of a command that there is; options are asked of the command itself."""
    for full in (False, True):
        arguments = inputs(given.output, full=full).arguments(each)
        if not arguments:
            continue
        assert arguments[0] == "-m"
        if arguments[1] == "pytest":
            continue
        program: Any = {"bench": bench, "learn": learn, "tests.faults": faults}[arguments[1]]
        command: Any = typer.main.get_command(program)
        command = getattr(command, "commands", {}).get(arguments[2], command)
        known = {option for parameter in command.params for option in parameter.opts}
        assert {word for word in arguments[3:] if word.startswith("-")} <= known, arguments


def test_curves_of_a_short_run_have_three_points_or_more() -> None:
    """Lists of grids and displacements are what its pictures have on their abscissas."""
    lists = [
        arguments[place + 1].split(",")
        for arguments in (inputs(Path("report")).arguments(each) for each in PARTS)
        for place, word in enumerate(arguments)
        if word in {"--nodes", "--deltas"}
    ]
    assert lists
    assert all(len(values) == 1 or len(values) >= 3 for values in lists)


def test_a_short_run_that_draws_fewer_pictures_is_shown(tmp_path: Path) -> None:
    for name in ("grow.txt", "grow.csv", "quick.png"):
        (tmp_path / name).write_text("made")
    shown = contents_of("grow", tmp_path)
    assert [path.name for each in shown for path in files_of(each)] == [
        *("grow.csv", "quick.png", "grow.csv")
    ]
