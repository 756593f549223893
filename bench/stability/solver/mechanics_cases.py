"""Cases about the model, its kernel and far field, and about what has to be refused."""

from collections.abc import Iterator
from functools import partial

import numpy as np

import bem
from bem.influence import KERNELS, Kernel
from bench.references.half_space import critical_delta
from bench.stability.finding import Refusal
from bench.stability.solver import topographies
from bench.stability.solver.case import Case
from bench.stability.solver.checks import Check, agrees_with_dense_solve, is_symmetric
from bench.stability.solver.setup import Setup, pressed
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
NO_NUMBER = Refusal(bem.OutOfRange, ("double precision",))


def cases() -> Iterator[Case]:
    """Family after family."""
    yield from _concentrated_forces()
    yield from _compliant_far_fields()
    yield from _refusals()


def _concentrated_forces() -> Iterator[Case]:
    """The kernel that is nearly singular where much is in contact."""
    kernel: Kernel = "concentrated-force"
    family = "concentrated force"
    for delta in (25.0, 80.0, 150.0, 500.0, 5000.0):
        setup = pressed(paper, delta, kernel=kernel)
        yield Case(family, f"Δ = {delta:g}", setup, reason=SHORT_WAVES)
        coarse = pressed(partial(paper, SMALL), delta, kernel=kernel)
        checks = (agrees_with_dense_solve(),)
        yield Case(family, f"Δ = {delta:g}, coarse", coarse, checks, reason=SHORT_WAVES)
    noise = pressed(topographies.white_noise, 100.0, kernel=kernel)
    yield Case(family, "white noise", noise, reason=SHORT_WAVES)
    smooth = pressed(flat, kernel=kernel)
    yield Case(family, "flat", smooth, (is_symmetric(),), reason=SHORT_WAVES)
    judges: dict[int, tuple[Check, ...]] = {
        topographies.NODES: (),
        SMALL: (agrees_with_dense_solve(),),
    }
    for nodes, dense in judges.items():
        for delta in (1.0, 10.0, 50.0, 1e3):
            setup = pressed(partial(topographies.checkerboard, nodes), delta, kernel=kernel)
            name = f"a checkerboard of {nodes} nodes, Δ = {delta:g}"
            yield Case(family, name, setup, (*dense, is_symmetric()), reason=CHECKERBOARD)


def _compliant_far_fields() -> Iterator[Case]:
    family = "compliant far field"
    for kernel in KERNELS:
        for share, allowed in ((0.9, 1e-4), (0.99, 1e-4), (0.999, 1e-3)):
            name = f"Δ = {share:g} Δ*, {kernel}"
            delta = partial(_share_of_critical, share, kernel)
            setup = pressed(paper, delta, kernel=kernel, far_field="compliant")
            yield Case(family, name, setup, reason=NEAR_CRITICAL)
            coarse = pressed(partial(paper, SMALL), delta, kernel=kernel, far_field="compliant")
            checks = (agrees_with_dense_solve(allowed),)
            yield Case(family, f"{name}, coarse", coarse, checks, reason=NEAR_CRITICAL)
        beyond = Refusal(bem.NoSolution, ("delta = ", "must stay below Delta* = "))
        for share in (1 + 1e-9, 2.0):
            delta = partial(_share_of_critical, share, kernel)
            setup = pressed(paper, delta, kernel=kernel, far_field="compliant")
            yield Case(family, f"Δ = {share:.10g} Δ*, {kernel}", setup, refusal=beyond)
    smooth = pressed(flat, 1e-9, far_field="compliant")
    nowhere = Refusal(bem.NoSolution, ("delta = 1e-09 um", "must stay below Delta* = 0 um"))
    yield Case(family, "flat: Δ* = 0", smooth, refusal=nowhere)


def _share_of_critical(share: float, kernel: Kernel, heights: Field) -> float:
    return share * critical_delta(heights, kernel)


def _refusals() -> Iterator[Case]:
    unfinished = Refusal(bem.NotConverged, ("after 3 iterations", "raise max_iterations (3) or"))
    yield Case("refused", "3 iterations", pressed(paper, max_iterations=3), refusal=unfinished)
    for name, heights, words in (
        ("one node not a number", _with_hole(np.nan), ("1 values", "not finite", "fill or crop")),
        ("one node infinite", _with_hole(np.inf), ("1 values", "not finite", "fill or crop")),
        ("no nodes", np.empty((0, 0)), ("shape (0, 0)", "a grid of nodes (nx, ny) is needed")),
        ("a profile of one axis", np.zeros(9), ("shape (9,)", "a grid of nodes")),
        ("complex heights", np.zeros((9, 9), complex), ("complex128", "real numbers are needed")),
        ("text", np.full((9, 9), "high"), ("<U4", "real numbers are needed")),
        ("masked nodes", np.ma.masked_equal(np.eye(9), 1), ("masked", "fill or crop")),
    ):
        refusal = Refusal(ValueError, words)
        yield Case("refused", name, partial(Setup, heights), refusal=refusal)
    for name, setup, words in (
        ("Δ not a number", pressed(paper, np.nan), ("delta = nan", "a finite number")),
        ("Δ infinite", pressed(paper, np.inf), ("delta = inf", "a finite number")),
        ("L = 0", pressed(paper, side=0.0), ("side = 0.0", "above 0 um")),
        ("E = 0", pressed(paper, modulus=0.0), ("modulus = 0.0", "above 0 MPa")),
        ("ν = 0.6", pressed(paper, poisson=0.6), ("poisson = 0.6", "above -1 and at most 0.5")),
        ("ν = -1", pressed(paper, poisson=-1.0), ("poisson = -1.0", "above -1 and at most 0.5")),
        ("rtol = 0", pressed(paper, rtol=0.0), ("rtol = 0.0", "between 1e-15 and 1")),
    ):
        yield Case("refused", name, setup, refusal=Refusal(ValueError, words))
    for name, setup in (
        ("pressures below the smallest number", pressed(paper, 5e-324)),
        ("pressures beyond the largest number", pressed(paper, modulus=1e300, side=1e-9)),
        ("cells below the smallest number", pressed(paper, side=5e-324)),
        ("cells of 1:1e-600", pressed(paper, side=(1e300, 1e-300))),
        (
            "heights of ±1.5e308 um",
            partial(Setup, np.array([[-1.5e308, 1.5e308], [0.0, -1.5e308]])),
        ),
    ):
        yield Case("refused", name, setup, refusal=NO_NUMBER)


def _with_hole(height: float) -> Field:
    return topographies.with_middle_at(height, flat((9, 9)))
