"""`learn predict`, `law` and `card`: ask a surrogate about surfaces, or about itself."""

import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from gen import options
from gen.maps.settings import Reading
from gen.material import combined_modulus, loads_from
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

REASONS = 12  # reasons that are printed at most
VALUE = re.compile(r" \S+ outside")  # the part of a reason that differs between rows
SHOWN = 40  # rows that are printed at most; a file gets all of them

File = Annotated[
    Path, typer.Argument(metavar="FILE", help="A surrogate made by learn fit.")
]
Inputs = Annotated[
    list[Path] | None,
    typer.Argument(
        metavar="[INPUT]...",
        help="Surfaces (.npy, text, instruments' files), folders of them, or tables of statistics"
        " as gen describe --csv writes them; for a scene's surrogate, tables of its numbers.",
    ),
]
At = Annotated[
    str,
    typer.Option(
        metavar="NAME=NUMBER,...",
        help="Parameters of a surrogate made with --features scene: hurst=0.7,rms_height=1.2.",
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
        help="Coverage of the intervals [0.9, or the largest below that the surrogate reaches].",
    ),
]
TableFile = Annotated[
    Path | None, typer.Option("--output", "-o", metavar="CSV", help="Write all rows.")
]
SurrogateAndInputs = Annotated[
    list[str],
    typer.Argument(
        metavar="[SURROGATE] INPUT...",
        help="A surrogate made by learn fit, or --solver instead of it; then one surface, or"
        " folders of them, databases or scenes: a population.",
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
        help="Boundary of the patches, see gen contact; that of the training or the scene if left"
        " out, else mirror."
    ),
]


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
) -> None:
    """Predict area and force of surfaces, with intervals, and a flag outside the training.

    A surrogate made with --features scene takes the scene's parameters and its load instead of
    surfaces: --at and --delta or --pressure, or tables with a column for each.
    """
    import numpy as np

    from gen.doubts import material_doubts
    from gen.runtime.documents import Row, write_csv
    from learn.surrogate import Surrogate
    from learn.surrogate.answers import answers, answers_of_parameters
    from learn.surrogate.level import level_note, level_of

    inputs = inputs or []
    check_outputs([Output(output, "--output")], [file, *inputs])
    surrogate = Surrogate.load(file)
    level = level_of(surrogate, interval, mean=mean)
    texts = {"delta": delta, "pressure": pressure}
    given = {
        name: np.array(loads_from(name, text)) for name, text in texts.items() if text
    }
    rows: list[Row] = []
    if surrogate.features.of_scene:
        numbers: dict[str, Any] = {**_parameters(at, reading, material), **given}
        rows += answers_of_parameters(surrogate, inputs, numbers, level, mean=mean)
        of = "means over surfaces" if mean else "new surfaces"
        _show(rows, f"Predictions of {of} with {100 * level:g} % intervals")
    elif at or mean or not inputs or given.keys() != {surrogate.features.load}:
        raise InputError(
            f"{file}: predicts for surfaces: give some, and --{surrogate.features.load}; --at and"
            " --mean are for surrogates that learn fit --features scene makes, --pressure for those"
            " of --load pressure"
        )
    else:
        bodies = surrogate.bodies(combined_modulus(*material[:3]), material.hardness)
        for path in inputs:
            loads = given[surrogate.features.load]
            rows += answers(surrogate, path, loads, bodies, level, reading)
        title = f"Predictions with {100 * level:g} % intervals, {bodies.text}"
        _show(rows, title, material_doubts(bodies))
    if note := level_note(surrogate, level, interval):
        echo(note)
    if output is not None:
        write_csv(output, rows)
        echo(f"wrote {output}")


def _show(rows: Sequence[dict[str, Any]], title: str, doubts: Sequence[str] = ()) -> None:
    """Print the first rows of the table, and the reasons of those outside the training."""
    hidden = ("_low", "_high", "warnings")  # warnings were said with the surface
    names = [name for name in rows[0] if not name.endswith(hidden)]
    lines = []
    for row in rows[:SHOWN]:
        flagged, cells = row["flag"] == "outside", list[str]()
        for name in names:
            value = row[name]
            text = f"{value:.4g}" if isinstance(value, float) else str(value)
            if f"{name}_low" in row:  # `-` for an interval that is withheld
                low, high = row[f"{name}_low"], row[f"{name}_high"]
                text += " (-)" if flagged else f" ({low:.4g} to {high:.4g})"
            cells.append(first_reason(text) if name == "reason" else text)
        lines.append(cells)
    echo(f"{title}:")
    print_columns(lines, names, right={*names} - {"input", "flag", "reason"})
    if len(rows) > SHOWN:
        echo(f"... and {len(rows) - SHOWN} more: -o writes all of them")
    for doubt in doubts:
        echo(f"warning: {doubt}")
    outside = [row for row in rows if row["flag"] == "outside"]
    if outside:
        echo(
            f"{len(outside)} of {len(rows)} rows lie outside what the surrogate was trained on: no"
            " interval holds there, and none is given (-)"
        )
    kinds: dict[str, list[str]] = {}
    for reason in (each for row in outside for each in str(row["reason"]).split("; ")):
        kinds.setdefault(VALUE.sub(" outside", reason), []).append(reason)
    for alike in sorted(kinds.values(), key=len, reverse=True)[:REASONS]:
        echo(f"  {len(alike)} of {len(rows)}: {alike[0]}")
    if len(kinds) > REASONS:
        echo(f"  and {len(kinds) - REASONS} more: -o writes all of them")


