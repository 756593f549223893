"""Cases of the contact solver: elastic bodies, and a hardness from none to all nodes yielded."""

import math
from collections.abc import Callable, Iterator
from functools import partial
from itertools import chain, product
from typing import Any

import numpy as np

import bem
from bem.analytic import Cone, FlatPunch, Indenter, Paraboloid
from bem.far_field import BeyondCriticalDelta
from bem.influence import KERNELS, Kernel
from bench.references import dense
from bench.references.half_space import Field, critical_delta, influence_coefficients
from bench.stability import checks as judged
from bench.stability import setup as topographies
from bench.stability.case import Case, Refusal
from bench.stability.checks import contact_case
from bench.stability.setup import CELL, DELTA, NODES, SIDE, SMALL, Setup, flat, paper

# Heights times a power of ten are rounded anew: two solves then differ by their tolerance.
HEIGHT_ROUNDING = 1e-6

# Solves that take many iterations: cells whose short side hardly counts; pressures by concentrated
# forces, which resist a checkerboard seven times less than uniform ones do; compliant far fields
# near Delta*; and bodies that yield, whose yielded nodes have to be found too.
slow_case = partial(contact_case, most=math.inf)


def cases() -> Iterator[Case]:
    """Yield elastic contacts, family after family, then bodies that yield."""
    given = _materials_and_sizes(), _displacements(), _grids()
    surfaces = _roughness(), _single_nodes(), _terraces(), _bodies()
    models = _concentrated_forces(), _compliant_far_fields()
    yielding = _hardnesses(), _limits(), _yielding_surfaces(), _loads()
    return chain(*given, *surfaces, *models, *yielding)


def _one_cell(delta: float, spacing: float) -> Any:
    """One square cell carries the force that presses it down by Delta, E* = 1 MPa."""
    force = (
        delta * spacing / float(influence_coefficients((1, 1), "uniform-pressure")[0, 0])
    )
    return partial(judged.has_force, "one cell", force, 1e-6)


def _materials_and_sizes() -> Iterator[Case]:
    def case(
        family: str, name: str, factor: float, force: float, **arguments: Any
    ) -> Case:
        allowed = judged.FOUR_ULP if np.log2(factor).is_integer() else HEIGHT_ROUNDING
        heights, check = paper() * factor, partial(judged.scales, force, allowed)
        return contact_case(
            family, name, heights, DELTA * factor, checks=(check,), **arguments
        )

    for modulus in (1e-12, 1e-6, 1e6, 1e15):
        yield case("material", f"E = {modulus:g} MPa", 1, modulus, modulus=modulus)
    for poisson in (-0.99, -0.5, 0.3, 0.5):
        yield case(
            "material", f"ν = {poisson:g}", 1, 1 / (1 - poisson**2), poisson=poisson
        )
    for side in (1e-9, 1.0, 1e9):
        yield case("size", f"L = {side:g} um", 1, side / SIDE, side=side)
    for name, factor in (
        ("1e-12", 1e-12),
        ("1e12", 1e12),
        ("2^-40", 2.0**-40),
        ("2^40", 2.0**40),
    ):
        yield case("size", f"heights and Δ times {name}", factor, factor)
    name = "E, L, heights and Δ"
    yield case("size", f"{name} small", 1e-12, 1e-36, side=1e-9, modulus=1e-12)
    yield case("size", f"{name} large", 1e12, 1e33, side=1e9, modulus=1e15)


def _displacements() -> Iterator[Case]:
    case = partial(contact_case, "displacement")
    untouched = partial(judged.has_force, "nothing touches", 0.0, 0.0)
    for delta in (0.0, -1.0, -1e300):
        yield case(f"Δ = {delta:g}", paper, delta, checks=(untouched,))
    ulp = float(np.spacing(paper().max()))
    for name, delta in (("one ulp of the highest node", ulp), ("1e-300 um", 1e-300)):
        yield case(
            f"first touch by {name}", paper, delta, checks=(_one_cell(delta, CELL),)
        )
    shares = {
        "1e-3 short of": 1 - 1e-3,
        "at": 1.0,
        "1e-3 beyond": 1 + 1e-3,
        "10 times": 10.0,
    }
    for name, factor in shares.items():
        yield case(
            f"{name} full contact", paper(SMALL), partial(_to_full_contact, factor)
        )
    for times in (1.0, 10.0, 1e3, 1e6):
        yield case(f"Δ of {times:g} height ranges", paper, times * float(np.ptp(paper())))


def _to_full_contact(factor: float, heights: Field) -> float:
    return factor * dense.full_contact_delta(heights, "uniform-pressure")


