"""Points of one surface's contact law: predicted, or solved contact by contact."""

import numpy as np
from numpy.typing import NDArray

from gen.single import solve_loads
from gen.topography import Topography
from learn.surrogate.model import OnSurface

Values = NDArray[np.float64]
Flags = NDArray[np.bool_]


def predicted(
    pressed: OnSurface, deltas: Values, level: float, e_star: float
) -> tuple[dict[str, Values], Flags]:
    """One surface's law from the surrogate, and where that is outside its training ranges."""
    answer = pressed.predict(deltas, e_star=e_star, level=level)
    area = np.stack([answer.area, answer.low["area"], answer.high["area"]])
    force = np.stack([answer.force, answer.low["force"], answer.high["force"]])
    if "mean_gap" in answer.values:
        ends = answer.low["mean_gap"], answer.high["mean_gap"]
        gap = np.stack([answer.values["mean_gap"], *ends])
    else:
        gap = _mean_gap(pressed, deltas, force[[0, 2, 1]] / e_star)[[0, 2, 1]]
        gap = np.sort(gap, axis=0)[[1, 0, 2]]
    found = {
        "area_percent": area,
        "force_uN": force,
        "mean_gap_um": gap,
        "pressure_MPa": force / _nominal(pressed),
    }
    return found, ~answer.inside


def solved(
    pressed: OnSurface, deltas: Values, level: float, e_star: float
) -> tuple[dict[str, Values], Flags]:
    """One surface's law from the solver, which has no band and is nowhere outside."""
    surface = pressed.surface
    topography = Topography(surface.name, surface.heights, surface.sides)
    contacts = [
        contact for contact, _ in solve_loads(topography, "delta", list(deltas), modulus=e_star)
    ]
    force = np.array([contact.force for contact in contacts])
    found = {
        "area_percent": np.array([contact.area_percent for contact in contacts]),
        "force_uN": force,
        "mean_gap_um": np.array([contact.mean_gap for contact in contacts]),
        "pressure_MPa": force / _nominal(pressed),
    }
    inside = np.zeros(deltas.size, dtype=np.bool_)
    return {name: np.stack([values] * 3) for name, values in found.items()}, inside


def _mean_gap(pressed: OnSurface, deltas: Values, force: Values) -> Values:
    """Mean gap from forces over E*, (3, k) as they are [um]."""
    surface = pressed.surface
    heights = surface.heights
    rest = float(heights.max()) - float(heights.mean())
    compliance = np.array([surface.compliance(float(delta)) for delta in deltas])
    return np.maximum(rest - deltas + compliance * force / surface.length, 0.0)


def _nominal(pressed: OnSurface) -> float:
    """Area of the cells of all nodes, over which the nominal pressure is a mean [um2]."""
    steps, shape = pressed.surface.steps, pressed.surface.heights.shape
    return float(steps[0] * steps[1] * shape[0] * shape[1])
