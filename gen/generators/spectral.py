"""Self-affine surfaces with a given power spectrum."""

import math
from collections.abc import Mapping
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from gen.arrays import Heights
from gen.distribution import AboveZero, AtLeastZero, FromZeroToOne, limits
from gen.generators.rules import MOST_NODES, Drawn, Grid, GridSurface
from gen.spectral import ROUNDING, SelfAffineSpectrum, generate_spectral

FARTHEST = 1e30
"""Largest roll-off over the longest wave: beyond it has no effect, and its powers overflow."""

MOST_PERIOD_NODES = 4 * MOST_NODES
"""Largest number of nodes along an axis of a surface's period: its waves take 10 GB."""


def _smooth(nodes: int) -> int:
    """Return the first number from `nodes` on without prime factors above 5: it transforms fast."""
    while True:
        rest = nodes
        for factor in (2, 3, 5):
            while rest % factor == 0:
                rest //= factor
        if rest == 1:
            return nodes
        nodes += 1


class SpectralSurface(GridSurface):
    """Self-affine surfaces with a given power spectrum and random phases."""

    generator: Literal["spectral"]
    hurst: Annotated[
        FromZeroToOne, Drawn("1", "Hurst exponent of the surface", paper_range=(0.5, 0.8))
    ] = Field(
        default=0.8,
        description="a number from 0 to 1, [low, high] or a distribution of these",
    )
    roll_off: Annotated[AboveZero, Drawn("um", "longest wavelength of the power law")] = Field(
        description="a wavelength above 0, [low, high] or a distribution of these [um]"
    )
    cut_off: Annotated[AboveZero, Drawn("um", "shortest wavelength")] = Field(
        description="a wavelength above 0, [low, high] or a distribution of these [um]"
    )
    rms_height: Annotated[AtLeastZero | None, Drawn("um", "rms height drawn for the spectrum")] = (
        Field(
            default=None,
            description="a number from 0 on, [low, high] or a distribution of these [um]",
        )
    )
    rms_slope: Annotated[AtLeastZero | None, Drawn("1", "rms slope drawn for the spectrum")] = (
        Field(
            default=None, description="a number from 0 on, [low, high] or a distribution of these"
        )
    )
    stretch: Annotated[AboveZero, Drawn("1", "wavelengths along x over those along y")] = Field(
        default=1.0,
        description="a number above 0, [low, high] or a distribution of these: wavelengths along x"
        " over those along y",
    )
    # Scenes that do not give it take 1 on periodic patches, otherwise 2.
    period: Annotated[float, Field(ge=1, le=16)] | None = Field(
        default=None, description="the surface's period in sides of the patch, from 1 to 16"
    )

    @model_validator(mode="after")
    def _require_one_rms(self) -> Self:
        """Refuse surfaces without a height, or with two, and a cut-off beyond the roll-off."""
        if (self.rms_height is None) == (self.rms_slope is None):
            raise PydanticCustomError("conflict", "give either rms_height or rms_slope")
        longest, shortest = limits(self.cut_off)[1], limits(self.roll_off)[0]
        if longest > shortest:
            raise PydanticCustomError(
                "conflict",
                f"cut_off is up to {longest:g} um and roll_off from {shortest:g} um on: the cut-off"
                " is the shorter wavelength",
            )
        return self

    def periods(self, boundary: str) -> float:
        """Return the surface's period in sides of a patch with a boundary [1]."""
        if self.period is not None:
            return self.period
        return 1.0 if boundary == "periodic" else 2.0

    def period_nodes(self, boundary: str) -> tuple[int, int]:
        """Return the nodes along x and y of a surface's period on a patch with a boundary.

        A period that is not the patch itself is rounded up to a number that suits transforms.
        """
        nx, ny = self.shape(edgeless=boundary != "free")
        if (periods := self.periods(boundary)) == 1.0:
            return nx, ny
        return _smooth(math.ceil(periods * nx)), _smooth(math.ceil(periods * ny))

    def fault_on(self, grid: Grid) -> str:
        """Return why a wave may be too short for the grid, or too long for the period, or ""."""
        spacing, boundary = grid.spacing, grid.boundary
        if max(self.period_nodes(boundary)) > MOST_PERIOD_NODES:
            nx, ny = self.period_nodes(boundary)
            return (
                f"its period has {nx} x {ny} nodes, {self.periods(boundary):g} times those of the"
                f" patch: give a shorter period, at most {MOST_PERIOD_NODES} nodes"
            )
        (shortest, longest), stretches = limits(self.cut_off), limits(self.stretch)
        finest = max(2 * spacing[0] / stretches[0], 2 * spacing[1])
        if shortest * (1 + ROUNDING) < finest:
            return (
                f"cut_off is from {shortest:g} um on; this grid holds waves of {finest:.6g} um"
                " and more: give a longer cut_off or more nodes"
            )
        periods = zip(self.period_nodes(boundary), spacing, (stretches[1], 1.0), strict=True)
        most = max(nodes * pitch / ratio if nodes > 2 else 0.0 for nodes, pitch, ratio in periods)
        if longest > most * (1 + ROUNDING):
            return (
                f"cut_off is up to {longest:g} um and the longest wave of the period {most:.6g} um:"
                " give a shorter cut_off"
            )
        if (beyond := limits(self.roll_off)[1]) > FARTHEST * most:
            return f"roll_off is up to {beyond:g} um: give at most {FARTHEST * most:g} um"
        return ""

    def heights(
        self,
        grid: Grid,
        surface: int,
        parameters: Mapping[str, float],
        random: np.random.Generator,
    ) -> Heights:
        """Add waves up; see `GeneratedSurface.heights`.

        A surface on a periodic patch has the patch as its period. Any other one is a window of a
        surface whose period is longer, so that its opposite borders have nothing to do with each
        other.
        """
        names = ("hurst", "roll_off", "cut_off", "stretch")
        nodes = self.period_nodes(grid.boundary)
        whole = generate_spectral(
            nodes,
            (nodes[0] * grid.spacing[0], nodes[1] * grid.spacing[1]),
            SelfAffineSpectrum(*(parameters[name] for name in names)),
            random,
            rms_height=parameters.get("rms_height"),
            rms_slope=parameters.get("rms_slope"),
        )
        heights = whole[: grid.shape[0], : grid.shape[1]]
        return np.ascontiguousarray(heights - heights.min())
