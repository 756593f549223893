"""Cases about the surface: its roughness, single features, and bodies with closed forms."""

from collections.abc import Callable, Iterator
from functools import partial

import numpy as np

from bem.analytic import Cone, FlatPunch, Indenter, Paraboloid
from bench.stability.solver import topographies
from bench.stability.solver.case import Case
from bench.stability.solver.checks import (
    Check,
    agrees_with_dense_solve,
    has_force,
    is_symmetric,
    one_cell_force,
)
from bench.stability.solver.setup import Setup, pressed
from bench.stability.solver.topographies import CELL, SIDE, SMALL, flat, paper

PLANE = flat((SMALL, SMALL))
DENSE = (agrees_with_dense_solve(),)


def cases() -> Iterator[Case]:
    """Family after family."""
    yield from _roughness()
    yield from _features()
    yield from _bodies()


def _roughness() -> Iterator[Case]:
    for hurst in (0.01, 0.99):
        rough, coarse = (partial(paper, nodes, hurst) for nodes in (topographies.NODES, SMALL))
        yield Case("roughness", f"H = {hurst:g}", pressed(rough))
        yield Case("roughness", f"H = {hurst:g}, large contact", pressed(rough, 200.0))
        yield Case("roughness", f"H = {hurst:g}, coarse", pressed(coarse, 200.0), DENSE)
    smooth = pressed(partial(paper, sigma0=0.0))
    yield Case("roughness", "σ0 = 0: flat, edge singular", smooth, (is_symmetric(),))
    small = pressed(partial(paper, SMALL, sigma0=0.0))
    yield Case("roughness", "σ0 = 0, coarse", small, (*DENSE, is_symmetric()))
    for delta in (1.0, 10.0, 100.0, 1000.0):
        setup = pressed(topographies.white_noise, delta)
        yield Case("roughness", f"white noise, Δ = {delta:g} σ", setup)
    noise = pressed(partial(topographies.white_noise, SMALL), 10.0)
    yield Case("roughness", "white noise, coarse", noise, DENSE)
    for delta in (1.0, 25.0, 700.0, 5000.0):
        setup = pressed(lambda: topographies.tilted(paper()), delta)
        yield Case("roughness", f"rough, tilted by 45°, Δ = {delta:g}", setup)
    plane = pressed(partial(topographies.tilted, PLANE), 700.0)
    yield Case("roughness", "a plane tilted by 45°", plane, DENSE)


def _features() -> Iterator[Case]:
    spike = partial(topographies.with_middle_at, 10.0, flat())
    alone = has_force("one cell", one_cell_force(5, CELL), 1e-6)
    yield Case("feature", "a spike on a plane", pressed(spike, 5.0), (alone,))
    yield Case("feature", "spike and plane touch", pressed(spike, 20.0), (is_symmetric(),))
    small_spike = pressed(partial(topographies.with_middle_at, 10.0, PLANE), 20.0)
    yield Case("feature", "spike and plane touch, coarse", small_spike, (*DENSE, is_symmetric()))
    needle = partial(topographies.with_middle_at, 1e6, paper())
    carries_all = has_force("one cell", one_cell_force(25, CELL), 1e-6)
    yield Case("feature", "a needle carries all load", pressed(needle, 25.0), (carries_all,))
    yield Case("feature", "a needle in to its root", pressed(needle, 1.1e6))
    pit = partial(topographies.with_middle_at, -1e6, flat())
    for delta in (1.0, 1e7):
        setup = pressed(pit, delta)
        yield Case("feature", f"a pit 1e6 deep, Δ = {delta:g}", setup, (is_symmetric(),))
    small_pit = pressed(partial(topographies.with_middle_at, -1e6, PLANE), 10.0)
    yield Case("feature", "a pit 1e6 deep, coarse", small_pit, (*DENSE, is_symmetric()))
    for delta in (0.5, 1.0, 3.0):
        yield Case("feature", f"a step of 1 um, Δ = {delta:g}", pressed(topographies.step, delta))
    step = pressed(partial(topographies.step, SMALL), 3.0)
    yield Case("feature", "a step of 1 um, coarse", step, DENSE)
    for delta in (1.0, 10.0, 1e3):
        setup = pressed(topographies.checkerboard, delta)
        name = f"a checkerboard of 1 um, Δ = {delta:g}"
        yield Case("feature", name, setup, (is_symmetric(),))
    board = pressed(partial(topographies.checkerboard, SMALL), 10.0)
    yield Case("feature", "a checkerboard, coarse", board, (*DENSE, is_symmetric()))
    for delta in (10.0, 25.0, 60.0):
        setup = pressed(topographies.terraces, delta)
        yield Case("feature", f"plateaus of exact ties, Δ = {delta:g}", setup)
    ties = pressed(partial(topographies.terraces, SMALL), 60.0)
    yield Case("feature", "plateaus of exact ties, coarse", ties, DENSE)


def _bodies() -> Iterator[Case]:
    """Closed forms, within what the grid costs; some 60 nodes carry the first."""
    four_tips = _body("Hertz's", Paraboloid(5000.0), 0.2, 128, 0.01)
    yield Case(
        "closed form", "Hertz, even grid: four nodes tie", four_tips[0], four_tips[1] + DENSE
    )
    for name, body, delta, allowed in (
        ("Hertz", Paraboloid(5000.0), 5.0, 0.001),
        ("a cone", Cone(0.1), 25.0, 0.001),
        ("a flat punch", FlatPunch(250.0), 1.0, 0.01),
    ):
        yield Case("closed form", name, *_body(name, body, delta, topographies.NODES, allowed))


def _body(
    name: str, body: Indenter, delta: float, nodes: int, allowed: float
) -> tuple[Callable[[], Setup], tuple[Check, ...]]:
    """A body of revolution and its checks; on an even grid no node is at the tip."""
    off_tip = 0.0 if nodes % 2 else SIDE / (nodes - 1) * np.sqrt(0.5)
    below_tip = -float(body.heights(np.array(off_tip)))
    checks = (has_force(name, body.force(delta + below_tip), allowed), is_symmetric())
    return pressed(partial(topographies.indenter, body, nodes), delta), checks
