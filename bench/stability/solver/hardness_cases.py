"""Cases about a hardness: from none to all nodes yielded, on every kind of surface and cell."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np

import bem
from bem.analytic import Paraboloid
from bem.influence import Kernel
from bench.references import dense, yielding
from bench.stability.case import Case, Finding, Refusal
from bench.stability.solver import topographies
from bench.stability.solver.case import contact_case
from bench.stability.solver.checks import gap_under, has_force
from bench.stability.solver.setup import Setup
from bench.stability.solver.topographies import SIDE, Field, flat, paper

UNDECIDED = 1e-5
"""Pressures, over the hardness, and gaps, over the displacement, that may be either [1]."""

SMALL = 17
"""Nodes a side where the dense matrix is to judge: it takes many solves of all nodes."""

CAPS = (1e-9, 1e-6, 1e-4, 1e-3, 5e-3, 2e-2, 5e-2, 0.1, 0.3, 1.0, 1e3)
"""Of a half-space of E* = 1 MPa [MPa]."""

MORE_SETS = "the yielded nodes have to be found too, which takes solves of their own"
"""Reason for more iterations than those of the elastic contact."""

capped = partial(contact_case, "hardness", reason=MORE_SETS)


def cases() -> Iterator[Case]:
    """By the share of the nodes that yield, then by surface, cell and load."""
    yield from _caps()
    yield from _limits()
    yield from _prescribed()
    yield from _surfaces()
    yield from _loads()


def _caps() -> Iterator[Case]:
    for hardness in CAPS:
        name = f"H = {hardness:g} E*"
        yield capped(name, paper, hardness=hardness, checks=(says_what_yields,))
        checks = (agrees_with_dense_solve, says_what_yields)
        yield capped(f"{name}, coarse", partial(paper, SMALL), hardness=hardness, checks=checks)


def _limits() -> Iterator[Case]:
    """The elastic contact from its largest pressure on, and the bearing area."""
    largest = float(Setup(paper()).solve().pressure.max())
    for name, hardness in (
        ("the largest elastic pressure", largest),
        ("one ulp above the largest elastic pressure", float(np.nextafter(largest, np.inf))),
        ("one ulp below the largest elastic pressure", float(np.nextafter(largest, 0))),
    ):
        yield capped(name, paper, hardness=hardness, checks=(is_nearly_elastic,))
    for name, hardness in (
        ("1e-3 above the largest elastic pressure", 1.001 * largest),
        ("H = 1e90 E*", 1e90),
    ):
        yield capped(name, paper, hardness=hardness, checks=(is_elastic,))
    for hardness in (1e-12, 1e-90):
        checks = (is_bearing_area, says_what_yields)
        yield capped(f"bearing area, H = {hardness:g} E*", paper, hardness=hardness, checks=checks)
    refusal = Refusal(ValueError, ("hardness",))
    for hardness in (0.0, -1.0, np.nan):
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
            cell = SIDE / (SMALL - 1)
            force = has_force("the one it is made of", pressure.sum() * cell**2, 1e-6)
            yield capped(
                f"{name}, H = {hardness:g} E*", heights, delta, hardness=hardness, checks=(force,)
            )


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
    sphere = partial(topographies.indenter, Paraboloid(5000.0))
    noise, board, ties = topographies.white_noise, topographies.checkerboard, topographies.terraces
    concentrated: Kernel = "concentrated-force"
    surfaces: tuple[tuple[str, Callable[..., Field], float], ...] = (
        ("flat", lambda nodes: flat((nodes, nodes)), 5.0),
        ("sphere", sphere, 5.0),
        ("white noise", noise, 10.0),
        ("checkerboard", board, 10.0),
        ("exact ties", ties, 25.0),
    )
    for name, surface, delta in surfaces:
        for hardness in (1e-3, 1e-2, 5e-2):
            for kernel in ("uniform-pressure", concentrated):
                title = f"{name}, H = {hardness:g} E*, {kernel}"
                common = partial(capped, delta=delta, hardness=hardness, kernel=kernel)
                yield common(title, partial(surface, topographies.NODES))
                coarse = partial(surface, SMALL)
                yield common(f"{title}, coarse", coarse, checks=(agrees_with_dense_solve,))
    for sides in ((1000.0, 64000.0), (64000.0, 1000.0)):
        for hardness in (1e-4, 1e-3, 1e-2):
            title = f"cells of {sides[0] / 1000:g}:{sides[1] / 1000:g}, H = {hardness:g} E*"
            yield capped(title, paper, side=sides, hardness=hardness)


def _loads() -> Iterator[Case]:
    """A given mean pressure up to the hardness, beyond which there is no solution."""
    for hardness in (1e-3, 0.1):
        for share in (1e-3, 0.5, 0.9, 0.99, 1 - 1e-6):
            pressure = share * hardness
            cell = topographies.CELL
            force = has_force("the one given", pressure * paper().size * cell**2, 1e-12)
            name = f"p = {share:.7g} H, H = {hardness:g} E*"
            yield capped(name, paper, pressure=pressure, hardness=hardness, checks=(force,))
        for share in (1.0, 2.0):
            name = f"p = {share:g} H, H = {hardness:g} E*"
            refusal = Refusal(bem.NoSolution, ("hardness",))
            pressure = share * hardness
            yield capped(name, paper, pressure=pressure, hardness=hardness, refusal=refusal)


def agrees_with_dense_solve(asked: Setup, contact: bem.Contact) -> Iterable[Finding]:
    """Force, contact nodes and yielded nodes are those of the dense matrix."""
    hardness = float(asked.hardness or np.inf)
    unit = asked.cell[0] / asked.plane_strain_modulus
    pressure, gap = yielding.press(
        asked.surface,
        asked.delta,
        hardness * unit,
        asked.kernel,
        asked.aspect,
        yielding.by_growth,
    )
    pressure = pressure / unit
    force = float(pressure.sum()) * asked.cell[0] * asked.cell[1]
    yield Finding("force off a dense solve", abs(contact.force / force - 1), 1e-4)
    little, close = UNDECIDED * float(pressure.max()), UNDECIDED * asked.delta
    touching = (contact.pressure > 0) != (pressure > 0)
    touching &= (pressure > little) | (gap > close)
    yield Finding("nodes off", int(np.count_nonzero(touching)), 0)
    yielded = (contact.pressure == hardness) != (pressure >= hardness * (1 - 1e-15))
    yielded &= (hardness - pressure > little) | (gap < -close)
    yield Finding("yielded nodes off", int(np.count_nonzero(yielded)), 0)


def says_what_yields(asked: Setup, contact: bem.Contact) -> Iterable[Finding]:
    """Share, depth and flattened heights are those of the pressure."""
    yielded = contact.pressure == asked.hardness
    share = 100 * float(yielded.mean())
    yield Finding("yielded share off", abs(contact.yielded_percent - share), 1e-12)
    gap = gap_under(asked, contact.pressure)
    depth = np.where(yielded, np.maximum(-gap, 0.0), 0.0)
    off = float(np.abs(contact.yielded_depth / asked.delta - depth).max())
    yield Finding("yielded depth off", off, 1e-9)
    heights = asked.surface - contact.yielded_depth
    off = float(np.abs(contact.flattened - heights).max()) / float(np.abs(asked.surface).max())
    yield Finding("flattened heights off", off, 1e-15)


def is_elastic(asked: Setup, contact: bem.Contact) -> Iterable[Finding]:
    """The pressure is that of the elastic contact, to the last bit."""
    elastic = replace(asked, hardness=None).solve()
    unlike = int(np.count_nonzero(contact.pressure != elastic.pressure))
    yield Finding("nodes off the elastic contact", unlike, 0)


def is_nearly_elastic(asked: Setup, contact: bem.Contact) -> Iterable[Finding]:
    """Force and contact nodes are those of the elastic contact, to the tolerance of both."""
    elastic = replace(asked, hardness=None).solve()
    yield Finding("force off the elastic one", abs(contact.force / elastic.force - 1), asked.rtol)
    unlike = (contact.pressure > 0) != (elastic.pressure > 0)
    yield Finding("nodes off the elastic contact", int(np.count_nonzero(unlike)), 0)


def is_bearing_area(asked: Setup, contact: bem.Contact) -> Iterable[Finding]:
    """The pressure is the hardness wherever the undeformed surfaces overlap."""
    overlap = asked.surface - asked.surface.max() + asked.delta > 0
    expected = np.where(overlap, asked.hardness or 0.0, 0.0)
    yield Finding(
        "nodes off the bearing area", int(np.count_nonzero(contact.pressure != expected)), 0
    )
