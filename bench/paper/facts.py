"""The paper's numbers that nothing else here needs, and why ours differ.

Its ranges (Table 1) stand in `gen.scene`, its search spaces, optima, times and scores (Tables 2
to 4) in `learn.comparison.paper`, its costs (section 4.4) in `bench.surrogates.cost`, its
paraboloid (section 2.4) in `bench.theory`: modules here take them from there.
"""

import math
from collections.abc import Iterable, Sequence
from typing import Any

from bench.files import Row, read_toml
from bench.surrogates.cost import PAPER_ROWS, PAPER_TESTS
from gen.scene import ALL_COLUMNS
from learn.metrics import Scores

GRIDS = (2, 8, 32, 128)  # cells a side of the surfaces that show how the generator works
DELTAS = (
    25.0,
    35.0,
)  # displacements at which two topographies are pressed (section 2.4) [um]
LONGEST_SOLVE = (
    1750.0  # time that a simulation takes at most, approximately (section 2.4) [s]
)
TRAIN_ROWS = PAPER_ROWS - PAPER_TESTS  # rows that train (section 3.2)
FINE_ROWS = 800  # simulations on the finer grid (section 4.3)
FINE = Scores(
    1.46, 3.95, 7.56, 99.16
)  # scores of kernel ridge on the finer grid, Table 5 [%]
# Smallest and largest value of each quantity of Table 1.
RANGES = {column.name: column.paper_range for column in ALL_COLUMNS if column.paper_range}
AREA_MAX = RANGES["area_percent"][1]  # largest area in the paper's database [%]

DIGITS = 4  # significant digits of dots of pictures

WHY = {name: " ".join(text.split()) for name, text in read_toml("paper/why").items()}


def why(name: str, **values: Any) -> str:
    """Say why a number differs from the paper's."""
    return WHY[name].format(**values)


def rows_of(header: Sequence[str], lines: Iterable[Sequence[Any]]) -> list[Row]:
    """Return lines of a table by the names of its columns."""
    return [dict(zip(header, line, strict=True)) for line in lines]


def few(line: Iterable[float]) -> list[float]:
    """Return numbers of dots with no more digits than can be seen."""
    return [float(f"{value:.{DIGITS}g}") for value in line]


def ratio(ours: float, theirs: float) -> str:
    """Write our number over the paper's."""
    if not theirs or math.isnan(ours) or math.isnan(theirs):
        return ""
    times = ours / theirs
    return f"x {times:.3g}" if times >= 0.1 else f"1/{1 / times:,.0f}"
