"""Orders of convergence: force and area of round indenters against their closed forms.

The orders expected with `uniform-pressure`, where h is the spacing of the nodes:

- Force, smooth profiles: order 2. The surfaces meet at the centres of cells, as in a midpoint rule.
  The force is largest at the true contact area (Barber, Journal of Strain Analysis 9 (1974)), so
  that an edge that is wrong by a share of a cell costs the square of that share.
- Force, flat punch: order 1. Its area is prescribed and wrong by a share of a cell, nothing makes
  the force stationary, and no cell resolves the pressure that rises as d^(-1/2) towards the rim.
- Area, smooth profiles: order 1. The edge is wrong by a share of a cell, the same all round.
- Area, flat punch: order 3/2. Cells cover a circle without bias, and only the independent errors
  of the a/h cells on its rim remain.

With `concentrated-force` the force on smooth profiles is of order 1: the displacement of a cell
under its own pressure is too small by an amount proportional to h. The displacement at a given
force has the order of the force at a given displacement, since dF / dDelta = 2 E* a.
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
    """An indenter and its indentation.

    Attributes
    ----------
    name : str
        Name in messages.
    indenter : Indenter
        Closed form of the indenter.
    delta : float
        Indentation from the tip on [um].
    """

    name: str
    indenter: Indenter
    delta: float


def _at_contact_radius(name: str, indenter: PowerLaw) -> Profile:
    """Choose the indentation at which the contact radius is `RADIUS`."""
    return Profile(name, indenter, indenter.indentation(RADIUS))


PROFILES = (
    _at_contact_radius("sphere", Paraboloid(5000.0)),
    _at_contact_radius("cone", Cone(0.01)),
    _at_contact_radius("r^4", PowerLaw(1e-9, 4.0)),
    Profile("flat punch", FlatPunch(RADIUS), 1.0),
)


@dataclass(frozen=True)
class GridErrors:
    """The distance of the results on one grid from the closed form.

    Attributes
    ----------
    nodes : int
        Nodes a side.
    spacing : float
        Spacing h over the contact radius [1].
    force_error : float
        Relative error of the force, root mean square over the placements [1].
    area_error : float
        Relative error of the area of the cells in contact, root mean square likewise [1].
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
) -> list[GridErrors]:
    """Compute the errors on a number of grids.

    Parameters
    ----------
    profile : Profile
        Indenter and indentation.
    nodes : sequence of int
        Nodes a side of the grids.
    kernel : str
        Influence coefficients, see `bem.solve`.
    placements : int
        Number of placements of the axis between the nodes over which errors are averaged, because
        the number of cells in a circle jumps with every shift. The first is the patch's centre,
        which is a node if the number of nodes is odd.
    """
    return [_grid_errors(profile, count, kernel, placements) for count in nodes]


def fitted_order(spacings: Sequence[float], errors: Sequence[float]) -> float:
    """Fit the slope of log(error) over log(spacing) by least squares [1]."""
    return float(
        np.polynomial.Polynomial.fit(np.log(spacings), np.log(errors), 1).convert().coef[1]
    )


def force_order(grids: Sequence[GridErrors]) -> float:
    """Return the order of convergence of the force [1]."""
    return fitted_order([grid.spacing for grid in grids], [grid.force_error for grid in grids])


def area_order(grids: Sequence[GridErrors]) -> float:
    """Return the order of convergence of the area [1]."""
    return fitted_order([grid.spacing for grid in grids], [grid.area_error for grid in grids])


def _grid_errors(profile: Profile, nodes: int, kernel: Kernel, placements: int) -> GridErrors:
    spacing = SIDE / (nodes - 1)
    errors = [
        _errors(profile, nodes, kernel, (share[0] * spacing, share[1] * spacing))
        for share in _shares_of_a_cell(placements)
    ]
    force_error, area_error = np.sqrt(np.mean(np.square(errors), axis=0)).tolist()
    radius = profile.indenter.contact_radius(profile.delta)
    return GridErrors(nodes, spacing / radius, force_error, area_error)


def _errors(
    profile: Profile, nodes: int, kernel: Kernel, shift: tuple[float, float]
) -> tuple[float, float]:
    """Return the relative errors of force and area with the axis shifted by `shift` [um]."""
    heights = profile.indenter.heights(distances_to_centre((nodes, nodes), SIDE, shift))
    below_tip = float(heights.max())
    contact = bem.solve(heights, SIDE, profile.delta + below_tip, kernel=kernel, rtol=RTOL)
    force = profile.indenter.force(profile.delta)
    area = np.pi * profile.indenter.contact_radius(profile.delta) ** 2
    cells = contact.contact_nodes * contact.problem.spacing[0] * contact.problem.spacing[1]
    return contact.force / force - 1, cells / area - 1


def _shares_of_a_cell(count: int) -> list[tuple[float, float]]:
    """Return evenly spread shifts of at most half a cell, zero first (Roberts's R2 sequence)."""
    steps = np.outer(np.arange(count), TURNS)
    return [(float(s), float(t)) for s, t in steps - np.round(steps)]
