"""The second of two rough bodies, as the options name it."""

import shlex
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from gen import options
from gen.option_groups import Against, Reading
from gen.runtime import command_line
from gen.runtime.command_line import grouped
from gen.runtime.errors import InputError
from gen.runtime.numbers import shown

if TYPE_CHECKING:
    from gen.maps.bodies import Opposite, Source


def second_body(first: "Source", facing: Against) -> "Opposite | None":
    """Return the second body, None if no option names one.

    Parameters
    ----------
    first : Source
        First body, whose options the second one shares unless it has its own.
    facing : Against
        Options of the second body.

    Raises
    ------
    InputError
        If an option of the second body comes without it, or cannot be used.
    """
    from gen.maps.bodies import Opposite, Placement

    path, text, turned, shift = facing
    if path is None:
        given = {"--against-options": text is not None, "--turned": turned, "--shift": shift}
        for option in (name for name, value in given.items() if value):
            raise InputError(f"{option}: needs --against, the second rough body")
        return None
    placement = Placement.parse(turned, shift)
    if text is None:
        return Opposite(replace(first, path=path), placement)
    return Opposite(_source_of(path, text), placement, shared=False)


def _source_of(path: Path, text: str) -> "Source":
    """Return a surface that is read and prepared by the options in a text."""
    from gen.maps.bodies import Source

    named = f"--against-options {shown(text)}"
    alone = typer.Typer(add_completion=False, rich_markup_mode=None)
    alone.command()(grouped(_one_body))
    try:
        arguments = [str(path.absolute()), *shlex.split(text)]
        parser = typer.main.get_command(alone)
        context = parser.make_context("describe", arguments, help_option_names=[])
    except command_line.CommandLineError as error:
        raise InputError(f"{named}: {error.format_message()}") from None
    except ValueError as error:  # a quotation mark that is not closed
        raise InputError(f"{named}: {error}") from None
    return Source.of_options(path, context.params)


def _one_body(surface: options.SurfaceFile, *, reading: Reading) -> None:
    """Take the options of one body, which are parsed and nothing more."""
