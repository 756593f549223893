"""Arguments and options of the commands of `python -m gen`, and groups that commands share.

An alias such as `Delta` annotates one argument of a command's function: it has the type, and the
description for Typer. A NamedTuple is a group of options, each a field, which
`gen.runtime.command_line.grouped` hands to Typer one by one.
"""

import math
import shlex
import sys
from collections.abc import Iterable, Iterator, Mapping
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
    from gen.material import Friction


OUT = ("--output", "-o")
"""Names of the option for the file or folder that a command writes."""


def _file(help_text: str, *names: str) -> Any:
    """Return an option for the path of a file to write.

    Without `names`, such as "--csv", Typer names the option after its field or argument.
    """
    return Option(*names, metavar="FILE", help=help_text)


Database = Annotated[Path, Argument(metavar="FILE", help="A database (HDF5).")]
SurfaceFiles = Annotated[
    list[Path],
    Argument(
        metavar="SURFACE...",
        help="Heights: .npy, text, instruments' (x3p, sur, gwy ...); or several, or folders.",
    ),
]
Table = Annotated[Path | None, _file("Also write the results as a CSV table.", "--csv")]
Json = Annotated[Path | None, _file("Also write the results as JSON.", "--json")]
Scene = Annotated[
    str,
    Argument(
        metavar="SCENE",
        help="A shipped scene, as quick, a TOML file, or a database, for its scene.",
    ),
]
NewDatabase = Annotated[Path, Option(*OUT, metavar="FILE", help="The database to write.")]
ExportFolder = Annotated[
    Path, Option(*OUT, metavar="FOLDER", help="The folder to write.")
]
Title = Annotated[str, Option(metavar="TEXT", help="Title of the dataset.")]
Creator = Annotated[
    str, Option(metavar="TEXT", help="Creator of the dataset, as it is to be cited.")
]
Licence = Annotated[
    str,
    Option(metavar="NAME", help="Licence of the dataset: an SPDX identifier, or URL."),
]
Doi = Annotated[
    str,
    Option(metavar="DOI", help="Identifier of the dataset, as 10.5281/zenodo.1234567."),
]
Rows = Annotated[
    str, Option(metavar="A:B", help="Only the rows A to B - 1, for job arrays.")
]
RetryFailed = Annotated[bool, Option("--retry-failed", help="Compute failed rows again.")]
Force = Annotated[
    bool, Option("--force", help="Continue a file of another physics number.")
]
SampleLimit = Annotated[
    float | None,
    Option(metavar="SECONDS", help="Leave rows pending that take longer than this."),
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
SlipShares = Annotated[
    str,
    Option(
        "--shear",
        metavar="SHARES",
        help="Shear forces over the one at which the bodies slide: 0.5 or start:stop:count.",
    ),
]
AtPressure = Annotated[
    float | None,
    Option(metavar="MPA", help="Pressure of the stick slope in CalculiX' file, in MPa."),
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
Error = Annotated[
    str,
    Option(
        metavar="ERROR",
        help="Solve on the coarsest grid that gives the area to this error at 95 %, as 3%; other"
        " answers as area=1%,mean_gap=2%.",
    ),
]
TimeLimit = Annotated[
    float | None,
    Option(
        metavar="SECONDS",
        help="With --error of a scene: stop after this time, and say what is left of each error.",
    ),
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
        help="Conductivity of a gas in the gap in W/(m K); its conductance is added.",
    ),
]
JumpDistance = Annotated[
    float | None,
    Option(metavar="UM", help="Jump distance of the gas at its pressure, in um."),
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
Kernel = Annotated[
    str, Option(help="Influence coefficients: uniform-pressure or concentrated-force.")
]
Boundary = Annotated[
    Literal["free", "periodic", "mirror"],
    Option(
        help="free: the patch alone; periodic: it repeats; mirror: mirror images continue it."
    ),
]
FarField = Annotated[str, Option(help="Far field of the bodies: rigid or compliant.")]
Tolerance = Annotated[
    float, Option(help="Largest residual of a solution, divided by Delta.")
]
MaxIterations = Annotated[int, Option(help="Largest number of iterations of the solver.")]
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
        "Write the surface's spectrum, radial and along x and y, over q = 2 pi/wavelength.",
        "--spectrum",
    ),
]
Join = Annotated[
    bool,
    Option(
        "--join",
        help="Join the spectra of scans of one surface at different magnifications.",
    ),
]
Picture = Annotated[Path | None, _file("Draw surface and contact.", "--plot")]
SurfacePicture = Annotated[
    Path | None, _file("Draw the surface and its spectrum.", "--plot")
]
NewPicture = Annotated[Path, Option(*OUT, metavar="PNG", help="The picture to write.")]
Recompute = Annotated[
    int, Option(metavar="N", min=0, help="Rows to recompute and compare.")
]
DatabaseOrScene = Annotated[
    str,
    Argument(
        metavar="FILE",
        help="A database (HDF5); or a scene with [expect], a shipped one or a TOML file.",
    ),
]
FirstSurfaces = Annotated[
    int,
    Option(
        "--surfaces",
        metavar="N",
        min=2,
        help="Surfaces of a scene to compute, for its means.",
    ),
]
Expect = Annotated[
    bool,
    Option("--expect", help="Print the means as a table [expect] for the scene."),
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
    list[Path] | None,
    Option(
        metavar="MAP",
        help="Instead of MAPS: a map, for a scene of surfaces like it. Again for more of its kind.",
    ),
]
LikeGenerator = Annotated[
    str,
    Option(
        metavar="NAME",
        help="With --like: spectral (a law) or like (its spectrum), whatever the contact says.",
    ),
]


