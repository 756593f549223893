"""Cases of the contact solver: elastic bodies, then bodies of which no node to all nodes yield."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import product
from typing import Any

import numpy as np

import bem
from bem.analytic import Cone, FlatPunch, Indenter, Paraboloid
from bem.bodies import KERNELS, Kernel
from bem.far_field import BeyondCriticalDelta
from bench.references import dense
from bench.references.half_space import Field, critical_delta, influence_coefficients
from bench.stability.case import Case, Refusal
from bench.stability.checks import (
    FOUR_ULP,
    Check,
    contact_case,
    has_force,
    is_bearing_area,
    is_nearly_elastic,
    says_what_yields,
    scales,
)
from bench.stability.setup import (
    CELL,
    DELTA,
    NODES,
    SIDE,
    SMALL,
    Setup,
    checkerboard,
    cropped_paper,
    flat,
    indenter,
    paper,
    step,
    terraces,
    white_noise,
    with_middle_at,
)

HEIGHT_ROUNDING = 1e-6
"""Allowed error of the force if heights are multiplied by a factor that is no power of two [1].

Each height is then rounded again, so that two solves differ by their tolerance.
"""

slow_case = partial(contact_case, largest_ratio=math.inf)
"""Makes a case of a contact that may take any number of iterations up to `max_iterations`.

Many iterations are needed for long cells, whose short side matters little; for concentrated forces,
which resist a checkerboard seven times less than uniform pressures do; for compliant far fields
near Delta*; and for bodies that yield, whose yielded nodes have to be found too.
"""

LONG_CELLS = ((1000.0, 64000.0), (64000.0, 1000.0))
"""Sides along x and y of patches whose cells are 64 times as long as wide [um]."""


def cases() -> Iterator[Case]:
    """Yield elastic contacts, family after family, then bodies that yield."""
    yield from _materials()
    yield from _sizes()
    yield from _displacements()
    yield from _grids()
    yield from _roughness()
    yield from _single_nodes()
    yield from _terraces()
    yield from _bodies()
    yield from _concentrated_forces()
    yield from _compliant_far_fields()
    yield from _hardnesses()
    yield from _limits()
    yield from _yielding_surfaces()
    yield from _loads()


def _one_cell(delta: float, spacing: float) -> Check:
    """Return a check that the force is that of one square cell, pressed down by `delta` [um].

    E* is 1 MPa, and `spacing` is the side of the cell [um].
    """
    compliance = float(influence_coefficients((1, 1), "uniform-pressure")[0, 0])
    force = delta * spacing / compliance
    allowed = 1e-6
    return partial(has_force, "one cell", force, allowed)


def _scaled(
    family: str, name: str, factor: float, force_ratio: float, **arguments: Any
) -> Case:
    """Make a case of the ordinary contact in other units.

    Heights and Delta are multiplied by `factor`; the force has to be that of the ordinary contact
    times `force_ratio`. Further arguments are fields of `Setup`.
    """
    allowed = HEIGHT_ROUNDING
    if np.log2(factor).is_integer():  # all heights keep their bits
        allowed = FOUR_ULP
    check = partial(scales, force_ratio, allowed)
    heights = paper() * factor
    return contact_case(
        family, name, heights, DELTA * factor, checks=(check,), **arguments
    )


def _materials() -> Iterator[Case]:
    """Yield the ordinary contact with extreme moduli and Poisson's ratios."""
    for modulus in (1e-12, 1e-6, 1e6, 1e15):
        name = f"E = {modulus:g} MPa"
        yield _scaled("material", name, factor=1, force_ratio=modulus, modulus=modulus)
    for poisson in (-0.99, -0.5, 0.3, 0.5):
        name = f"ν = {poisson:g}"
        ratio = 1 / (1 - poisson**2)  # E* over the modulus
        yield _scaled("material", name, factor=1, force_ratio=ratio, poisson=poisson)


def _sizes() -> Iterator[Case]:
    """Yield the ordinary contact with extreme scan lengths, heights and displacements."""
    for side in (1e-9, 1.0, 1e9):
        name = f"L = {side:g} um"
        yield _scaled("size", name, factor=1, force_ratio=side / SIDE, side=side)
    factors = {
        "1e-12": 1e-12,
        "1e12": 1e12,
        "2^-40": 2.0**-40,
        "2^40": 2.0**40,
    }
    for text, factor in factors.items():
        name = f"heights and Δ times {text}"
        yield _scaled("size", name, factor=factor, force_ratio=factor)
    # The force is proportional to the modulus, the scan length (over `SIDE`) and the heights.
    yield _scaled(
        "size",
        "E, L, heights and Δ small",
        factor=1e-12,
        force_ratio=1e-36,
        side=1e-9,
        modulus=1e-12,
    )
    yield _scaled(
        "size",
        "E, L, heights and Δ large",
        factor=1e12,
        force_ratio=1e33,
        side=1e9,
        modulus=1e15,
    )


