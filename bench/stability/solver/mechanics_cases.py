"""Cases about the model, its kernel and far field, and about what has to be refused."""

from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np

import bem
from bem.equilibrium import BeyondCriticalDelta
from bem.influence import KERNELS, Kernel
from bench.references.half_space import critical_delta
from bench.stability.case import Case, Refusal
from bench.stability.solver import topographies
from bench.stability.solver.case import contact_case
from bench.stability.solver.checks import agrees_with_dense_solve, is_symmetric
from bench.stability.solver.topographies import SMALL, Field, flat, paper

SHORT_WAVES = (
    "the concentrated force resists a checkerboard of pressures seven times less than a uniform"
    " pressure does (smallest eigenvalue 0.08 against 0.58): conjugate gradients are slower"
)
CHECKERBOARD = (
    "the surface asks for the checkerboard of pressures that the concentrated force resists least:"
    " the active set cycles, and projected gradients have to end that"
)
NEAR_CRITICAL = (
    "the compliant operator is nearly singular on sets larger than the solution's: the active set"
    " cycles, and projected gradients or rigid solves have to bring it near"
)
DENSE = (agrees_with_dense_solve(),)
NO_NUMBER = Refusal(bem.OutOfRange, ("double precision",))


def cases() -> Iterator[Case]:
    """Family after family."""
    yield from _concentrated_forces()
    yield from _compliant_far_fields()
    yield from _refusals()


def _concentrated_forces() -> Iterator[Case]:
    """The kernel that is nearly singular where much is in contact."""
    case = partial(contact_case, "concentrated force", kernel="concentrated-force")
    rough = partial(case, reason=SHORT_WAVES)
    for delta in (25.0, 80.0, 150.0, 500.0, 5000.0):
        yield rough(f"Δ = {delta:g}", paper, delta)
        yield rough(f"Δ = {delta:g}, coarse", partial(paper, SMALL), delta, checks=DENSE)
    yield rough("white noise", topographies.white_noise, 100.0)
    yield rough("flat", flat, checks=(is_symmetric(),))
    for nodes, checks in (
        (topographies.NODES, (is_symmetric(),)),
        (SMALL, (*DENSE, is_symmetric())),
    ):
        board = partial(topographies.checkerboard, nodes)
        for delta in (1.0, 10.0, 50.0, 1e3):
            name = f"a checkerboard of {nodes} nodes, Δ = {delta:g}"
            yield case(name, board, delta, checks=checks, reason=CHECKERBOARD)


def _compliant_far_fields() -> Iterator[Case]:
    case = partial(contact_case, "compliant far field", far_field="compliant")
    for kernel in KERNELS:
        near = partial(case, kernel=kernel, reason=NEAR_CRITICAL)
        for share, allowed in ((0.9, 1e-4), (0.99, 1e-4), (0.999, 1e-3)):
            name = f"Δ = {share:g} Δ*, {kernel}"
            delta = partial(_share_of_critical, share, kernel)
            yield near(name, paper, delta)
            checks = (agrees_with_dense_solve(allowed),)
            yield near(f"{name}, coarse", partial(paper, SMALL), delta, checks=checks)
        beyond = Refusal(BeyondCriticalDelta, ("delta = ", "must stay below Delta* = "))
        for share in (1 + 1e-9, 2.0):
            delta = partial(_share_of_critical, share, kernel)
            name = f"Δ = {share:.10g} Δ*, {kernel}"
            yield case(name, paper, delta, kernel=kernel, refusal=beyond)
    nowhere = Refusal(BeyondCriticalDelta, ("delta = 1e-09 um", "must stay below Delta* = 0 um"))
    yield case("flat: Δ* = 0", flat, 1e-9, refusal=nowhere)


def _share_of_critical(share: float, kernel: Kernel, heights: Field) -> float:
    return share * critical_delta(heights, kernel)


def _refusals() -> Iterator[Case]:
    case = partial(contact_case, "refused")
    unfinished = Refusal(bem.NotConverged, ("after 3 iterations", "raise max_iterations (3) or"))
    yield case("3 iterations", paper, max_iterations=3, refusal=unfinished)
    for name, heights, words in (
        ("one node not a number", _with_hole(np.nan), ("1 values", "not finite", "fill or crop")),
        ("one node infinite", _with_hole(np.inf), ("1 values", "not finite", "fill or crop")),
        ("no nodes", np.empty((0, 0)), ("shape (0, 0)", "a grid of nodes (nx, ny) is needed")),
        ("a profile of one axis", np.zeros(9), ("shape (9,)", "a grid of nodes")),
        ("complex heights", np.zeros((9, 9), complex), ("complex128", "real numbers are needed")),
        ("text", np.full((9, 9), "high"), ("<U4", "real numbers are needed")),
        ("masked nodes", np.ma.masked_equal(np.eye(9), 1), ("masked", "fill or crop")),
    ):
        yield case(name, heights, refusal=Refusal(ValueError, words))
    wrong: tuple[tuple[str, dict[str, Any], tuple[str, ...]], ...] = (
        ("Δ not a number", {"delta": np.nan}, ("delta = nan", "a finite number")),
        ("Δ infinite", {"delta": np.inf}, ("delta = inf", "a finite number")),
        ("L = 0", {"side": 0.0}, ("side = 0.0", "above 0 um")),
        ("E = 0", {"modulus": 0.0}, ("modulus = 0.0", "above 0 MPa")),
        ("ν = 0.6", {"poisson": 0.6}, ("poisson = 0.6", "above -1 and at most 0.5")),
        ("ν = -1", {"poisson": -1.0}, ("poisson = -1.0", "above -1 and at most 0.5")),
        ("rtol = 0", {"rtol": 0.0}, ("rtol = 0.0", "between 1e-15 and 1")),
    )
    for name, arguments, said in wrong:
        yield case(name, paper, **arguments, refusal=Refusal(ValueError, said))
    yield from _beyond_double_precision()


def _beyond_double_precision() -> Iterator[Case]:
    case = partial(contact_case, "refused", refusal=NO_NUMBER)
    yield case("pressures below the smallest number", paper, 5e-324)
    yield case("pressures beyond the largest number", paper, modulus=1e300, side=1e-9)
    yield case("cells below the smallest number", paper, side=5e-324)
    yield case("cells of 1:1e-600", paper, side=(1e300, 1e-300))
    yield case("heights of ±1.5e308 um", np.array([[-1.5e308, 1.5e308], [0.0, -1.5e308]]))


def _with_hole(height: float) -> Field:
    return topographies.with_middle_at(height, flat((9, 9)))
