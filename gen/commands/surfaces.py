"""Commands about surfaces and maps: `gen describe contact law scene`."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import typer

from gen import options
from gen.maps.settings import Reading, SceneReading
from gen.material import Bodies, Friction, Gas, Layer, require_within, shear_shares
from gen.runtime.command_line import Trust, grouped, recorded_command_line
from gen.runtime.errors import InputError
from gen.runtime.figure import figure_for
from gen.runtime.terminal import echo

if TYPE_CHECKING:  # each command imports no more than it needs
    from gen.law import Law, Order


@grouped
def describe(
    context: typer.Context,
    surfaces: options.SurfaceFiles,
    *,
    reading: Reading,
    facing: options.Against,
    boundary: options.Boundary = "free",
    depth: options.Depth = None,
    join: options.Join = False,
    table: options.Table = None,
    json: options.Json = None,
    spectrum: options.SpectrumTable = None,
    picture: options.SurfacePicture = None,
) -> None:
    """Print the 22 roughness statistics, the parameters of ISO 25178 and the self-affine law.

    For several files or folders a row is printed for each map, then the mean and the standard
    deviation. A map that cannot be read is named and left out.

    With --join several scans of one surface at different magnifications give one spectrum: the
    waves that each scan knows are printed, and the self-affine law of all.
    """
    from gen.commands.descriptions import (
        DescriptionFiles,
        DescriptionOrder,
        describe_joined,
        describe_one,
        describe_several,
    )
    from gen.maps import several

    files = DescriptionFiles(
        table=table,
        json=json,
        spectrum=spectrum,
        picture=picture,
        command=recorded_command_line(context, "gen"),
    )
    files.check(_input_files(surfaces, facing))
    order = DescriptionOrder(
        reading=reading,
        boundary=boundary,
        opposite=facing.second_body(reading),
        depth=depth,
    )
    if join:
        options.refuse(context, options.NOT_WITH_JOIN, "--join")
        describe_joined(order, surfaces, files)
    elif several.are_several(surfaces):
        describe_several(order, surfaces, files)
    else:
        describe_one(order, surfaces[0], files)


def _input_files(
    surfaces: Iterable[Path | str], facing: options.Against
) -> list[Path | str]:
    """Return the files that a command reads: its surfaces, and the second rough body if any."""
    files = list(surfaces)
    if facing.against is not None:
        files.append(facing.against)
    return files


@grouped
def contact(
    context: typer.Context,
    surfaces: options.SurfaceFiles,
    *,
    delta: options.Delta = "",
    force: options.NormalForce = "",
    pressure: options.Pressure = "",
    material: options.Material,
    layer: options.Layer,
    reading: Reading,
    facing: options.Against,
    boundary: options.Boundary = "free",
    kernel: options.Kernel = "uniform-pressure",
    far_field: options.FarField = "rigid",
    rtol: options.Tolerance = 2e-7,
    max_iterations: options.MaxIterations = 1000,
    accuracy: options.Accuracy,
    spots: options.Spots = False,
    flow: options.Flow = False,
    stiffness: options.Stiffness = False,
    conductivity: options.Conductivity = None,
    shear: options.Shear,
    shares: options.SlipShares = "",
    threads: options.Threads = None,
    table: options.Table = None,
    json: options.Json = None,
    picture: options.Picture = None,
    flattened: options.Flattened = None,
) -> None:
    """Solve contact problems of one surface: area, force, pressure, gap, yielding, residual.

    The contact area is printed twice: as a share of the nodes, and in the continuum, with the error
    of the grid. The options --spots, --flow, --stiffness and --conductivity add the spots of
    contact, the flow of a fluid through the gap, the stiffness and the conductance.

    With --layer-thickness the first elastic body has a layer; --young and --poisson are those of
    what it lies on.

    With --friction two like bodies are sheared: their stiffness before slip along x and y, and with
    --shear the shift, the area that sticks, and the energy that a cycle loses.

    With --error each contact is solved on fewer nodes, as many as the error needs. Names of answers
    are area, mean_gap, stiffness, delta and force.

    Give one of --delta, --force and --pressure: a number, several numbers with commas, or a series
    as start:stop:count. The numbers of start:stop:count:log have a constant ratio.

    For several files or folders a row is printed for each map and load, then the mean and the
    standard deviation. A map that cannot be read or solved is named and left out.
    """
    from bem.threads import cores, default_threads, on_threads
    from gen.commands.pressings import (
        ContactFiles,
        PressingOrder,
        press_one,
        press_several,
    )
    from gen.maps import contacts, several
    from gen.maps.answers import AnswerOptions

    load = contacts.chosen_load({"delta": delta, "force": force, "pressure": pressure})
    _require_flattened_heights(flattened, material)
    bodies = _bodies(context, material, layer)
    conductivities = _conductivities(conductivity)
    friction = shear.friction_of(material)
    slip_shares = _slip_shares(shares, friction)
    _refuse_other_bodies(friction, kernel, far_field)
    settings: dict[str, Any] = {"max_iterations": max_iterations}
    errors = accuracy.errors(context)
    if errors is not None:
        # The stiffness is printed if its error is asked for.
        stiffness = stiffness or "stiffness" in errors
    else:
        # With errors the tolerance follows from them, and kernel and far field are the default.
        settings |= {"kernel": kernel, "far_field": far_field, "rtol": rtol}
    files = ContactFiles(
        table=table,
        json=json,
        picture=picture,
        flattened=flattened,
        command=recorded_command_line(context, "gen"),
    )
    files.check(_input_files(surfaces, facing))
    order = PressingOrder(
        reading=reading,
        boundary=boundary,
        opposite=facing.second_body(reading),
        load=load.name,
        values=load.values,
        options=AnswerOptions(
            grid_error=accuracy.grid_error,
            spots=spots,
            flow=flow,
            stiffness=stiffness,
            conductivities=conductivities,
            friction=friction,
            shares=slip_shares,
            errors=errors,
        ),
        bodies=bodies,
        settings={
            **bodies.elastic_settings,
            "hardness": bodies.hardness,
            **settings,
        },
    )
    number_of_threads = threads or default_threads(cores())
    with on_threads(number_of_threads):
        if several.are_several(surfaces):
            press_several(order, surfaces, files)
        else:
            press_one(order, surfaces[0], files)


def _conductivities(values: Sequence[float] | None) -> tuple[float, float] | None:
    """Return the conductivities of both bodies [W/(m K)], None if the option is left out.

    `values` has the values of the option --conductivity: one for equal bodies, or two. Raises
    InputError if there are more values, or one is outside the range of physical numbers.
    """
    from gen.maps.answers import require_conductivities

    if not values:
        return None
    return require_conductivities(values)


def _bodies(
    context: typer.Context, material: options.Material, layer: options.Layer
) -> Bodies:
    """Return the bodies of the options; raise InputError if the options do not go together.

    With a layer, other options of the command may be refused.
    """
    bonded = Layer.of(*layer)
    if bonded is None:
        return Bodies.of(*material)
    options.refuse(context, options.NOT_WITH_LAYER, "--layer-thickness")
    return Bodies.with_layer(bonded, *material)


def _slip_shares(text: str, friction: Friction | None) -> tuple[float, ...]:
    """Return the shares of the option --shear; raise InputError if it lacks --friction."""
    if text and friction is None:
        raise InputError("--shear goes with --friction")
    return shear_shares(text)


def _refuse_other_bodies(friction: Friction | None, kernel: str, far_field: str) -> None:
    """Refuse --friction with a --kernel or --far-field that is not the default."""
    if friction is None or (kernel, far_field) == ("uniform-pressure", "rigid"):
        return
    raise InputError(
        f"--friction with --kernel {kernel} and --far-field {far_field}: shear is that of"
        " half-spaces; leave both options out"
    )


def _refuse_stick_pressure(order: Order) -> None:
    """Refuse the option --at-pressure without --friction, or outside the pressures of a law."""
    pressure = order.stick_pressure
    if pressure is None:
        return
    if order.friction is None:
        raise InputError("--at-pressure goes with --friction")
    require_within("--at-pressure", pressure, "MPa")
    from gen.law.friction import require_in_law

    pressures = order.loads().get("pressure")
    if pressures is not None:
        require_in_law(pressure, pressures[pressures > 0])


def _gas(conductivity: float | None, jump_distance: float | None) -> Gas | None:
    """Return the gas in the gap with its conductivity [W/(m K)] and its jump distance [um].

    Both are values of options. None if both are left out. InputError if only one is left out, or
    if a number is not allowed.
    """
    if conductivity is None and jump_distance is None:
        return None
    return Gas.of_options(conductivity, jump_distance)


def _require_flattened_heights(path: Path | None, material: options.Material) -> None:
    """Refuse the option --flattened without a hardness, or with a name that does not end in .npy.

    `path` is the option's value, None if it is left out.
    """
    if path is None:
        return
    if material.hardness is None:
        raise InputError(
            "--flattened needs --hardness: elastic bodies keep their surface"
        )
    if path.suffix.lower() != ".npy":
        raise InputError(f"--flattened {path}: give a name that ends in .npy")


@grouped
def law(
    context: typer.Context,
    inputs: options.Surfaces,
    *,
    delta: options.Delta = "",
    pressure: options.Pressure = "",
    material: options.Material,
    layer: options.Layer,
    layer_in: options.LayerIn = "mesh",
    conductivity: options.Conductivity = None,
    shear: options.Shear,
    at_pressure: options.AtPressure = None,
    gas_conductivity: options.GasConductivity = None,
    jump_distance: options.JumpDistance = None,
    boundary: options.Boundary = "mirror",
    surfaces: options.Population = 50,
    band: options.Band = 0.9,
    accuracy: options.Accuracy,
    time_limit: options.TimeLimit = None,
    flow: options.Flow = False,
    also: options.Also = None,
    output: options.LawFiles = None,
    trust: Trust = False,
    files: options.LawOutputs,
    reading: Reading,
    facing: options.Against,
) -> int:
    """Tabulate the law of an interface: closure, area, gap, conductance over nominal pressure.

    The solver presses one surface, or each surface of a population. The tables of a population hold
    means, and a band in which a further surface lies with the given share at each single load.

    The patch is a piece of a larger interface, continued by its mirror images. The closure is
    therefore that of the interface alone: a mesh adds it to the deformation of the bodies.

    With --layer-thickness the first elastic body has a layer; --young and --poisson are those of
    what it lies on. Mesh the layer, or give --layer-in law.

    With --error each load of each surface is solved on fewer nodes, as many as the error needs, and
    the files say which errors were asked for and are met.

    With --error and a scene the means over its population have these errors. The number of surfaces
    on each of several grids follows from the error.

    With --friction two like bodies are sheared: stiffness before slip and elastic slip along x and
    y, and the shift and the loss of a cycle at 20, 40, 60 and 80 % of the sliding force.
    """
    from gen.law import Order
    from gen.law.files import show, write_files
    from gen.law.order import require_also
    from gen.law.surfaces import files_read

    files = files.resolved(output, _input_files(files_read(inputs), facing))
    if not 0 < band < 1:
        raise InputError(f"--band {band:g}: give a share between 0 and 1, as 0.9")
    figure = figure_for(files.picture, width=12.0, height=7.0)
    bodies = _bodies(context, material, layer)
    # Poisson's ratio alone states a material too, with a modulus of 1 MPa.
    states_modulus = bodies.has_modulus or material.poisson
    order = Order(
        inputs=tuple(inputs),
        delta=delta,
        pressure=pressure,
        surfaces=surfaces,
        level=band,
        e_star=bodies.e_star if states_modulus else None,
        hardness=bodies.hardness,
        layered=bodies.layered,
        layer_in=layer_in,
        boundary=boundary,
        conductivities=_conductivities(conductivity),
        gas=_gas(gas_conductivity, jump_distance),
        friction=shear.friction_of(material),
        stick_pressure=at_pressure,
        stiffness=True,
        grid_error=accuracy.grid_error,
        errors=accuracy.errors(context),
        flow=flow,
        also=require_also(also or []),
        reading=reading,
        opposite=facing.second_body(reading),
        between=files.refined_tables,
        straight=files.straight_lines,
        command=recorded_command_line(context, "gen"),
        both_tables=any((files.table, files.json, files.header)),
    )
    _refuse_stick_pressure(order)
    made = _made_law(order, context, time_limit)
    show(made.law)
    if made.signal:
        echo("interrupted: no file is written", err=True)
        return 128 + made.signal
    for path in write_files(made.law, files, figure):
        echo(f"wrote {path}")
    return 0


class _MadeLaw(NamedTuple):
    """A law, and whether a signal has stopped it."""

    law: Law
    signal: int = 0  # the signal that has stopped the means of a population; 0 for none


def _made_law(order: Order, context: typer.Context, time_limit: float | None) -> _MadeLaw:
    """Make a law by the solver, or by the means of a population if errors of these were asked for.

    `time_limit` is the value of --time-limit [s]. Raises InputError for options that do not go with
    the error of means.
    """
    from gen.law import by_means, by_solver
    from gen.law.surfaces import has_scene
    from gen.runtime.farm import Interruption

    if order.errors is None or not has_scene(order.inputs):
        if time_limit is not None:
            raise InputError(
                "--time-limit: needs --error and a scene, whose means it stops"
            )
        return _MadeLaw(by_solver(order))
    options.refuse(context, options.NOT_WITH_MEANS, "--error")
    if time_limit is not None and not 0 < time_limit < math.inf:
        raise InputError(f"--time-limit {time_limit:g}: give a number of seconds above 0")
    end = time.monotonic() + (time_limit or math.inf)
    with Interruption(listening=True) as interruption:
        contact_law = by_means(
            order, lambda: interruption.requested() or time.monotonic() > end
        )
        return _MadeLaw(contact_law, interruption.signal)


@grouped
def scene(
    context: typer.Context,
    inputs: options.Maps = None,
    *,
    output: options.NewScene,
    like: options.Like = None,
    generator: options.LikeGenerator = "",
    join: options.Join = False,
    material: options.Material,
    reading: SceneReading,
) -> None:
    """Examine measured maps and write a scene of their windows, or of surfaces like them.

    With --like, the map and up to ten surfaces are pressed under three pressures. If area and mean
    gap are those of the map, the surfaces are taken: those of its self-affine law if it has one,
    otherwise surfaces with its own spectrum and heights. If not, windows of the map are.

    With --join the maps of --like are scans of one surface at different magnifications. The
    surfaces have their joined spectrum and the spacing of the finest scan.

    Maps are despiked, levelled and filled as they need it, and --despike and --level overrule these
    steps. Other commands take the same steps with --prepare.

    Comments in the scene give the reasons for its values. The scene can be run as it is, and is
    meant to be edited.
    """
    from gen.draft import draft

    draft(
        inputs=inputs or [],
        like=like or [],
        output=output,
        reading=Reading(**vars(reading)),
        bodies=Bodies.of(*material),
        command=recorded_command_line(context, "gen"),
        generator=generator,
        join=join,
    )
