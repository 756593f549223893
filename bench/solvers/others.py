"""Solvers by other people that can be compared with ours.

**ContactMechanics** (Pastewka and others, MIT licence) solves free and periodic patches, and is
given a displacement or a force. It convolves on exactly twice the nodes a side. For 257 nodes this
number has a large prime factor, which slows the FFT. The variant with a margin adds nodes, so that
the FFT is fast; users of the package would have to know this. In version 1.8.3,
`dual_minimize_proxy` fails without `init_force`, although its default is None.

**Tamaas** (Frérot and others, AGPL) solves free and periodic patches, and is given a force. It
solves the periodic problem without a warning unless an operator for free patches is registered, and
the solver is told to use it. In version 2.9, the displacement that it returns lacks the part of the
far field. The reports compute the displacement from the pressure, and do not count the time.

**ASPHER** (Yastrebov, BSD) solves free and periodic patches, and is given a force. To build it one
needs a C++17 compiler, CMake and the headers of Eigen. Its nested grids need coarsest x 2^k nodes a
side. Surfaces of 2^k + 1 nodes a side therefore run with a margin.

The functions that set up a solver import its package.
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

RIGID = 1e30
"""Stiffness against a mean displacement of a periodic patch, which makes it zero [MPa / um]."""

OPERATOR = "dcfft"
"""Name of the operator of Tamaas for free patches."""

COARSEST = 32
"""Fewest nodes a side of the coarsest of ASPHER's nested grids."""


def fast_grid(nodes: int) -> int:
    """Return the smallest number of nodes from `nodes` that has no prime factors above 5.

    FFTs of this number of nodes are fast.

    Parameters
    ----------
    nodes : int
        Fewest nodes a side.

    Returns
    -------
    int
        Nodes a side.
    """
    return int(fft.next_fast_len(nodes, real=True))


def primal_gradients(
    nodes: int,
    spacing: float,
    control: Control = "displacement",
    boundary: Boundary = "free",
) -> Press:
    """Set up ContactMechanics' default, the conjugate gradients of Polonsky and Keer.

    The tolerance of the returned function bounds two relative numbers: the largest penetration over
    Delta, and the last change of the force over the force. It bounds neither the tension that each
    step sets to 0 nor pressures above the hardness.

    Parameters
    ----------
    nodes : int
        Nodes a side.
    spacing : float
        Spacing of the nodes [um].
    control : {"displacement", "force"}
        Quantity that the solver is given.
    boundary : {"free", "periodic"}
        Boundary of the patch.

    Returns
    -------
    callable
        Function that solves a case on this grid.
    """
    system_of = _systems(nodes, spacing, boundary)

    def press(case: Case, force: float, tolerance: float) -> Answer:
        """Solve a case at its displacement, or under `force` [uN] if `control` is "force".

        Raises Failure if it is not solved.
        """
        load = {"offset": case.delta - case.heights.max()}
        if control == "force":
            load = {"external_force": force}
        result = system_of(case).minimize_proxy(
            **load,
            pentol=tolerance * case.delta,  # largest penetration [um]
            thermotol=tolerance,  # largest relative change of the force
            forcetol=np.inf,  # no bound of the tension
            maxiter=MAX_ITERATIONS,
        )
        pressure = result.jac / spacing**2  # forces on nodes [uN] over the area of a cell
        return _cm_answer(result, pressure, convolutions=int(result.nfev))

    return press


def dual_gradients(nodes: int, spacing: float, boundary: Boundary = "free") -> Press:
    """Set up ContactMechanics' gradients in pressures, after Bugnicourt and others (2018).

    The tolerance bounds the largest residual gap over Delta. The first pressure is proportional to
    the overlap, which is faster than starting from zero.

    Parameters
    ----------
    nodes : int
        Nodes a side.
    spacing : float
        Spacing of the nodes [um].
    boundary : {"free", "periodic"}
        Boundary of the patch.

    Returns
    -------
    callable
        Function that solves a case on this grid.
    """
    system_of = _systems(nodes, spacing, boundary)

    def press(case: Case, force: float, tolerance: float) -> Answer:
        """Solve a case at its displacement. Raises Failure if it is not solved."""
        offset = case.delta - case.heights.max()
        result = system_of(case).dual_minimize_proxy(
            offset=offset,
            init_force=np.maximum(case.heights + offset, 0) * spacing,  # from the overlap
            solver="ccg-without-restart",
            gtol=tolerance * case.delta,
            maxiter=MAX_ITERATIONS,
        )
        pressure = np.reshape(result.x, case.heights.shape) / spacing**2
        return _cm_answer(result, pressure)

    return press


