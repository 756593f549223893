"""The columns of a database: the one place that names them.

Database files, checks, statistics and the manual's table of columns are derived from `COLUMNS`.
Lengths are in um, pressures in MPa, forces in uN.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import TYPE_CHECKING, Literal

from gen.runtime.errors import InputError

if TYPE_CHECKING:
    from gen.scene import Scene

SCHEMA = 1
"""Number of the file layout: a file of another layout is refused."""

PART = 2
"""Number of the layout of parts, which add the attributes `first_row` and `rows`. It differs from
`SCHEMA` so that versions that know whole databases only refuse parts."""

PHYSICS = 11
"""Number of the results: raised whenever a change of the code changes a deterministic column."""

PHYSICS_CHANGES: dict[int, str] = {
    11: "one active set on masks solves all contacts: areas differ by single nodes, forces within"
    " the tolerance, and iterations and convolutions are counted anew",
}
"""For each physics number since the solver is one, how it changed the results, in one sentence.
Earlier numbers, up to 4 for all scenes and up to 10 for some, are those of earlier solvers."""

SHARE, AMOUNT = (0.0, 100.0), (0.0, math.inf)
"""Bounds of percentages, and of quantities that cannot be negative."""

RUNTIME = "runtime"
"""Group of the columns that differ from run to run: times, ranks, hosts."""


class Status(IntEnum):
    """Progress of a row: not computed yet, computed, or impossible to compute."""

    PENDING = 0
    DONE = 1
    FAILED = 2


class Reason(IntEnum):
    """Cause of a row's failure, or of the statistics that a done row lacks."""

    NONE = 0
    NOT_CONVERGED = 1
    NO_SOLUTION = 2
    NO_STATISTICS = 3
    ARITHMETIC = 4
    NOT_FINITE = 5
    BEYOND_HARDNESS = 6
    FULL_CONTACT = 7


REASONS: dict[int, str] = {
    Reason.NONE: "",
    Reason.NOT_CONVERGED: "not converged within the iteration bound",
    Reason.NO_SOLUTION: "no solution: compliant far field beyond Delta*",
    Reason.NO_STATISTICS: "statistics undefined on this surface",
    Reason.ARITHMETIC: "the sample raised an arithmetic or value error",
    Reason.NOT_FINITE: "result not finite",
    Reason.BEYOND_HARDNESS: "no solution: the load is at or above what the hardness bears",
    Reason.FULL_CONTACT: "no solution: Delta at or beyond full contact of a patch without edges",
}
"""Texts of the reasons by their codes."""

DONE_REASONS = (Reason.NONE, Reason.NO_STATISTICS)
"""Reasons that a done row can have: its contact is solved, whatever its surface defines."""


@dataclass(frozen=True)
class Column:
    """One quantity that a database holds for every sample.

    Attributes
    ----------
    name : str
        Name of the column.
    dtype : str
        Type of one value, in numpy's notation.
    unit : str
        Unit of the values; "1" for pure numbers, "" for texts.
    long_name : str
        Meaning of the column in words.
    group : str
        Group inside the file: "" for results, `RUNTIME` for times, ranks and hosts.
    deterministic : bool
        Whether the scene alone decides the bytes.
    paper_range : tuple of float or None
        Smallest and largest value in the paper's Table 1; None if the table lacks the quantity.
    shape_of : str
        "" for one value per sample, "nodes" for a field of shape (rows, nx, ny).
    optional : str
        Key of the scene that adds the column, in Markdown; "" for a column of every database.
    bounds : tuple of float
        Least and most that a value can be, where the quantity has bounds.
    """

    name: str
    dtype: str
    unit: str
    long_name: str
    group: str = ""
    deterministic: bool = True
    paper_range: tuple[float, float] | None = None
    shape_of: Literal["", "nodes"] = ""
    optional: str = ""
    bounds: tuple[float, float] = (-math.inf, math.inf)

    @property
    def path(self) -> str:
        """Name inside the file, with the group in front."""
        return f"{self.group}/{self.name}" if self.group else self.name

    @property
    def fill(self) -> float | int | bytes:
        """Value of a row that has not been written: NaN, 0 or an empty text."""
        fills: dict[str, float | int | bytes] = {"f": math.nan, "S": b""}
        return fills.get(self.dtype[0], 0)

    def shape(self, rows: int, grid: tuple[int, int]) -> tuple[int, ...]:
        """Return the shape of the values of `rows` samples on a grid of nx x ny nodes."""
        return (rows, *grid) if self.shape_of else (rows,)

    def row_bytes(self, grid: tuple[int, int]) -> int:
        """Return the size of one sample's value on a grid of nx x ny nodes [bytes]."""
        return int(self.dtype[1:]) * math.prod(self.shape(1, grid))


