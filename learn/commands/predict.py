"""`learn predict`, `law` and `card`: ask a surrogate about surfaces, or about itself."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple

import typer

from gen import options
from gen.maps.settings import Reading
from gen.material import Bodies, Layer, LayeredBody, combined_modulus, loads_from
from gen.runtime.command_line import (
    Trust,
    grouped,
    recorded_command_line,
    warn_deprecated,
)
from gen.runtime.errors import InputError
from gen.runtime.figure import figure_for
from gen.runtime.files import Output, check_outputs, kind_of
from gen.runtime.terminal import (
    command_to_type,
    echo,
    first_reason,
    print_columns,
    quoted,
)

if TYPE_CHECKING:
    from bem.problem import Boundary
    from gen.arrays import Values
    from gen.law import Law, Order
    from learn.surrogate import Surrogate

MOST_ROWS = 40
"""Largest number of rows that are printed; a file gets all rows."""

MOST_REASONS = 12
"""Largest number of kinds of reasons that are printed."""

VALUE = re.compile(r" \S+ outside")
"""Part of a reason with the value, which differs between rows: " 3.1 outside" in
"delta/h 3.1 outside 0.1 to 2"."""

HIDDEN = ("_low", "_high", "warnings")
"""Endings of the titles of columns that are not printed. The ends of an interval are printed in the
cell of its value, and warnings while surfaces are read."""


File = Annotated[
    Path, typer.Argument(metavar="FILE", help="A surrogate made by learn fit.")
]
Inputs = Annotated[
    list[Path] | None,
    typer.Argument(
        metavar="[INPUT]...",
        help="Surfaces (.npy, text, instruments' files), folders of them, or tables of"
        " statistics as gen describe --csv writes them; for a scene's surrogate, tables"
        " of its numbers.",
    ),
]
At = Annotated[
    str,
    typer.Option(
        metavar="NAME=NUMBER,...",
        help="Parameters of a surrogate made with --features scene:"
        " hurst=0.7,rms_height=1.2.",
    ),
]
Mean = Annotated[
    bool,
    typer.Option("--mean", help="Predict the mean over all surfaces of the parameters."),
]
Coverage = Annotated[
    float | None,
    typer.Option(
        metavar="SHARE",
        help="Coverage of the intervals [0.9, or the largest below that the surrogate"
        " reaches].",
    ),
]
TableFile = Annotated[
    Path | None, typer.Option("--output", "-o", metavar="CSV", help="Write all rows.")
]
SurrogateAndInputs = Annotated[
    list[str],
    typer.Argument(
        metavar="[SURROGATE] INPUT...",
        help="A surrogate made by learn fit, or --solver instead of it; then one"
        " surface, or folders of them, databases or scenes: a population.",
    ),
]
Solver = Annotated[
    bool,
    typer.Option(
        "--solver", help="Solve every contact. Leaves with version 2.0: use gen law."
    ),
]
LawBoundary = Annotated[
    Literal["free", "periodic", "mirror"] | None,
    typer.Option(
        help="Boundary of the patches, see gen contact; that of the training or the"
        " scene if left out, else mirror."
    ),
]


class LawQuestion(NamedTuple):
    """The options about the content of a law; see their help."""

    delta: options.Delta = ""
    pressure: options.Pressure = ""
    conductivity: options.Conductivity = None
    also: options.Also = None
    at: At = ""
    solver: Solver = False
    surfaces: options.Population = 50
    layer_in: options.LayerIn = "mesh"
    boundary: LawBoundary = None
    interval: Coverage = None


@grouped
def predict(
    file: File,
    inputs: Inputs = None,
    delta: options.Delta = "",
    pressure: options.Pressure = "",
    at: At = "",
    output: TableFile = None,
    interval: Coverage = None,
    mean: Mean = False,
    *,
    reading: Reading,
    material: options.Material,
    layer: options.Layer,
) -> None:
    """Predict area and force of surfaces, with intervals, and a flag outside the training.

    A surrogate made with --features scene takes the scene's parameters and its load instead of
    surfaces: --at and --delta or --pressure, or tables with a column for each. A surrogate of
    layers of several thicknesses or moduli takes the options of a layer, with --young and --poisson
    of what is below it.
    """
    from gen.doubts import material_doubts
    from gen.runtime.documents import Row, write_csv
    from learn.surrogate import Surrogate
    from learn.surrogate.answers import (
        SurfaceQuestion,
        answers,
        answers_of_parameters,
    )
    from learn.surrogate.level import level_note, level_of

    inputs = inputs or []
    check_outputs([Output(output, "--output")], [file, *inputs])
    surrogate = Surrogate.load(file)
    level = level_of(surrogate, interval, mean=mean)
    loads = _loads(delta, pressure)
    rows: list[Row] = []
    doubts: list[str] = []
    if surrogate.features.of_scene:
        parameters = _parameters(at, reading, material, layer)
        numbers: dict[str, Any] = {**parameters, **loads}
        rows += answers_of_parameters(surrogate, inputs, numbers, level, mean=mean)
        predicted = "means over surfaces" if mean else "new surfaces"
        title = f"Predictions of {predicted} with {100 * level:g} % intervals"
    else:
        load = surrogate.features.load
        if at or mean or not inputs or loads.keys() != {load}:
            raise InputError(
                f"{file}: predicts for surfaces: give some, and --{load}; --at and"
                " --mean are for surrogates that learn fit --features scene makes,"
                " --pressure for those of --load pressure"
            )
        bodies = _bodies(surrogate, material, layer)
        question = SurfaceQuestion(
            loads=loads[load], bodies=bodies, level=level, reading=reading
        )
        for path in inputs:
            rows += answers(surrogate, path, question)
        title = f"Predictions with {100 * level:g} % intervals, {bodies.text}"
        doubts = material_doubts(bodies)
    _print_predictions(rows, title, doubts)
    note = level_note(surrogate, level, interval)
    if note:
        echo(note)
    if output is not None:
        write_csv(output, rows)
        echo(f"wrote {output}")


def _loads(delta: str, pressure: str) -> dict[str, Values]:
    """Parse --delta [um] and --pressure [MPa]; return the loads by name, (k,), that are given.

    Raises InputError if a text is no list of loads.
    """
    import numpy as np

    loads: dict[str, Values] = {}
    for name, text in {"delta": delta, "pressure": pressure}.items():
        if text:
            loads[name] = np.array(loads_from(name, text))
    return loads


def _bodies(
    surrogate: Surrogate, material: options.Material, layer: options.Layer
) -> Bodies:
    """Return the bodies of the options, completed by the training of a surrogate of surfaces.

    Raises InputError if they are impossible, or if the surrogate has not learnt their kind.
    """
    from learn.surrogate.model import under_a_rigid_body

    layered = _layered(material, layer)
    if layered is None:
        return surrogate.bodies(_modulus(material), material.hardness)
    return surrogate.bodies(None, material.hardness, under_a_rigid_body(layered))


def _layered(material: options.Material, layer: options.Layer) -> LayeredBody | None:
    """Return the bodies of the options if one of them has a layer, otherwise None.

    Raises InputError if they are impossible.
    """
    bonded = Layer.of(*layer)
    if bonded is None:
        return None
    return Bodies.with_layer(bonded, *material).layered


def _modulus(material: options.Material) -> float | None:
    """Return E* of the options [MPa]; None if they give neither a modulus nor a ratio."""
    return combined_modulus(material.young, material.poisson, material.e_star)


def _print_predictions(
    rows: Sequence[Mapping[str, Any]], title: str, doubts: Sequence[str]
) -> None:
    """Print predictions on standard output.

    Print the title, the first `MOST_ROWS` rows as a table, the doubts about the bodies, and why
    rows are outside the training. `rows` are the cells of each row by column, one row or more, all
    with equal columns.
    """
    columns = [name for name in rows[0] if not name.endswith(HIDDEN)]
    lines = [[_cell(row, column) for column in columns] for row in rows[:MOST_ROWS]]
    echo(f"{title}:")
    print_columns(lines, columns, right={*columns} - {"input", "flag", "reason"})
    if len(rows) > MOST_ROWS:
        echo(f"... and {len(rows) - MOST_ROWS} more: -o writes all of them")
    for doubt in doubts:
        echo(f"warning: {doubt}")
    _print_reasons(rows)


def _cell(row: Mapping[str, Any], column: str) -> str:
    """Return the text of a cell of a row.

    Of the column "reason" it is the first reason only. The value of a target is followed by its
    interval in brackets, or by "(-)" if the row is outside the training.
    """
    value = row[column]
    if column == "reason":
        return first_reason(str(value))
    text = f"{value:.4g}" if isinstance(value, float) else str(value)
    if f"{column}_low" not in row:  # not a target
        return text
    if row["flag"] == "outside":
        return f"{text} (-)"
    low = row[f"{column}_low"]
    high = row[f"{column}_high"]
    return f"{text} ({low:.4g} to {high:.4g})"


def _print_reasons(rows: Sequence[Mapping[str, Any]]) -> None:
    """Print how many rows are outside the training, and the most frequent kinds of reasons.

    Reasons are of one kind if only the value in them differs; the first reason of each kind is
    printed. Nothing is printed if all rows are inside.
    """
    outside = [row for row in rows if row["flag"] == "outside"]
    if not outside:
        return
    echo(
        f"{len(outside)} of {len(rows)} rows lie outside what the surrogate was trained"
        " on: no interval holds there, and none is given (-)"
    )
    kinds: dict[str, list[str]] = {}
    for row in outside:
        for reason in str(row["reason"]).split("; "):
            kind = VALUE.sub(" outside", reason)
            kinds.setdefault(kind, []).append(reason)
    most_frequent = sorted(kinds.values(), key=len, reverse=True)
    for reasons in most_frequent[:MOST_REASONS]:
        echo(f"  {len(reasons)} of {len(rows)}: {reasons[0]}")
    if len(kinds) > MOST_REASONS:
        echo(f"  and {len(kinds) - MOST_REASONS} more: -o writes all of them")


def _parameters(
    at: str, reading: Reading, material: options.Material, layer: options.Layer
) -> dict[str, float]:
    """Return the numbers of --at and the hardness of --hardness [MPa], if it is given, by name.

    The numbers are in the units of the scene. Raises InputError for options of surfaces, moduli and
    layers, for a part of --at that is no NAME=NUMBER, and for a name that is given twice, of which
    "hardness" is one if --hardness is given.
    """
    _refuse_options_of_surfaces(reading, material, layer)
    hardness: dict[str, float] = {}
    if material.hardness is not None:
        hardness["hardness"] = material.hardness
    return hardness | _numbers_at(at, taken=hardness.keys())


def _refuse_options_of_surfaces(
    reading: Reading, material: options.Material, layer: options.Layer
) -> None:
    """Raise InputError for options that a surrogate of a scene's own features does not take.

    They are the options of layers, of moduli, and of the preparation of maps. A hardness is
    allowed.
    """
    if layer != options.Layer():
        raise InputError(
            "the surrogate's layer is that of its scene: leave out the options --layer-*; a layer"
            " that the scene draws has layer_thickness and layer_modulus in --at"
        )
    if _modulus(material) is not None:
        raise InputError(
            "the surrogate's E* is that of its scene, which learn card tells: leave out"
            " --young, --poisson and --e-star; for elastic bodies of another E*, give each"
            " pressure times the scene's E* over theirs: areas are then those of the bodies,"
            " forces those at the scene's E*"
        )
    if reading != Reading():
        raise InputError(
            "the surrogate reads no surfaces: leave out the options that prepare them"
        )


def _numbers_at(at: str, taken: Collection[str]) -> dict[str, float]:
    """Parse the text of --at, as "hurst=0.7,rms_height=1.2"; return its numbers by name.

    Empty parts between commas are skipped. Raises InputError for a part that is no NAME=NUMBER,
    for a name that is given twice, and for one of the names `taken` by other options.
    """
    numbers: dict[str, float] = {}
    for part in at.split(","):
        if not part:
            continue
        name, _, text = part.partition("=")
        name = name.strip()
        try:
            number = float(text)
        except ValueError:
            number = math.nan  # which is refused
        if math.isnan(number) or name in numbers or name in taken:
            raise InputError(
                f"--at {quoted(at)}: give NAME=NUMBER once a name, with commas between,"
                " as hurst=0.7"
            )
        numbers[name] = number
    return numbers


def card(file: File) -> None:
    """Print a surrogate's model card: what it was made of, its scores, intervals and ranges."""
    from learn.surrogate.card import show
    from learn.surrogate.learnt import read_file

    contents = read_file(file)
    show(contents.card, contents.low, contents.high)


