"""The columns of databases apart from those of generators, and the numbers of layout and results.

The columns of generators are their parameters, and places of surfaces; `gen.scene.columns` adds
them. Lengths are in um, pressures in MPa, forces in uN.
"""

import math
from dataclasses import dataclass
from enum import IntEnum
from typing import Literal

from gen.quantities import (
    DELTA,
    LAYER_MODULUS,
    LAYER_THICKNESS,
    OF_LAYERS,
    Powers,
    Quantity,
    stored_quantities,
)

SCHEMA = 1
"""Number of the layout of a database's file. Files with another number are refused."""

PART = 2
"""Number of the layout of a file with a part of a database, which has two more attributes,
`first_row` and `rows`. It differs from `SCHEMA`, so that older versions, which do not know parts,
refuse the file."""

PHYSICS = 14
"""Number of the results. It is raised whenever the values of a deterministic column change."""

PHYSICS_CHANGES: dict[int, str] = {
    11: "one active set on masks solves all contacts: areas differ by single nodes, forces within"
    " the tolerance, and iterations and convolutions are counted anew",
    12: "contacts begin from a coarser grid from 500 nodes a side on, and take other first steps:"
    " forces differ within the tolerance, and iterations and convolutions are counted anew",
    13: "contacts take longer first steps, and full contact is the start under high loads at any"
    " size: forces differ within the tolerance, and iterations and convolutions are counted anew",
    14: "areas in the continuum fall by up to 3 % on oblong cells, and contacts take other starts:"
    " forces differ within the tolerance, and iterations and convolutions are counted anew",
}
"""Changes of the results by the `PHYSICS` number that they led to. The list begins with the solver
that solves all contacts. Earlier solvers computed the results with numbers up to 4 for all scenes,
and up to 10 for some scenes."""

RUNTIME = "runtime"
"""Group of the file with the columns that differ from run to run: times, ranks and hosts."""


class Status(IntEnum):
    """Progress of a row: not computed yet, computed, or impossible to compute."""

    PENDING = 0
    DONE = 1
    FAILED = 2


class Reason(IntEnum):
    """Cause of a row's failure, or reason why a done row lacks statistics; NONE for other rows."""

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
"""Descriptions of the reasons by their codes."""

DONE_REASONS = (Reason.NONE, Reason.NO_STATISTICS)
"""Reasons of done rows, whose contact is solved."""


@dataclass(frozen=True)
class Column:
    """One quantity that a database holds for every sample.

    Attributes
    ----------
    name : str
        Name of the column, without its group.
    dtype : str
        Type of one value, in numpy's notation.
    unit : str
        Unit of a value; "1" for pure numbers, "" for texts.
    long_name : str
        Meaning of the column, in words.
    group : str
        Group inside the file: "" for results, `RUNTIME` for times, ranks and hosts.
    deterministic : bool
        Whether the bytes depend on the scene alone, and not on the run.
    paper_range : tuple of two float or None
        Range in the paper's Table 1; None for a column that is not in the table.
    shape_of : {"", "nodes"}
        "nodes" for a field of shape (rows, nx, ny), "" for one value a row.
    optional : str
        Condition for the column, in Markdown; mostly a key of the scene. "" if every database has
        the column.
    bounds : tuple of two float
        Smallest and largest possible value.
    powers : Powers or None
        Powers of heights, lengths and E* with which the values scale. None if the values do not
        scale with powers, or the powers are not known.
    measured : bool
        Whether the powers are measured by a run and recorded in the file, as for a user's output.
    cost : str
        Computation that the column needs in addition to the contact; "" if it needs none.
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
    powers: Powers | None = None
    measured: bool = False
    cost: str = ""

    @property
    def path(self) -> str:
        """Name inside the file: the group, a slash and the name, or the name alone."""
        if not self.group:
            return self.name
        return f"{self.group}/{self.name}"

    @property
    def fill(self) -> float | int | bytes:
        """Value of a row that has not been written: NaN, an empty text, or 0 for whole numbers."""
        fills: dict[str, float | int | bytes] = {"f": math.nan, "S": b""}
        kind = self.dtype[0]  # numpy's letter for the kind of a type
        return fills.get(kind, 0)

    def shape(self, rows: int, grid: tuple[int, int]) -> tuple[int, ...]:
        """Return the shape of the array of values of several rows.

        Parameters
        ----------
        rows : int
            Number of rows.
        grid : tuple of two int
            Nodes along x and y.

        Returns
        -------
        tuple of int
            (rows,), or (rows, nx, ny) for a field.
        """
        if self.shape_of == "nodes":
            return (rows, *grid)
        return (rows,)

    def row_bytes(self, grid: tuple[int, int]) -> int:
        """Return the size of the value of one row.

        Parameters
        ----------
        grid : tuple of two int
            Nodes along x and y.

        Returns
        -------
        int
            Size of a number, of a text or of a whole field [bytes].
        """
        bytes_of_value = int(self.dtype[1:])  # as 8 of "f8"; of a text, its length
        return bytes_of_value * math.prod(self.shape(1, grid))


def _statistic(
    name: str, unit: str, long_name: str, paper_range: tuple[float, float]
) -> Column:
    """Make the column of a roughness statistic, with its range in the paper's Table 1."""
    return Column(
        name=name, dtype="f8", unit=unit, long_name=long_name, paper_range=paper_range
    )


