"""Tamaas (Frérot and others, AGPL) with its non-periodic or its periodic operator.

Controls force only. It solves the periodic problem, without a word, unless the operator is
registered and the solver is told to use it, both. Version 2.9: the displacement it leaves is
heights + gap, without the far field's part: the displacement of the far field has to be computed
from the pressure by one more application of the operator, which is not counted here.
"""

import importlib

import numpy as np

from bem.spacing import Boundary
from bench.solvers.case import Case
from bench.solvers.contact_mechanics import fast_grid
from bench.solvers.solver import MAX_ITERATIONS, Answer, Failure, Press, Solver

OPERATOR = "dcfft"


def projected_gradients(nodes: int, spacing: float, boundary: Boundary = "free") -> Press:
    """Open its projected conjugate gradients, `PolonskyKeerRey`.

    The tolerance is on its own measure of the sum of pressure times gap.
    """
    package = importlib.import_module("tamaas")
    package.set_log_level(package.LogLevel.error)
    sides = [nodes * spacing, nodes * spacing]
    model = package.ModelFactory.createModel(package.model_type.basic_2d, sides, [nodes, nodes])
    model.E, model.nu = 1.0, 0.0
    if boundary == "free":
        package.ModelFactory.registerNonPeriodic(model, OPERATOR)

    def press(case: Case, force: float, tolerance: float) -> Answer:
        model.traction[:] = 0  # every solve starts afresh
        model.displacement[:] = 0
        solver = package.PolonskyKeerRey(model, case.heights, tolerance)
        if boundary == "free":
            solver.setIntegralOperator(OPERATOR)
        solver.max_iter = MAX_ITERATIONS
        error = solver.solve(case.mean_pressure(force))
        if not error <= tolerance:
            raise Failure(f"error {error:.1e} after {MAX_ITERATIONS} iterations")
        return Answer(np.array(model.traction))

    return press


SOLVERS = (
    Solver(
        "Tamaas, margin",
        projected_gradients,
        package="tamaas",
        install="pip install tamaas",
        control="force",
        grid=fast_grid,
    ),
)
