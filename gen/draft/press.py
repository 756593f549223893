"""The contact of maps and of surfaces that are to be like them, at a bearable cost."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from gen.arrays import Heights
from gen.maps.read import Sides
from gen.material import Bodies
from gen.quantities import AREA, MEAN_GAP, QUANTITIES, UNLOADING, Quantity
from gen.statistics import rms_slope

KAPPA = 2.0
"""Share of the patch in contact under light loads over p / (E* rms slope).

p is the mean pressure. Theories give 1.6 (Persson) and 2.5 (Bush, Gibson and Thomas).
"""

SHARES = (0.01, 0.05, 0.2)
"""Approximate shares of the patch in contact under the three pressures [1]."""

MOST_NODES = 450_000
"""Largest number of nodes of the pressed map; of a larger map the middle is pressed."""

# Tolerance of the solver. On a measured map of 256 x 256 nodes and two surfaces like it, areas are
# within 0.08 % of those of the default tolerance, mean gaps within 0.01 %, in 0.7 of the time.
TOLERANCE = 1e-3

# smallest rms slope of every second node over that of all nodes with which every second node of map
# and surfaces is enough [1]
ENOUGH_SLOPE = 0.95
# fewest nodes along the shorter side of which every second one is taken
FEWEST_HALVED = 128

ANSWERS: Mapping[str, Quantity] = {
    "area": AREA,
    "mean gap": MEAN_GAP,
    "stiffness": UNLOADING,
    "number of spots": QUANTITIES["contact_spots"],
}
"""Quantities of a contact that are compared, by the names of the answers."""

Answers = Mapping[str, float]
"""The answers of `ANSWERS` of one contact, by name; NaN if it has not converged."""


def middle_of(heights: Heights, most: int = MOST_NODES) -> Heights:
    """Cut the middle out of a map, with the proportions of the map.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights of the map [um].
    most : int
        Largest number of nodes of the middle.

    Returns
    -------
    ndarray
        Heights of the middle, or of the whole map if it has no more nodes, less their mean [um].
    """
    share = min(1.0, math.sqrt(most / heights.size))
    nx, ny = (int(share * nodes) for nodes in heights.shape)
    x = (heights.shape[0] - nx) // 2
    y = (heights.shape[1] - ny) // 2
    middle = heights[x : x + nx, y : y + ny]
    return np.asarray(middle - middle.mean())


def step_of_nodes(surfaces: Sequence[Heights], spacing: Sides) -> int:
    """Determine with which step nodes of surfaces have to be pressed.

    Every second node is enough if it has nearly the rms slope of all nodes. The contact then hardly
    differs, but costs a quarter.

    Parameters
    ----------
    surfaces : sequence of ndarray
        Heights of the surfaces [um].
    spacing : tuple of float
        Distance of their nodes along x and y [um].

    Returns
    -------
    int
        The step along both axes: 2 if every second node of all surfaces is enough, else 1.
    """
    spacing_of_second = (2 * spacing[0], 2 * spacing[1])
    for heights in surfaces:
        if min(heights.shape) < FEWEST_HALVED:
            return 1
        slope = rms_slope(heights[::2, ::2], spacing_of_second)
        if not slope >= ENOUGH_SLOPE * rms_slope(heights, spacing):
            return 1
    return 2


def pressures_for(slope: float, bodies: Bodies) -> tuple[float, ...]:
    """Choose the pressures of a map, to three digits.

    Parameters
    ----------
    slope : float
        Rms slope of the map [1].
    bodies : Bodies
        Material of the contact.

    Returns
    -------
    tuple of float
        Mean pressures that bring about `SHARES` of the patch into contact [MPa].
    """
    scale = bodies.e_star * slope / KAPPA
    if bodies.hardness is not None:
        scale = min(scale, bodies.hardness)
    return tuple(float(f"{share * scale:.3g}") for share in SHARES)


@dataclass(frozen=True)
class Press:
    """The contact of a rigid plane with surfaces that are mirrored at their borders."""

    spacing: Sides  # distance of the nodes along x and y [um]
    step: int  # step with which nodes are pressed, along both axes
    bodies: Bodies
    pressures: tuple[float, ...]  # rising mean pressures [MPa]

    def pressed_nodes(self, heights: Heights) -> Heights:
        """Return the heights of the nodes that are pressed.

        Parameters
        ----------
        heights : ndarray, shape (nx, ny)
            Heights of all nodes [um].

        Returns
        -------
        ndarray
            Heights of every node, or of every second one along both axes [um].
        """
        return heights[:: self.step, :: self.step]

    def answers(
        self,
        heights: Heights,
        advance: Callable[[int], None] = lambda _: None,
        names: Sequence[str] = tuple(ANSWERS),
    ) -> list[Answers]:
        """Press a surface under each pressure.

        The solver starts each contact from earlier ones of the surface.

        Parameters
        ----------
        heights : ndarray, shape (nx, ny)
            Heights [um].
        advance : callable
            Function that is called with the number of contacts, 1, after each contact.
        names : sequence of str
            Names of the answers.

        Returns
        -------
        list of mapping
            The answers under each pressure.
        """
        import bem

        pressed = self.pressed_nodes(heights)
        nx, ny = pressed.shape
        dx, dy = self.spacing
        contacts = bem.ladder(
            pressed,
            (nx * self.step * dx, ny * self.step * dy),
            pressures=self.pressures,
            modulus=self.bodies.e_star,
            hardness=self.bodies.hardness,
            boundary="mirror",
            rtol=TOLERANCE,
        )
        by_pressure: list[Answers] = []
        for _ in self.pressures:
            try:
                contact = next(contacts)
                answers = {name: float(ANSWERS[name].of(contact)) for name in names}
            except ArithmeticError:  # it has not converged
                answers = dict.fromkeys(names, math.nan)
            by_pressure.append(answers)
            advance(1)
        return by_pressure
