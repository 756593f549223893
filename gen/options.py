"""Arguments and options of the commands of `python -m gen`, and groups that commands share."""

import math
import shlex
import sys
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple

import typer
from typer import Argument, Option

from gen.maps.settings import Reading, numbers_in
from gen.runtime import command_line
from gen.runtime.errors import InputError
from gen.runtime.files import Output, check_outputs
from gen.runtime.terminal import quoted

if TYPE_CHECKING:
    from gen.maps.bodies import Opposite


OUT = "--output", "-o"


def _file(said: str, *names: str) -> Any:
    """Return an option that names a file to write."""
    return Option(*names, metavar="FILE", help=said)


Database = Annotated[Path, Argument(metavar="FILE", help="A database (HDF5).")]
SurfaceFile = Annotated[
    Path,
    Argument(
        metavar="SURFACE", help="Heights: .npy, text, instruments' (x3p, sur, gwy ...)."
    ),
]
SurfaceFiles = Annotated[
    list[Path],
    Argument(
        metavar="SURFACE...",
        help="Heights: .npy, text, instruments' (x3p, sur, gwy ...); or several, or folders.",
    ),
]
Table = Annotated[Path | None, _file("Also write a table.", "--csv")]
Json = Annotated[Path | None, _file("Also write it as JSON.", "--json")]
Scene = Annotated[
    str, Argument(metavar="SCENE", help="A shipped scene, as quick, or a TOML file.")
]
NewDatabase = Annotated[Path, Option(*OUT, metavar="FILE", help="The database to write.")]
ExportFolder = Annotated[
    Path, Option(*OUT, metavar="FOLDER", help="The folder to write.")
]
Title = Annotated[str, Option(metavar="TEXT", help="Title of the dataset.")]
Creator = Annotated[
    str, Option(metavar="TEXT", help="Who made it, as the dataset is to be cited.")
]
Licence = Annotated[
    str, Option(metavar="NAME", help="Its licence: an SPDX identifier, or URL.")
]
Doi = Annotated[
    str, Option(metavar="DOI", help="Its identifier, as 10.5281/zenodo.1234567.")
]
Rows = Annotated[
    str, Option(metavar="A:B", help="Only the rows A to B - 1, for job arrays.")
]
RetryFailed = Annotated[bool, Option("--retry-failed", help="Compute failed rows again.")]
Force = Annotated[
    bool, Option("--force", help="Continue a file of another physics number.")
]
SampleLimit = Annotated[
    float | None, Option(metavar="SECONDS", help="Leave slower rows pending.")
]
Writer = Annotated[
    Literal["auto", "single", "parallel"],
    Option(
        help="Who writes: rank 0, or every worker its own rows (needs an h5py with MPI)."
    ),
]
DryRun = Annotated[bool, Option("--dry-run", help="Show the plan and write nothing.")]
Delta = Annotated[
    str,
    Option(metavar="UM", help="Displacements in um: 2, 1,2,5 or start:stop:count[:log]."),
]
NormalForce = Annotated[str, Option(metavar="UN", help="Normal forces in uN, likewise.")]
Pressure = Annotated[
    str, Option(metavar="MPA", help="Pressures over the patch in MPa, likewise.")
]
Spots = Annotated[
    bool, Option("--spots", help="Count spots; see if contact and gap cross.")
]
Flow = Annotated[
    bool, Option("--flow", help="Let a fluid flow through the gap along x and y.")
]
GridError = Annotated[
    bool, Option(help="Give the area in the continuum, and the grid's error.")
]
Stiffness = Annotated[
    bool, Option("--stiffness", help="Solve for stiffness and the interface's.")
]
Conductivity = Annotated[
    list[float] | None,
    Option(
        metavar="W/MK",
        help="Conductivity of the bodies in W/(m K); twice if they differ.",
    ),
]
GasConductivity = Annotated[
    float | None,
    Option(
        metavar="W/MK",
        help="Conductivity of a gas in the gap in W/(m K), whose part is added.",
    ),
]
JumpDistance = Annotated[
    float | None,
    Option(metavar="UM", help="The gas' jump distance in um, at its pressure."),
]
Also = Annotated[
    list[str] | None,
    Option(
        "--also",
        metavar="NAME",
        help="Add a quantity to the law, as perimeter or largest_spot_percent; repeat for more.",
    ),
]
Flattened = Annotated[
    Path | None, Option(metavar="NPY", help="Write the heights that are left.")
]
Kernel = Annotated[str, Option(help="uniform-pressure or concentrated-force.")]
Boundary = Annotated[
    Literal["free", "periodic", "mirror"],
    Option(
        help="The patch is all there is, repeats, or is a piece among its mirror images."
    ),
]
FarField = Annotated[str, Option(help="rigid or compliant.")]
Tolerance = Annotated[float, Option(help="Residual to reach, divided by Delta.")]
MaxIterations = Annotated[int, Option(help="Bound on the solver's iterations.")]
Threads = Annotated[
    int | None,
    Option(
        min=1,
        metavar="N",
        help="Threads for large grids.  [default: OMP_NUM_THREADS, or all cores]",
        show_default=False,
    ),
]
Depth = Annotated[
    float | None, Option(metavar="UM", min=0, help="Add Smr so far below the top.")
]
SpectrumTable = Annotated[
    Path | None,
    _file(
        "Write its spectrum, radial and along x and y, over q = 2 pi/wavelength.",
        "--spectrum",
    ),
]
Picture = Annotated[Path | None, _file("Draw surface and contact.", "--plot")]
SurfacePicture = Annotated[Path | None, _file("Draw it and its spectrum.", "--plot")]
NewPicture = Annotated[Path, Option(*OUT, metavar="PNG", help="The picture to write.")]
Recompute = Annotated[
    int, Option(metavar="N", min=0, help="Rows to recompute and compare.")
]
Repair = Annotated[
    bool, Option("--repair", help="Make damaged rows pending, for gen run.")
]
Seed = Annotated[int, Option(min=0, help="Seed of the choice of rows.")]
Databases = Annotated[
    list[Path], Argument(metavar="FILES", help="Databases of one scene.")
]
Ranks = Annotated[
    int, Option(min=1, help="Processes of the run; rank 0 computes nothing.")
]

