"""The limits of a measured map: what no grid of it, and no error of a grid, can tell.

Waves that a map does not carry are in none of its contacts. `MapLimits` names how many nodes its
shortest wave has, and what the file says of the instrument: the length below which it resolves
nothing, and the radius of its tip.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from gen.runtime.documents import Row

if TYPE_CHECKING:
    from gen.maps.read import Topography
    from gen.maps.scan import Instrument


@dataclass(frozen=True)
class MapLimits:
    """The limits of a map."""

    nodes_a_wave: (
        float  # nodes in the shortest wave that carries roughness [1]; NaN without waves
    )
    instrument: Instrument  # limits of the instrument, as far as the file states them

    @property
    def columns(self) -> Row:
        """The limits by the names of their columns; "" for one that is not known."""
        limits = {
            NODES_A_WAVE: None if math.isnan(self.nodes_a_wave) else self.nodes_a_wave,
            CUT_OFF: self.instrument.cut_off,
            TIP_RADIUS: self.instrument.tip_radius,
        }
        return {
            column: "" if limit is None else limit for column, limit in limits.items()
        }

    @property
    def remark(self) -> str:
        """What the number of nodes is, and the limits of the instrument if they are known."""
        remark = "nodes in its shortest wave"
        if math.isnan(self.nodes_a_wave):
            remark = "no wave"
        if self.instrument.cut_off is not None:
            remark += f"; the instrument cuts at {self.instrument.cut_off:.3g} um"
        if self.instrument.tip_radius is not None:
            remark += f"; its tip has a radius of {self.instrument.tip_radius:.3g} um"
        return remark

    @property
    def text(self) -> str:
        """The limits in words, as "8.2 nodes in its shortest wave"."""
        if math.isnan(self.nodes_a_wave):
            return self.remark
        return f"{self.nodes_a_wave:.2g} {self.remark}"

    def or_worse(self, other: MapLimits) -> MapLimits:
        """Return the worst limits of two maps.

        Parameters
        ----------
        other : MapLimits
            Limits of the other map.

        Returns
        -------
        MapLimits
            The fewer nodes in a wave, and the larger lengths of the instruments.
        """
        nodes = min(
            self.nodes_a_wave,
            other.nodes_a_wave,
            key=lambda number: math.inf if math.isnan(number) else number,
        )
        return MapLimits(nodes, self.instrument.or_worse(other.instrument))


NODES_A_WAVE = "map_nodes_a_wave"
"""Name of the column with the number of nodes in the shortest wave of a map [1]."""

CUT_OFF = "instrument_cut_off_um"
TIP_RADIUS = "instrument_tip_radius_um"
"""Names of the columns with the limits of the instrument [um]."""


def limits_of(topography: Topography) -> MapLimits:
    """Compute the limits of a map.

    Parameters
    ----------
    topography : Topography
        The prepared surface, without holes.

    Returns
    -------
    MapLimits
        Its limits. The nodes in its shortest wave are those of `gen describe`.
    """
    from gen.maps.texture import nodes_a_wave, radial_waves

    waves = radial_waves(topography)
    return MapLimits(
        nodes_a_wave=nodes_a_wave(waves, topography.spacing),
        instrument=topography.instrument,
    )
