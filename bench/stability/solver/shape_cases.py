"""Cases about the surface: its roughness, single features, and bodies with closed forms."""

from collections.abc import Iterator
from functools import partial

import numpy as np

from bem.analytic import Cone, FlatPunch, Indenter, Paraboloid
from bench.stability.case import Case
from bench.stability.solver import topographies
from bench.stability.solver.case import contact_case
from bench.stability.solver.checks import (
    Check,
    agrees_with_dense_solve,
    has_force,
    is_symmetric,
    one_cell_force,
)
from bench.stability.solver.topographies import CELL, SIDE, SMALL, flat, paper

PLANE = flat((SMALL, SMALL))
DENSE = (agrees_with_dense_solve(),)
SYMMETRIC = (is_symmetric(),)


def cases() -> Iterator[Case]:
    """Family after family."""
    yield from _roughness()
    yield from _single_nodes()
    yield from _terraces()
    yield from _bodies()


def _roughness() -> Iterator[Case]:
    case = partial(contact_case, "roughness")
    for hurst in (0.01, 0.99):
        rough, coarse = (partial(paper, nodes, hurst) for nodes in (topographies.NODES, SMALL))
        yield case(f"H = {hurst:g}", rough)
        yield case(f"H = {hurst:g}, large contact", rough, 200.0)
        yield case(f"H = {hurst:g}, coarse", coarse, 200.0, checks=DENSE)
    yield case("σ0 = 0: flat, edge singular", partial(paper, sigma0=0.0), checks=SYMMETRIC)
    smooth = partial(paper, SMALL, sigma0=0.0)
    yield case("σ0 = 0, coarse", smooth, checks=DENSE + SYMMETRIC)
    for delta in (1.0, 10.0, 100.0, 1000.0):
        yield case(f"white noise, Δ = {delta:g} σ", topographies.white_noise, delta)
    yield case("white noise, coarse", partial(topographies.white_noise, SMALL), 10.0, checks=DENSE)
    for delta in (1.0, 25.0, 700.0, 5000.0):
        name = f"rough, tilted by 45°, Δ = {delta:g}"
        yield case(name, lambda: topographies.tilted(paper()), delta)
    yield case("a plane tilted by 45°", topographies.tilted(PLANE), 700.0, checks=DENSE)


def _single_nodes() -> Iterator[Case]:
    """One node above or below all others."""
    case, middle = partial(contact_case, "feature"), topographies.with_middle_at
    spike = partial(middle, 10.0, flat())
    alone = has_force("one cell", one_cell_force(5, CELL), 1e-6)
    yield case("a spike on a plane", spike, 5.0, checks=(alone,))
    yield case("spike and plane touch", spike, 20.0, checks=SYMMETRIC)
    coarse = middle(10.0, PLANE)
    yield case("spike and plane touch, coarse", coarse, 20.0, checks=DENSE + SYMMETRIC)
    needle = partial(middle, 1e6, paper())
    carries_all = has_force("one cell", one_cell_force(25, CELL), 1e-6)
    yield case("a needle carries all load", needle, 25.0, checks=(carries_all,))
    yield case("a needle in to its root", needle, 1.1e6)
    for delta in (1.0, 1e7):
        pit = partial(middle, -1e6, flat())
        yield case(f"a pit 1e6 deep, Δ = {delta:g}", pit, delta, checks=SYMMETRIC)
    coarse = middle(-1e6, PLANE)
    yield case("a pit 1e6 deep, coarse", coarse, 10.0, checks=DENSE + SYMMETRIC)


def _terraces() -> Iterator[Case]:
    """Steps and exact ties."""
    for name, surface, deltas, checks, on_coarse in (
        ("a step of 1 um", topographies.step, (0.5, 1.0, 3.0), (), 3.0),
        ("a checkerboard of 1 um", topographies.checkerboard, (1.0, 10.0, 1e3), SYMMETRIC, 10.0),
        ("plateaus of exact ties", topographies.terraces, (10.0, 25.0, 60.0), (), 60.0),
    ):
        for delta in deltas:
            yield contact_case("feature", f"{name}, Δ = {delta:g}", surface, delta, checks=checks)
        coarse, title = partial(surface, SMALL), name.replace("board of 1 um", "board")
        yield contact_case("feature", f"{title}, coarse", coarse, on_coarse, checks=DENSE + checks)


def _bodies() -> Iterator[Case]:
    """Closed forms, within what the grid costs; some 60 nodes carry the first."""
    name = "Hertz, even grid: four nodes tie"
    yield _body(name, "Hertz's", Paraboloid(5000.0), 0.2, 128, 0.01, DENSE)
    for name, body, delta, allowed in (
        ("Hertz", Paraboloid(5000.0), 5.0, 0.001),
        ("a cone", Cone(0.1), 25.0, 0.001),
        ("a flat punch", FlatPunch(250.0), 1.0, 0.01),
    ):
        yield _body(name, name, body, delta, topographies.NODES, allowed)


def _body(
    name: str,
    whose: str,
    body: Indenter,
    delta: float,
    nodes: int,
    allowed: float,
    checks: tuple[Check, ...] = (),
) -> Case:
    """A body of revolution; on an even grid no node is at its tip."""
    off_tip = 0.0 if nodes % 2 else SIDE / (nodes - 1) * np.sqrt(0.5)
    below_tip = -float(body.heights(np.array(off_tip)))
    closed_form = has_force(whose, body.force(delta + below_tip), allowed)
    surface = partial(topographies.indenter, body, nodes)
    checks = (closed_form, *SYMMETRIC, *checks)
    return contact_case("closed form", name, surface, delta, checks=checks)
