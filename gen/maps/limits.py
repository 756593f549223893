"""The limits of a measured map, of which neither its contacts nor their errors tell anything.

Waves that a map does not carry are in none of its contacts. `MapLimits` has the number of nodes in
the shortest wave of the map, and two numbers of the instrument if the file states them: the length
below which the instrument resolves nothing, and the radius of its tip.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from gen.runtime.documents import Row

if TYPE_CHECKING:
    from gen.maps.read import Topography
    from gen.maps.scan import Instrument


NODES_A_WAVE = "map_nodes_a_wave"
"""Name of the column with the number of nodes in the shortest wave of a map [1]."""

CUT_OFF = "instrument_cut_off_um"
TIP_RADIUS = "instrument_tip_radius_um"
"""Names of the columns with the limits of the instrument [um]."""


@dataclass(frozen=True)
class MapLimits:
    """The limits of a map."""

    # Nodes in the shortest wave that carries roughness [1]; NaN without waves.
    nodes_a_wave: float
    instrument: Instrument  # limits of the instrument, as far as the file states them

    @property
    def columns(self) -> Row:
        """The limits by the names of their columns; "" for a limit that is not known."""
        row: Row = dict.fromkeys((NODES_A_WAVE, CUT_OFF, TIP_RADIUS), "")
        if not math.isnan(self.nodes_a_wave):
            row[NODES_A_WAVE] = self.nodes_a_wave
        if self.instrument.cut_off is not None:
            row[CUT_OFF] = self.instrument.cut_off
        if self.instrument.tip_radius is not None:
            row[TIP_RADIUS] = self.instrument.tip_radius
        return row

    @property
    def remark(self) -> str:
        """The words behind the number of nodes, and the limits of the instrument if known."""
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
        # `fmin` ignores a map without waves.
        nodes = float(np.fmin(self.nodes_a_wave, other.nodes_a_wave))
        return MapLimits(
            nodes_a_wave=nodes, instrument=self.instrument.or_worse(other.instrument)
        )


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