def _grids() -> Iterator[Case]:
    """Numbers of nodes, and patches and cells that are not square."""
    case, corner = partial(contact_case, "grid"), topographies.cropped_paper
    for k in range(1, 12):
        yield case(f"k = {k}", partial(paper, 2**k + 1), slow=k >= 10)
    yield case("a single node", flat(1), 3.0, spacing=2.0, checks=(_one_cell(3, 2),))
    for name, shape in (
        ("one row", (1, 129)),
        ("one column", (129, 1)),
        ("four nodes", (2, 2)),
    ):
        yield case(name, corner(shape), 10.0, spacing=7.8125)
    yield case("a patch of 1:64", corner((3, 129)), side=(1000 / 64, 1000.0))
    for sides in ((1000.0, 64000.0), (64000.0, 1000.0)):
        name = f"cells of {sides[0] / 1000:g}:{sides[1] / 1000:g}"
        long = partial(slow_case, "grid", side=sides)
        yield long(name, paper)
        yield long(f"{name}, large contact", paper, 500.0)


def _roughness() -> Iterator[Case]:
    case = partial(contact_case, "roughness")
    for hurst in (0.01, 0.99):
        yield case(f"H = {hurst:g}", paper(NODES, hurst))
        yield case(f"H = {hurst:g}, large contact", paper(NODES, hurst), 200.0)
    yield case("σ0 = 0: flat, edge singular", paper(sigma0=0.0))
    for delta in (1.0, 10.0, 100.0, 1000.0):
        yield case(f"white noise, Δ = {delta:g} σ", topographies.white_noise, delta)
    plane = np.linspace(0.0, SIDE, NODES)[:, None]
    for delta in (1.0, 25.0, 700.0, 5000.0):
        yield case(f"rough, tilted by 45°, Δ = {delta:g}", paper() + plane, delta)
    yield case("a plane tilted by 45°", flat() + plane, 700.0)


def _single_nodes() -> Iterator[Case]:
    """One node above or below all others."""
    case, middle = partial(contact_case, "feature"), topographies.with_middle_at
    spike, needle, pit = middle(10.0, flat()), middle(1e6, paper()), middle(-1e6, flat())
    yield case("a spike on a plane", spike, 5.0, checks=(_one_cell(5, CELL),))
    yield case("spike and plane touch", spike, 20.0)
    yield case("a needle carries all load", needle, 25.0, checks=(_one_cell(25, CELL),))
    yield case("a needle in to its root", needle, 1.1e6)
    for delta in (1.0, 1e7):
        yield case(f"a pit 1e6 deep, Δ = {delta:g}", pit, delta)


def _terraces() -> Iterator[Case]:
    """Steps and exact ties."""
    for name, surface, deltas in (
        ("a step of 1 um", topographies.step, (0.5, 1.0, 3.0)),
        ("a checkerboard of 1 um", topographies.checkerboard, (1.0, 1e3, 10.0)),
        ("plateaus of exact ties", topographies.terraces, (10.0, 25.0, 60.0)),
    ):
        for delta in deltas:
            yield contact_case("feature", f"{name}, Δ = {delta:g}", surface, delta)


def _bodies() -> Iterator[Case]:
    """Closed forms, within what the grid costs; some 60 nodes carry the first."""
    bodies: tuple[tuple[str, str, Indenter, float, int, float], ...] = (
        (
            "Hertz, even grid: four nodes tie",
            "Hertz's",
            Paraboloid(5000.0),
            0.2,
            128,
            0.01,
        ),
        ("Hertz", "Hertz", Paraboloid(5000.0), 5.0, NODES, 0.001),
        ("a cone", "a cone", Cone(0.1), 25.0, NODES, 0.001),
        ("a flat punch", "a flat punch", FlatPunch(250.0), 1.0, NODES, 0.01),
    )
    for name, whose, body, delta, nodes, allowed in bodies:
        off_tip = (
            0.0 if nodes % 2 else SIDE / (nodes - 1) * np.sqrt(0.5)
        )  # of the nearest node
        below_tip = -float(body.heights(np.array(off_tip)))
        closed_form = partial(
            judged.has_force, whose, body.force(delta + below_tip), allowed
        )
        surface = partial(topographies.indenter, body, nodes)
        yield contact_case("closed form", name, surface, delta, checks=(closed_form,))


def _concentrated_forces() -> Iterator[Case]:
    """The kernel that is nearly singular where much is in contact."""
    case = partial(slow_case, "concentrated force", kernel="concentrated-force")
    for delta in (25.0, 80.0, 150.0, 500.0, 5000.0):
        yield case(f"Δ = {delta:g}", paper, delta)
    yield case("white noise", topographies.white_noise, 100.0)
    yield case("flat", flat)
    for nodes, delta in product((NODES, SMALL), (1.0, 10.0, 50.0, 1e3)):
        name, board = f"a checkerboard of {nodes} nodes", topographies.checkerboard(nodes)
        yield case(f"{name}, Δ = {delta:g}", board, delta)