def _displacements() -> Iterator[Case]:
    """Yield displacements from none to far beyond full contact."""
    case = partial(contact_case, "displacement")
    expected_force = 0.0
    allowed = 0.0
    untouched = partial(has_force, "nothing touches", expected_force, allowed)
    for delta in (0.0, -1.0, -1e300):
        yield case(f"Δ = {delta:g}", paper, delta, checks=(untouched,))
    ulp = float(np.spacing(paper().max()))
    first_touches = {"one ulp of the highest node": ulp, "1e-300 um": 1e-300}
    for name, delta in first_touches.items():
        check = _one_cell(delta, CELL)
        yield case(f"first touch by {name}", paper, delta, checks=(check,))
    shares = {
        "1e-3 short of": 1 - 1e-3,
        "at": 1.0,
        "1e-3 beyond": 1 + 1e-3,
        "10 times": 10.0,
    }
    for name, share in shares.items():
        delta_of = partial(_to_full_contact, share)
        yield case(f"{name} full contact", paper(SMALL), delta_of)
    for ranges in (1.0, 10.0, 1e3, 1e6):
        delta = ranges * float(np.ptp(paper()))
        yield case(f"Δ of {ranges:g} height ranges", paper, delta)


def _to_full_contact(share: float, heights: Field) -> float:
    """Return a displacement [um], `share` times that of full contact."""
    return share * dense.full_contact_delta(heights, "uniform-pressure")


def _grids() -> Iterator[Case]:
    """Yield numbers of nodes, and patches and cells that are not square."""
    case = partial(contact_case, "grid")
    for k in range(1, 12):
        surface = partial(paper, 2**k + 1)
        yield case(f"k = {k}", surface, slow=k >= 10)
    check = _one_cell(delta=3, spacing=2)
    yield case("a single node", flat(1), 3.0, spacing=2.0, checks=(check,))
    shapes = {
        "one row": (1, 129),
        "one column": (129, 1),
        "four nodes": (2, 2),
    }
    for name, shape in shapes.items():
        yield case(name, cropped_paper(shape), 10.0, spacing=7.8125)
    narrow = cropped_paper((3, 129))
    yield case("a patch of 1:64", narrow, side=(1000 / 64, 1000.0))
    for sides in LONG_CELLS:
        name = _cells(sides)
        long = partial(slow_case, "grid", side=sides)
        yield long(name, paper)
        yield long(f"{name}, large contact", paper, 500.0)


def _cells(sides: tuple[float, float]) -> str:
    """Return a name as "cells of 1:64", with the ratio of the sides of the patch [um]."""
    first, second = (side / SIDE for side in sides)
    return f"cells of {first:g}:{second:g}"


def _roughness() -> Iterator[Case]:
    """Yield surfaces from smooth to white noise, and tilted ones."""
    case = partial(contact_case, "roughness")
    for hurst in (0.01, 0.99):
        heights = paper(NODES, hurst)
        yield case(f"H = {hurst:g}", heights)
        yield case(f"H = {hurst:g}, large contact", heights, 200.0)
    yield case("σ0 = 0: flat, edge singular", paper(sigma0=0.0))
    for delta in (1.0, 10.0, 100.0, 1000.0):
        # White noise has σ = 1 um.
        yield case(f"white noise, Δ = {delta:g} σ", white_noise, delta)
    plane = np.linspace(0.0, SIDE, NODES)[:, None]
    for delta in (1.0, 25.0, 700.0, 5000.0):
        name = f"rough, tilted by 45°, Δ = {delta:g}"
        yield case(name, paper() + plane, delta)
    yield case("a plane tilted by 45°", flat() + plane, 700.0)


def _single_nodes() -> Iterator[Case]:
    """Yield surfaces with one node above or below all other nodes, in most of them far."""
    case = partial(contact_case, "feature")
    spike = with_middle_at(10.0, flat())
    check = _one_cell(delta=5, spacing=CELL)
    yield case("a spike on a plane", spike, 5.0, checks=(check,))
    yield case("spike and plane touch", spike, 20.0)
    needle = with_middle_at(1e6, paper())
    check = _one_cell(delta=25, spacing=CELL)
    yield case("a needle carries all load", needle, 25.0, checks=(check,))
    yield case("a needle in to its root", needle, 1.1e6)
    pit = with_middle_at(-1e6, flat())
    for delta in (1.0, 1e7):
        yield case(f"a pit 1e6 deep, Δ = {delta:g}", pit, delta)


