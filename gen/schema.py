"""The columns of a database: the one place that names them.

Creation, reader, checks, the README's table and the tests derive from `COLUMNS`. Lengths are in
um, pressures in MPa, forces in uN (DESIGN, section 1).
"""

import math
from dataclasses import dataclass
from enum import IntEnum
from typing import Literal

SCHEMA = 1
"""Number of the layout: a file of another layout is refused."""

PART = 2
"""Number of the layout of parts, which hold some rows of their scene: `first_row` and `rows` more,
attributes that say which. Versions that know whole databases only refuse them."""

PHYSICS = 4
"""Number of the results: raised whenever a change of the code changes what a scene gives."""

RUNTIME = "runtime"
"""Group of the columns that differ from run to run: times, ranks, hosts."""


class Status(IntEnum):
    """What has become of a row."""

    PENDING = 0
    DONE = 1
    FAILED = 2


class Reason(IntEnum):
    """Why a row failed."""

    NONE = 0
    NOT_CONVERGED = 1
    NO_SOLUTION = 2
    NO_STATISTICS = 3
    ARITHMETIC = 4
    NOT_FINITE = 5


REASONS: dict[int, str] = {
    Reason.NONE: "",
    Reason.NOT_CONVERGED: "not converged within the iteration bound",
    Reason.NO_SOLUTION: "no solution: compliant far field beyond Delta*",
    Reason.NO_STATISTICS: "statistics undefined on this surface",
    Reason.ARITHMETIC: "the sample raised an arithmetic or value error",
    Reason.NOT_FINITE: "result not finite",
}
"""Text of every reason, by its code."""


@dataclass(frozen=True)
class Column:
    """One quantity of every sample.

    Attributes
    ----------
    name : name of the column
    dtype : type of one value, as numpy writes it
    unit : unit of the values; "1" for pure numbers, "" for texts
    long_name : what it is, in words
    group : "" for results, `RUNTIME` for times, ranks and hosts
    deterministic : True if the scene alone decides the bytes
    paper_range : smallest and largest value in the paper's Table 1, None if it has none
    shape_of : "" for one value per sample, "nodes" for a field: shape (rows, n, n)
    optional : the flag of the scene's `store` that creates the column, "" if always there
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

    @property
    def path(self) -> str:
        """Name inside the file, with the group in front."""
        return f"{self.group}/{self.name}" if self.group else self.name

    @property
    def fill(self) -> float | int | bytes:
        """Value of a row that nobody has written: NaN, 0 or an empty text."""
        fills: dict[str, float | int | bytes] = {"f": math.nan, "S": b""}
        return fills.get(self.dtype[0], 0)

    def shape(self, rows: int, nodes: int) -> tuple[int, ...]:
        """Shape of `rows` samples on a grid of `nodes` x `nodes`."""
        return (rows, nodes, nodes) if self.shape_of else (rows,)

    def row_bytes(self, nodes: int) -> int:
        """Bytes of one sample on a grid of `nodes` x `nodes`."""
        return int(self.dtype[1:]) * math.prod(self.shape(1, nodes))


def _statistic(name: str, unit: str, long_name: str, lowest: float, highest: float) -> Column:
    """Column of one of the 22 statistics, with its range in Table 1."""
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

STATUS = Column("status", "u1", "1", "0 pending, 1 done, 2 failed; written last")
REASON = Column("reason", "u1", "1", "code of the reason why the sample failed")

COLUMNS: tuple[Column, ...] = (
    STATUS,
    REASON,
    Column("surface", "i8", "1", "index of the surface, shared by its samples"),
    Column("hurst", "f8", "1", "Hurst exponent of the surface", paper_range=(0.5, 0.8)),
    Column("sigma0", "f8", "um", "standard deviation of the generator's first displacement"),
    Column("delta", "f8", "um", "far-field displacement Delta", paper_range=(5.0, 45.0)),
    *_STATISTICS,
    Column("area_percent", "f8", "%", "effective contact area", paper_range=(0.01, 16.56)),
    Column("force", "f8", "uN", "normal force at the scene's modulus (1 uN = 1 MPa um2)"),
    Column("contact_nodes", "i4", "1", "nodes under pressure"),
    Column("iterations", "i4", "1", "iterations of the solver"),
    Column("convolutions", "i4", "1", "applications of the influence operator"),
    Column("residual", "f8", "1", "relative residual of the solution"),
    Column("mean_gap", "f8", "um", "mean gap over all nodes", optional="mean_gap"),
    Column("largest_pressure", "f8", "MPa", "largest pressure", optional="largest_pressure"),
    Column("perimeter", "f8", "um", "length of the contact's edges", optional="perimeter"),
    Column("heights", "f8", "um", "surface heights", shape_of="nodes", optional="heights"),
    Column("pressure", "f8", "MPa", "contact pressure", shape_of="nodes", optional="pressure"),
    # "s", not "seconds": xarray would turn the word into a time difference.
    Column("surface_seconds", "f8", "s", "time for the surface", RUNTIME, deterministic=False),
    Column(
        "solve_seconds", "f8", "s", "time for the contact problem", RUNTIME, deterministic=False
    ),
    Column("rank", "i4", "1", "MPI rank that computed the sample", RUNTIME, deterministic=False),
    Column("host", "S64", "", "machine that computed the sample", RUNTIME, deterministic=False),
)
"""Every column that a database can have, in the order of the file."""


def columns_for(store: object) -> tuple[Column, ...]:
    """Columns of a database.

    Parameters
    ----------
    store : the scene's flags, one boolean attribute for each optional column

    Returns
    -------
    Those of `COLUMNS` that are always there or whose flag is set

    Raises
    ------
    AttributeError
        If `store` lacks a flag.
    """
    return tuple(
        column for column in COLUMNS if not column.optional or getattr(store, column.optional)
    )


def row_bytes(store: object, nodes: int) -> int:
    """Bytes of one row of all columns; `store` as in `columns_for`, `nodes` the nodes a side."""
    return sum(column.row_bytes(nodes) for column in columns_for(store))


def statistics_columns() -> tuple[Column, ...]:
    """Return the 22 statistics of the surface, in the order of the paper's Table 1."""
    return _STATISTICS


def markdown_table() -> str:
    """Write the table of columns that stands in the README.

    Returns
    -------
    Lines of Markdown: name, unit, meaning and the paper's range of every column
    """
    lines = ["| Column | Unit | Meaning | Paper's range |", "|---|---|---|---|"]
    for column in COLUMNS:
        lowest_highest = column.paper_range
        span = f"{lowest_highest[0]:g} to {lowest_highest[1]:g}" if lowest_highest else ""
        shape = ", n x n per sample" if column.shape_of else ""
        asked = f" (with `store.{column.optional}`)" if column.optional else ""
        meaning = f"{column.long_name}{shape}{asked}"
        lines.append(f"| `{column.path}` | {column.unit} | {meaning} | {span} |")
    return "\n".join(lines)
