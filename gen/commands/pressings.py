"""The reports of `gen contact`: one map in full, or several with a row for each map and load."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from gen.runtime.documents import Row, write_csv
from gen.runtime.errors import InputError
from gen.runtime.figure import figure_for
from gen.runtime.files import Output, atomic, check_outputs
from gen.runtime.terminal import RunProgress, echo

if TYPE_CHECKING:  # each command imports no more than it needs
    from pathlib import Path

    from bem.problem import Boundary
    from gen.maps.answers import Answer, AnswerOptions
    from gen.maps.bodies import Opposite
    from gen.maps.contacts import LoadSolution, SolvedLoads
    from gen.maps.limits import MapLimits
    from gen.maps.read import Topography
    from gen.maps.settings import Reading
    from gen.material import Bodies

COLUMNS_OF_LOADS = {
    "delta": "given_delta_um",
    "force": "given_force_uN",
    "pressure": "given_pressure_MPa",
}
"""Column that has the load in tables of several maps, by the quantity that the user gave."""


@dataclass(frozen=True)
class ContactFiles:
    """Files that `gen contact` writes, each None if its option is left out."""

    table: Path | None
    json: Path | None
    picture: Path | None
    flattened: Path | None  # heights after yielding
    command: str  # the command line, which the JSON file records

    def check(self, inputs: Iterable[Path | str]) -> None:
        """Refuse files that cannot be written, before anything is computed.

        Parameters
        ----------
        inputs : iterable of Path or str
            Files and folders that the command reads, which are not replaced.

        Raises
        ------
        InputError
            If a file cannot be written, or is an input or another output.
        """
        check_outputs(
            [
                Output(self.table, "--csv"),
                Output(self.json, "--json"),
                Output(self.picture, "--plot", kind="picture"),
                Output(self.flattened, "--flattened", kind="heights"),
            ],
            inputs,
        )


@dataclass(frozen=True, eq=False)
class PressingOrder:
    """Options of a command by which it reads and presses every map."""

    reading: Reading
    boundary: Boundary
    opposite: Opposite | None  # second rough body, the same for all maps
    load: str  # quantity of the loads: "delta", "force" or "pressure"
    values: Sequence[float]  # the loads for each map [um, uN or MPa]
    options: AnswerOptions
    bodies: Bodies
    settings: Mapping[str, Any]  # further arguments of `gen.maps.contacts.solve_loads`

    @property
    def column(self) -> str:
        """Name of the column that has the load, such as "given_delta_um"."""
        return COLUMNS_OF_LOADS[self.load]

    def read(self, file: Path) -> tuple[Topography, list[str]]:
        """Read and prepare a map.

        Parameters
        ----------
        file : Path
            File of the map.

        Returns
        -------
        topography : Topography
            The prepared surface, without holes.
        warnings : list of str
            One line for each reason to distrust contacts of the surface.

        Raises
        ------
        InputError
            If the map cannot be read or prepared.
        """
        from gen.maps.bodies import read_surface

        return read_surface(file, self.reading, self.boundary, self.opposite)

    def solutions(self, topography: Topography) -> Iterator[LoadSolution]:
        """Solve a surface under all loads, one after another.

        Parameters
        ----------
        topography : Topography
            The prepared surface.

        Returns
        -------
        iterator of LoadSolution
            The contact under each load of `values`, in their order, or the reason why this load was
            not solved. A load is solved when the iterator is advanced.

        Raises
        ------
        InputError
            When the iterator is advanced: if a number is not allowed, no load can be solved, or
            memory is too short.
        """
        from gen.maps.contacts import solve_loads

        return solve_loads(
            topography,
            self.load,
            self.values,
            errors=self.options.errors,
            **self.settings,
        )

    def limits(self, topography: Topography) -> MapLimits | None:
        """Compute the limits of a map, which belong to errors that are asked for.

        Parameters
        ----------
        topography : Topography
            The prepared surface.

        Returns
        -------
        MapLimits or None
            The limits; None if no error is asked for.
        """
        from gen.maps.limits import limits_of

        if self.options.errors is None:
            return None
        return limits_of(topography)

    def doubts(self, topography: Topography, rows: Sequence[Row]) -> list[str]:
        """Return reasons to doubt the physics of a surface's contacts.

        Parameters
        ----------
        topography : Topography
            The prepared surface.
        rows : sequence of Row
            A row for each contact that was solved, with all its answers by column.

        Returns
        -------
        list of str
            One line for each doubt.
        """
        from gen.doubts import contact_doubts
        from gen.maps.contacts import pressed_contacts

        pressed = pressed_contacts(rows)
        return contact_doubts(topography.heights, self.bodies, self.load, pressed)

    def rows(self, file: Path, progress: RunProgress) -> list[Row]:
        """Press one of several maps, and print its preparation and warnings on standard error.

        Parameters
        ----------
        file : Path
            File of the map.
        progress : RunProgress
            Progress of the command, to which all loads of the map are added. If an InputError is
            raised, the loads that are left are added as failed.

        Returns
        -------
        list of Row
            A row for each load that was solved: the load under the name `column`, the answers, the
            steps of the preparation and the warnings. Steps and warnings are repeated in each row.

        Raises
        ------
        InputError
            If the map cannot be read or no load is solved.
        """
        from gen.commands.printer import print_preparation_in_line
        from gen.doubts import material_doubts

        counted = 0
        rows: list[Row] = []
        faults: list[str] = []
        try:
            topography, warnings = self.read(file)
            limits = self.limits(topography)
            solutions = self.solutions(topography)
            for value, solution in zip(self.values, solutions, strict=True):
                is_solved = solution.contact is not None
                if is_solved:
                    cells = _cells_of_contact(solution.contact, self.options, limits)
                    rows.append({self.column: value, **cells})
                else:
                    faults.append(f"not solved, left out: {solution.fault}")
                counted += 1
                progress.advance(rows=1, failed=0 if is_solved else 1)
        except InputError:
            # The progress counts the loads that this map does not reach as failed.
            remaining = len(self.values) - counted
            progress.advance(rows=remaining, failed=remaining)
            raise
        doubts = self.doubts(topography, rows)
        warnings = [*material_doubts(self.bodies), *warnings, *faults, *doubts]
        print_preparation_in_line(topography, warnings)
        record = _record(topography, warnings)
        return [{**row, **record} for row in rows]

    def summaries(self, rows: Sequence[Row]) -> list[Row]:
        """Compute mean and standard deviation over all maps, separately for each load.

        Parameters
        ----------
        rows : sequence of Row
            Rows of all maps and loads, from `gen.maps.several.collect_rows`.

        Returns
        -------
        list of Row
            Two rows, the mean and the standard deviation, for each load under which a map was
            solved. Both have the load itself in the column `self.column`.
        """
        from gen.maps.several import summary

        summaries: list[Row] = []
        for value in self.values:
            under_load = [row for row in rows if row[self.column] == value]
            if not under_load:
                continue
            for row in summary(under_load):
                row[self.column] = value
                summaries.append(row)
        return summaries


def _cells_of_contact(
    contact: Any, options: AnswerOptions, limits: MapLimits | None
) -> Row:
    """Return the values of the answers about a contact, by the names of their columns."""
    from gen.maps.answers import answers

    return _cells(answers(contact, options, limits))


def _cells(answers: Sequence[Answer]) -> Row:
    """Return the values of answers by the names of their columns."""
    return {answer.column: answer.value for answer in answers}


def _record(topography: Topography, warnings: Sequence[str]) -> Row:
    """Return the cells "prepared", with the steps of the preparation, and "warnings".

    In both, the lines are joined by "; ".
    """
    return {"prepared": "; ".join(topography.steps), "warnings": "; ".join(warnings)}


def press_one(order: PressingOrder, surface: Path, files: ContactFiles) -> None:
    """Press one map, print its contact or a table of several contacts, and write files.

    A load that is not solved is left out of the rows, with a warning.

    Parameters
    ----------
    order : PressingOrder
        How the map is read and pressed.
    surface : Path
        File of the map.
    files : ContactFiles
        Files to write. The picture and the flattened heights show the contact under the last load.

    Raises
    ------
    InputError
        If the map cannot be read, no load is solved, a file cannot be written, or flattened heights
        are asked for and a load was not solved.
    """
    from gen.commands import printer
    from gen.doubts import material_doubts
    from gen.maps import contacts

    figure = figure_for(files.picture, width=11, height=8.2)
    topography, warnings = order.read(surface)
    limits = order.limits(topography)
    solutions = order.solutions(topography)
    solved = contacts.solve_all(solutions, len(order.values), order.options, limits)
    rows = [_cells(answers) for answers in solved.rows]
    warnings = [
        *material_doubts(order.bodies),
        *warnings,
        *order.doubts(topography, rows),
        *solved.faults,
    ]
    printer.print_preparation(topography, warnings)
    printer.print_contacts(solved)
    remark = contacts.border_remark(topography, solved.last, len(rows))
    if remark:
        echo(f"{topography.name}: {remark}")
    # The report of a single contact has a line for the limits.
    if limits is not None and len(rows) > 1:
        echo(f"{topography.name}: limits of the map: {limits.text}")
    record = _record(topography, warnings)
    _write_one(surface, [{**row, **record} for row in rows], files)
    if files.flattened is not None:
        _write_flattened(files.flattened, solved)
    if files.picture is not None:
        from gen.maps.contact_pictures import ContactCaptions, plot_contacts

        captions = ContactCaptions(
            name=topography.name,
            load=order.load,
            bodies=order.bodies,
            warnings=warnings,
            options=order.options,
        )
        plot_contacts(figure, solved.last, rows, files.picture, captions)


def _write_one(surface: Path, rows: Sequence[Row], files: ContactFiles) -> None:
    """Write the rows of one map as a CSV table and as JSON, if the user wants them.

    In the JSON file, every row also has the path of the map under the key "surface".
    """
    from gen.maps import several

    if files.table is not None:
        write_csv(files.table, rows)
    if files.json is not None:
        with_name: list[Row] = [{"surface": str(surface), **row} for row in rows]
        several.write_json(files.json, "contacts", with_name, files.command)


def _write_flattened(path: Path, solved: SolvedLoads) -> None:
    """Write the heights of the surface after the last load [um] as a NumPy file.

    Raises InputError if any load was not solved, because heights after an earlier load could be
    taken for those after the last one.
    """
    import numpy as np

    if solved.faults:
        raise InputError(f"--flattened {path}: not written, as not every load was solved")
    with atomic(path, "heights") as file:
        np.save(file, solved.last.flattened)


def press_several(
    order: PressingOrder, inputs: Sequence[Path], files: ContactFiles
) -> None:
    """Press several maps, print a table for each load, and write the rows of all maps and loads.

    The rows of the maps are followed by their means and standard deviations under each load. The
    preparation of each map, its warnings and the progress are printed on standard error.

    Parameters
    ----------
    order : PressingOrder
        How the maps are read and pressed.
    inputs : sequence of Path
        Files and folders of maps.
    files : ContactFiles
        Files to write. A picture or flattened heights of several maps are refused.

    Raises
    ------
    InputError
        If no map can be pressed, a file cannot be written, or a picture or flattened heights are
        asked for.
    """
    from gen.commands import printer
    from gen.maps import several

    several.require_one(inputs, {"--plot": files.picture, "--flattened": files.flattened})
    maps = several.files_of(inputs)
    number_of_contacts = len(maps) * len(order.values)
    with RunProgress(number_of_contacts, "contacts") as progress:
        collected = several.collect_rows(maps, lambda file: order.rows(file, progress))
    rows = [*collected.rows, *order.summaries(collected.rows)]
    printer.print_pressed_maps(rows, order.column, order.bodies)
    if files.table is not None:
        write_csv(files.table, rows)
    if files.json is not None:
        several.write_json(
            files.json, "contacts", rows, files.command, left_out=collected.left_out
        )
