"""Orders of convergence: force and area of round indenters against their closed forms.

What is to be expected, with h the spacing of the nodes and `uniform-pressure`:

- Force, smooth profiles: order 2. Surfaces meet at the centres of cells only, a midpoint rule; and
  the force is largest at the true contact area (Barber, Journal of Strain Analysis 9 (1974)), so
  that an edge that is wrong by a share of a cell costs the square of that share.
- Force, flat punch: order 1. Its area is prescribed and wrong by a share of a cell, nothing makes
  the force stationary, and no cell resolves the pressure that rises as d^(-1/2) towards the rim.
- Area, smooth profiles: order 1. The edge is found to a share of a cell, the same all round.
- Area, flat punch: order 3/2. Cells cover a circle without bias, and what is left are the
  independent errors of the a/h cells on its rim.

With `concentrated-force` the force on smooth profiles is of order 1: a cell gives way too little
under its own pressure, by a displacement in proportion to h. The displacement at a given force has
the order of the force at a given displacement, since dF / dDelta = 2 E* a.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

import bem
from bem.analytic import Cone, FlatPunch, Indenter, Paraboloid, PowerLaw, distances_to_centre
from bem.influence import Kernel

SIDE = 1000.0  # um
RADIUS = 300.0  # um, of every contact
PLACEMENTS = 8
TURNS = 0.7548776662466927, 0.5698402909980532  # 1 / p and 1 / p^2 with p^3 = p + 1
RTOL = 1e-8  # far below the errors that are measured


@dataclass(frozen=True)
class Profile:
    """An indenter and how far it is pressed in.

    Attributes
    ----------
    name : for tables
    indenter : its closed form
    delta : indentation, from the tip on [um]
    """

    name: str
    indenter: Indenter
    delta: float


def _pressed_to_radius(name: str, indenter: PowerLaw) -> Profile:
    return Profile(name, indenter, indenter.indentation(RADIUS))


PROFILES = (
    _pressed_to_radius("sphere", Paraboloid(5000.0)),
    _pressed_to_radius("cone", Cone(0.01)),
    _pressed_to_radius("r^4", PowerLaw(1e-9, 4.0)),
    Profile("flat punch", FlatPunch(RADIUS), 1.0),
)


@dataclass(frozen=True)
class Row:
    """How far one grid is from the closed form.

    Attributes
    ----------
    nodes : a side
    spacing : h over the contact radius [1]
    force_error : of the force, relative, root mean square over the placements [1]
    area_error : of the area of the cells in contact, likewise [1]
    """

    nodes: int
    spacing: float
    force_error: float
    area_error: float


def convergence(
    profile: Profile,
    nodes: Sequence[int],
    kernel: Kernel = "uniform-pressure",
    placements: int = PLACEMENTS,
) -> list[Row]:
    """Errors on each grid.

    Parameters
    ----------
    profile : what is pressed
    nodes : a side, one grid after the other
    kernel : see `bem.solve`
    placements : of the axis between the nodes, over which errors are averaged, since the number
        of cells in a circle jumps with every shift; the first is the patch's centre, which is a
        node where their number is odd
    """
    return [_row(profile, count, kernel, placements) for count in nodes]


def fitted_order(spacings: Sequence[float], errors: Sequence[float]) -> float:
    """Slope of log(error) over log(spacing), by least squares [1]."""
    return float(
        np.polynomial.Polynomial.fit(np.log(spacings), np.log(errors), 1).convert().coef[1]
    )


def force_order(rows: Sequence[Row]) -> float:
    """Order of convergence of the force [1]."""
    return fitted_order([row.spacing for row in rows], [row.force_error for row in rows])


def area_order(rows: Sequence[Row]) -> float:
    """Order of convergence of the area [1]."""
    return fitted_order([row.spacing for row in rows], [row.area_error for row in rows])


def _row(profile: Profile, nodes: int, kernel: Kernel, placements: int) -> Row:
    spacing = SIDE / (nodes - 1)
    errors = [
        _errors(profile, nodes, kernel, (share[0] * spacing, share[1] * spacing))
        for share in _shares_of_a_cell(placements)
    ]
    force_error, area_error = np.sqrt(np.mean(np.square(errors), axis=0)).tolist()
    radius = profile.indenter.contact_radius(profile.delta)
    return Row(nodes, spacing / radius, force_error, area_error)


def _errors(
    profile: Profile, nodes: int, kernel: Kernel, shift: tuple[float, float]
) -> tuple[float, float]:
    """Relative errors of force and area with the axis shifted out of the centre [um]."""
    heights = profile.indenter.heights(distances_to_centre((nodes, nodes), SIDE, shift))
    below_tip = float(heights.max())
    contact = bem.solve(heights, SIDE, profile.delta + below_tip, kernel=kernel, rtol=RTOL)
    force = profile.indenter.force(profile.delta)
    area = np.pi * profile.indenter.contact_radius(profile.delta) ** 2
    cells = contact.contact_nodes * contact.problem.spacing[0] * contact.problem.spacing[1]
    return contact.force / force - 1, cells / area - 1


def _shares_of_a_cell(count: int) -> list[tuple[float, float]]:
    """Evenly spread shifts of at most half a cell, from none on (Roberts's R2 sequence)."""
    steps = np.outer(np.arange(count), TURNS)
    return [(float(s), float(t)) for s, t in steps - np.round(steps)]
