"""The table `[expect]` of a scene: the means that columns of its rows have over the population.

The means are a promise of who wrote the scene. They change no row, and are no part of what makes
two scenes different. `gen check` compares them with rows, see `gen.generation.means`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import BeforeValidator, ConfigDict, Field, Strict, with_config

from gen.distribution import Number

MEANS = (
    "a table of columns and their means, as { area_percent = 2.57 } or"
    " { area_percent = { mean = 2.57, tolerance = 0.05 } } with a tolerance of 0 or more"
)
"""Allowed tables `[expect]` in words."""


StrictNumber = Annotated[Number, Strict()]


@with_config(ConfigDict(extra="forbid", allow_inf_nan=False))
@dataclass(frozen=True)
class ExpectedMean:
    """Mean of a column over the population of a scene, in the unit of the column."""

    mean: StrictNumber
    # Largest difference of the population's mean from `mean`. The scatter of the rows that are
    # compared with it comes on top.
    tolerance: Annotated[StrictNumber, Field(ge=0)] = 0.0


def _with_mean(value: Any) -> Any:
    """Return a table with the key `mean` for a number, and anything else unchanged."""
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return {"mean": value} if is_number else value


Expect = Annotated[
    dict[str, Annotated[ExpectedMean, BeforeValidator(_with_mean)]],
    Field(min_length=1),
]
"""Means by the names of columns, at least one."""