class Material(NamedTuple):
    """The options about the material: elastic constants of one or two bodies, and the hardness.

    A single body is pressed on a rigid plane. The fields have the order of the parameters of
    `gen.material.Bodies.of`.
    """

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
        float | None,
        Option(
            metavar="MPA", help="E* of both bodies, instead of --young and --poisson."
        ),
    ] = None
    hardness: Annotated[
        float | None,
        Option(
            metavar="MPA",
            help="Hardness of the softer body, which yields at this pressure.",
        ),
    ] = None


class Layer(NamedTuple):
    """The options about a layer that is bonded to the first elastic body, or to a rigid one.

    The fields have the order of the parameters of `gen.material.Layer.of`.
    """

    layer_thickness: Annotated[
        float | None,
        Option(
            metavar="UM",
            help="Thickness of a layer that is bonded to the body of --young.",
        ),
    ] = None
    layer_young: Annotated[
        float | None, Option(metavar="MPA", help="Young's modulus of the layer.")
    ] = None
    layer_poisson: Annotated[
        float | None, Option(metavar="NU", help="Poisson's ratio of the layer [0].")
    ] = None
    layer_base: Annotated[
        Literal["elastic", "rigid"],
        Option(
            help="elastic: the layer lies on the body of --young; rigid: on a rigid one."
        ),
    ] = "elastic"


LayerPlace = Literal["mesh", "law"]
"""What has the uniform compression of a layer: the mesh, or the closure of the law."""

LayerIn = Annotated[
    LayerPlace,
    Option(
        help="mesh: the mesh contains the layer, so that the closure is without its uniform"
        " compression; law: the closure has it."
    ),
]


class Shear(NamedTuple):
    """The options about shear of two bodies of like elastic constants."""

    friction: Annotated[
        float | None,
        Option(
            metavar="F",
            help="Coefficient of friction: add stiffness in shear, elastic slip and slip curve.",
        ),
    ] = None
    like_bodies: Annotated[
        bool,
        Option(
            "--like-bodies",
            help="Take two bodies with unlike moduli for alike in shear.",
        ),
    ] = False

    def friction_of(self, material: Material) -> "Friction | None":
        """Return the friction of the bodies; None if --friction is left out.

        Parameters
        ----------
        material : Material
            The options about the material.

        Returns
        -------
        Friction or None
            Friction and Poisson's ratio of both bodies.

        Raises
        ------
        InputError
            If the bodies yield or are not alike, a number is not allowed, or --like-bodies was
            given without --friction.
        """
        from gen.material import Friction

        if self.friction is None:
            if self.like_bodies:
                raise InputError("--like-bodies goes with --friction")
            return None
        if material.hardness is not None:
            raise InputError(
                "--friction with --hardness: partial slip is that of elastic bodies; leave one"
                " of them out"
            )
        return Friction.of_options(
            self.friction,
            material.young,
            material.poisson,
            like_bodies=self.like_bodies,
        )