def _statistic(name: str, unit: str, long_name: str, lowest: float, highest: float) -> Column:
    """Make the column of one of the 22 statistics, with its range in Table 1."""
    return Column(name, "f8", unit, long_name, paper_range=(lowest, highest))


# Table 1's order. Which kurtosis is Pearson's (normal: 3) and which is the excess (normal: 0)
# is what the table's ranges show; the names say it, because the paper does not.
_STATISTICS = (
    _statistic("peak_mean", "um", "mean height of profile peaks", 8.20, 47.51),
    _statistic("peak_rms", "um", "standard deviation of profile peak heights", 2.54, 15.49),
    _statistic("peak_kurtosis_pearson", "1", "Pearson kurtosis of peak heights", 1.56, 7.13),
    _statistic("peak_skewness", "1", "skewness of profile peak heights", -1.34, 1.36),
    _statistic("peak_density", "1", "profile peaks per node and direction", 0.19, 0.27),
    _statistic("peak_curvature_mean", "um-1", "mean curvature of profile peaks", 0.015, 0.066),
    _statistic(
        "peak_curvature_kurtosis_excess", "1", "excess kurtosis of peak curvatures", -0.07, 5.35
    ),
    _statistic("peak_curvature_skewness", "1", "skewness of peak curvatures", 0.55, 1.15),
    _statistic("bandwidth_x", "1", "Nayak's bandwidth parameter along x", 4.06, 46.19),
    _statistic("bandwidth_y", "1", "Nayak's bandwidth parameter along y", 4.19, 48.52),
    _statistic("asperity_mean", "um", "mean height of asperities", 8.54, 48.18),
    _statistic("asperity_rms", "um", "standard deviation of asperity heights", 2.56, 15.60),
    _statistic("asperity_kurtosis_excess", "1", "excess kurtosis of asperity heights", -1.45, 4.26),
    _statistic("asperity_skewness", "1", "skewness of asperity heights", -1.34, 1.48),
    _statistic("asperity_density", "1", "asperities per node", 0.08, 0.13),
    _statistic("asperity_curvature_mean", "um-1", "mean curvature of asperities", 0.017, 0.072),
    _statistic(
        "asperity_curvature_rms", "um-1", "standard deviation of asperity curvatures", 0.007, 0.031
    ),
    _statistic(
        "asperity_curvature_kurtosis_pearson",
        "1",
        "Pearson kurtosis of asperity curvatures",
        2.81,
        15.14,
    ),
    _statistic("asperity_curvature_skewness", "1", "skewness of asperity curvatures", 0.41, 1.6),
    _statistic("height_mean", "um", "mean height of the surface", 7.71, 45.36),
    _statistic("height_max", "um", "largest height of the surface", 16.36, 79.25),
    _statistic("height_rms", "um", "standard deviation of the surface's heights", 2.62, 15.55),
)

_RMD = "the generators of random midpoint displacement"
_SPECTRAL = "the generator `spectral`"
_PARAMETERS = (
    Column(
        "hurst",
        "f8",
        "1",
        "Hurst exponent of the surface",
        paper_range=(0.5, 0.8),
        optional=f"{_RMD} and {_SPECTRAL}",
    ),
    Column(
        "sigma0",
        "f8",
        "um",
        "standard deviation of the generator's first displacement",
        optional=_RMD,
    ),
    Column("roll_off", "f8", "um", "longest wavelength of the power law", optional=_SPECTRAL),
    Column("cut_off", "f8", "um", "shortest wavelength", optional=_SPECTRAL),
    Column("drawn_rms_height", "f8", "um", "rms height drawn for the spectrum", optional=_SPECTRAL),
    Column("drawn_rms_slope", "f8", "1", "rms slope drawn for the spectrum", optional=_SPECTRAL),
    Column("stretch", "f8", "1", "wavelengths along x over those along y", optional=_SPECTRAL),
)

DRAWN_NAMES = {"rms_height": "drawn_rms_height", "rms_slope": "drawn_rms_slope"}
"""Parameters whose names could be taken for measured statistics, and the names of their columns.
Files made before 1.0.0 have these columns under the names of the parameters."""

STATUS = Column("status", "u1", "1", "0 pending, 1 done, 2 failed; written last")
REASON = Column("reason", "u1", "1", "why the sample failed, or lacks statistics: a code")