def _terraces() -> Iterator[Case]:
    """Yield surfaces with steps, and surfaces many of whose nodes are exactly equally high."""
    for name, surface, deltas in (
        ("a step of 1 um", step, (0.5, 1.0, 3.0)),
        ("a checkerboard of 1 um", checkerboard, (1.0, 1e3, 10.0)),
        ("plateaus of exact ties", terraces, (10.0, 25.0, 60.0)),
    ):
        for delta in deltas:
            title = f"{name}, Δ = {delta:g}"
            yield contact_case("feature", title, surface, delta)


@dataclass(frozen=True)
class _ClosedForm:
    """A contact of a body of revolution, whose force has a closed form."""

    case: str  # name of the case
    name: str  # name of the closed form in the finding
    body: Indenter
    delta: float  # displacement from the touch of the highest node [um]
    nodes: int  # nodes a side
    allowed: float  # largest relative error of the force, which the grid makes [1]


CLOSED_FORMS = (
    _ClosedForm(
        case="Hertz, even grid: four nodes tie",
        name="Hertz's",
        body=Paraboloid(5000.0),
        delta=0.2,
        nodes=128,
        allowed=0.01,
    ),
    _ClosedForm(
        case="Hertz",
        name="Hertz",
        body=Paraboloid(5000.0),
        delta=5.0,
        nodes=NODES,
        allowed=0.001,
    ),
    _ClosedForm(
        case="a cone",
        name="a cone",
        body=Cone(0.1),
        delta=25.0,
        nodes=NODES,
        allowed=0.001,
    ),
    _ClosedForm(
        case="a flat punch",
        name="a flat punch",
        body=FlatPunch(250.0),
        delta=1.0,
        nodes=NODES,
        allowed=0.01,
    ),
)
"""The contacts with closed forms. In the first, some 60 nodes are in contact."""


def _bodies() -> Iterator[Case]:
    """Yield bodies of revolution, compared with their closed forms."""
    for form in CLOSED_FORMS:
        off_tip = 0.0  # distance of the highest nodes from the tip [um]
        if form.nodes % 2 == 0:  # the tip is in the middle of four nodes
            off_tip = SIDE / (form.nodes - 1) * np.sqrt(0.5)
        below_tip = -float(form.body.heights(np.array(off_tip)))
        from_touch_of_tip = form.delta + below_tip
        force = form.body.force(from_touch_of_tip)
        check = partial(has_force, form.name, force, form.allowed)
        surface = partial(indenter, form.body, form.nodes)
        yield contact_case("closed form", form.case, surface, form.delta, checks=(check,))


def _concentrated_forces() -> Iterator[Case]:
    """Yield contacts with concentrated forces. The matrix of large contacts is nearly singular."""
    case = partial(slow_case, "concentrated force", kernel="concentrated-force")
    for delta in (25.0, 80.0, 150.0, 500.0, 5000.0):
        yield case(f"Δ = {delta:g}", paper, delta)
    yield case("white noise", white_noise, 100.0)
    yield case("flat", flat)
    for nodes, delta in product((NODES, SMALL), (1.0, 10.0, 50.0, 1e3)):
        name = f"a checkerboard of {nodes} nodes, Δ = {delta:g}"
        yield case(name, checkerboard(nodes), delta)


def _compliant_far_fields() -> Iterator[Case]:
    """Yield contacts on a compliant far field at displacements near Delta*.

    At Delta* or above there is no solution, and the input has to be refused.
    """
    case = partial(contact_case, "compliant far field", far_field="compliant")
    refusal = Refusal(BeyondCriticalDelta, ("delta = ", "must stay below Delta* = "))
    shares = (0.9, 0.99, 0.999, 1 + 1e-9, 2.0)
    for kernel, share in product(KERNELS, shares):
        name = f"Δ = {share:.10g} Δ*, {kernel}"
        delta_of = partial(_of_critical, share, kernel)
        if share < 1:
            yield case(name, paper, delta_of, kernel=kernel, largest_ratio=math.inf)
        else:
            yield case(name, paper, delta_of, kernel=kernel, refusal=refusal)
    words = ("delta = 1e-09 um", "must stay below Delta* = 0 um")
    at_zero = Refusal(BeyondCriticalDelta, words)
    yield case("flat: Δ* = 0", flat, 1e-9, refusal=at_zero)