class Accuracy(NamedTuple):
    """The options about the errors of answers: those of the grid, or those that are asked for."""

    grid_error: GridError = True
    error: Error = ""

    def errors(self, context: typer.Context) -> dict[str, float] | None:
        """Parse --error, and refuse the options of a command that do not go with it.

        Parameters
        ----------
        context : typer.Context
            The command with the values of all of its options.

        Returns
        -------
        dict from str to float, or None
            Largest relative errors, by the names of the answers in `bem.answers.ANSWERS` [1]; None
            if the option is left out.

        Raises
        ------
        InputError
            If an option does not go with it, or its text names no errors.
        """
        if not self.error:
            return None
        from gen.maps.accuracy import errors_from

        refuse(context, NOT_WITH_ERROR, "--error")
        return errors_from(self.error)


class Refusal(NamedTuple):
    """What another option of a command refuses about an option."""

    allowed: object  # the only value that is not refused
    reason: str


NOT_WITH_ERROR = {
    "grid_error": Refusal(True, "answers within an error need the error of the grid"),
    "rtol": Refusal(None, "the tolerance of the solver follows from the error"),
    "kernel": Refusal("uniform-pressure", "answers of the other one belong to its grid"),
    "far_field": Refusal("rigid", "answers of the other one belong to its grid"),
    "flattened": Refusal(None, "it would have fewer nodes than the map"),
}
"""Options that --error refuses, by their parameters."""


NOT_WITH_MEANS = {
    "surfaces": Refusal(None, "the number of surfaces follows from the error"),
    "band": Refusal(None, "the band is the error of the means"),
}
"""Further options that --error refuses with a scene, by their parameters."""


NOT_WITH_LAYER = {
    "kernel": Refusal("uniform-pressure", "the other one is that of a half-space"),
    "far_field": Refusal("rigid", "the other one is that of a half-space"),
    "conductivity": Refusal(
        None, "the conductance follows from the stiffness on half-spaces only"
    ),
    "friction": Refusal(
        None, "partial slip follows from normal contacts on half-spaces only"
    ),
}
"""Options that --layer-thickness refuses, by their parameters."""


_WITHOUT_ROWS = "a scene has no rows yet"
NOT_WITH_SCENE = {
    "recompute": Refusal(None, _WITHOUT_ROWS),
    "seed": Refusal(None, _WITHOUT_ROWS),
    "repair": Refusal(False, _WITHOUT_ROWS),
}
"""Options of gen check that a scene refuses, by their parameters."""

NOT_WITH_DATABASE = {
    "surfaces": Refusal(None, "all rows of the database are averaged"),
}
"""Options of gen check that a database refuses, by their parameters."""


_OF_ONE_MAP = "its numbers are those of a single map"
NOT_WITH_JOIN = {
    "table": Refusal(None, "--spectrum writes the joined spectrum as CSV"),
    "json": Refusal(None, "--spectrum writes the joined spectrum as CSV"),
    "depth": Refusal(None, _OF_ONE_MAP),
    "against": Refusal(None, "scans of one surface are joined, not two bodies"),
}
"""Options that --join refuses, by their parameters."""


def refuse(
    context: typer.Context, refusals: Mapping[str, Refusal], other_option: str
) -> None:
    """Refuse the first option on the command line that does not go with another one.

    Parameters
    ----------
    context : typer.Context
        The command with the values of all of its options.
    refusals : mapping of str to Refusal
        Refused options by their parameters.
    other_option : str
        The option that refuses them, as "--error".

    Raises
    ------
    InputError
        If one of them was given with a value that is not allowed.
    """
    for parameter in context.command.params:
        name = str(parameter.name)
        if name not in refusals:
            continue
        refusal = refusals[name]
        source = context.get_parameter_source(name)
        is_given = source is not None and source.name == "COMMANDLINE"
        value = context.params[name]
        if not is_given or value == refusal.allowed:
            continue
        option = parameter.opts[0]
        if value is False:
            option = parameter.secondary_opts[0]
        raise InputError(f"{option}: leave it out with {other_option}: {refusal.reason}")