def _systems(nodes: int, spacing: float, boundary: Boundary) -> Callable[[Case], Any]:
    """Return a function that makes the system, the object by which ContactMechanics solves a case.

    All systems share one elastic half-space, of `nodes` nodes a side at a spacing [um], and its
    influence coefficients.
    """
    package = importlib.import_module("ContactMechanics")
    surface = importlib.import_module("SurfaceTopography")
    sides = (nodes * spacing, nodes * spacing)
    if boundary == "free":
        substrate = package.FreeFFTElasticHalfSpace(
            (nodes, nodes), young=1.0, physical_sizes=sides
        )
    else:
        substrate = package.PeriodicFFTElasticHalfSpace(
            (nodes, nodes), young=1.0, physical_sizes=sides, stiffness_q0=RIGID
        )

    def system_of(case: Case) -> Any:
        """Return the system of the half-space and the surface of a case, with its hardness."""
        topography = surface.Topography(
            case.heights, physical_sizes=sides, periodic=boundary == "periodic"
        )
        if case.hardness is None:
            return package.Systems.NonSmoothContactSystem(substrate, topography)
        plastic = surface.PlasticTopography(topography, case.hardness)
        return package.make_plastic_system(substrate=substrate, surface=plastic)

    return system_of


def _cm_answer(result: Any, pressure: Any, convolutions: int | None = None) -> Answer:
    """Return a pressure of ContactMechanics [MPa] as an answer.

    Raises Failure if `result` states no success.
    """
    if not result.success:
        raise Failure(str(result.message))
    return Answer(np.asarray(pressure), convolutions)


def projected_gradients(nodes: int, spacing: float, boundary: Boundary = "free") -> Press:
    """Set up Tamaas' projected conjugate gradients, `PolonskyKeerRey`.

    The tolerance bounds the error that Tamaas itself computes from the sum of pressure times gap.

    Parameters
    ----------
    nodes : int
        Nodes a side.
    spacing : float
        Spacing of the nodes [um].
    boundary : {"free", "periodic"}
        Boundary of the patch.

    Returns
    -------
    callable
        Function that solves a case on this grid.
    """
    package = importlib.import_module("tamaas")
    package.set_log_level(package.LogLevel.error)
    sides = [nodes * spacing, nodes * spacing]
    model = package.ModelFactory.createModel(
        package.model_type.basic_2d, sides, [nodes, nodes]
    )
    model.E = 1.0
    model.nu = 0.0
    if boundary == "free":
        package.ModelFactory.registerNonPeriodic(model, OPERATOR)

    def press(case: Case, force: float, tolerance: float) -> Answer:
        """Solve a case under a force [uN]. Raises Failure if the error exceeds the tolerance."""
        model.traction[:] = 0  # or else the solve would start from the last solution
        model.displacement[:] = 0
        solver = package.PolonskyKeerRey(model, case.heights, tolerance)
        if boundary == "free":
            solver.setIntegralOperator(OPERATOR)
        solver.max_iter = MAX_ITERATIONS
        error = solver.solve(case.mean_pressure(force))
        if not error <= tolerance:  # also if it is NaN
            raise Failure(f"error {error:.1e} after {MAX_ITERATIONS} iterations")
        return Answer(np.array(model.traction))

    return press


