"""Arguments and options of the commands of `python -m gen`."""

from pathlib import Path
from typing import Annotated, Literal

import typer

Database = Annotated[Path, typer.Argument(metavar="FILE", help="A database (HDF5).")]
SurfaceFile = Annotated[
    Path,
    typer.Argument(
        metavar="SURFACE",
        help="Heights: .npy, text, or an instrument's file (x3p, sur, al3d, opd, plu, gwy ...).",
    ),
]
Side = Annotated[
    str,
    typer.Option(
        metavar="UM",
        help="Scan length in um for a file without lengths; two for an oblong patch: 1000,500.",
    ),
]
Unit = Annotated[
    str, typer.Option(metavar="UNIT", help="Unit of a file that names none: m, mm, um, nm or A.")
]
Channel = Annotated[
    str, typer.Option(metavar="NAME", help="Name or index of a channel of the file.")
]
OverrideScale = Annotated[
    bool, typer.Option("--override-scale", help="Let --side and --unit overrule the file's own.")
]
Fill = Annotated[bool, typer.Option("--fill", help="Close holes by Laplace's equation.")]
FillMost = Annotated[
    bool, typer.Option("--fill-most", help="Fill even if more than half is missing.")
]
Level = Annotated[
    str, typer.Option(metavar="HOW", help="Subtract the mean, plane or quadratic fit.")
]
Crop = Annotated[
    str, typer.Option(metavar="X0:X1,Y0:Y1", help="Keep only this part, in um from the first node.")
]
Invert = Annotated[
    bool, typer.Option("--invert", help="Turn upside down: heights point into the material.")
]
Mask = Annotated[
    str, typer.Option(metavar="BELOW:ABOVE", help="Heights outside these, in um, become holes.")
]
Despike = Annotated[
    float | None,
    typer.Option(
        metavar="THRESHOLD",
        help="Replace nodes further from the local median than this times the scatter, as 7.",
    ),
]
Form = Annotated[
    int | None,
    typer.Option(metavar="N", help="Subtract the fitted polynomial of total degree N, 1 to 20."),
]
Filter = Annotated[
    str,
    typer.Option(
        "--filter",
        metavar="S:L",
        help="Gaussian filter (ISO 16610-61): cut-offs of the S- and L-filter in um; one may be"
        " left out.",
    ),
]
Downsample = Annotated[
    int | None, typer.Option(metavar="N", help="Take the means of N x N nodes as nodes.")
]
Table = Annotated[Path | None, typer.Option("--csv", metavar="FILE", help="Also write a table.")]
Scene = Annotated[
    str,
    typer.Argument(
        metavar="SCENE",
        help="quick, paper, fine, paper-mirco, paper-yielding, extreme, or a TOML file.",
    ),
]
NewDatabase = Annotated[
    Path, typer.Option("--output", "-o", metavar="FILE", help="The database to write.")
]
Rows = Annotated[str, typer.Option(metavar="A:B", help="Only the rows A to B - 1, for job arrays.")]
RetryFailed = Annotated[bool, typer.Option("--retry-failed", help="Compute failed rows again.")]
Force = Annotated[bool, typer.Option("--force", help="Continue a file of another physics number.")]
SampleLimit = Annotated[
    float | None,
    typer.Option(
        metavar="SECONDS",
        help="Leave slower samples pending; which samples these are depends on the machine.",
    ),
]
Writer = Annotated[
    Literal["auto", "single", "parallel"],
    typer.Option(
        help="Who writes: rank 0 (single), every worker its own rows (parallel; needs an h5py with"
        " MPI), or parallel if that is possible (auto)."
    ),
]
DryRun = Annotated[bool, typer.Option("--dry-run", help="Show the plan and write nothing.")]
Delta = Annotated[
    str, typer.Option(metavar="UM", help="Far-field displacement from first touch in um.")
]
NormalForce = Annotated[str, typer.Option(metavar="UN", help="Or normal force in uN.")]
Pressure = Annotated[
    str, typer.Option(metavar="MPA", help="Or mean pressure over the whole patch in MPa.")
]
Young = Annotated[
    list[float] | None,
    typer.Option(metavar="MPA", help="Young's modulus; give it twice for two elastic bodies [1]."),
]
Poisson = Annotated[
    list[float] | None, typer.Option(metavar="NU", help="Poisson's ratio, as often as --young [0].")
]
EStar = Annotated[float | None, typer.Option(metavar="MPA", help="Or E* of both bodies.")]
Hardness = Annotated[
    float | None,
    typer.Option(metavar="MPA", help="Hardness of the softer body, which yields there [none]."),
]
Flattened = Annotated[
    Path | None,
    typer.Option(metavar="NPY", help="Write the heights that the last load leaves, for another."),
]
Kernel = Annotated[str, typer.Option(help="uniform-pressure or concentrated-force.")]
Boundary = Annotated[
    Literal["free", "periodic", "mirror"],
    typer.Option(
        help="free: the patch is all there is; periodic: it repeats; mirror: its mirror images"
        " surround it, for a piece of a larger surface."
    ),
]
FarField = Annotated[str, typer.Option(help="rigid or compliant.")]
Tolerance = Annotated[float, typer.Option(help="Residual to reach, divided by Delta.")]
MaxIterations = Annotated[int, typer.Option(help="Bound on the solver's iterations.")]
Picture = Annotated[
    Path | None, typer.Option("--plot", metavar="FILE", help="Draw heights, contact and a section.")
]
SurfacePicture = Annotated[
    Path | None,
    typer.Option(
        "--plot", metavar="FILE", help="Draw heights, distribution and spectrum; fit a law to it."
    ),
]
NewPicture = Annotated[
    Path, typer.Option("--output", "-o", metavar="PNG", help="The picture to write.")
]
Recompute = Annotated[
    int,
    typer.Option(metavar="N", min=0, help="Number of rows to recompute and compare bit for bit."),
]
Seed = Annotated[int, typer.Option(min=0, help="Seed of the choice of rows.")]
Databases = Annotated[list[Path], typer.Argument(metavar="FILES", help="Databases of one scene.")]
SceneName = Annotated[str, typer.Argument(metavar="SCENE", help="A scene's name, or a TOML file.")]
Ranks = Annotated[int, typer.Option(min=1, help="Processes of the run; rank 0 computes nothing.")]
