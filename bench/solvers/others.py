"""Solvers by other people that can be compared with ours.

**ContactMechanics** (Pastewka and others, MIT licence), free or periodic, controls displacement or
force. It convolves on exactly twice the nodes a side, a period with a large prime factor for 257
nodes: the variant with a margin runs on a size that the FFT likes, which its users would have to
know. Version 1.8.3: `dual_minimize_proxy` needs `init_force` in spite of its default None.

**Tamaas** (Frérot and others, AGPL), non-periodic or periodic, controls force only. It solves the
periodic problem, without a word, unless the operator is registered and the solver is told to use
it, both. Version 2.9: the displacement it leaves lacks the far field's part, which is computed from
the pressure, and not counted here.

**ASPHER** (Yastrebov, BSD), free or periodic, controls force only. Building it takes a C++17
compiler, CMake and the headers of Eigen. Its nested grids need nodes = coarsest x 2^k a side, which
2^k + 1 are not: they run with a margin.
"""

import importlib
from collections.abc import Callable, Iterable
from functools import partial
from typing import Any

import numpy as np
from scipy import fft

from bem.problem import Boundary
from bench.solvers.solver import (
    MAX_ITERATIONS,
    Answer,
    Case,
    Control,
    Failure,
    Press,
    Solver,
)

# Stiffness of the mean displacement of a periodic patch, which is to be zero [MPa / um].
RIGID = 1e30


def fast_grid(nodes: int) -> int:
    """Smallest number of nodes a side without prime factors above 5."""
    return int(fft.next_fast_len(nodes, real=True))


def primal_gradients(
    nodes: int,
    spacing: float,
    control: Control = "displacement",
    boundary: Boundary = "free",
) -> Press:
    """Open ContactMechanics' default, Polonsky and Keer's conjugate gradients.

    The tolerance is the largest penetration over Delta, and the last change of the force over the
    force; tension cut off in a step, or pressure above the hardness, is not bounded.
    """
    system = _systems(nodes, spacing, boundary)

    def press(case: Case, force: float, tolerance: float) -> Answer:
        by_force = {"external_force": force}
        result = system(case).minimize_proxy(
            **(
                by_force
                if control == "force"
                else {"offset": case.delta - case.heights.max()}
            ),
            pentol=tolerance * case.delta,
            thermotol=tolerance,
            forcetol=np.inf,
            maxiter=MAX_ITERATIONS,
        )
        return _cm_answer(result, result.jac / spacing**2, int(result.nfev))

    return press


def dual_gradients(nodes: int, spacing: float, boundary: Boundary = "free") -> Press:
    """Open ContactMechanics' gradients in pressures, after Bugnicourt and others (2018).

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
        return _cm_answer(result, np.reshape(result.x, case.heights.shape) / spacing**2)

    return press


def _systems(nodes: int, spacing: float, boundary: Boundary) -> Callable[[Case], Any]:
    """Return what poses a case on the substrate, whose coefficients are kept for all contacts."""
    package, surface = map(
        importlib.import_module, ("ContactMechanics", "SurfaceTopography")
    )
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


def _cm_answer(result: Any, pressure: Any, convolutions: int | None = None) -> Answer:
    if not result.success:
        raise Failure(str(result.message))
    return Answer(np.asarray(pressure), convolutions)


OPERATOR = "dcfft"


def projected_gradients(nodes: int, spacing: float, boundary: Boundary = "free") -> Press:
    """Open Tamaas' projected conjugate gradients, `PolonskyKeerRey`.

    The tolerance is on its own measure of the sum of pressure times gap.
    """
    package = importlib.import_module("tamaas")
    package.set_log_level(package.LogLevel.error)
    sides = [nodes * spacing, nodes * spacing]
    model = package.ModelFactory.createModel(
        package.model_type.basic_2d, sides, [nodes, nodes]
    )
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


COARSEST = 32  # nodes a side that the coarsest of the nested grids has at least


def levels(nodes: int) -> int:
    """How often a grid may be halved."""
    return max((nodes // COARSEST).bit_length() - 1, 0)


def nested_grid(nodes: int) -> int:
    """Smallest number of nodes a side that can be halved that often."""
    step: int = 2 ** levels(nodes)
    return -(-nodes // step) * step


def single_grid(
    nodes: int, spacing: float, precond: str = "fourier", backend: str = "fft"
) -> Press:
    """Open ASPHER's Polonsky and Keer with its |q| preconditioner, a stencil or "fourier-fft".

    In double precision. The tolerance is on Frank and Wolfe's duality gap over the force, and on
    the largest penetration, both over the range of heights.
    """
    solver = importlib.import_module("aspher").ContactSolver(
        grid_size=nodes, domain_size=nodes * spacing, E_star=1.0, backend=backend
    )
    return partial(_press_aspher, partial(solver.solve, precond=precond))


def nested_grids(nodes: int, spacing: float, engine: str, backend: str = "fft") -> Press:
    """Open ASPHER from coarse to fine grids, in single and then double precision.

    Every call sets up every grid: that is in the time of the solve. The engine of the
    preconditioner is "stencil", on the nodes in contact, or "fft", by transforms of the grid.
    """
    solve = partial(
        importlib.import_module("aspher").solve_nested,
        grid_size=nodes,
        domain_size=nodes * spacing,
        coarsest=nodes // 2 ** levels(nodes),
        E_star=1.0,
        backend=backend,
        precision="float_then_double",
        precond_engine=engine,
    )
    return partial(_press_aspher, lambda gap, **settings: solve(gap=gap, **settings))


def _press_aspher(solve: Any, case: Case, force: float, tolerance: float) -> Answer:
    result = solve(
        -case.heights.ravel(),
        p_nominal=case.mean_pressure(force),
        tol=tolerance,
        max_iter=MAX_ITERATIONS,
    )
    if not result.converged:
        raise Failure(f"{result.status} {result.status_reason}".strip())
    return Answer(np.array(result.pressure).reshape(case.heights.shape))


_cm = partial(Solver, package="ContactMechanics", install="pip install ContactMechanics")
_by_force = partial(Solver, control="force")
_aspher = partial(
    _by_force,
    package="aspher",
    install="pip install aspher, which builds with C++17, CMake 3.18 and Eigen"
    " (Debian: apt-get install g++ cmake libeigen3-dev)",
)
_nested = partial(_aspher, grid=nested_grid)

OTHERS: tuple[Solver, ...] = (
    _cm("ContactMechanics primal", primal_gradients, plastic=True),
    _cm("ContactMechanics dual", dual_gradients),
    _cm("ContactMechanics dual, margin", dual_gradients, grid=fast_grid),
    _by_force(
        "Tamaas, margin",
        projected_gradients,
        "tamaas",
        "pip install tamaas",
        grid=fast_grid,
    ),
    _aspher("ASPHER", single_grid),
    _nested("ASPHER nested, stencil, margin", partial(nested_grids, engine="stencil")),
    _nested("ASPHER nested, FFT, margin", partial(nested_grids, engine="fft")),
)


def installed(solvers: Iterable[Solver] = OTHERS) -> list[Solver]:
    """Return the solvers whose packages are installed."""
    return [solver for solver in solvers if solver.version]


def missing(solvers: Iterable[Solver] = OTHERS) -> dict[str, str]:
    """Return the packages that are not installed, each with how to get it."""
    return {solver.package: solver.install for solver in solvers if not solver.version}
