"""ContactMechanics (Pastewka and others, MIT licence) on its free elastic half-space.

Controls displacement or force; here displacement. Physical sizes are nodes x spacing. Influence
coefficients are Love's in closed form. It convolves on exactly twice the nodes a side, a period
with a large prime factor for 257 nodes: the variant with a margin runs on a size that the FFT
likes, which its users would have to know.

Version 1.8.3: `dual_minimize_proxy` needs `init_force` in spite of its default None; from zero,
its variant "ccg-with-restart" never leaves the start; `forcetol` of the primal solver is a force
in absolute units.
"""

import importlib
from functools import partial
from typing import Any

import numpy as np
from scipy import fft

from bench.solvers.case import Case
from bench.solvers.solver import MAX_ITERATIONS, Answer, Failure, Solver


def fast_grid(nodes: int) -> int:
    """Smallest number of nodes a side without prime factors above 5."""
    return int(fft.next_fast_len(nodes, real=True))


class _FreeHalfSpace:
    """The substrate with its transformed influence coefficients, kept for all contacts."""

    def __init__(self, nodes: int, spacing: float) -> None:
        self._package = importlib.import_module("ContactMechanics")
        self._sides = nodes * spacing, nodes * spacing
        self._cell = spacing**2
        half_space = self._package.FreeFFTElasticHalfSpace
        self._substrate = half_space((nodes, nodes), young=1.0, physical_sizes=self._sides)

    def _system(self, case: Case) -> Any:
        surface = importlib.import_module("SurfaceTopography")
        topography = surface.Topography(case.heights, physical_sizes=self._sides)
        if case.hardness is None:
            return self._package.Systems.NonSmoothContactSystem(self._substrate, topography)
        plastic = surface.PlasticTopography(topography, case.hardness)
        return self._package.make_plastic_system(substrate=self._substrate, surface=plastic)

    def _answer(self, result: Any, forces: Any, convolutions: int | None = None) -> Answer:
        if not result.success:
            raise Failure(str(result.message))
        return Answer(np.asarray(forces) / self._cell, int(result.nit), convolutions)


class PrimalGradients(_FreeHalfSpace):
    """Its default, Polonsky and Keer's conjugate gradients.

    The tolerance is the largest penetration over Delta, and the last change of the force over the
    force; tension cut off in a step, or pressure above the hardness, is not bounded. With a
    hardness, nodes that have yielded leave the gradients, and where fewer than 1 % of the contact
    are left it relaxes towards the bearing area instead. A step takes two convolutions.
    """

    def press(self, case: Case, force: float, tolerance: float) -> Answer:
        """Solve for a displacement."""
        return self._press(case, tolerance, offset=case.delta - case.heights.max())

    def press_by_force(self, case: Case, force: float, tolerance: float) -> Answer:
        """Solve for a force; the case's displacement is what the tolerance is relative to."""
        return self._press(case, tolerance, external_force=force)

    def _press(self, case: Case, tolerance: float, **load: float) -> Answer:
        result = self._system(case).minimize_proxy(
            **load,
            pentol=tolerance * case.delta,
            thermotol=tolerance,
            forcetol=np.inf,
            maxiter=MAX_ITERATIONS,
        )
        return self._answer(result, result.jac, int(result.nfev))


class DualGradients(_FreeHalfSpace):
    """Its constrained conjugate gradients in pressures, after Bugnicourt and others (2018).

    The tolerance is the largest residual gap over Delta. Starts from the overlap as a pressure,
    with which it is faster than from zero.
    """

    def press(self, case: Case, force: float, tolerance: float) -> Answer:
        """Solve for a displacement."""
        offset = case.delta - case.heights.max()
        result = self._system(case).dual_minimize_proxy(
            offset=offset,
            init_force=np.maximum(case.heights + offset, 0) * case.spacing,
            solver="ccg-without-restart",
            gtol=tolerance * case.delta,
            maxiter=MAX_ITERATIONS,
        )
        return self._answer(result, np.reshape(result.x, case.heights.shape))


_solver = partial(Solver, package="ContactMechanics", install='pip install -e ".[peers]"')

SOLVERS = (
    _solver("ContactMechanics primal", open_session=PrimalGradients, plastic=True),
    _solver("ContactMechanics dual", open_session=DualGradients),
    _solver("ContactMechanics dual, margin", open_session=DualGradients, grid=fast_grid),
)