def levels(nodes: int) -> int:
    """Count how often a grid may be halved to no fewer than `COARSEST` nodes a side.

    Parameters
    ----------
    nodes : int
        Nodes a side.

    Returns
    -------
    int
        Number of halvings, at least 0.
    """
    return max((nodes // COARSEST).bit_length() - 1, 0)


def nested_grid(nodes: int) -> int:
    """Return the smallest number of nodes from `nodes` that can be halved `levels(nodes)` times.

    Parameters
    ----------
    nodes : int
        Fewest nodes a side.

    Returns
    -------
    int
        Nodes a side.
    """
    step: int = 2 ** levels(nodes)
    return -(-nodes // step) * step  # rounded up to a multiple of the step


def single_grid(
    nodes: int, spacing: float, precond: str = "fourier", backend: str = "fft"
) -> Press:
    """Set up ASPHER's Polonsky and Keer with its |q| preconditioner, in double precision.

    The tolerance of a solve bounds two numbers over the range of heights: Frank and Wolfe's duality
    gap per force, and the largest penetration.

    Parameters
    ----------
    nodes : int
        Nodes a side.
    spacing : float
        Spacing of the nodes [um].
    precond : {"fourier", "fourier-fft"}
        How the preconditioner works, by ASPHER's names: "fourier" is a stencil, "fourier-fft"
        transforms the grid.
    backend : {"fft", "periodic"}
        Boundary of the patch; "fft" is a free patch.

    Returns
    -------
    callable
        Function that solves a case on this grid.
    """
    solver = importlib.import_module("aspher").ContactSolver(
        grid_size=nodes, domain_size=nodes * spacing, E_star=1.0, backend=backend
    )
    return partial(_press_aspher, partial(solver.solve, precond=precond))


def nested_grids(nodes: int, spacing: float, engine: str, backend: str = "fft") -> Press:
    """Set up ASPHER's solve from coarse to fine grids, in single and then in double precision.

    Every solve sets up all grids again, so that the time of a solve includes this. The tolerance
    bounds the numbers that it bounds in `single_grid`.

    Parameters
    ----------
    nodes : int
        Nodes a side.
    spacing : float
        Spacing of the nodes [um].
    engine : {"stencil", "fft"}
        How the preconditioner works: by a stencil on the nodes in contact, or by transforms of the
        grid.
    backend : {"fft", "periodic"}
        Boundary of the patch; "fft" is a free patch.

    Returns
    -------
    callable
        Function that solves a case on this grid.
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
    # `_press_aspher` gives the gap by position, `solve_nested` takes it by its name.
    return partial(_press_aspher, lambda gap, **settings: solve(gap=gap, **settings))


def _press_aspher(solve: Any, case: Case, force: float, tolerance: float) -> Answer:
    """Solve a case under a force [uN] by a function of ASPHER.

    `solve` takes the gap of the undeformed bodies, (n * n,) [um], and the settings below by name.
    Raises Failure if it does not converge.
    """
    result = solve(
        -case.heights.ravel(),
        p_nominal=case.mean_pressure(force),
        tol=tolerance,
        max_iter=MAX_ITERATIONS,
    )
    if not result.converged:
        raise Failure(f"{result.status} {result.status_reason}".strip())
    return Answer(np.array(result.pressure).reshape(case.heights.shape))


_contact_mechanics = partial(
    Solver, package="ContactMechanics", install="pip install ContactMechanics"
)
"""Makes a solver of ContactMechanics."""

_aspher = partial(
    Solver,
    package="aspher",
    install="pip install aspher, which builds with C++17, CMake 3.18 and Eigen"
    " (Debian: apt-get install g++ cmake libeigen3-dev)",
    control="force",
)
"""Makes a solver of ASPHER."""

OTHERS: tuple[Solver, ...] = (
    _contact_mechanics("ContactMechanics primal", primal_gradients, plastic=True),
    _contact_mechanics("ContactMechanics dual", dual_gradients),
    _contact_mechanics("ContactMechanics dual, margin", dual_gradients, grid=fast_grid),
    Solver(
        "Tamaas, margin",
        projected_gradients,
        package="tamaas",
        install="pip install tamaas",
        control="force",
        grid=fast_grid,
    ),
    _aspher("ASPHER", single_grid),
    _aspher(
        "ASPHER nested, stencil, margin",
        partial(nested_grids, engine="stencil"),
        grid=nested_grid,
    ),
    _aspher(
        "ASPHER nested, FFT, margin",
        partial(nested_grids, engine="fft"),
        grid=nested_grid,
    ),
)
"""The solvers on free patches, whether they are installed or not."""


def installed(solvers: Iterable[Solver] = OTHERS) -> list[Solver]:
    """Return the solvers whose packages are installed.

    Parameters
    ----------
    solvers : iterable of Solver
        The solvers.

    Returns
    -------
    list of Solver
        The installed solvers, in the given order.
    """
    return [solver for solver in solvers if solver.version]


def missing(solvers: Iterable[Solver] = OTHERS) -> dict[str, str]:
    """Return how to install the packages of solvers that are not installed.

    Parameters
    ----------
    solvers : iterable of Solver
        The solvers.

    Returns
    -------
    dict
        Commands by the names of the packages; empty if all are installed.
    """
    return {solver.package: solver.install for solver in solvers if not solver.version}