TABLE_1 = (
    _statistic("peak_mean", "um", "mean height of profile peaks", (8.20, 47.51)),
    _statistic(
        "peak_rms", "um", "standard deviation of profile peak heights", (2.54, 15.49)
    ),
    _statistic(
        "peak_kurtosis_pearson", "1", "Pearson kurtosis of peak heights", (1.56, 7.13)
    ),
    _statistic("peak_skewness", "1", "skewness of profile peak heights", (-1.34, 1.36)),
    _statistic("peak_density", "1", "profile peaks per node and direction", (0.19, 0.27)),
    _statistic(
        "peak_curvature_mean", "um-1", "mean curvature of profile peaks", (0.015, 0.066)
    ),
    _statistic(
        "peak_curvature_kurtosis_excess",
        "1",
        "excess kurtosis of peak curvatures",
        (-0.07, 5.35),
    ),
    _statistic(
        "peak_curvature_skewness", "1", "skewness of peak curvatures", (0.55, 1.15)
    ),
    _statistic("bandwidth_x", "1", "Nayak's bandwidth parameter along x", (4.06, 46.19)),
    _statistic("bandwidth_y", "1", "Nayak's bandwidth parameter along y", (4.19, 48.52)),
    _statistic("asperity_mean", "um", "mean height of asperities", (8.54, 48.18)),
    _statistic(
        "asperity_rms", "um", "standard deviation of asperity heights", (2.56, 15.60)
    ),
    _statistic(
        "asperity_kurtosis_excess",
        "1",
        "excess kurtosis of asperity heights",
        (-1.45, 4.26),
    ),
    _statistic("asperity_skewness", "1", "skewness of asperity heights", (-1.34, 1.48)),
    _statistic("asperity_density", "1", "asperities per node", (0.08, 0.13)),
    _statistic(
        "asperity_curvature_mean", "um-1", "mean curvature of asperities", (0.017, 0.072)
    ),
    _statistic(
        "asperity_curvature_rms",
        "um-1",
        "standard deviation of asperity curvatures",
        (0.007, 0.031),
    ),
    _statistic(
        "asperity_curvature_kurtosis_pearson",
        "1",
        "Pearson kurtosis of asperity curvatures",
        (2.81, 15.14),
    ),
    _statistic(
        "asperity_curvature_skewness", "1", "skewness of asperity curvatures", (0.41, 1.6)
    ),
    _statistic("height_mean", "um", "mean height of the surface", (7.71, 45.36)),
    _statistic("height_max", "um", "largest height of the surface", (16.36, 79.25)),
    _statistic(
        "height_rms", "um", "standard deviation of the surface's heights", (2.62, 15.55)
    ),
)
"""Columns of the 22 statistics in the paper's order. The paper does not say whether a kurtosis is
Pearson's (3 for a normal distribution) or the excess (0 for a normal distribution). The ranges of
its table show which one it is, and the names of the columns say it."""

