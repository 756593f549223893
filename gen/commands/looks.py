"""What `gen describe` makes of one map in full, and of several with a row each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from gen.runtime.documents import Row, write_csv
from gen.runtime.errors import InputError
from gen.runtime.figure import figure_for

if TYPE_CHECKING:  # each command imports no more than it needs
    from pathlib import Path

    from bem.problem import Boundary
    from gen.maps.bodies import Opposite
    from gen.maps.read import Topography
    from gen.maps.settings import Reading
    from gen.maps.texture import RadialSpectrum, SelfAffineFit
    from gen.statistics import Description


class LookFiles(NamedTuple):
    """Files to write, each None if it is not asked for, and the command line for the record."""

    table: Path | None
    json: Path | None
    spectrum: Path | None
    picture: Path | None
    command: str


@dataclass(frozen=True, eq=False)
class Look:
    """A prepared map with its statistics, areal parameters, spectrum and self-affine law."""

    topography: Topography
    warnings: list[str]
    description: Description  # the 22 statistics
    areal: Description  # parameters of ISO 25178
    radial: RadialSpectrum
    fit: SelfAffineFit | str  # or why there is no law
    nodes: float  # in the shortest wave

    @property
    def is_directional(self) -> bool:
        """Whether the map has a lay, so that profiles along x and y differ."""
        from gen.maps.texture import lay_of

        return bool(lay_of(self.topography, self.areal.values["Str"]))


@dataclass(frozen=True, eq=False)
class Looking:
    """How maps are read and described, all alike."""

    reading: Reading
    boundary: Boundary
    body: Opposite | None  # second rough body, the same for all maps
    depth: float | None  # below the highest node, at which Smr is given too [um]

    def at(self, file: Path) -> Look:
        """Read and describe a map; InputError is raised if that cannot be done."""
        from gen import statistics
        from gen.maps import texture
        from gen.maps.bodies import read_surface

        topography, warnings = read_surface(file, self.reading, self.boundary, self.body)
        areal = texture.areal_parameters(topography, self.depth)
        radial = texture.radial_spectrum(topography)
        return Look(
            topography=topography,
            warnings=warnings,
            description=statistics.describe(topography.heights, topography.spacing),
            areal=areal,
            radial=radial,
            fit=texture.fit_self_affine(topography, radial, areal.values["Str"]),
            nodes=texture.nodes_a_wave(radial, topography.spacing),
        )

    def row(self, look: Look) -> Row:
        """Return all numbers of a map as a row of a table, with their units."""
        from gen.maps.texture import LAW

        topography, fit = look.topography, look.fit
        edgeless = (
            {} if topography.boundary == "free" else {"boundary": topography.boundary}
        )
        row: Row = {
            **look.description.values,
            **dict(zip(("nodes_x", "nodes_y"), topography.heights.shape, strict=True)),
            **dict(zip(("side_x_um", "side_y_um"), topography.sides, strict=True)),
            **edgeless,
            "prepared": "; ".join(topography.steps),
            "warnings": "; ".join(look.warnings),
            **look.areal.values,
            **({} if self.depth is None else {"Smr_depth": self.depth}),
            **(dict.fromkeys(LAW, "") if isinstance(fit, str) else fit.values),
            "law": f"none: {fit}" if isinstance(fit, str) else "; ".join(fit.remarks),
            "nodes_a_wave": look.nodes,
        }
        units = units_of_looks()
        row["units"] = "; ".join(f"{name} {units[name]}" for name in row if name in units)
        return row


def units_of_looks() -> dict[str, str]:
    """Return the units of the columns of `Looking.row` by their names."""
    from gen.maps.texture import LAW, PARAMETERS
    from gen.schema import TABLE_1

    units = {column.name: column.unit for column in TABLE_1}
    units |= {name: unit for name, unit, _ in PARAMETERS} | LAW
    return units | {"Smr_depth": "um", "nodes_a_wave": "1"}


def look_at_one(looking: Looking, surface: Path, files: LookFiles) -> None:
    """Print what is known of one map, and write its files."""
    from gen.commands import printer
    from gen.maps import pictures, several, texture

    figure = figure_for(files.picture, 10.5, 8.6)
    look = looking.at(surface)
    printer.print_preparation(look.topography, look.warnings)
    printer.print_statistics(look.topography, look.description, look.areal)
    if look.is_directional:
        printer.print_profiles(texture.profile_roughness(look.topography))
    printer.print_spectrum(look.fit, look.nodes)
    if files.spectrum is not None and not look.radial.wavenumbers.size:
        raise InputError(f"--spectrum {files.spectrum}: there is none, {look.fit}")
    row = looking.row(look)
    if files.table is not None:
        write_csv(files.table, [row])
    if files.json is not None:
        units = units_of_looks()
        named: list[Row] = [{"surface": str(surface), **row}]
        several.write_json(files.json, "descriptions", named, files.command, units=units)
    if files.spectrum is not None:
        write_csv(files.spectrum, look.radial.rows())
    if files.picture is not None:
        pictures.plot_surface(
            figure,
            look.topography,
            look.radial,
            look.fit,
            files.picture,
            directional=look.is_directional,
        )


def look_at_several(looking: Looking, inputs: Sequence[Path], files: LookFiles) -> None:
    """Print a row for each map, then mean and standard deviation, and write them."""
    from gen.commands import printer
    from gen.maps import several

    several.require_one(inputs, {"--spectrum": files.spectrum, "--plot": files.picture})

    def rows_of(file: Path) -> list[Row]:
        look = looking.at(file)
        printer.tell_preparation(look.topography, look.warnings)
        return [looking.row(look)]

    found = several.collected(several.files_of(inputs), rows_of)
    rows = [*found.rows, *several.summary(found.rows)]
    units = units_of_looks()
    printer.print_looks(rows, units)
    if files.table is not None:
        write_csv(files.table, rows)
    if files.json is not None:
        more = {"units": units, "left_out": found.left_out}
        several.write_json(files.json, "descriptions", rows, files.command, **more)
