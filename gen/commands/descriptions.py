"""The reports of `gen describe`: one map in full, a row for each of several, or joined scans."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from gen.runtime.documents import Row, write_csv
from gen.runtime.errors import InputError
from gen.runtime.figure import figure_for
from gen.runtime.files import Output, check_outputs
from gen.runtime.terminal import echo

if TYPE_CHECKING:  # each command imports no more than it needs
    from pathlib import Path

    from bem.problem import Boundary
    from gen.maps.bodies import Opposite
    from gen.maps.read import Topography
    from gen.maps.settings import Reading
    from gen.maps.texture import RadialSpectrum, SelfAffineFit
    from gen.statistics import Description


@dataclass(frozen=True)
class DescriptionFiles:
    """Files that `gen describe` writes, each None if its option is left out."""

    table: Path | None
    json: Path | None
    spectrum: Path | None
    picture: Path | None
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
                Output(self.spectrum, "--spectrum"),
                Output(self.picture, "--plot", kind="picture"),
            ],
            inputs,
        )


@dataclass(frozen=True, eq=False)
class DescribedMap:
    """A prepared map with its statistics, areal parameters, spectrum and self-affine law."""

    topography: Topography
    warnings: list[str]  # one line for each reason to distrust contacts of the map
    statistics: Description  # the 22 statistics
    areal: Description  # parameters of ISO 25178
    spectrum: RadialSpectrum
    fit: SelfAffineFit | str  # the self-affine law, or the reason why none fits
    nodes_per_wave: float  # nodes in the shortest wave; NaN if there is no wave

    @property
    def roughness(self) -> Roughness:
        """The numbers that are compared with those after other steps of a preparation."""
        from gen.statistics import rms_slope

        heights = self.topography.heights
        return Roughness(
            rms_height=float(heights.std()),
            rms_slope=rms_slope(heights, self.topography.spacing),
            fit=self.fit,
        )

    @property
    def is_directional(self) -> bool:
        """Whether the map has a lay (grooves in one direction), so that its profiles differ."""
        from gen.maps.texture import lay_of

        return bool(lay_of(self.topography, self.areal.values["Str"]))


@dataclass(frozen=True)
class Roughness:
    """The roughness of a map after some steps of a preparation."""

    rms_height: float  # [um]
    rms_slope: float  # [1]
    fit: SelfAffineFit | str  # the self-affine law, or the reason why none fits

    @property
    def decades(self) -> float:
        """Decades of wavelengths over which the self-affine law holds, 0 without a law."""
        if isinstance(self.fit, str):
            return 0.0
        return self.fit.decades

    @property
    def law(self) -> str:
        """The self-affine law in words."""
        if isinstance(self.fit, str):
            return "no self-affine law"
        hurst = self.fit.spectrum.hurst
        return f"a self-affine law over {self.decades:.2g} decades (Hurst {hurst:.2f})"

    def changes_of(self, other: Roughness) -> list[str]:
        """Say which numbers of another roughness differ.

        Parameters
        ----------
        other : Roughness
            Roughness of the same map after other steps.

        Returns
        -------
        list of str
            A few words for each number that differs by more than a few per cent.
        """
        from gen.maps.prepare import is_changed

        changes = []
        if is_changed(self.rms_height, other.rms_height):
            changes.append(
                f"rms height {other.rms_height:.3g} um instead of {self.rms_height:.3g}"
            )
        if is_changed(self.rms_slope, other.rms_slope):
            changes.append(
                f"rms slope {other.rms_slope:.3g} instead of {self.rms_slope:.3g}"
            )
        if is_changed(self.decades, other.decades):
            changes.append(f"{other.law} instead of {self.law}")
        return changes


@dataclass(frozen=True, eq=False)
class DescriptionOrder:
    """Options of a command by which it reads and describes every map."""

    reading: Reading
    boundary: Boundary
    opposite: Opposite | None  # second rough body, the same for all maps
    depth: float | None  # depth below the highest node for a further Smr [um]

    def describe(self, file: Path) -> DescribedMap:
        """Read and describe a map.

        Parameters
        ----------
        file : Path
            File of the map.

        Returns
        -------
        DescribedMap
            The prepared map and its numbers.

        Raises
        ------
        InputError
            If the map cannot be read or prepared.
        """
        from gen import statistics
        from gen.maps import areal, texture
        from gen.maps.bodies import read_surface

        topography, warnings = read_surface(
            file, self.reading, self.boundary, self.opposite
        )
        parameters = areal.areal_parameters(topography, self.depth)
        aspect = parameters.values["Str"]
        spectrum = texture.radial_spectrum(topography)
        return DescribedMap(
            topography=topography,
            warnings=warnings,
            statistics=statistics.describe(topography.heights, topography.spacing),
            areal=parameters,
            spectrum=spectrum,
            fit=texture.fit_self_affine(topography, spectrum, aspect),
            nodes_per_wave=texture.nodes_a_wave(spectrum, topography.spacing),
        )

    def effect_of_needed_steps(self, file: Path, described: DescribedMap) -> str:
        """Say what the steps of `--prepare` would change in the description of a map.

        Parameters
        ----------
        file : Path
            File of the map.
        described : DescribedMap
            The map with the steps that the user has given, from `describe`.

        Returns
        -------
        str
            A sentence with the steps and the numbers that they change; "" if they hardly change
            anything, or there is a second body.

        Raises
        ------
        InputError
            If the map cannot be prepared by these steps.
        """
        from gen.maps.prepare import needed_steps
        from gen.maps.read import read

        if self.opposite is not None:
            return ""
        steps = needed_steps(read(file, self.reading, self.boundary), self.reading)
        if steps == self.reading:
            return ""
        prepared = replace(self, reading=steps).describe(file)
        changes = described.roughness.changes_of(prepared.roughness)
        if not changes:
            return ""
        return f"with --prepare ({steps.options_of_steps}): {', '.join(changes)}"

    def row(self, described: DescribedMap) -> Row:
        """Put all numbers of a map into a row of a table.

        Parameters
        ----------
        described : DescribedMap
            The map, from `describe`.

        Returns
        -------
        Row
            The numbers by the names of their columns, in the units of `units_of_descriptions`. It
            also has texts: the boundary unless it is free, the steps of the preparation
            ("prepared"), the warnings, remarks on the self-affine law ("law"), and the units, such
            as "height_rms um; nodes_a_wave 1".
        """
        topography = described.topography
        nodes_x, nodes_y = topography.heights.shape
        side_x, side_y = topography.sides
        row: Row = {
            **described.statistics.values,
            "nodes_x": nodes_x,
            "nodes_y": nodes_y,
            "side_x_um": side_x,
            "side_y_um": side_y,
        }
        if topography.boundary != "free":
            row["boundary"] = topography.boundary
        row["prepared"] = "; ".join(topography.steps)
        row["warnings"] = "; ".join(described.warnings)
        row |= described.areal.values
        if self.depth is not None:
            row["Smr_depth"] = self.depth
        row |= _cells_of_law(described.fit)
        row["nodes_a_wave"] = described.nodes_per_wave
        units = units_of_descriptions()
        row["units"] = "; ".join(f"{name} {units[name]}" for name in row if name in units)
        return row


def _cells_of_law(fit: SelfAffineFit | str) -> Row:
    """Return the numbers of a self-affine law by name, and its remarks as the text "law".

    Without a law, all numbers are "", and the text gives the reason.
    """
    from gen.maps.texture import LAW_UNITS

    cells: Row = {}
    if isinstance(fit, str):  # the reason why none fits
        cells |= dict.fromkeys(LAW_UNITS, "")
        cells["law"] = f"none: {fit}"
    else:
        cells |= fit.values
        cells["law"] = "; ".join(fit.remarks)
    return cells


def units_of_descriptions() -> dict[str, str]:
    """Return the units of the columns that `DescriptionOrder.row` can have, by the columns' names.

    The columns of the numbers of nodes and of the lengths of sides are left out.
    """
    from gen.maps.areal import PARAMETERS
    from gen.maps.texture import LAW_UNITS
    from gen.schema import TABLE_1

    units = {column.name: column.unit for column in TABLE_1}
    units |= {parameter.name: parameter.unit for parameter in PARAMETERS}
    units |= LAW_UNITS
    units["Smr_depth"] = "um"
    units["nodes_a_wave"] = "1"
    return units


def describe_one(order: DescriptionOrder, surface: Path, files: DescriptionFiles) -> None:
    """Print the description of one map, and write its files.

    Parameters
    ----------
    order : DescriptionOrder
        How the map is read and described.
    surface : Path
        File of the map.
    files : DescriptionFiles
        Files to write.

    Raises
    ------
    InputError
        If the map cannot be described, a file cannot be written, or a file of the spectrum is asked
        for and there is no spectrum.
    """
    from gen.commands import printer
    from gen.maps import pictures, texture

    figure = figure_for(files.picture, width=10.5, height=8.6)
    described = order.describe(surface)
    printer.print_preparation(described.topography, described.warnings)
    printer.print_statistics(described.topography, described.statistics, described.areal)
    if described.is_directional:
        printer.print_profiles(texture.profile_roughness(described.topography))
    printer.print_spectrum(described.fit, described.nodes_per_wave)
    effect = order.effect_of_needed_steps(surface, described)
    if effect:
        echo(effect)
    has_spectrum = described.spectrum.wavenumbers.size > 0
    # Without a spectrum no law is fitted, so that `fit` is the reason.
    if files.spectrum is not None and not has_spectrum:
        raise InputError(f"--spectrum {files.spectrum}: there is none, {described.fit}")
    _write_one(surface, order.row(described), files)
    if files.spectrum is not None:
        write_csv(files.spectrum, described.spectrum.rows())
    if files.picture is not None:
        pictures.plot_surface(
            figure,
            described.topography,
            described.spectrum,
            described.fit,
            files.picture,
            directional=described.is_directional,
        )


def _write_one(surface: Path, row: Row, files: DescriptionFiles) -> None:
    """Write the row of one map as a CSV table and as JSON, if the user wants them.

    In the JSON file, the row also has the path of the map under the key "surface".
    """
    from gen.maps import several

    if files.table is not None:
        write_csv(files.table, [row])
    if files.json is not None:
        several.write_json(
            files.json,
            "descriptions",
            [{"surface": str(surface), **row}],
            files.command,
            units=units_of_descriptions(),
        )


def describe_several(
    order: DescriptionOrder, inputs: Sequence[Path], files: DescriptionFiles
) -> None:
    """Describe several maps, print the main numbers of each in a table, and write all rows.

    The rows of the maps are followed by their mean and standard deviation. The preparation of each
    map and its warnings are printed on standard error.

    Parameters
    ----------
    order : DescriptionOrder
        How the maps are read and described.
    inputs : sequence of Path
        Files and folders of maps.
    files : DescriptionFiles
        Files to write. A spectrum or a picture of several maps is refused.

    Raises
    ------
    InputError
        If no map can be described, a file cannot be written, or a spectrum or a picture is asked
        for.
    """
    from gen.commands import printer
    from gen.maps import several

    several.require_one(inputs, {"--spectrum": files.spectrum, "--plot": files.picture})

    def rows_of(file: Path) -> list[Row]:
        """Describe one map, print its preparation and warnings, and return its row in a list."""
        described = order.describe(file)
        printer.print_preparation_in_line(described.topography, described.warnings)
        return [order.row(described)]

    collected = several.collect_rows(several.files_of(inputs), rows_of)
    rows = [*collected.rows, *several.summary(collected.rows)]
    units = units_of_descriptions()
    printer.print_described_maps(rows, units)
    if files.table is not None:
        write_csv(files.table, rows)
    if files.json is not None:
        several.write_json(
            files.json,
            "descriptions",
            rows,
            files.command,
            units=units,
            left_out=collected.left_out,
        )


def describe_joined(
    order: DescriptionOrder, inputs: Sequence[Path], files: DescriptionFiles
) -> None:
    """Join the spectra of scans of one surface, print their ranges and the law, and write files.

    The preparation of each scan and all warnings are printed on standard error.

    Parameters
    ----------
    order : DescriptionOrder
        How the scans are read and prepared.
    inputs : sequence of Path
        Files and folders of scans.
    files : DescriptionFiles
        Files to write: the spectrum and the picture.

    Raises
    ------
    InputError
        If there are fewer than two scans, a scan cannot be used, or a file cannot be written.
    """
    from gen.commands import printer
    from gen.maps import joining, pictures, several
    from gen.maps.bodies import read_surface

    figure = figure_for(files.picture, width=8.0, height=6.0)
    paths = several.files_of(inputs)
    if len(paths) < 2:
        raise InputError(
            f"--join {' '.join(map(str, paths))}: give two or more scans of one surface"
        )
    topographies = []
    for path in paths:
        topography, warnings = read_surface(path, order.reading, order.boundary)
        printer.print_preparation_in_line(topography, warnings)
        topographies.append(topography)
    joined = joining.join(topographies)
    for warning in joined.warnings:
        echo(f"warning: {warning}", err=True)
    printer.print_joined(joined)
    if files.spectrum is not None:
        write_csv(files.spectrum, joined.rows())
    if files.picture is not None:
        pictures.plot_joined(figure, joined, files.picture)