class Against(NamedTuple):
    """The options about a second rough body, against which surfaces are pressed.

    The second body is read and prepared by the options of the first body. If --against-options is
    given, only the options in its value apply.
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
        """Make the record of the second body from its options.

        If the user gave `--against-options`, a warning on standard error says that version 2.0 will
        not have it.

        Parameters
        ----------
        first : Reading
            How the first body is read and prepared. The second body is read and prepared alike
            unless the user gave `--against-options`.

        Returns
        -------
        Opposite or None
            The second body and its place on the first one. Its file is not read yet. None if the
            user gave no second body.

        Raises
        ------
        InputError
            If the value of an option is not allowed, or an option is given without `--against`.
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
        body = Opposite(
            path=self.against,
            reading=first,
            turned=turned,
            shift=(distances[0], distances[1]),
        )
        if self.against_options is None:
            return body
        reading_of_second = _reading_of(self.against_options)
        command_line.warn_deprecated(
            "--against-options",
            "prepare the second map in another program, which saves it with its lengths",
        )
        return replace(body, reading=reading_of_second, shared=False)

    def _refuse_alone(self) -> None:
        """Refuse the first option of a second body that is given, because --against is not."""
        given_options = {
            "--against-options": self.against_options is not None,
            "--turned": bool(self.turned),
            "--shift": bool(self.shift),
        }
        for option, is_given in given_options.items():
            if is_given:
                raise InputError(f"{option}: needs --against, the second rough body")


def _reading_of(text: str) -> Reading:
    """Parse the value of --against-options, such as "--side 500 --fill".

    Returns how the second body is read and prepared. Raises InputError for options that do not
    exist or have no such value.
    """
    place = f"--against-options {quoted(text)}"
    # A program whose only command has the options of `Reading` parses the text.
    program = typer.Typer(add_completion=False, rich_markup_mode=None)
    program.command()(command_line.grouped(_one_body))
    parser = typer.main.get_command(program)
    try:
        words = shlex.split(text)
        # An empty list disables --help, which would end the command.
        context = parser.make_context("describe", words, help_option_names=[])
    except command_line.CommandLineError as error:
        raise InputError(f"{place}: {error.format_message()}") from None
    except ValueError as error:  # a quotation mark that is not closed
        raise InputError(f"{place}: {error}") from None
    return Reading(**context.params)


def _one_body(*, reading: Reading) -> None:
    """Do nothing: `_reading_of` needs a command with these options, and never runs it."""


Units = Literal["mm", "si", "um"]
"""Systems of units of the files for CalculiX, Abaqus and 4C; see the help of --units."""


BAND_SIDES = ("soft", "stiff")
"""Limits of a law's band. Each has a file beside that of the law, such as law-abaqus-soft.inp."""


@dataclass(frozen=True)
class LawFormat:
    """A format in which a law is written to a file."""

    option: str  # option that names the file, for messages
    ending: str  # what `--output NAME` appends to NAME, such as ".csv"
    # Endings of the stems of further files: the sides of the band, or the argument of a table.
    further: tuple[str, ...] = ()
    by_stem: bool = True  # whether `--output` writes this format


LAW_FORMATS = {
    "table": LawFormat("--csv", ".csv"),
    "json": LawFormat("--json", ".json"),
    "header": LawFormat("--header", ".h"),
    "calculix": LawFormat("--calculix", "-calculix.inp", further=BAND_SIDES),
    "abaqus": LawFormat("--abaqus", "-abaqus.inp", further=BAND_SIDES),
    "for_4c": LawFormat("--4c", "_4c.py"),
    "moose": LawFormat("--moose", "-moose.csv", further=("closure",), by_stem=False),
    "ansys": LawFormat("--ansys", "-ansys.inp", by_stem=False),
    "comsol": LawFormat("--comsol", "-comsol.txt", further=("closure",), by_stem=False),
}
"""Formats by the field of `LawOutputs` that names the file."""


