"""Arguments and options that several commands share, one by one and in groups."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from gen.options import Trust
from gen.runtime.files import check_folder
from gen.runtime.terminal import echo

if TYPE_CHECKING:
    from learn.dataset import Request

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
        help="area, force, both, or the column of another result that is stored, as mean_gap.",
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
Again = Annotated[
    bool, typer.Option("--again", help="Measure again, also where a result is there.")
]

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
    typer.Option(metavar="UM", help="Far-field displacement: 2, 1,2,5 or start:stop:count[:log]."),
]
Coverage = Annotated[
    float, typer.Option(metavar="SHARE", help="Coverage of the intervals, as 0.9.")
]


class Selection(NamedTuple):
    """Rows and features that a comparison rests on; see the help of the options."""

    area_max: AreaMax = None
    features: Features = "paper"
    normalise: Normalise = ""
    seed: Seed = 0
    train_rows: TrainRows = None
    trust: Trust = False


class Material(NamedTuple):
    """Elastic constants of one body on a rigid plane, or of two bodies, and their hardness."""

    young: Annotated[
        list[float] | None,
        typer.Option(metavar="MPA", help="Young's modulus, twice for two elastic bodies."),
    ] = None
    poisson: Annotated[
        list[float] | None, typer.Option(metavar="NU", help="Poisson's ratio, as often.")
    ] = None
    e_star: Annotated[
        float | None, typer.Option(metavar="MPA", help="Or E*; that of the training if left out.")
    ] = None
    hardness: Annotated[
        float | None,
        typer.Option(
            metavar="MPA",
            help="Hardness of the softer body, where bodies yield; that of the training if it has"
            " only one.",
        ),
    ] = None

    def modulus(self) -> float | None:
        """Return E* [MPa], or None if none was given."""
        if self.young is None and self.poisson is None and self.e_star is None:
            return None
        from gen.material import combined_modulus

        return combined_modulus(self.young or [], self.poisson or [], self.e_star)


def note(line: str) -> None:
    """Print a line for the user on standard error."""
    echo(line, err=True)


def requested(
    file: Path,
    output: Path,
    models: list[str] | None,
    target: str,
    selection: Selection,
    *,
    again: bool = False,
    limit: float | None = None,
) -> Request:
    """Return the request of a comparison, after a look at its folder.

    InputError is raised if the folder cannot be written, or an option has no meaning.
    """
    from learn.dataset import Request
    from learn.features import chosen
    from learn.surrogate.fitting import normalisation_of

    check_folder(output)
    return Request(
        database=file,
        output=output,
        targets=("area", "force") if target == "both" else (target,),
        models=tuple(models or ()),
        area_max=selection.area_max,
        normalisation=normalisation_of(
            chosen(selection.features).normalisation, selection.normalise
        ),
        features=selection.features,
        seed=selection.seed,
        train_rows=selection.train_rows,
        again=again,
        limit=limit,
    )
