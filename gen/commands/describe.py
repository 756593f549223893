"""`gen describe`: the roughness of a surface, before any contact."""

from pathlib import Path
from typing import Any

from gen import options
from gen.commands.bodies import second_body
from gen.commands.pictures import empty_figure
from gen.option_groups import Against, Reading
from gen.runtime.option_groups import grouped
from gen.runtime.output import Output, check_outputs


@grouped
def describe(
    surface: options.SurfaceFile,
    *,
    reading: Reading,
    facing: Against,
    boundary: options.Boundary = "free",
    table: options.Table = None,
    picture: options.SurfacePicture = None,
) -> None:
    """Print the 22 roughness statistics and the parameters of ISO 25178 with their units."""
    from gen.display import surfaces
    from gen.measured import single
    from gen.measured.areal import areal_parameters
    from gen.measured.preparation import surface_warnings
    from gen.measured.source import Source, surface_of
    from gen.runtime.table import write_csv

    outputs = [Output(table, "--csv"), Output(picture, "--plot", "picture")]
    check_outputs(outputs, facing.with_first(surface))
    figure = empty_figure(picture, 10.5, 8.6)
    source = Source.of_options(surface, reading._asdict())
    topography = surface_of(source, second_body(source, facing), boundary)
    warnings = surface_warnings(topography)
    surfaces.print_preparation(topography, warnings)
    description = single.describe(topography)
    surfaces.print_statistics(topography, description)
    areal = areal_parameters(topography)
    surfaces.print_areal(areal)
    if table is not None:
        row = single.statistics_row(topography, description, warnings)
        write_csv(table, [{**row, **areal.values}])
    if picture is not None:
        _draw_description(figure, topography, areal.values["Str"], picture)


def _draw_description(figure: Any, topography: Any, aspect: float, picture: Path) -> None:
    """Fit the self-affine law to a surface, print it, and draw both."""
    from gen.display import surfaces
    from gen.measured.self_affine import fit_self_affine, radial_spectrum
    from gen.measured.surface_picture import draw_surface

    spectrum = radial_spectrum(topography)
    fit = fit_self_affine(topography, spectrum, aspect)
    surfaces.print_self_affine(fit)
    draw_surface(figure, topography, spectrum, fit, picture)