@grouped
def law(
    context: typer.Context,
    inputs: SurrogateAndInputs,
    *,
    question: LawQuestion,
    output: options.LawFiles = None,
    trust: Trust = False,
    files: options.LawOutputs,
    reading: Reading,
    material: options.Material,
    layer: options.Layer,
) -> None:
    """Tabulate area, force, gap and closure against Delta and pressure, monotone, with slopes.

    The band of one surface is the surrogate's interval; in that of a population a further surface
    lies. One surface has no band if it is solved, or outside the training.
    With --solver the law is that of gen law, with the boundary of the first scene. A surrogate made
    with --features scene takes --at, and no surface. With --conductivity the law has the
    conductance too. A stiffness that the surrogate has not learnt is the slope of the force, for
    elastic bodies only.
    """
    from gen.law.files import show, write_files
    from gen.law.surfaces import files_read
    from learn.surrogate.law import law_of_parameters, law_of_surfaces

    files = files.resolved(output, files_read(inputs))
    figure = figure_for(files.picture, width=12.0, height=7.0)
    surrogate = _surrogate_of_law(inputs, question)
    order = replace(
        _order(inputs, surrogate, question, material, layer),
        reading=reading,
        between=files.refined_tables,
        straight=files.straight_lines,
        command=recorded_command_line(context, "learn"),
    )
    if surrogate is None:
        contact_law = _solved_law(order)
    elif surrogate.features.of_scene:
        numbers = _parameters(question.at, reading, material, layer)
        contact_law = law_of_parameters(surrogate, order, numbers)
    else:
        contact_law = law_of_surfaces(surrogate, order)
    show(contact_law)
    for path in write_files(contact_law, files, figure):
        echo(f"wrote {path}")


