"""Closed forms of contact with an elastic half-space, against which numerical results are tested.

- `indenters`: single bodies of revolution.
- `waves`: surfaces that repeat themselves without end along one axis or both.
- `persson`: laws of random surfaces without edges.

Lengths are in um, moduli and pressures in MPa, forces in uN.
"""

from bem.analytic.indenters import (
    Cone,
    FlatPunch,
    Indenter,
    Paraboloid,
    PowerLaw,
    distances_to_centre,
)
from bem.analytic.persson import BUSH_GIBSON_THOMAS, PERSSON, PerssonInterface, area_share
from bem.analytic.waves import DoublySinusoidal, WavySurface

__all__ = [
    "BUSH_GIBSON_THOMAS",
    "PERSSON",
    "Cone",
    "DoublySinusoidal",
    "FlatPunch",
    "Indenter",
    "Paraboloid",
    "PerssonInterface",
    "PowerLaw",
    "WavySurface",
    "area_share",
    "distances_to_centre",
]
