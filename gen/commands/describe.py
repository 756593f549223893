"""`gen describe`: the roughness of a surface, before any contact."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from gen import options
from gen.maps.settings import Reading
from gen.runtime.command_line import grouped
from gen.runtime.errors import InputError
from gen.runtime.figure import empty_figure
from gen.runtime.files import Output, check_outputs

if TYPE_CHECKING:
    from gen.maps.read import Topography
    from gen.maps.self_affine import SelfAffineFit
    from gen.runtime.documents import Row
    from gen.statistics import Description


@grouped
def describe(
    surface: options.SurfaceFile,
    *,
    reading: Reading,
    facing: options.Against,
    boundary: options.Boundary = "free",
    depth: options.Depth = None,
    table: options.Table = None,
    spectrum: options.SpectrumTable = None,
    picture: options.SurfacePicture = None,
) -> None:
    """Print the 22 roughness statistics, the parameters of ISO 25178 and the self-affine law."""
    from gen import statistics
    from gen.display import surfaces
    from gen.maps.areal import areal_parameters
    from gen.maps.bodies import surface_of
    from gen.maps.doubts import surface_warnings
    from gen.maps.pictures import draw_surface
    from gen.maps.self_affine import fit_self_affine, radial_spectrum
    from gen.runtime.documents import write_csv

    outputs = [Output(table, "--csv"), Output(spectrum, "--spectrum")]
    check_outputs([*outputs, Output(picture, "--plot", "picture")], facing.with_first(surface))
    figure = empty_figure(picture, 10.5, 8.6)
    topography = surface_of(surface, reading, facing.body(reading), boundary)
    warnings = surface_warnings(topography)
    surfaces.print_preparation(topography, warnings)
    description = statistics.describe(topography.heights, topography.spacing)
    surfaces.print_statistics(topography, description)
    areal = areal_parameters(topography, depth)
    surfaces.print_areal(areal)
    radial = radial_spectrum(topography)
    fit = fit_self_affine(topography, radial, areal.values["Str"])
    surfaces.print_self_affine(fit)
    if spectrum is not None and not radial.wavenumbers.size:
        raise InputError(f"--spectrum {spectrum}: there is none, {fit}")
    if table is not None:
        row = _statistics_row(topography, description, warnings)
        further = _areal_row(areal, depth, fit)
        write_csv(table, [{**row, **further, "units": _units_of([*row, *further])}])
    if spectrum is not None:
        write_csv(spectrum, radial.rows())
    if picture is not None:
        draw_surface(figure, topography, radial, fit, picture)


def _statistics_row(
    topography: Topography, description: Description, warnings: Sequence[str]
) -> Row:
    """Return the row of a table of statistics: values, grid, steps of preparation, warnings."""
    from gen.maps.contacts import boundary_cell

    nx, ny = topography.heights.shape
    return {
        **description.values,
        "nodes_x": nx,
        "nodes_y": ny,
        "side_x_um": topography.sides[0],
        "side_y_um": topography.sides[1],
        **boundary_cell(topography),
        "prepared": "; ".join(topography.steps),
        "warnings": "; ".join(warnings),
    }


def _areal_row(areal: Description, depth: float | None, fit: SelfAffineFit | str) -> Row:
    """Return the further cells of a table of statistics: ISO 25178, and the self-affine law."""
    from gen.maps.self_affine import LAW

    row: Row = {**areal.values, **({} if depth is None else {"Smr_depth": depth})}
    if isinstance(fit, str):
        return {**row, **dict.fromkeys(LAW, ""), "law": f"none: {fit}"}
    return {**row, **fit.values, "law": "; ".join(fit.remarks)}


def _units_of(names: Iterable[str]) -> str:
    """Return the units of columns of a table of statistics, as "Sa um; Sk um"."""
    from gen.maps.areal import PARAMETERS
    from gen.maps.self_affine import LAW
    from gen.schema import statistics_columns

    units = {column.name: column.unit for column in statistics_columns()}
    units |= {name: unit for name, unit, _ in PARAMETERS} | LAW | {"Smr_depth": "um"}
    return "; ".join(f"{name} {units[name]}" for name in names if name in units)
