"""`gen scene`: draft a scene from measured maps."""

import typer

from gen import options
from gen.maps.settings import FileReading, Reading
from gen.runtime.command_line import grouped, typed


@grouped
def scene(
    context: typer.Context,
    inputs: options.Maps = None,
    *,
    output: options.NewScene,
    like: options.Like = None,
    young: options.Young = None,
    poisson: options.Poisson = None,
    e_star: options.EStar = None,
    hardness: options.Hardness = None,
    reading: FileReading,
) -> None:
    """Look at measured maps and write a scene of their windows, or of surfaces like one map.

    Comments in the scene say why it has its values. It runs as it is, and is meant to be edited.
    """
    from gen.draft import draft
    from gen.draft.proposal import Material

    material = Material.of_options(young or [], poisson or [], e_star, hardness)
    how = Reading.of_options(**vars(reading))
    draft(inputs or [], like, output, how, material, typed(context, "gen"))
