"""Every part is made by a command that there is."""

from pathlib import Path
from typing import Any

import typer
from page_parts import inputs

from bench.__main__ import app as bench
from bench.page.inputs import Inputs
from bench.page.parts import PARTS, Part
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
