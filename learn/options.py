"""Arguments and options that several commands share."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer

Database = Annotated[Path, typer.Argument(metavar="FILE", help="A database made by gen (HDF5).")]
Output = Annotated[
    Path, typer.Option("--output", "-o", metavar="DIR", help="The comparison folder.")
]
Comparison = Annotated[Path, typer.Argument(metavar="DIR", help="A comparison folder.")]
Models = Annotated[
    list[str] | None,
    typer.Option(
        "--model",
        metavar="NAME",
        help="decision-tree, random-forest, adaboost, xgboost, gradient-boost, svm,"
        " gaussian-process, kernel-ridge or mlp; may be repeated; all nine if left out.",
    ),
]
Target = Annotated[
    str,
    typer.Option(
        metavar="NAME",
        help="area, force, both, or mean_gap, largest_pressure, perimeter where they are stored.",
    ),
]
AreaMax = Annotated[
    float | None,
    typer.Option(metavar="PERCENT", help="Leave larger areas out; 16.56 is the paper's range."),
]
Normalise = Annotated[
    str,
    typer.Option(
        metavar="HOW",
        help="l2 (each row to unit length, the paper's), standard, min-max or none; l2 for paper"
        " features and standard for others if left out.",
    ),
]
Features = Annotated[
    str,
    typer.Option(
        metavar="SET",
        help="paper (Delta and the 22 statistics), dimensionless (the same without units: any scan"
        " length), or hybrid (with bearing area and a coarse contact solve of each surface).",
    ),
]
SEEDS = 2**32 - 1
"""The largest seed that all libraries of models take."""

Seed = Annotated[int, typer.Option(min=0, max=SEEDS, help="Seed of the split and of the models.")]
TrainRows = Annotated[
    int | None, typer.Option(metavar="N", help="Train on N rows at most, drawn with the seed.")
]
Again = Annotated[bool, typer.Option("--again", help="Measure anew what is there already.")]

File = Annotated[Path, typer.Argument(metavar="FILE", help="A surrogate made by learn fit.")]
Inputs = Annotated[
    list[Path],
    typer.Argument(
        metavar="INPUT...",
        help="Surfaces (.npy, text, instruments' files), folders of them, or tables of statistics"
        " as gen describe --csv writes them.",
    ),
]
Deltas = Annotated[
    str,
    typer.Option(metavar="UM", help="Far-field displacement: 2, 1,2,5 or start:stop:count."),
]
Side = Annotated[
    str, typer.Option(metavar="UM", help="Scan length where a file has none; 1000,500 if oblong.")
]
Unit = Annotated[str, typer.Option(metavar="UNIT", help="Of a file that says none: m, mm, um, nm.")]
Channel = Annotated[
    str, typer.Option(metavar="NAME", help="Channel of a file with several, or its index.")
]
OverrideScale = Annotated[
    bool, typer.Option("--override-scale", help="Let --side and --unit overrule the file's own.")
]
Fill = Annotated[bool, typer.Option("--fill", help="Close holes harmonically.")]
FillMost = Annotated[
    bool, typer.Option("--fill-most", help="Fill even if more than half is missing.")
]
Level = Annotated[
    str, typer.Option(metavar="HOW", help="Take away the mean, the plane or the quadratic fit.")
]
Crop = Annotated[str, typer.Option(metavar="X0:X1,Y0:Y1", help="Keep this part only, in um.")]
Invert = Annotated[bool, typer.Option("--invert", help="Turn upside down.")]
Young = Annotated[
    list[float] | None,
    typer.Option(metavar="MPA", help="Young's modulus, twice for two elastic bodies."),
]
Poisson = Annotated[
    list[float] | None, typer.Option(metavar="NU", help="Poisson's ratio, as often.")
]
EStar = Annotated[
    float | None, typer.Option(metavar="MPA", help="Or E*; that of the training if left out.")
]
Coverage = Annotated[
    float, typer.Option(metavar="SHARE", help="Coverage of the intervals, as 0.9.")
]


def modulus_from(
    young: list[float] | None, poisson: list[float] | None, e_star: float | None
) -> float | None:
    """E* if anything says it."""
    if young is None and poisson is None and e_star is None:
        return None
    from gen.measured.material import combined_modulus

    return combined_modulus(young or [], poisson or [], e_star)


def typed(context: typer.Context) -> str:
    """The command line of this command, for the record: what was given, defaults left out."""
    words = ["python", "-m", "learn", str(context.info_name)]
    for parameter in context.command.params:
        name = str(parameter.name)
        source = context.get_parameter_source(name)
        if source is None or source.name != "COMMANDLINE":
            continue
        given = context.params[name]
        values = given if isinstance(given, list | tuple) else [given]
        option = [] if parameter.param_type_name == "argument" else [parameter.opts[0]]
        for value in values:
            words += [*option, str(value)] if value is not True else option
    return shlex.join(words)