class LawOutputs(NamedTuple):
    """The options about the files of a law.

    Each path is None if its option is left out.
    """

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
    moose: Annotated[Path | None, _file("Write MOOSE's table of functions.")] = None
    ansys: Annotated[Path | None, _file("Write Ansys' tables in APDL.")] = None
    comsol: Annotated[Path | None, _file("Write COMSOL's interpolation functions.")] = (
        None
    )
    picture: Annotated[Path | None, _file("Draw the law with its band.", "--plot")] = None
    units: Annotated[
        Units,
        Option(
            help="Units of files for programs: mm (mm, N, s, MPa), si or um (with MPa)."
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
        """Tables for which contacts are solved between the loads too.

        "delta" is the table over Delta, "pressure" the table over the nominal pressure. A table is
        refined for these files: both tables for a C header, the one over pressure for CalculiX,
        Abaqus and 4C. Tables for MOOSE, Ansys and COMSOL have the loads of the law alone. With
        --no-check no table is refined.
        """
        if not self.check:
            return ()
        if self.header is not None:  # it has both tables
            return ("delta", "pressure")
        if self.straight_lines or self.for_4c is not None:
            return ("pressure",)
        return ()

    @property
    def straight_lines(self) -> bool:
        """Whether to judge how far straight lines between the points are off.

        It is judged for the files of CalculiX and Abaqus, which may have further points.
        """
        return self.check and (self.calculix is not None or self.abaqus is not None)

    def resolved(self, stem: Path | None, inputs: Iterable[Path | str]) -> "LawOutputs":
        """Add the files that `--output` names, and refuse files that cannot be written.

        Parameters
        ----------
        stem : Path or None
            Value of `--output`, with which the names of the files begin; None if it is left out.
        inputs : iterable of Path or str
            Files and folders that the command reads, which are not replaced.

        Returns
        -------
        LawOutputs
            A copy. If `stem` is given, every format that `--output` writes has a path.

        Raises
        ------
        InputError
            If `stem` has no name, 4C could not import its file, or a file cannot be written; see
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
    """Return a copy of files of a law in which every format that `--output` writes has a path.

    Paths that the user gave stay. The others are `stem`, the value of --output, with the ending of
    the format. Raises InputError if `stem` has no name.
    """
    if stem.name in {"", ".."}:
        raise InputError(
            f"--output {stem}: give what the names of the files begin with, as law"
        )
    paths: dict[str, Any] = {}
    for field, law_format in LAW_FORMATS.items():
        is_named = getattr(files, field) is not None  # by an option of its own
        if is_named or not law_format.by_stem:
            continue
        beginning = stem.name
        # 4C imports its file as a module, and the name of a module has no point.
        if field == "for_4c":
            beginning = beginning.replace(".", "_")
        paths[field] = stem.with_name(beginning + law_format.ending)
    return files._replace(**paths)


def _require_importable(path: Path) -> None:
    """Refuse a file for 4C that Python cannot import by its name.

    A module of Python's standard library would be imported instead of a file with its name.
    """
    is_module = path.suffix == ".py" and "." not in path.stem
    if not is_module or path.stem in sys.stdlib_module_names:
        raise InputError(
            f"--4c {path}: 4C imports it by its name, which has to end in .py, to have no other"
            " point, and not to be that of a module of Python"
        )


def _outputs(files: LawOutputs) -> Iterator[Output]:
    """Yield all files that a law may be written to: the picture, the formats, and further files.

    Files whose options are left out are not yielded.
    """
    if files.picture is not None:
        yield Output(files.picture, "--plot", kind="picture")
    for field, law_format in LAW_FORMATS.items():
        path = getattr(files, field)
        if path is None:
            continue
        yield Output(path, law_format.option)
        for ending in law_format.further:
            further_file = path.with_stem(f"{path.stem}-{ending}")
            yield Output(further_file, law_format.option)
