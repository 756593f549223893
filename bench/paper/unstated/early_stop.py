"""The far field that gives way, iterated and stopped early, as MIRCO does it.

MIRCO replaces Delta by Delta + F / K, solves, takes the new force, and stops once the force changes
by less than a tolerance. Where the force grows without bound this stops long before the
equilibrium, or not at all; `bem.solve` has the equilibrium in one solve.
"""

from collections.abc import Iterator
from functools import partial

import numpy as np
from numpy.typing import NDArray

import bem
from bem.far_field import critical_delta, shape_factor
from gen.generation.plan import parameters
from gen.generation.sample import surface_of
from gen.scene import Scene

# Relative change of the force at which MIRCO stops (the paper's section 2.4 does not say).
TOLERANCE = 0.01
ENOUGH = 1e-4  # relative tolerance of the solves, far below `TOLERANCE`
STEPS = 40  # solves after which an iteration counts as one that does not end


def compare(scene: Scene, surfaces: int, shares: tuple[float, ...]) -> Iterator[dict[str, float]]:
    """Press the first surfaces of a compliant scene to shares of their own limits Delta*.

    Yields
    ------
    dict
        For each share: iterations that stopped by themselves [%], median number of their solves,
        and by how much area and force are too low in the median, where there is an equilibrium [%].
    """
    plan = parameters(scene, 0, surfaces)
    heights = [surface_of(scene, plan, row) for row in range(surfaces)]
    limits = [critical_delta(each, scene.contact.kernel) for each in heights]
    for share in shares:
        pairs = zip(heights, limits, strict=True)
        columns = np.array([_difference(scene, each, share * limit) for each, limit in pairs]).T
        solves, area_low, force_low = map(_median, columns)
        yield {
            "share": share,
            "surfaces": surfaces,
            "ended": 100 * float(np.isfinite(columns[0]).mean()),
            "solves": solves,
            "area_low": area_low,
            "force_low": force_low,
        }


def _median(values: NDArray[np.float64]) -> float:
    known = values[np.isfinite(values)]
    return float(np.median(known)) if known.size else np.nan


def iterate(scene: Scene, heights: NDArray[np.float64], delta: float) -> tuple[bem.Contact, int]:
    """Iterate until the force changes by less than `TOLERANCE`; count the solves too.

    Raises
    ------
    ArithmeticError
        If that takes more than `STEPS` solves.
    """
    nodes, side, kernel = scene.shape[0], scene.sides[0], scene.contact.kernel
    stiffness = side / shape_factor((nodes, nodes), kernel)  # for E* = 1 MPa
    solve = partial(bem.solve, heights, side, spacing=side / nodes, kernel=kernel)
    force, near = 0.0, None
    for step in range(1, STEPS + 1):
        contact = solve(delta + force / stiffness, rtol=ENOUGH, near=near)
        if abs(contact.force - force) <= TOLERANCE * contact.force:
            return contact, step
        force, near = contact.force, contact.pressure
    raise ArithmeticError(f"{STEPS} solves, and the force still grows")


def _difference(
    scene: Scene, heights: NDArray[np.float64], delta: float
) -> tuple[float, float, float]:
    """Return the solves, and how much too low area and force are [%]; nan for what is not there."""
    side, kernel = scene.sides[0], scene.contact.kernel
    solve = partial(bem.solve, heights, side, spacing=side / scene.shape[0], kernel=kernel)
    solves = np.nan
    try:
        early, solves = iterate(scene, heights, delta)
        contact = solve(delta, far_field="compliant")
    except (ArithmeticError, ValueError):  # ValueError: beyond the limit
        return solves, np.nan, np.nan
    area = 100 * (1 - early.area_percent / contact.area_percent)
    return solves, area, 100 * (1 - early.force / contact.force)