DRAWN_NAMES = {"rms_height": "drawn_rms_height", "rms_slope": "drawn_rms_slope"}
"""Names of columns by the names of their parameters, for parameters whose names could be taken for
measured statistics. All other parameters share the names of their columns. In files made before
1.0.0 these columns have the names of the parameters."""

STATUS = Column(
    name="status",
    dtype="u1",
    unit="1",
    long_name="0 pending, 1 done, 2 failed; written last",
)
REASON = Column(
    name="reason",
    dtype="u1",
    unit="1",
    long_name="why the sample failed, or lacks statistics: a code",
)
CHECKSUM = Column(
    name="checksum",
    dtype="u4",
    unit="1",
    long_name=(
        "CRC-32 of the bytes of the row's other columns in this group, in the order of their names"
    ),
    optional="every new database; older ones lack it",
)


_OPTIONAL = {"always": "", "hardness": "`contact.hardness`", "asked": "`store.{}`"}
"""Conditions for the column of a quantity, by the quantity's attribute `stored`. The braces are
replaced by the name of the quantity."""


def _column(quantity: Quantity) -> Column:
    """Make the column of a quantity that is computed for each contact."""
    return Column(
        name=quantity.name,
        dtype=quantity.dtype,
        unit=quantity.unit,
        long_name=quantity.words,
        paper_range=quantity.paper_range,
        shape_of="nodes" if quantity.per_node else "",
        optional=_OPTIONAL[quantity.stored].format(quantity.name),
        bounds=quantity.bounds,
        powers=quantity.powers,
        cost=quantity.cost,
    )


def _runtime(name: str, dtype: str, unit: str, long_name: str) -> Column:
    """Make a column whose values differ from run to run."""
    return Column(
        name=name,
        dtype=dtype,
        unit=unit,
        long_name=long_name,
        group=RUNTIME,
        deterministic=False,
    )


_LOAD = "load in the unit of the scene's quantity"
_HARDNESS = "hardness of the softer body"
_RESULTS = [quantity for quantity in stored_quantities() if quantity is not DELTA]

COLUMNS: tuple[Column, ...] = (
    STATUS,
    REASON,
    CHECKSUM,
    Column("surface", "i8", "1", "index of the surface, shared by its samples"),
    Column("load", "f8", "1", _LOAD, optional="a `[load]` other than Delta"),
    _column(DELTA),
    Column("hardness", "f8", "MPa", _HARDNESS, optional="a range of `contact.hardness`"),
    Column(
        LAYER_THICKNESS,
        "f8",
        "um",
        "thickness of the layer",
        optional="a range of `contact.layer.thickness`",
        powers=OF_LAYERS[LAYER_THICKNESS],
    ),
    Column(
        LAYER_MODULUS,
        "f8",
        "MPa",
        "Young's modulus of the layer",
        optional="a range of `contact.layer.modulus`",
        powers=OF_LAYERS[LAYER_MODULUS],
    ),
    *TABLE_1,
    *(_column(quantity) for quantity in _RESULTS if quantity.stored != "asked"),
    Column("iterations", "i4", "1", "iterations of the solver"),
    Column("convolutions", "i4", "1", "applications of the influence operator"),
    Column("residual", "f8", "1", "relative residual of the solution"),
    *(_column(quantity) for quantity in _RESULTS if quantity.stored == "asked"),
    # "s", not "seconds": xarray would turn the word into a time difference.
    _runtime("surface_seconds", "f8", "s", "time for the surface"),
    _runtime("solve_seconds", "f8", "s", "time for the contact problem"),
    _runtime("rank", "i4", "1", "MPI rank that computed the sample"),
    _runtime("host", "S64", "", "machine that computed the sample"),
)
"""Every column that a database can have, in the order of the file, apart from the columns of
generators, which follow `surface`, and of a user's function."""


def made_by_other_solver(physics: int) -> str:
    """Say whether an earlier or a later solver than that of this version made results.

    Parameters
    ----------
    physics : int
        The `PHYSICS` number that a database has recorded.

    Returns
    -------
    str
        Words that begin with "made by"; "" if the number is that of this version.
    """
    if physics == PHYSICS:
        return ""
    solver = "an earlier solver" if physics < PHYSICS else "a later solver"
    return f"made by {solver} (physics {physics}, this version computes {PHYSICS})"
