"""The far field that gives way, iterated and stopped early, as MIRCO does it.

MIRCO replaces Delta by Delta + F / K, solves, takes the new force, and stops once the force changes
by less than a tolerance. Where the force grows without bound this stops long before the
equilibrium, or not at all; `bem.solve` has the equilibrium in one solve.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import bem
from bem.far_field import critical_delta, shape_factor
from gen.generation.plan import parameters
from gen.generation.sample import surface_of
from gen.scene import Scene

TOLERANCE = 0.01
"""Relative change of the force at which MIRCO stops (the paper's section 2.4 does not say)."""

ENOUGH = 1e-4
"""Relative tolerance of the solves, far below `TOLERANCE`."""

STEPS = 40
"""Solves after which an iteration counts as one that does not end."""


@dataclass(frozen=True)
class Row:
    """What stopping early does near the limit Delta*.

    Attributes
    ----------
    share : float
        Displacement over Delta* [1].
    surfaces : int
        Number of surfaces.
    ended : float
        Share of the iterations that stopped by themselves [%].
    solves : float
        Median number of solves until they stopped.
    area_low, force_low : float
        Median of how much too low area and force are, over the iterations that stopped and have an
        equilibrium [%].
    """

    share: float
    surfaces: int
    ended: float
    solves: float
    area_low: float
    force_low: float


def compare(scene: Scene, surfaces: int, shares: tuple[float, ...]) -> Iterator[Row]:
    """Press the first surfaces of a scene to shares of their own limits.

    Parameters
    ----------
    scene : Scene
        A scene with a compliant far field.
    surfaces : int
        Number of its first surfaces that are pressed.
    shares : tuple of float
        Displacements over Delta*; from 1 on there is no equilibrium.
    """
    plan = parameters(scene, 0, surfaces)
    heights = [surface_of(scene, plan, row) for row in range(surfaces)]
    limits = [critical_delta(each, scene.contact.kernel) for each in heights]
    for share in shares:
        found = [
            _difference(scene, each, share * limit)
            for each, limit in zip(heights, limits, strict=True)
        ]
        solves, area, force = np.array(found).T
        ended = np.isfinite(solves)
        yield Row(
            share=share,
            surfaces=surfaces,
            ended=100 * float(ended.mean()),
            solves=_median(solves),
            area_low=_median(area),
            force_low=_median(force),
        )


def iterate(scene: Scene, heights: NDArray[np.float64], delta: float) -> tuple[bem.Contact, int]:
    """Iterate until the force changes by less than `TOLERANCE`.

    Returns
    -------
    The last contact, and the number of solves

    Raises
    ------
    ArithmeticError
        If that takes more than `STEPS` solves.
    """
    nodes, side, kernel = scene.surface.nodes, scene.surface.side, scene.contact.kernel
    stiffness = side / shape_factor((nodes, nodes), kernel)  # for E* = 1 MPa
    force, near = 0.0, None
    for step in range(1, STEPS + 1):
        contact = bem.solve(
            heights,
            side,
            delta + force / stiffness,
            spacing=side / nodes,
            kernel=kernel,
            rtol=ENOUGH,
            near=near,
        )
        if abs(contact.force - force) <= TOLERANCE * contact.force:
            return contact, step
        force, near = contact.force, contact.pressure
    raise ArithmeticError(f"{STEPS} solves, and the force still grows")


def _difference(
    scene: Scene, heights: NDArray[np.float64], delta: float
) -> tuple[float, float, float]:
    """Solves, and how much too low area and force are [%]; nan for what there is not."""
    try:
        early, solves = iterate(scene, heights, delta)
    except ArithmeticError:
        return np.nan, np.nan, np.nan
    try:
        contact = bem.solve(
            heights,
            scene.surface.side,
            delta,
            spacing=scene.surface.side / scene.surface.nodes,
            kernel=scene.contact.kernel,
            far_field="compliant",
        )
    except (ArithmeticError, ValueError):  # beyond the limit
        return solves, np.nan, np.nan
    return (
        solves,
        100 * (1 - early.area_percent / contact.area_percent),
        100 * (1 - early.force / contact.force),
    )


def _median(values: NDArray[np.float64]) -> float:
    known = values[np.isfinite(values)]
    return float(np.median(known)) if known.size else np.nan