COLUMNS: tuple[Column, ...] = (
    STATUS,
    REASON,
    Column("surface", "i8", "1", "index of the surface, shared by its samples"),
    Column("map", "i4", "1", "index of the surface's map", optional="the generator `scans`"),
    Column(
        "tile",
        "i4",
        "1",
        "index of the tile of all maps, or of paired tiles",
        optional="the generator `scans`",
    ),
    *_PARAMETERS,
    Column(
        "load",
        "f8",
        "1",
        "load in the unit of the scene's quantity",
        optional="a `[load]` other than Delta",
    ),
    Column("delta", "f8", "um", "far-field displacement Delta", paper_range=(5.0, 45.0)),
    Column(
        "hardness",
        "f8",
        "MPa",
        "hardness of the softer body",
        optional="a range of `contact.hardness`",
    ),
    *_STATISTICS,
    Column(
        "area_percent",
        "f8",
        "%",
        "effective contact area",
        paper_range=(0.01, 16.56),
        bounds=SHARE,
    ),
    Column(
        "force",
        "f8",
        "uN",
        "normal force at the scene's modulus (1 uN = 1 MPa um2)",
        bounds=AMOUNT,
    ),
    Column("contact_nodes", "i4", "1", "nodes under pressure", bounds=AMOUNT),
    Column(
        "yielded_percent",
        "f8",
        "%",
        "share of nodes at the hardness",
        optional="`contact.hardness`",
        bounds=SHARE,
    ),
    Column("iterations", "i4", "1", "iterations of the solver"),
    Column("convolutions", "i4", "1", "applications of the influence operator"),
    Column("residual", "f8", "1", "relative residual of the solution"),
    Column(
        "mean_gap",
        "f8",
        "um",
        "mean gap over all nodes",
        optional="`store.mean_gap`",
        bounds=AMOUNT,
    ),
    Column(
        "largest_pressure",
        "f8",
        "MPa",
        "largest pressure",
        optional="`store.largest_pressure`",
        bounds=AMOUNT,
    ),
    Column(
        "perimeter",
        "f8",
        "um",
        "length of the contact's edges",
        optional="`store.perimeter`",
        bounds=AMOUNT,
    ),
    Column(
        "stiffness",
        "f8",
        "N/m",
        "stiffness of unloading, infinite at full contact without edges",
        optional="`store.stiffness`",
        bounds=AMOUNT,
    ),
    Column(
        "interface_stiffness",
        "f8",
        "N/m",
        "the same without the patch's own compliance, infinite at full contact",
        optional="`store.interface_stiffness`",
        bounds=AMOUNT,
    ),
    Column(
        "contact_spots",
        "i4",
        "1",
        "spots of contact",
        optional="`store.contact_spots`",
        bounds=AMOUNT,
    ),
    Column(
        "largest_spot_percent",
        "f8",
        "%",
        "share of the contact area in the largest spot",
        optional="`store.largest_spot_percent`",
        bounds=SHARE,
    ),
    Column(
        "contact_connects",
        "u1",
        "1",
        "opposite sides that contact connects: 0 none, 1 along x, 2 along y, 3 both",
        optional="`store.contact_connects`",
    ),
    Column(
        "gap_connects",
        "u1",
        "1",
        "opposite sides that the gap connects, in the same way",
        optional="`store.gap_connects`",
    ),
    Column(
        "corrected_area_percent",
        "f8",
        "%",
        "contact area less what the cells along its perimeter add",
        optional="`store.corrected_area_percent`",
        bounds=SHARE,
    ),
    Column("heights", "f8", "um", "surface heights", shape_of="nodes", optional="`store.heights`"),
    Column(
        "pressure", "f8", "MPa", "contact pressure", shape_of="nodes", optional="`store.pressure`"
    ),
    # "s", not "seconds": xarray would turn the word into a time difference.
    Column("surface_seconds", "f8", "s", "time for the surface", RUNTIME, deterministic=False),
    Column(
        "solve_seconds", "f8", "s", "time for the contact problem", RUNTIME, deterministic=False
    ),
    Column("rank", "i4", "1", "MPI rank that computed the sample", RUNTIME, deterministic=False),
    Column("host", "S64", "", "machine that computed the sample", RUNTIME, deterministic=False),
)
"""Every column that a database can have, in the order of the file."""


INFINITE_AT_FULL_CONTACT = frozenset(("stiffness", "interface_stiffness"))
"""Columns that full contact makes infinite."""


