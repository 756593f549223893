"""Arguments and options of the commands of `python -m gen`, and groups that commands share."""

import math
import shlex
import sys
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
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


OUT = ("--output", "-o")


def _file(help_text: str, *names: str) -> Any:
    """Return an option that names a file to write, called as its field unless names are given."""
    return Option(*names, metavar="FILE", help=help_text)


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
    float | None, Option(metavar="SECONDS", help="Leave rows pending that take longer.")
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
    bool, Option("--spots", help="Count spots; tell if contact and gap cross.")
]
Flow = Annotated[
    bool, Option("--flow", help="Let a fluid flow through the gap along x and y.")
]
GridError = Annotated[
    bool, Option(help="Give the area in the continuum, and the grid's error.")
]
Stiffness = Annotated[
    bool,
    Option("--stiffness", help="Solve for the stiffness, and that of the interface."),
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
    Path | None, Option(metavar="NPY", help="Write the heights after yielding.")
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
    float | None, Option(metavar="UM", min=0, help="Add Smr at this depth below the top.")
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
    int, Option(min=2, max=10_000, help="Number of surfaces of a scene or database.")
]
Band = Annotated[
    float,
    Option(
        metavar="SHARE", help="Share of further surfaces that the band of several holds."
    ),
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
    Path | None, Option(metavar="MAP", help="Instead of MAPS: surfaces like this one.")
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
            help="Read and prepare the second body by these alone, in quotes: '--side 500 --fill'."
            " Leaves with version 2.0.",
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
        """Return the second body, and how it lies on the first one.

        A line on standard error says that `--against-options` leaves, if it is given.

        Parameters
        ----------
        first : Reading
            How the first body is read and prepared, and the second one too unless it has options
            of its own.

        Returns
        -------
        Opposite or None
            The second body, whose file is not read yet; None if the user gave none.

        Raises
        ------
        InputError
            If an option has no such value, or is given without a second body.
        """
        if self.against is None:
            self._refuse_alone()
            return None
        from gen.maps.bodies import TURNS, Opposite

        turned = self.turned or TURNS[0]
        if turned not in TURNS:
            raise InputError(f"--turned {quoted(turned)}: give one of {', '.join(TURNS)}")
        distances = numbers_in(self.shift or "0,0")
        if len(distances) != 2 or not all(map(math.isfinite, distances)):
            raise InputError(
                f"--shift {quoted(self.shift)}: give the distances along x and y in um: 5,0"
            )
        body = Opposite(self.against, first, turned, (distances[0], distances[1]))
        if self.against_options is None:
            return body
        reading = _reading_of(self.against_options)
        command_line.warn_deprecated(
            "--against-options",
            "prepare the second map in another program, which saves it with its lengths",
        )
        return replace(body, reading=reading, shared=False)

    def _refuse_alone(self) -> None:
        """Refuse the options of a second body that are given without one."""
        given_options = {
            "--against-options": self.against_options is not None,
            "--turned": bool(self.turned),
            "--shift": bool(self.shift),
        }
        for option, is_given in given_options.items():
            if is_given:
                raise InputError(f"{option}: needs --against, the second rough body")


def _reading_of(text: str) -> Reading:
    """Return how a body is read and prepared by the quoted options of a text, or refuse them."""
    place = f"--against-options {quoted(text)}"
    program = typer.Typer(add_completion=False, rich_markup_mode=None)
    program.command()(command_line.grouped(_one_body))
    parser = typer.main.get_command(program)
    try:
        words = shlex.split(text)
        context = parser.make_context("describe", words, help_option_names=[])
    except command_line.CommandLineError as error:
        raise InputError(f"{place}: {error.format_message()}") from None
    except ValueError as error:  # a quotation mark that is not closed
        raise InputError(f"{place}: {error}") from None
    return Reading(**context.params)


def _one_body(*, reading: Reading) -> None:
    """Do nothing: this is the command whose options `_reading_of` parses."""


Units = Literal["mm", "si", "um"]


BAND_SIDES = ("soft", "stiff")
"""Sides of a law's band that have files of their own beside the law's, as law-abaqus-soft.inp."""


@dataclass(frozen=True)
class LawFormat:
    """A format in which a law is written."""

    option: str  # option that names the file, for messages
    ending: str  # end of the name that `--output NAME` gives the file
    has_sides: bool = False  # whether the `BAND_SIDES` have files beside it


LAW_FORMATS = {
    "table": LawFormat("--csv", ".csv"),
    "json": LawFormat("--json", ".json"),
    "header": LawFormat("--header", ".h"),
    "calculix": LawFormat("--calculix", "-calculix.inp", has_sides=True),
    "abaqus": LawFormat("--abaqus", "-abaqus.inp", has_sides=True),
    "for_4c": LawFormat("--4c", "_4c.py"),
}
"""Formats by the fields of `LawOutputs` that name their files; all are written by `--output`."""


class LawOutputs(NamedTuple):
    """Files to write a law to, each None unless the user names it, and the units of some."""

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
        """Tables with contacts solved between the loads too, for programs that join points."""
        if not self.check:
            return ()
        if self.header is not None:
            return ("delta", "pressure")
        if self.straight_lines or self.for_4c is not None:
            return ("pressure",)
        return ()

    @property
    def straight_lines(self) -> bool:
        """Whether a file is for a program that joins points by straight lines, to be judged."""
        return self.check and (self.calculix is not None or self.abaqus is not None)

    def resolved(self, stem: Path | None, inputs: Iterable[Path | str]) -> "LawOutputs":
        """Add the files that `--output` names, and refuse what cannot be written.

        Parameters
        ----------
        stem : Path or None
            Value of `--output`, with which the names of the files begin; None if it is not given.
        inputs : iterable of Path or str
            Files and folders that the command reads, which are not replaced.

        Returns
        -------
        LawOutputs
            These files, and one more for each format of `LAW_FORMATS` that has no name yet.

        Raises
        ------
        InputError
            If a name is none of a file, 4C cannot import its file, or a file cannot be written; see
            `gen.runtime.files.check_outputs`.
        """
        files = self
        if stem is not None:
            files = _named(files, stem)
        if files.for_4c is not None:
            _require_importable(files.for_4c)
        check_outputs(_outputs(files), inputs)
        return files


def _named(files: LawOutputs, stem: Path) -> LawOutputs:
    """Return files of a law with a name, which begins with that of `stem`, for each format."""
    if stem.name in {"", ".."}:
        raise InputError(
            f"--output {stem}: give what the names of the files begin with, as law"
        )
    paths: dict[str, Any] = {}
    for field, law_format in LAW_FORMATS.items():
        beginning = stem.name
        if field == "for_4c":  # a module of Python has no further point in its name
            beginning = beginning.replace(".", "_")
        if getattr(files, field) is None:
            paths[field] = stem.with_name(beginning + law_format.ending)
    return files._replace(**paths)


def _require_importable(path: Path) -> None:
    """Refuse a name of the file for 4C by which Python cannot import it."""
    is_module = path.suffix == ".py" and "." not in path.stem
    if not is_module or path.stem in sys.stdlib_module_names:
        raise InputError(
            f"--4c {path}: 4C imports it by its name, which has to end in .py, to have no other"
            " point, and not to be that of a module of Python"
        )


def _outputs(files: LawOutputs) -> Iterator[Output]:
    """Yield all files that a law is written to, also those of the sides of its band."""
    yield Output(files.picture, "--plot", "picture")
    for field, law_format in LAW_FORMATS.items():
        path = getattr(files, field)
        if path is None:
            continue
        yield Output(path, law_format.option)
        if law_format.has_sides:
            for side in BAND_SIDES:
                beside = path.parent / f"{path.stem}-{side}{path.suffix}"
                yield Output(beside, law_format.option)