Surfaces = Annotated[
    list[str],
    Argument(
        metavar="INPUT...", help="A surface; or several, folders, databases or scenes."
    ),
]
Population = Annotated[
    int, Option(min=2, max=10_000, help="Surfaces of a scene or database.")
]
Band = Annotated[
    float,
    Option(metavar="SHARE", help="Share of further surfaces in the band of several."),
]
LawFiles = Annotated[
    Path | None,
    Option(
        *OUT,
        metavar="NAME",
        help="Write NAME.csv .json .h _4c.py -calculix.inp -abaqus.inp.",
    ),
]
Maps = Annotated[
    list[str] | None, Argument(metavar="MAPS", help="Files, folders, quoted patterns.")
]
NewScene = Annotated[
    Path, Option(*OUT, metavar="TOML", help="The scene to write, a new file.")
]
Like = Annotated[
    Path | None, Option(metavar="MAP", help="Instead: surfaces like this map.")
]


class Material(NamedTuple):
    """Elastic constants of one body on a rigid plane, or of two bodies, and their hardness."""

    young: Annotated[
        list[float] | None,
        Option(
            metavar="MPA",
            help="Young's modulus; give it twice for two elastic bodies [1].",
        ),
    ] = None
    poisson: Annotated[
        list[float] | None,
        Option(metavar="NU", help="Poisson's ratio, as often as --young [0]."),
    ] = None
    e_star: Annotated[
        float | None, Option(metavar="MPA", help="Or E* of both bodies.")
    ] = None
    hardness: Annotated[
        float | None,
        Option(metavar="MPA", help="Hardness of the softer body, which yields there."),
    ] = None


class Against(NamedTuple):
    """A second rough body that surfaces are pressed against.

    It is read by the options of the first body, or by those of its own alone.
    """

    against: Annotated[
        Path | None,
        Option(
            metavar="SURFACE",
            help="A second rough body, read and prepared alike; for gen law a folder of them too.",
        ),
    ] = None
    against_options: Annotated[
        str | None,
        Option(
            metavar="OPTIONS",
            help="Read and prepare the second body by these alone, in quotes: '--side 500 --fill'.",
        ),
    ] = None
    turned: Annotated[
        str,
        Option(
            metavar="AXIS",
            help="Axis of the second map that runs backwards, as its body is turned over: x, y or"
            " none [x].",
        ),
    ] = ""
    shift: Annotated[
        str,
        Option(
            metavar="X,Y", help="Centre of the second map, in um from that of the first."
        ),
    ] = ""

    def second_body(self, first: Reading) -> "Opposite | None":
        """Return the second body, if any, read as the first unless it has options of its own."""
        path, text, turned, shift = self
        if path is None:
            given = {
                "--against-options": text is not None,
                "--turned": turned,
                "--shift": shift,
            }
            for option in (name for name, value in given.items() if value):
                raise InputError(f"{option}: needs --against, the second rough body")
            return None
        from gen.maps.bodies import TURNS, Opposite

        if (turned := turned or TURNS[0]) not in TURNS:
            raise InputError(f"--turned {quoted(turned)}: give one of {', '.join(TURNS)}")
        distances = numbers_in(shift or "0,0")
        if len(distances) != 2 or not all(map(math.isfinite, distances)):
            raise InputError(
                f"--shift {quoted(shift)}: give the distances along x and y in um: 5,0"
            )
        laid = Opposite(path, first, turned, (distances[0], distances[1]))
        if text is None:
            return laid
        named = f"--against-options {quoted(text)}"
        alone = typer.Typer(add_completion=False, rich_markup_mode=None)
        alone.command()(command_line.grouped(_one_body))
        try:
            arguments = [str(path.absolute()), *shlex.split(text)]
            parser = typer.main.get_command(alone)
            context = parser.make_context("describe", arguments, help_option_names=[])
        except command_line.CommandLineError as error:
            raise InputError(f"{named}: {error.format_message()}") from None
        except ValueError as error:  # a quotation mark that is not closed
            raise InputError(f"{named}: {error}") from None
        own = {name: value for name, value in context.params.items() if name != "surface"}
        return replace(laid, reading=Reading(**own), shared=False)