def _compliant_far_fields() -> Iterator[Case]:
    case = partial(contact_case, "compliant far field", far_field="compliant")
    refusal = Refusal(BeyondCriticalDelta, ("delta = ", "must stay below Delta* = "))
    for kernel, share in product(KERNELS, (0.9, 0.99, 0.999, 1 + 1e-9, 2.0)):
        name, delta = (
            f"Δ = {share:.10g} Δ*, {kernel}",
            partial(_of_critical, share, kernel),
        )
        judged_by: dict[str, Any] = (
            {"most": math.inf} if share < 1 else {"refusal": refusal}
        )
        yield case(name, paper, delta, kernel=kernel, **judged_by)
    nowhere = Refusal(
        BeyondCriticalDelta, ("delta = 1e-09 um", "must stay below Delta* = 0 um")
    )
    yield case("flat: Δ* = 0", flat, 1e-9, refusal=nowhere)


def _of_critical(share: float, kernel: Kernel, heights: Field) -> float:
    return share * critical_delta(heights, kernel)


# Of a half-space of E* = 1 MPa [MPa].
CAPS = (1e-9, 1e-6, 1e-4, 1e-3, 5e-3, 2e-2, 5e-2, 0.1, 0.3, 1.0, 1e3)
capped = partial(slow_case, "hardness")


def _hardnesses() -> Iterator[Case]:
    """Yield the paper's surface with fewer and fewer yielded nodes."""
    for hardness in CAPS:
        checks = (judged.says_what_yields,)
        yield capped(f"H = {hardness:g} E*", paper, hardness=hardness, checks=checks)


def _limits() -> Iterator[Case]:
    """The elastic contact from its largest pressure on, and the bearing area."""
    largest = float(Setup(paper()).solve().pressure.max())
    for title, hardness in (
        ("the largest elastic pressure", largest),
        (
            "one ulp above the largest elastic pressure",
            float(np.nextafter(largest, np.inf)),
        ),
        ("one ulp below the largest elastic pressure", float(np.nextafter(largest, 0))),
        ("H = 1e90 E*", 1e90),
    ):
        yield capped(title, paper, hardness=hardness, checks=(judged.is_nearly_elastic,))
    for hardness in (1e-12, 1e-90):
        both = judged.is_bearing_area, judged.says_what_yields
        name = f"bearing area, H = {hardness:g} E*"
        yield capped(name, paper, hardness=hardness, checks=both)
    for hardness in (0.0, -1.0, np.nan):
        refusal = Refusal(ValueError, ("hardness",))
        yield capped(f"H = {hardness:g}", paper, hardness=hardness, refusal=refusal)


def _yielding_surfaces() -> Iterator[Case]:
    surfaces: tuple[tuple[str, Callable[..., Field], float], ...] = (
        ("flat", flat, 5.0),
        ("sphere", partial(topographies.indenter, Paraboloid(5000.0)), 5.0),
        ("white noise", topographies.white_noise, 10.0),
        ("checkerboard", topographies.checkerboard, 10.0),
        ("exact ties", topographies.terraces, 25.0),
    )
    hardnesses = (1e-3, 1e-2, 5e-2)
    for (name, surface, delta), hardness, kernel in product(
        surfaces, hardnesses, KERNELS
    ):
        title = f"{name}, H = {hardness:g} E*, {kernel}"
        yield capped(title, surface, delta, hardness=hardness, kernel=kernel)
    for sides in ((1000.0, 64000.0), (64000.0, 1000.0)):
        for hardness in (1e-4, 1e-3, 1e-2):
            title = (
                f"cells of {sides[0] / 1000:g}:{sides[1] / 1000:g}, H = {hardness:g} E*"
            )
            yield capped(title, paper, hardness=hardness, side=sides)


def _loads() -> Iterator[Case]:
    """A given mean pressure up to the hardness, beyond which there is no solution."""
    for hardness in (1e-3, 0.1):
        for share in (1e-3, 0.5, 0.9, 0.99, 1 - 1e-6, 1.0, 2.0):
            pressure = share * hardness
            given = partial(
                judged.has_force,
                "the one given",
                pressure * paper().size * CELL**2,
                1e-12,
            )
            refusal = Refusal(bem.NoSolution, ("hardness",)) if share >= 1 else None
            case = partial(capped, hardness=hardness, checks=(given,), refusal=refusal)
            yield case(
                f"p = {share:.7g} H, H = {hardness:g} E*", paper, pressure=pressure
            )
