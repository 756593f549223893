"""Cases about a hardness: from none to all nodes yielded, on every kind of surface and cell."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np

import bem
from bem.analytic import Paraboloid
from bem.influence import KERNELS
from bench.references import dense
from bench.stability.case import Case, Refusal
from bench.stability.solver import topographies
from bench.stability.solver.case import contact_case
from bench.stability.solver.checks import (
    equals,
    has_force,
    is_bearing_area,
    is_nearly_elastic,
    says_what_yields,
    yields_as_by_dense_solve,
)
from bench.stability.solver.setup import Setup
from bench.stability.solver.topographies import CELL, SIDE, Field, flat, paper

SMALL = 17
"""Nodes a side where the dense matrix is to judge: it takes many solves of all nodes."""

CAPS = (1e-9, 1e-6, 1e-4, 1e-3, 5e-3, 2e-2, 5e-2, 0.1, 0.3, 1.0, 1e3)
"""Of a half-space of E* = 1 MPa [MPa]."""

MORE_SETS = "the yielded nodes have to be found too, which takes solves of their own"
"""Reason for more iterations than those of the elastic contact."""


def _capped(
    name: str, surface: Field | Callable[[], Field], hardness: float, **more: object
) -> Case:
    more = {"reason": MORE_SETS, **more}
    return contact_case("hardness", name, surface, hardness=hardness, **more)  # type: ignore[arg-type]


def cases() -> Iterator[Case]:
    """By the share of the nodes that yield, then by surface, cell and load."""
    for hardness in CAPS:
        name, checks = f"H = {hardness:g} E*", (yields_as_by_dense_solve, says_what_yields)
        yield _capped(name, paper, hardness, checks=checks[1:])
        yield _capped(f"{name}, coarse", paper(SMALL), hardness, checks=checks)
    yield from _limits()
    yield from _prescribed()
    yield from _surfaces()
    yield from _loads()


def _limits() -> Iterator[Case]:
    """The elastic contact from its largest pressure on, and the bearing area."""
    largest = float(Setup(paper()).solve().pressure.max())
    elastic = partial(equals, "the elastic contact", lambda setup: replace(setup, hardness=None))
    for name, hardness, check in (
        ("the largest elastic pressure", largest, is_nearly_elastic),
        (
            "one ulp above the largest elastic pressure",
            float(np.nextafter(largest, np.inf)),
            is_nearly_elastic,
        ),
        (
            "one ulp below the largest elastic pressure",
            float(np.nextafter(largest, 0)),
            is_nearly_elastic,
        ),
        ("1e-3 above the largest elastic pressure", 1.001 * largest, elastic),
        ("H = 1e90 E*", 1e90, elastic),
    ):
        yield _capped(name, paper, hardness, checks=(check,))
    for hardness in (1e-12, 1e-90):
        checks = (is_bearing_area, says_what_yields)
        yield _capped(f"bearing area, H = {hardness:g} E*", paper, hardness, checks=checks)
    for hardness in (0.0, -1.0, np.nan):
        refusal = Refusal(ValueError, ("hardness",))
        yield _capped(f"H = {hardness:g}", paper, hardness, refusal=refusal)


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
            force = partial(has_force, "the one it is made of", pressure.sum() * area, 1e-6)
            title = f"{name}, H = {hardness:g} E*"
            yield _capped(title, heights, hardness, delta=delta, checks=(force,))


def _made(below: int, depth: float, hardness: float) -> tuple[Field, Field, float]:
    """Pressure of which some nodes are below the hardness, and heights and displacement for it.

    Parameters
    ----------
    below : int
        Number of nodes below the hardness.
    depth : float
        Depth to which the others yield, over the displacement that the pressure makes [1].
    hardness : float
        Of a half-space of E* = 1 MPa [MPa].
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
    dense_check = (yields_as_by_dense_solve,)
    for name, surface, delta in surfaces:
        for hardness in (1e-3, 1e-2, 5e-2):
            for kernel in KERNELS:
                title = f"{name}, H = {hardness:g} E*, {kernel}"
                case = partial(_capped, hardness=hardness, delta=delta, kernel=kernel)
                yield case(title, surface)
                yield case(f"{title}, coarse", partial(surface, SMALL), checks=dense_check)
    for sides in ((1000.0, 64000.0), (64000.0, 1000.0)):
        for hardness in (1e-4, 1e-3, 1e-2):
            title = f"cells of {sides[0] / 1000:g}:{sides[1] / 1000:g}, H = {hardness:g} E*"
            yield _capped(title, paper, hardness, side=sides)


def _loads() -> Iterator[Case]:
    """A given mean pressure up to the hardness, beyond which there is no solution."""
    for hardness in (1e-3, 0.1):
        for share in (1e-3, 0.5, 0.9, 0.99, 1 - 1e-6, 1.0, 2.0):
            pressure = share * hardness
            given = partial(has_force, "the one given", pressure * paper().size * CELL**2, 1e-12)
            refusal = Refusal(bem.NoSolution, ("hardness",)) if share >= 1 else None
            yield _capped(
                f"p = {share:.7g} H, H = {hardness:g} E*",
                paper,
                hardness,
                pressure=pressure,
                checks=(given,),
                refusal=refusal,
            )
