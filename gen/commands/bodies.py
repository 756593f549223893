"""The second of two rough bodies, as the options name it."""

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from gen import options
from gen.maps.settings import Reading
from gen.runtime import command_line
from gen.runtime.command_line import grouped
from gen.runtime.errors import InputError
from gen.runtime.numbers import shown

if TYPE_CHECKING:
    from gen.maps.bodies import Opposite


class Against(NamedTuple):
    """A second rough body that surfaces are pressed against.

    Attributes
    ----------
    against : Path or None
        File of the second body; None for a flat one.
    against_options : str or None
        Options that it alone is read and prepared by; None for those of the first body.
    turned, shift : str
        How it is laid on the first body, see `gen.maps.bodies.Placement`.
    """

    against: Annotated[
        Path | None,
        typer.Option(
            metavar="SURFACE",
            help="A second rough body instead of a plane: a file, read and prepared alike; for gen"
            " law a folder too, each of which every surface is pressed against.",
        ),
    ] = None
    against_options: Annotated[
        str | None,
        typer.Option(
            metavar="OPTIONS",
            help="Read and prepare the second body by these alone, in quotes: '--side 500 --fill'.",
        ),
    ] = None
    turned: Annotated[
        str,
        typer.Option(
            metavar="AXIS",
            help="Axis of the second map that runs backwards as its body is turned over: x, y, or"
            " none for a map seen through its body [x].",
        ),
    ] = ""
    shift: Annotated[
        str,
        typer.Option(metavar="X,Y", help="Centre of the second map, in um from that of the first."),
    ] = ""

    def with_first(self, *surfaces: Path | str) -> list[Path | str]:
        """Return the files of the first body and, if there is one, the second body's."""
        return [*surfaces, *([self.against] if self.against else [])]


def second_body(first: Reading, facing: Against) -> "Opposite | None":
    """Return the second body, None if no option names one.

    Parameters
    ----------
    first : Reading
        How the first body is read, and the second one unless it has options of its own.
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
        return Opposite(path, first, placement)
    return Opposite(path, _own_reading(path, text), placement, shared=False)


def _own_reading(path: Path, text: str) -> Reading:
    """Return how a surface is read and prepared by the options in a text."""
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
    given = {name: value for name, value in context.params.items() if name != "surface"}
    return Reading.of_options(**given)


def _one_body(surface: options.SurfaceFile, *, reading: Reading) -> None:
    """Take the options of one body, which are parsed and nothing more."""