def _order(
    inputs: Sequence[str],
    surrogate: Surrogate | None,
    question: LawQuestion,
    material: options.Material,
    layer: options.Layer,
) -> Order:
    """Return the order of a law with its surfaces, loads, material and further quantities.

    The preparation of maps and the settings of tables are added by `law`. `inputs` are the
    arguments of the command: a surrogate and then surfaces, or surfaces only. `surrogate` is the
    one that predicts the law; None if the law is solved. Raises InputError for an option whose
    value is not allowed.
    """
    from gen.law import Order
    from gen.law.order import require_also
    from gen.maps.answers import require_conductivities

    interval = question.interval
    if interval is not None and not 0 < interval < 1:
        raise InputError(
            f"--interval {interval:g}: give a coverage between 0 and 1, as 0.9"
        )
    boundary = question.boundary
    if surrogate is None and boundary is None:
        boundary = _boundary_of_scene(inputs)
    # A law at given parameters of a scene has no surfaces: the surrogate is its only input.
    surfaces = inputs
    if surrogate is not None and not surrogate.features.of_scene:
        surfaces = inputs[1:]  # the first input is the surrogate
    conductivities: tuple[float, float] | None = None
    if question.conductivity:
        conductivities = require_conductivities(question.conductivity)
    layered = _layered(material, layer)
    e_star = layered.e_star if layered is not None else _modulus(material)
    return Order(
        inputs=tuple(surfaces),
        delta=question.delta,
        pressure=question.pressure,
        surfaces=question.surfaces,
        level=interval,
        e_star=e_star,
        hardness=material.hardness,
        layered=layered,
        layer_in=question.layer_in,
        boundary=boundary,
        conductivities=conductivities,
        also=require_also(question.also or []),
    )