def _one_body(surface: SurfaceFile, *, reading: Reading) -> None:
    """Take the options of one body, which are parsed and nothing more."""


Units = Literal["mm", "si", "um"]


BAND_SIDES = "soft", "stiff"
"""Sides of a law's band that have files of their own beside the law's, as law-abaqus-soft.inp."""

LAW_ENDS = {
    "table": ".csv",
    "json": ".json",
    "header": ".h",
    "calculix": "-calculix.inp",
    "abaqus": "-abaqus.inp",
    "for_4c": "_4c.py",
}
"""Ends of the names of a law's files that `--output NAME` writes."""


class LawOutputs(NamedTuple):
    """Files to write a law to, each None if it is not asked for, and units for two of them."""

    table: Annotated[Path | None, _file("Write the table.", "--csv")] = None
    json: Annotated[Path | None, _file("Write the tables as JSON.")] = None
    header: Annotated[
        Path | None, _file("Write a C header: monotone cubics and their tangents.")
    ] = None
    calculix: Annotated[Path | None, _file("Write CalculiX's surface interaction.")] = (
        None
    )
    abaqus: Annotated[Path | None, _file("Write Abaqus' surface interaction.")] = None
    for_4c: Annotated[
        Path | None, _file("Write 4C's Python file of a contact law.", "--4c")
    ] = None
    picture: Annotated[Path | None, _file("Draw the law with its band.", "--plot")] = None
    units: Annotated[
        Units,
        Option(
            help="Units for CalculiX, Abaqus and 4C: mm (mm, N, s, MPa), si or um (with MPa)."
        ),
    ] = "mm"
    check: Annotated[
        bool,
        Option(
            "--check/--no-check",
            help="Solve contacts between the loads too, for files whose programs join the points:"
            " lay these closely, and say how far off lines are.",
        ),
    ] = True

    @property
    def refined_tables(self) -> tuple[Literal["delta", "pressure"], ...]:
        """Tables between whose loads contacts are to be solved, for programs that join points."""
        if not self.check:
            return ()
        if self.header is not None:
            return ("delta", "pressure")
        return ("pressure",) if self.straight_lines or self.for_4c else ()

    @property
    def straight_lines(self) -> bool:
        """Whether programs that join the points by straight lines have files, which are judged."""
        return self.check and bool(self.calculix or self.abaqus)

    def resolved(self, stem: Path | None, inputs: Iterable[Path | str]) -> "LawOutputs":
        """Return the files, those that `--output` names among them, once they can be written."""
        if stem is not None:
            if stem.name in {"", ".."}:
                raise InputError(
                    f"--output {stem}: give what the names of the files begin with, as law"
                )
            names = {name: f"{stem.name}{end}" for name, end in LAW_ENDS.items()}
            names["for_4c"] = (
                stem.name.replace(".", "_") + LAW_ENDS["for_4c"]
            )  # to be imported
            missing = {name for name in names if getattr(self, name) is None}
            given: dict[str, Any] = {
                name: stem.with_name(names[name]) for name in missing
            }
            self = self._replace(**given)  # noqa: PLW0642
        path = self.for_4c
        if path and (
            path.suffix != ".py"
            or "." in path.stem
            or path.stem in sys.stdlib_module_names
        ):
            raise InputError(
                f"--4c {path}: 4C imports it by its name, which has to end in .py, to have no other"
                " point, and not to be that of a module of Python"
            )
        found = [Output(self.picture, "--plot", "picture")]
        for name in LAW_ENDS:
            path = getattr(self, name)
            option = {"table": "--csv", "for_4c": "--4c"}.get(name, f"--{name}")
            sides = BAND_SIDES if path and name in {"calculix", "abaqus"} else ()
            beside = [path.parent / f"{path.stem}-{side}{path.suffix}" for side in sides]
            found += [Output(each, option) for each in (path, *beside)]
        check_outputs(found, inputs)
        return self
