"""Numbers of the paper that no other package needs, and the reasons why ours differ.

Other modules have further numbers: `gen.scene` the ranges of Table 1, `learn.comparison.paper` the
search spaces, optima, times and scores of Tables 2 to 4, `bench.surrogates.cost` the costs of
section 4.4, and `bench.theory` the paraboloid of section 2.4.
"""

import math
from collections.abc import Iterable
from typing import Any

from bench.files import read_toml
from bench.surrogates.cost import PAPER_ROWS, PAPER_TESTS
from gen.scene import ALL_COLUMNS
from learn.metrics import Scores

GRIDS = (2, 8, 32, 128)
"""Cells a side of the surfaces that show how the generator works (section 2.2). A surface has one
node more a side."""

DELTAS = (25.0, 35.0)
"""The two displacements at which topographies are pressed (section 2.4) [um]."""

LONGEST_SOLVE = 1750.0
"""Approximate time of the longest simulation (section 2.4) [s]."""

TRAIN_ROWS = PAPER_ROWS - PAPER_TESTS
"""Number of training rows of the paper (section 3.2)."""

FINE_ROWS = 800
"""Number of the paper's simulations on the finer grid (section 4.3)."""

FINE = Scores(nmse=1.46, nmae=3.95, nmaxe=7.56, r2=99.16)
"""Scores of kernel ridge on the finer grid (Table 5) [%]."""

RANGES = {column.name: column.paper_range for column in ALL_COLUMNS if column.paper_range}
"""The paper's smallest and largest value of each quantity of Table 1, by the name of our column."""

AREA_MAX = RANGES["area_percent"][1]
"""Largest area in the paper's database (Table 1) [%]."""

DIGITS = 4
"""Significant digits of the numbers behind the dots of a picture."""

WHY = {name: " ".join(text.split()) for name, text in read_toml("paper/why").items()}
"""Reasons why a number differs from the paper's, by their names in `why.toml`."""


def why(name: str, **values: Any) -> str:
    """Return a reason why a number differs from the paper's.

    Parameters
    ----------
    name : str
        Name of the reason in `why.toml`.
    **values
        Values of the placeholders in its text, which are in braces.

    Returns
    -------
    str
        The reason, on one line.
    """
    return WHY[name].format(**values)


def rounded(values: Iterable[float]) -> list[float]:
    """Round numbers to the digits that can be seen in a picture.

    Parameters
    ----------
    values : iterable of float
        The numbers.

    Returns
    -------
    list of float
        The numbers with `DIGITS` significant digits.
    """
    return [float(f"{value:.{DIGITS}g}") for value in values]


def ratio(ours: float, theirs: float) -> str:
    """Write our number over the paper's.

    Parameters
    ----------
    ours, theirs : float
        Our number and the paper's, in the same unit.

    Returns
    -------
    str
        "x 1.2", for example; "1/20" for a ratio below 0.1; "" if a number is NaN, or if the
        paper's number is 0.
    """
    if not theirs or math.isnan(ours) or math.isnan(theirs):
        return ""
    quotient = ours / theirs
    if quotient >= 0.1:
        return f"x {quotient:.3g}"
    return f"1/{1 / quotient:,.0f}"