def _parameters(
    text: str, reading: Reading, material: options.Material
) -> dict[str, float]:
    """Parse --at, as "hurst=0.7,rms_height=1.2", add a hardness, and refuse options of surfaces."""
    if combined_modulus(*material[:3]) is not None:
        raise InputError(
            "the surrogate's E* is that of its scene, which learn card tells: leave out --young,"
            " --poisson and --e-star, and give elastic pressures as they are at that E*"
        )
    if reading != Reading():
        raise InputError(
            "the surrogate reads no surfaces: leave out the options that prepare them"
        )
    found = {} if material.hardness is None else {"hardness": material.hardness}
    for part in filter(None, text.split(",")):
        name, _, number = part.partition("=")
        try:
            value = float(number)
        except ValueError:
            value = math.nan
        if math.isnan(value) or name.strip() in found:
            raise InputError(
                f"--at {quoted(text)}: give NAME=NUMBER once a name, with commas between, as"
                " hurst=0.7"
            )
        found[name.strip()] = value
    return found


def card(file: File) -> None:
    """Print a surrogate's model card: what it was made of, its scores, intervals and ranges."""
    from learn.surrogate.card import show
    from learn.surrogate.learnt import read_file

    surrogate = read_file(file)
    show(surrogate.card, surrogate.low, surrogate.high)


@grouped
def law(
    context: typer.Context,
    inputs: SurrogateAndInputs,
    delta: options.Delta = "",
    pressure: options.Pressure = "",
    conductivity: options.Conductivity = None,
    also: options.Also = None,
    at: At = "",
    solver: Solver = False,
    surfaces: options.Population = 50,
    boundary: LawBoundary = None,
    interval: Coverage = None,
    output: options.LawFiles = None,
    trust: Trust = False,
    *,
    files: options.LawOutputs,
    reading: Reading,
    material: options.Material,
) -> None:
    """Tabulate area, force, gap and closure against Delta and pressure, monotone, with slopes.

    Bands are the surrogate's intervals for one surface, and for a population where a further
    surface lies. There is none for one surface that is solved, or outside the training.
    With --solver it is what gen law makes, with the boundary of the first scene. A surrogate made
    with --features scene takes --at, and no surface. With
    --conductivity there is the conductance too. Surrogates that have not learnt the stiffness take
    it from the slope of the force, for elastic bodies only.
    """
    from gen.law import Order, by_solver
    from gen.law.files import show, write_files
    from gen.law.order import require_also
    from gen.law.surfaces import files_read, scene_of
    from gen.maps.contacts import require_conductivities
    from learn.surrogate import Surrogate
    from learn.surrogate.law import make, of_parameters

    files = files.resolved(output, files_read(inputs))
    figure = figure_for(files.picture, 12.0, 7.0)
    first, *others = inputs
    known = Path(first).is_file() and kind_of(Path(first)) == "surrogate"
    if solver and known:
        raise InputError(
            f"{first}: --solver solves the law without a surrogate: leave it out"
        )
    surrogate = Surrogate.load(Path(first)) if known else None
    of_scene = surrogate is not None and surrogate.features.of_scene
    if of_scene and (others or boundary):
        raise InputError(
            f"{first}: a law at given parameters: leave out surfaces and --boundary"
        )
    if at and not of_scene:
        raise InputError("--at: is for surrogates that learn fit --features scene makes")
    if not (solver or others or of_scene):
        raise InputError(
            f"{first}: nothing else given: give a surrogate and then surfaces, or surfaces and"
            " --solver"
        )
    if interval is not None and not 0 < interval < 1:
        raise InputError(
            f"--interval {interval:g}: give a coverage between 0 and 1, as 0.9"
        )
    if solver and boundary is None:
        scene = next(filter(None, map(scene_of, inputs)), None)
        boundary = None if scene is None else scene.contact.boundary
    order = Order(
        inputs=tuple(inputs if solver or of_scene else others),
        delta=delta,
        pressure=pressure,
        surfaces=surfaces,
        level=interval,
        e_star=combined_modulus(*material[:3]),
        hardness=material.hardness,
        boundary=boundary,
        conductivities=require_conductivities(conductivity) if conductivity else None,
        also=require_also(also or []),
        reading=reading,
        between=files.refined_tables,
        straight=files.straight_lines,
        command=recorded_command_line(context, "learn"),
    )
    if solver:
        made = by_solver(order)
        instead = f"use {command_to_type('gen law')}, for a scene with its --boundary"
        warn_deprecated("--solver", instead)
    else:
        surrogate = surrogate or Surrogate.load(Path(first))
        if of_scene:
            made = of_parameters(surrogate, order, _parameters(at, reading, material))
        else:
            made = make(surrogate, order)
    show(made)
    for written in write_files(made, files, figure):
        echo(f"wrote {written}")
