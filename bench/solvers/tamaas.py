"""Tamaas (Frérot and others, AGPL) with its non-periodic operator.

Controls force only. It solves the periodic problem, without a word, unless the operator is
registered and the solver is told to use it, both. Version 2.9: the displacement it leaves is
heights + gap, without the far field's part: the displacement of the far field has to be computed
from the pressure by one more application of the operator, which is not counted here.
"""

import importlib

import numpy as np

from bench.solvers.case import Case
from bench.solvers.contact_mechanics import fast_grid
from bench.solvers.solver import MAX_ITERATIONS, Answer, Failure, Solver

OPERATOR = "dcfft"


class PolonskyKeerRey:
    """Its projected conjugate gradients.

    The tolerance is on its own measure of the sum of pressure times gap.
    """

    def __init__(self, nodes: int, spacing: float) -> None:
        self._package = importlib.import_module("tamaas")
        self._package.set_log_level(self._package.LogLevel.error)
        factory = self._package.ModelFactory
        sides = [nodes * spacing, nodes * spacing]
        self._model = factory.createModel(self._package.model_type.basic_2d, sides, [nodes, nodes])
        self._model.E, self._model.nu = 1.0, 0.0
        factory.registerNonPeriodic(self._model, OPERATOR)

    def press(self, case: Case, force: float, tolerance: float) -> Answer:
        """Solve for a force."""
        self._model.traction[:] = 0  # every solve starts afresh
        self._model.displacement[:] = 0
        solver = self._package.PolonskyKeerRey(self._model, case.heights, tolerance)
        solver.setIntegralOperator(OPERATOR)
        solver.max_iter = MAX_ITERATIONS
        error = solver.solve(case.mean_pressure(force))
        if not error <= tolerance:
            raise Failure(f"error {error:.1e} after {MAX_ITERATIONS} iterations")
        return Answer(np.array(self._model.traction))


SOLVERS = (
    Solver(
        "Tamaas, margin",
        package="tamaas",
        install='pip install -e ".[peers]"',
        open_session=PolonskyKeerRey,
        control="force",
        grid=fast_grid,
    ),
)
