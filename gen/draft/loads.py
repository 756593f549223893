"""Choose the loads of a scene for a material."""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from dataclasses import dataclass

from gen.draft.writing import rounded
from gen.material import Bodies, plane_strain_modulus

FEWEST_NODES = 50
"""Nodes in contact under the smallest load; fewer count the grid rather than the area."""

LARGEST_AREA = 0.4
"""Share of the patch in contact under the largest load, about."""

YIELDING = 0.5
"""Largest mean pressure over the hardness; at 1 there is no equilibrium."""

KAPPA = 2.0
"""Contact area times E* rms slope over the load for light loads; the theories say 1.6 and 2.5."""


@dataclass(frozen=True)
class Material:
    """Elastic constants and hardness of a contact.

    Attributes
    ----------
    young : float
        Young's modulus of an elastic body on a rigid one, or E* with `poisson` 0 [MPa].
    poisson : float
        Poisson's ratio [1].
    hardness : float or None
        Hardness of the softer body; None for elastic bodies [MPa].
    known : bool
        Whether the user gave a modulus.
    """

    young: float = 1.0
    poisson: float = 0.0
    hardness: float | None = None
    known: bool = False

    @classmethod
    def of_options(
        cls,
        young: Sequence[float],
        poisson: Sequence[float],
        e_star: float | None,
        hardness: float | None,
    ) -> Material:
        """Make a material of the options of `gen contact`; raise InputError if it is none."""
        combined, hardness, known = Bodies.of_options(young, poisson, e_star, hardness)
        if len(young) == 1:
            return cls(young[0], poisson[0] if poisson else 0.0, hardness, known=True)
        return cls(combined, 0.0, hardness, known)

    @property
    def e_star(self) -> float:
        """Plane-strain modulus E* [MPa]."""
        return plane_strain_modulus(self.young, self.poisson)


@dataclass(frozen=True)
class Loads:
    """Loads of a scene, and how they were found.

    Attributes
    ----------
    quantity : {"pressure", "pressure/(E* slope_rms)"}
        What is given.
    low, high : float
        Ends of the range, [MPa] or [1].
    areas : tuple of float
        Contact area expected at both ends on a surface of middling slope [%].
    slopes : tuple of float
        Smallest, middle and largest rms slope of the surfaces [1].
    """

    quantity: str
    low: float
    high: float
    areas: tuple[float, float]
    slopes: tuple[float, float, float]


def choose_loads(material: Material, slopes: Sequence[float], nodes: int) -> Loads:
    """Choose loads from first contacts that the grid resolves to a large part of the patch.

    The contact area under a mean pressure p is about KAPPA p / (E* rms slope) of an elastic body,
    and at least p / hardness. The area of elastic bodies follows from p / (E* rms slope), so that
    this quantity gives rough and smooth surfaces the same areas; with a hardness there are two
    scales, and loads are pressures.

    Parameters
    ----------
    material : Material
        Elastic constants and hardness.
    slopes : sequence of float
        Rms slopes of the surfaces [1].
    nodes : int
        Number of nodes of a surface.

    Returns
    -------
    Loads
        Quantity and range.
    """
    middle = statistics.median(slopes)
    ends = min(slopes), middle, max(slopes)
    smallest = min(FEWEST_NODES / nodes, LARGEST_AREA / 10)
    if material.hardness is None:
        low, high = rounded(smallest / KAPPA), rounded(LARGEST_AREA / KAPPA)
        return Loads(
            "pressure/(E* slope_rms)", low, high, (100 * KAPPA * low, 100 * KAPPA * high), ends
        )
    bearing = min(material.hardness, material.e_star * middle / KAPPA)
    low = rounded(smallest * bearing)
    high = rounded(min(LARGEST_AREA * bearing, YIELDING * material.hardness))
    return Loads("pressure", low, high, (100 * low / bearing, 100 * high / bearing), ends)