def _of_critical(share: float, kernel: Kernel, heights: Field) -> float:
    """Return a displacement [um], `share` times Delta*."""
    return share * critical_delta(heights, kernel)


CAPS = (1e-9, 1e-6, 1e-4, 1e-3, 5e-3, 2e-2, 5e-2, 0.1, 0.3, 1.0, 1e3)
"""Hardnesses for E* = 1 MPa [MPa]. At the lowest nearly all nodes in contact yield, at the highest
none."""

capped = partial(slow_case, "hardness")
"""Makes a case of bodies that yield."""


def _hardnesses() -> Iterator[Case]:
    """Yield the paper's surface with rising hardness, so that fewer and fewer nodes yield."""
    for hardness in CAPS:
        checks = (says_what_yields,)
        yield capped(f"H = {hardness:g} E*", paper, hardness=hardness, checks=checks)


def _limits() -> Iterator[Case]:
    """Yield cases of the paper's surface with extreme hardnesses, and with refused ones.

    Near the largest elastic pressure and far above it, the contact has to be nearly elastic. At
    hardnesses close to 0 it has to be the bearing area. Hardnesses that are not above 0 or NaN have
    to raise ValueError.
    """
    largest = float(Setup(paper()).solve().pressure.max())
    nearly_elastic = {
        "the largest elastic pressure": largest,
        "one ulp above the largest elastic pressure": float(
            np.nextafter(largest, np.inf)
        ),
        "one ulp below the largest elastic pressure": float(np.nextafter(largest, 0)),
        "H = 1e90 E*": 1e90,
    }
    for name, hardness in nearly_elastic.items():
        yield capped(name, paper, hardness=hardness, checks=(is_nearly_elastic,))
    for hardness in (1e-12, 1e-90):
        checks = (is_bearing_area, says_what_yields)
        name = f"bearing area, H = {hardness:g} E*"
        yield capped(name, paper, hardness=hardness, checks=checks)
    refusal = Refusal(ValueError, ("hardness",))
    for hardness in (0.0, -1.0, np.nan):
        yield capped(f"H = {hardness:g}", paper, hardness=hardness, refusal=refusal)


@dataclass(frozen=True)
class _YieldingSurface:
    """A surface of extreme form that bodies of several hardnesses have."""

    name: str  # name in the table
    make: Callable[[], Field]  # returns the heights [um]
    delta: float  # displacement [um]


YIELDING_SURFACES = (
    _YieldingSurface(name="flat", make=flat, delta=5.0),
    _YieldingSurface(
        name="sphere", make=partial(indenter, Paraboloid(5000.0)), delta=5.0
    ),
    _YieldingSurface(name="white noise", make=white_noise, delta=10.0),
    _YieldingSurface(name="checkerboard", make=checkerboard, delta=10.0),
    _YieldingSurface(name="exact ties", make=terraces, delta=25.0),
)
"""The surfaces of extreme form."""


def _yielding_surfaces() -> Iterator[Case]:
    """Yield surfaces of extreme form, and long cells, of bodies that yield."""
    combinations = product(YIELDING_SURFACES, (1e-3, 1e-2, 5e-2), KERNELS)
    for surface, hardness, kernel in combinations:
        name = f"{surface.name}, H = {hardness:g} E*, {kernel}"
        yield capped(name, surface.make, surface.delta, hardness=hardness, kernel=kernel)
    for sides, hardness in product(LONG_CELLS, (1e-4, 1e-3, 1e-2)):
        name = f"{_cells(sides)}, H = {hardness:g} E*"
        yield capped(name, paper, hardness=hardness, side=sides)


def _loads() -> Iterator[Case]:
    """Yield mean pressures below the hardness, and refused ones at the hardness or above it."""
    for hardness, share in product(
        (1e-3, 0.1), (1e-3, 0.5, 0.9, 0.99, 1 - 1e-6, 1.0, 2.0)
    ):
        pressure = share * hardness
        force = pressure * paper().size * CELL**2
        allowed = 1e-12
        check = partial(has_force, "the one given", force, allowed)
        refusal = None
        if share >= 1:
            refusal = Refusal(bem.NoSolution, ("hardness",))
        yield capped(
            f"p = {share:.7g} H, H = {hardness:g} E*",
            paper,
            pressure=pressure,
            hardness=hardness,
            checks=(check,),
            refusal=refusal,
        )
