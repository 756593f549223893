"""Surfaces of random midpoint displacement, by either of two kinds: the paper's population."""

from collections.abc import Mapping
from typing import Annotated, Literal

import numpy as np
from pydantic import AfterValidator, Field

from gen.arrays import Heights
from gen.distribution import AtLeastZero, FromZeroToOne, Positive
from gen.generators.rules import MOST_NODES, Drawn, GeneratedSurface, Grid
from gen.surface import generate, without_last_nodes


def _power_of_two_plus_one(nodes: int) -> int:
    """Refuse a number of nodes that random midpoint displacement cannot make."""
    if (nodes - 1) & (nodes - 2):
        raise ValueError(f"{nodes} - 1 is not a power of two")
    return nodes


class DisplacedSurface(GeneratedSurface):
    """Surfaces of random midpoint displacement.

    The defaults are the paper's (section 3.2, Table 1). The paper does not give `sigma0`: its
    default is calibrated so that the 22 statistics have the ranges of Table 1.
    """

    generator: Literal["diamond-square", "midpoint"] = "diamond-square"
    nodes: Annotated[int, Field(ge=3, le=MOST_NODES), AfterValidator(_power_of_two_plus_one)] = (
        Field(default=129, description="2^k + 1 nodes a side, a whole number from 3 to 4097")
    )
    side: Positive = Field(default=1000.0, description="a finite number above 0 [um]")
    hurst: Annotated[
        FromZeroToOne, Drawn("1", "Hurst exponent of the surface", paper_range=(0.5, 0.8))
    ] = Field(
        default=(0.5, 0.8),
        description="two numbers [low, high] with 0 <= low <= high <= 1, one number, or a"
        " distribution",
    )
    sigma0: Annotated[
        AtLeastZero, Drawn("um", "standard deviation of the generator's first displacement")
    ] = Field(
        default=(10.0, 15.0),
        description="two finite numbers [low, high] with 0 <= low <= high, one number, or a"
        " distribution [um]",
    )

    def shape(self, *, edgeless: bool) -> tuple[int, int]:
        """Return 2^k nodes along both axes on a patch without edges, otherwise 2^k + 1."""
        return (self.nodes - edgeless,) * 2

    def sides(self, *, cells: bool) -> tuple[float, float]:
        """Return the side twice [um]."""
        return self.side, self.side

    def heights(
        self,
        grid: Grid,
        surface: int,
        parameters: Mapping[str, float],
        random: np.random.Generator,
    ) -> Heights:
        """Displace midpoints; see `GeneratedSurface.heights`."""
        hurst, sigma0 = parameters["hurst"], parameters["sigma0"]
        heights = generate(self.generator, self.nodes, hurst, sigma0, random)
        return heights if grid.boundary == "free" else without_last_nodes(heights)