def _surrogate_of_law(inputs: Sequence[str], question: LawQuestion) -> Surrogate | None:
    """Read the surrogate that predicts a law, which is the first input; None with --solver.

    Raises InputError if the first input is no surrogate although --solver is not given, or if
    inputs and options do not belong together.
    """
    from learn.surrogate import Surrogate

    # With --solver there is no surrogate, and `first` is a surface too.
    first, *surfaces = inputs
    path = Path(first)
    is_surrogate = path.is_file() and kind_of(path) == "surrogate"
    if question.solver and is_surrogate:
        raise InputError(
            f"{first}: --solver solves the law without a surrogate: leave it out"
        )
    surrogate = Surrogate.load(path) if is_surrogate else None
    of_scene = surrogate is not None and surrogate.features.of_scene
    if of_scene and (surfaces or question.boundary):
        raise InputError(
            f"{first}: a law at given parameters: leave out surfaces and --boundary"
        )
    if question.at and not of_scene:
        raise InputError("--at: is for surrogates that learn fit --features scene makes")
    if not (question.solver or surfaces or of_scene):
        raise InputError(
            f"{first}: nothing else given: give a surrogate and then surfaces, or"
            " surfaces and --solver"
        )
    if surrogate is None and not question.solver:
        return Surrogate.load(path)  # raises InputError, which says what the file is
    return surrogate


def _boundary_of_scene(inputs: Sequence[str]) -> Boundary | None:
    """Return the boundary of the first input that is a scene; None if no input is a scene."""
    from gen.law.surfaces import scene_of

    for text in inputs:
        scene = scene_of(text)
        if scene is not None:
            return scene.contact.boundary
    return None


def _solved_law(order: Order) -> Law:
    """Solve a law without a surrogate, and warn that the option --solver is deprecated."""
    from gen.law import by_solver

    contact_law = by_solver(order)
    gen_law = command_to_type("gen law")
    warn_deprecated("--solver", f"use {gen_law}, for a scene with its --boundary")
    return contact_law
