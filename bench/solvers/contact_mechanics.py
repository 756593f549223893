"""ContactMechanics (Pastewka and others, MIT licence) on its free or periodic half-space.

Controls displacement or force; here displacement. Physical sizes are nodes x spacing. Influence
coefficients are Love's in closed form. It convolves on exactly twice the nodes a side, a period
with a large prime factor for 257 nodes: the variant with a margin runs on a size that the FFT
likes, which its users would have to know.

Version 1.8.3: `dual_minimize_proxy` needs `init_force` in spite of its default None; from zero,
its variant "ccg-with-restart" never leaves the start; `forcetol` of the primal solver is a force
in absolute units.
"""

import importlib
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from scipy import fft

from bem.spacing import Boundary
from bench.solvers.case import Case
from bench.solvers.solver import MAX_ITERATIONS, Answer, Control, Failure, Press, Solver

# Stiffness of the mean displacement of a periodic patch, which is to be zero [MPa / um].
RIGID = 1e30


def fast_grid(nodes: int) -> int:
    """Smallest number of nodes a side without prime factors above 5."""
    return int(fft.next_fast_len(nodes, real=True))


def primal_gradients(
    nodes: int, spacing: float, control: Control = "displacement", boundary: Boundary = "free"
) -> Press:
    """Open its default, Polonsky and Keer's conjugate gradients.

    The tolerance is the largest penetration over Delta, and the last change of the force over the
    force; tension cut off in a step, or pressure above the hardness, is not bounded. With a
    hardness, nodes that have yielded leave the gradients, and where fewer than 1 % of the contact
    are left it relaxes towards the bearing area instead. A step takes two convolutions.
    """
    system = _systems(nodes, spacing, boundary)

    def press(case: Case, force: float, tolerance: float) -> Answer:
        by_force = {"external_force": force}
        result = system(case).minimize_proxy(
            **(by_force if control == "force" else {"offset": case.delta - case.heights.max()}),
            pentol=tolerance * case.delta,
            thermotol=tolerance,
            forcetol=np.inf,
            maxiter=MAX_ITERATIONS,
        )
        return _answer(result, result.jac / spacing**2, int(result.nfev))

    return press


def dual_gradients(nodes: int, spacing: float, boundary: Boundary = "free") -> Press:
    """Open its constrained conjugate gradients in pressures, after Bugnicourt and others (2018).

    The tolerance is the largest residual gap over Delta. Starts from the overlap as a pressure,
    with which it is faster than from zero.
    """
    system = _systems(nodes, spacing, boundary)

    def press(case: Case, force: float, tolerance: float) -> Answer:
        offset = case.delta - case.heights.max()
        result = system(case).dual_minimize_proxy(
            offset=offset,
            init_force=np.maximum(case.heights + offset, 0) * spacing,
            solver="ccg-without-restart",
            gtol=tolerance * case.delta,
            maxiter=MAX_ITERATIONS,
        )
        return _answer(result, np.reshape(result.x, case.heights.shape) / spacing**2)

    return press


def _systems(nodes: int, spacing: float, boundary: Boundary) -> Callable[[Case], Any]:
    """Return what poses a case on the substrate, whose coefficients are kept for all contacts."""
    package, surface = map(importlib.import_module, ("ContactMechanics", "SurfaceTopography"))
    sides = nodes * spacing, nodes * spacing
    if boundary == "free":
        half_space, more = package.FreeFFTElasticHalfSpace, {}
    else:
        half_space, more = package.PeriodicFFTElasticHalfSpace, {"stiffness_q0": RIGID}
    substrate = half_space((nodes, nodes), young=1.0, physical_sizes=sides, **more)

    def system(case: Case) -> Any:
        topography = surface.Topography(
            case.heights, physical_sizes=sides, periodic=boundary == "periodic"
        )
        if case.hardness is None:
            return package.Systems.NonSmoothContactSystem(substrate, topography)
        plastic = surface.PlasticTopography(topography, case.hardness)
        return package.make_plastic_system(substrate=substrate, surface=plastic)

    return system


def _answer(result: Any, pressure: Any, convolutions: int | None = None) -> Answer:
    if not result.success:
        raise Failure(str(result.message))
    return Answer(np.asarray(pressure), int(result.nit), convolutions)


_solver = partial(Solver, package="ContactMechanics", install="pip install ContactMechanics")

SOLVERS = (
    _solver("ContactMechanics primal", primal_gradients, plastic=True),
    _solver("ContactMechanics dual", dual_gradients),
    _solver("ContactMechanics dual, margin", dual_gradients, grid=fast_grid),
)
