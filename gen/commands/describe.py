"""`gen describe`: the roughness of a surface, before any contact."""

from gen import options
from gen.commands.bodies import Against, second_body
from gen.commands.pictures import empty_figure
from gen.maps.settings import Reading
from gen.runtime.command_line import grouped
from gen.runtime.errors import InputError
from gen.runtime.files import Output, check_outputs


@grouped
def describe(
    surface: options.SurfaceFile,
    *,
    reading: Reading,
    facing: Against,
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
    from gen.maps.description import areal_row, draw_surface, statistics_row, units_of
    from gen.maps.doubts import surface_warnings
    from gen.maps.self_affine import fit_self_affine, radial_spectrum
    from gen.runtime.documents import write_csv

    outputs = [Output(table, "--csv"), Output(spectrum, "--spectrum")]
    check_outputs([*outputs, Output(picture, "--plot", "picture")], facing.with_first(surface))
    figure = empty_figure(picture, 10.5, 8.6)
    topography = surface_of(surface, reading, second_body(reading, facing), boundary)
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
        row = statistics_row(topography, description, warnings)
        further = areal_row(areal, depth, fit)
        write_csv(table, [{**row, **further, "units": units_of([*row, *further])}])
    if spectrum is not None:
        write_csv(spectrum, radial.rows())
    if picture is not None:
        draw_surface(figure, topography, radial, fit, picture)