def columns_for(scene: Scene) -> tuple[Column, ...]:
    """Return the columns of a scene's database, in the order of the file.

    Parameters
    ----------
    scene : Scene
        The scene, whose `optional_columns` names the optional columns that it asks for.

    Returns
    -------
    tuple of Column
        The columns that every database has, the optional ones that the scene asks for, and those
        of the parameters and outputs of a user's functions.
    """
    parameters = parameter_columns(scene)
    asked_for = {parameters.get(name, name) for name in scene.optional_columns}
    chosen = [column for column in COLUMNS if not column.optional or column.name in asked_for]
    names = [column.name for column in chosen]
    if "load" in names:
        load = names.index("load")
        chosen[load] = replace(chosen[load], unit=scene.load_unit, long_name=scene.quantity)
    own = tuple(
        Column(name, "f8", "1", f"parameter of {scene.surface.generator}")
        for name in parameters.values()
        if name not in names
    )
    outputs = tuple(
        Column(
            name, "f8", unit, f"output of {scene.store.function}", bounds=scene.store.bounds(name)
        )
        for name, unit in (scene.store.outputs or {}).items()
    )
    place = names.index("surface") + 1
    last = next(index for index, column in enumerate(chosen) if column.group)
    return (*chosen[:place], *own, *chosen[place:last], *outputs, *chosen[last:])


def parameter_columns(scene: Scene) -> dict[str, str]:
    """Return the columns of the parameters of a scene's surfaces, by the parameters' names."""
    return {name: DRAWN_NAMES.get(name, name) for name in scene.drawn_parameters}


def made_by_another(physics: int) -> str:
    """Say that another solver made results of a number; an empty text if it was this one."""
    if physics == PHYSICS:
        return ""
    which = "an earlier" if physics < PHYSICS else "a later"
    return f"made by {which} solver (physics {physics}, this version computes {PHYSICS})"


RESERVED = frozenset(
    (*(column.name for column in COLUMNS), *DRAWN_NAMES, RUNTIME, "sample", "x", "y", "area")
)
"""Names that outputs of a user's function cannot have: columns, dimensions, groups and targets."""


ARGUMENTS = ("shape", "spacing", "rng")
"""Names that parameters of a user's generator cannot have, which is called with these."""

TAKEN = "is the name of something else; give a name of your own"


def require_own_names(scene: Scene) -> None:
    """Refuse parameters and outputs of a user's functions that have the names of other columns.

    Parameters of a user's generator may have the names that other generators' parameters have.

    Parameters
    ----------
    scene : Scene
        The scene.

    Raises
    ------
    InputError
        With the first name that is taken.
    """
    known = {column.name for column in _PARAMETERS} - {*DRAWN_NAMES.values()} | DRAWN_NAMES.keys()
    for name in scene.drawn_parameters:
        if name in RESERVED - known or name in ARGUMENTS:
            raise InputError(f"surface.parameters.{name}: {name} {TAKEN}, as own_{name}")
    for name in scene.store.outputs or ():
        if name in RESERVED or name in scene.drawn_parameters:
            raise InputError(f"store.outputs.{name}: {name} {TAKEN}, as own_{name}")
    outputs = scene.store.outputs
    for name in (*(scene.store.least or ()), *(scene.store.most or ())):
        if outputs is not None and name not in outputs:
            raise InputError(f"store: {name} has bounds; the outputs are {', '.join(outputs)}")


def row_bytes(scene: Scene) -> int:
    """Return the size of one row of a scene's database, all columns together [bytes]."""
    return sum(column.row_bytes(scene.shape) for column in columns_for(scene))


def statistics_columns() -> tuple[Column, ...]:
    """Return the columns of the 22 statistics, in the order of the paper's Table 1."""
    return _STATISTICS


def markdown_table() -> str:
    """Write the table of columns that stands in `docs/how-to/reading.md`.

    Returns
    -------
    str
        Lines of Markdown: name, unit, meaning and the paper's range of every column.
    """
    lines = ["| Column | Unit | Meaning | Paper's range |", "|---|---|---|---|"]
    for column in COLUMNS:
        span = "{:g} to {:g}".format(*column.paper_range) if column.paper_range else ""
        shape = ", nx x ny per sample" if column.shape_of else ""
        condition = f" (with {column.optional})" if column.optional else ""
        meaning = f"{column.long_name}{shape}{condition}"
        lines.append(f"| `{column.path}` | {column.unit} | {meaning} | {span} |")
    return "\n".join(lines)
