"""Cases about a hardness: from none to all nodes yielded, on every kind of surface and cell."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np

import bem
from bem.analytic import Paraboloid
from bem.influence import KERNELS
from bench.references import dense
from bench.references.half_space import Field
from bench.stability.case import Case, Refusal
from bench.stability.solver import checks as judged
from bench.stability.solver import topographies
from bench.stability.solver.case import contact_case
from bench.stability.solver.setup import Setup
from bench.stability.solver.topographies import CELL, SIDE, flat, paper

SMALL = 17  # nodes a side where the dense matrix is to judge: it takes many solves of all nodes
# Of a half-space of E* = 1 MPa [MPa].
CAPS = (1e-9, 1e-6, 1e-4, 1e-3, 5e-3, 2e-2, 5e-2, 0.1, 0.3, 1.0, 1e3)
# Reason for more iterations than those of the elastic contact.
MORE_SETS = "the yielded nodes have to be found too, which takes solves of their own"
capped = partial(contact_case, "hardness", reason=MORE_SETS)


def cases() -> Iterator[Case]:
    """By the share of the nodes that yield, then by surface, cell and load."""
    for hardness in CAPS:
        case = partial(capped, hardness=hardness, checks=(judged.says_what_yields,))
        both = judged.yields_as_by_dense_solve, judged.says_what_yields
        yield case(f"H = {hardness:g} E*", paper)
        yield case(f"H = {hardness:g} E*, coarse", paper(SMALL), checks=both)
    yield from _limits()
    yield from _prescribed()
    yield from _surfaces()
    yield from _loads()


def _limits() -> Iterator[Case]:
    """The elastic contact from its largest pressure on, and the bearing area."""
    largest = float(Setup(paper()).solve().pressure.max())
    elastic = partial(judged.equals, "the elastic contact", partial(replace, hardness=None))
    for name, hardness in (
        ("the", largest),
        ("one ulp above the", float(np.nextafter(largest, np.inf))),
        ("one ulp below the", float(np.nextafter(largest, 0))),
    ):
        title, checks = f"{name} largest elastic pressure", (judged.is_nearly_elastic,)
        yield capped(title, paper, hardness=hardness, checks=checks)
    name = "1e-3 above the largest elastic pressure"
    yield capped(name, paper, hardness=1.001 * largest, checks=(elastic,))
    yield capped("H = 1e90 E*", paper, hardness=1e90, checks=(elastic,))
    for hardness in (1e-12, 1e-90):
        both = judged.is_bearing_area, judged.says_what_yields
        name = f"bearing area, H = {hardness:g} E*"
        yield capped(name, paper, hardness=hardness, checks=both)
    for hardness in (0.0, -1.0, np.nan):
        refusal = Refusal(ValueError, ("hardness",))
        yield capped(f"H = {hardness:g}", paper, hardness=hardness, refusal=refusal)


def _prescribed() -> Iterator[Case]:
    """Surfaces made from the pressure that solves them, so that each node's side is known."""
    for name, below, depth in (
        ("all nodes yield", 0, 1.0),
        ("all nodes at the hardness, none deeper", 0, 0.0),
        ("all nodes yield but one, which is just below", 1, 1.0),
        ("all nodes at the hardness but one, none deeper", 1, 0.0),
        ("half of the nodes yield", SMALL**2 // 2, 1.0),
    ):
        for hardness in (1e-3, 1.0, 1e3):
            pressure, heights, delta = _made(below, depth, hardness)
            area = (SIDE / (SMALL - 1)) ** 2
            force = partial(judged.has_force, "the one it is made of", pressure.sum() * area, 1e-6)
            title = f"{name}, H = {hardness:g} E*"
            yield capped(title, heights, delta, hardness=hardness, checks=(force,))


def _made(below: int, depth: float, hardness: float) -> tuple[Field, Field, float]:
    """Pressure with some nodes below the hardness, and heights and displacement for it.

    The other nodes yield to a depth over the largest displacement that the pressure makes [1].
    """
    random = np.random.default_rng(below)
    pressure = np.full(SMALL**2, hardness)
    chosen = random.choice(SMALL**2, below, replace=False)
    pressure[chosen] *= random.uniform(0.9, 0.999, below)
    field = pressure.reshape(SMALL, SMALL)
    moved = dense.displace(field, "uniform-pressure") * (SIDE / (SMALL - 1))
    deeper = depth * random.random(field.shape) * float(moved.max())
    interference = moved + np.where(field == hardness, deeper, 0.0)
    return field, interference - interference.max(), float(interference.max())


def _surfaces() -> Iterator[Case]:
    surfaces: tuple[tuple[str, Callable[..., Field], float], ...] = (
        ("flat", flat, 5.0),
        ("sphere", partial(topographies.indenter, Paraboloid(5000.0)), 5.0),
        ("white noise", topographies.white_noise, 10.0),
        ("checkerboard", topographies.checkerboard, 10.0),
        ("exact ties", topographies.terraces, 25.0),
    )
    dense_check = (judged.yields_as_by_dense_solve,)
    for name, surface, delta in surfaces:
        for hardness in (1e-3, 1e-2, 5e-2):
            for kernel in KERNELS:
                title = f"{name}, H = {hardness:g} E*, {kernel}"
                case = partial(capped, hardness=hardness, delta=delta, kernel=kernel)
                yield case(title, surface)
                yield case(f"{title}, coarse", partial(surface, SMALL), checks=dense_check)
    for sides in ((1000.0, 64000.0), (64000.0, 1000.0)):
        for hardness in (1e-4, 1e-3, 1e-2):
            title = f"cells of {sides[0] / 1000:g}:{sides[1] / 1000:g}, H = {hardness:g} E*"
            yield capped(title, paper, hardness=hardness, side=sides)


def _loads() -> Iterator[Case]:
    """A given mean pressure up to the hardness, beyond which there is no solution."""
    for hardness in (1e-3, 0.1):
        for share in (1e-3, 0.5, 0.9, 0.99, 1 - 1e-6, 1.0, 2.0):
            pressure = share * hardness
            given = partial(
                judged.has_force, "the one given", pressure * paper().size * CELL**2, 1e-12
            )
            refusal = Refusal(bem.NoSolution, ("hardness",)) if share >= 1 else None
            case = partial(capped, hardness=hardness, checks=(given,), refusal=refusal)
            yield case(f"p = {share:.7g} H, H = {hardness:g} E*", paper, pressure=pressure)
