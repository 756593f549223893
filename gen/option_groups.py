"""Groups of options that several commands share: reading a surface, the files of a law."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import typer

from gen.runtime.errors import InputError
from gen.runtime.files import Output

Units = Literal["mm", "si"]


def sides_of(path: Path) -> list[Path]:
    """Return the names of the files of a band's soft and stiff side, beside the law's own file."""
    return [path.parent / f"{path.stem}-{side}{path.suffix}" for side in ("soft", "stiff")]


class Files(NamedTuple):
    """Files to write a law to, each None if it is not asked for.

    Attributes
    ----------
    table, json, header, calculix, abaqus, picture : Path or None
        Table (CSV), JSON, C header, surface interactions for CalculiX and for Abaqus, picture.
    units : {"mm", "si"}
        System of units of the surface interactions.
    """

    table: Annotated[
        Path | None, typer.Option("--csv", metavar="FILE", help="Write the table.")
    ] = None
    json: Annotated[Path | None, typer.Option(metavar="FILE", help="Write the tables as JSON.")] = (
        None
    )
    header: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Write a C header: monotone cubics and their tangents."),
    ] = None
    calculix: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write CalculiX's surface interaction.")
    ] = None
    abaqus: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write Abaqus' surface interaction.")
    ] = None
    picture: Annotated[
        Path | None,
        typer.Option("--plot", metavar="FILE", help="Draw the law with its band."),
    ] = None
    units: Annotated[
        Units, typer.Option(help="Units for CalculiX and Abaqus: mm (mm, N, s, MPa) or si.")
    ] = "mm"

    @property
    def outputs(self) -> list[Output]:
        """The outputs, for `gen.runtime.files.check_outputs`, with those of a band's sides."""
        models = {"--calculix": self.calculix, "--abaqus": self.abaqus}
        return [
            Output(self.table, "--csv"),
            Output(self.json, "--json"),
            Output(self.header, "--header"),
            *(Output(path, option) for option, path in models.items()),
            *(
                Output(side, option)
                for option, path in models.items()
                if path
                for side in sides_of(path)
            ),
            Output(self.picture, "--plot", "picture"),
        ]

    def filled(self, stem: Path | None) -> Files:
        """Return the files, with missing names made from a stem, but no picture.

        Raises
        ------
        InputError
            If the stem is empty or a folder's `.` or `..`.
        """
        if stem is None:
            return self
        if stem.name in {"", ".."}:
            raise InputError(
                f"--output {stem}: give what the names of the files begin with, as law"
            )
        place, name = stem.parent, stem.name
        return self._replace(
            table=self.table or place / f"{name}.csv",
            json=self.json or place / f"{name}.json",
            header=self.header or place / f"{name}.h",
            calculix=self.calculix or place / f"{name}-calculix.inp",
            abaqus=self.abaqus or place / f"{name}-abaqus.inp",
        )

    def empty_figure(self) -> Any:
        """Return the figure to draw into, or None; refuse a picture that cannot be drawn.

        Raises
        ------
        InputError
            If the suffix is of no picture, or matplotlib is missing.
        """
        if self.picture is None:
            return None
        from gen.runtime.figure import new_figure, require_picture_name

        require_picture_name(self.picture)
        return new_figure(12.0, 7.0, dpi=110)
