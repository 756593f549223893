"""What `gen contact` makes of one map in full, and of several with a row for each map and load."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

from gen.runtime.documents import Row, write_csv
from gen.runtime.errors import InputError
from gen.runtime.figure import figure_for
from gen.runtime.files import atomic
from gen.runtime.terminal import RunProgress, echo

if TYPE_CHECKING:  # each command imports no more than it needs
    from pathlib import Path

    from bem.problem import Boundary
    from gen.maps.bodies import Opposite
    from gen.maps.contacts import AnswerOptions
    from gen.maps.settings import Reading
    from gen.material import Bodies

GIVEN = {
    "delta": "given_delta_um",
    "force": "given_force_uN",
    "pressure": "given_pressure_MPa",
}
"""Column of the load that was asked for, in tables of several maps."""


class ContactFiles(NamedTuple):
    """Files to write, each None if it is not asked for, and the command line for the record."""

    table: Path | None
    json: Path | None
    picture: Path | None
    flattened: Path | None
    command: str


@dataclass(frozen=True, eq=False)
class Pressing:
    """How maps are read and pressed: all alike, each under all loads."""

    reading: Reading
    boundary: Boundary
    body: Opposite | None  # second rough body, the same for all maps
    load: str  # "delta", "force" or "pressure"
    values: Sequence[float]  # of the load [um, uN or MPa]
    wanted: AnswerOptions
    bodies: Bodies
    settings: Mapping[str, Any]  # of the solver

    @property
    def column(self) -> str:
        """Column of the load that was asked for."""
        return GIVEN[self.load]

    def rows(self, file: Path, progress: RunProgress) -> list[Row]:
        """Press one of several maps, and tell its preparation and warnings on standard error.

        Parameters
        ----------
        file : Path
            The map.
        progress : RunProgress
            Counts a row for each load.

        Returns
        -------
        list of Row
            A row for each load that was solved.

        Raises
        ------
        InputError
            If the map cannot be read or no load is solved.
        """
        from gen.commands.printer import tell_preparation
        from gen.doubts import contact_doubts, material_doubts
        from gen.maps import contacts
        from gen.maps.bodies import read_surface

        left = len(self.values)
        warnings = material_doubts(self.bodies)
        rows: list[Row] = []
        try:
            topography, doubts = read_surface(
                file, self.reading, self.boundary, self.body
            )
            warnings += doubts
            solutions = contacts.solve_loads(
                topography, self.load, self.values, **self.settings
            )
            for value, solution in zip(self.values, solutions, strict=True):
                contact = solution.contact
                if contact is None:
                    warnings.append(f"not solved, left out: {solution.fault}")
                else:
                    cells = contacts.answers(contact, self.wanted)
                    rows.append(
                        {
                            self.column: value,
                            **{each.column: each.value for each in cells},
                        }
                    )
                left -= 1
                progress.advance(1, int(contact is None))
        except InputError:
            progress.advance(left, left)
            raise
        pressed = contacts.pressed_contacts(rows)
        warnings += contact_doubts(topography.heights, self.bodies, self.load, pressed)
        tell_preparation(topography, warnings)
        record = {
            "prepared": "; ".join(topography.steps),
            "warnings": "; ".join(warnings),
        }
        return [{**row, **record} for row in rows]

    def summaries(self, rows: Sequence[Row]) -> list[Row]:
        """Return mean and standard deviation over the rows of maps under each load."""
        from gen.maps.several import summary

        made: list[Row] = []
        for value in self.values:
            same = [row for row in rows if row[self.column] == value]
            if same:
                made += [{**row, self.column: value} for row in summary(same)]
        return made


def press_one(pressing: Pressing, surface: Path, files: ContactFiles) -> None:
    """Press one map; print the contact, or a line for each of several loads, and write files."""
    import numpy as np

    from gen.commands import printer
    from gen.doubts import contact_doubts, material_doubts
    from gen.maps import contacts, several
    from gen.maps.bodies import read_surface

    figure = figure_for(files.picture, 11, 8.2)
    bodies, load = pressing.bodies, pressing.load
    topography, doubts = read_surface(
        surface, pressing.reading, pressing.boundary, pressing.body
    )
    solutions = contacts.solve_loads(
        topography, load, pressing.values, **pressing.settings
    )
    number = len(pressing.values)
    solved = contacts.solve_all(solutions, number, pressing.wanted)
    answers = solved.rows
    last = solved.last
    rows: list[Row] = [{each.column: each.value for each in row} for row in answers]
    warnings = [*material_doubts(bodies), *doubts]
    pressed = contacts.pressed_contacts(rows)
    warnings += contact_doubts(topography.heights, bodies, load, pressed)
    warnings += solved.faults
    printer.print_preparation(topography, warnings)
    printer.print_contacts(answers, last, solved.seconds)
    if remark := contacts.border_remark(topography, last, len(answers)):
        echo(f"{topography.name}: {remark}")
    record = {"prepared": "; ".join(topography.steps), "warnings": "; ".join(warnings)}
    if files.table is not None:
        write_csv(files.table, [{**row, **record} for row in rows])
    if files.json is not None:
        named: list[Row] = [{"surface": str(surface), **row, **record} for row in rows]
        several.write_json(files.json, "contacts", named, files.command)
    if files.flattened is not None:
        if solved.faults:
            left_out = "not written, as not every load was solved"
            raise InputError(f"--flattened {files.flattened}: {left_out}")
        with atomic(files.flattened, "heights") as file:
            np.save(file, last.flattened)
    if files.picture is not None:
        from gen.maps.pictures import plot_contacts

        plot_contacts(
            figure,
            last,
            rows,
            files.picture,
            name=topography.name,
            load=load,
            bodies=bodies,
            warnings=warnings,
            options=pressing.wanted,
        )


def press_several(
    pressing: Pressing, inputs: Sequence[Path], files: ContactFiles
) -> None:
    """Print a row for each map and load, then mean and standard deviation, and write them."""
    from gen.commands import printer
    from gen.maps import several

    several.require_one(inputs, {"--plot": files.picture, "--flattened": files.flattened})
    maps = several.files_of(inputs)
    with RunProgress(len(maps) * len(pressing.values), "contacts") as progress:
        found = several.collected(maps, lambda file: pressing.rows(file, progress))
    rows = [*found.rows, *pressing.summaries(found.rows)]
    printer.print_pressed_maps(rows, pressing.column, pressing.bodies)
    if files.table is not None:
        write_csv(files.table, rows)
    if files.json is not None:
        left_out = found.left_out
        several.write_json(files.json, "contacts", rows, files.command, left_out=left_out)
