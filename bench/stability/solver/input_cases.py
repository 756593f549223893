"""Cases about what is given: material, size, displacement, grid, array and tolerance."""

from collections.abc import Iterator
from functools import partial

import numpy as np

from bench.references import dense
from bench.stability.case import Case
from bench.stability.solver import topographies
from bench.stability.solver.case import contact_case
from bench.stability.solver.checks import (
    FOUR_ULP,
    Check,
    agrees_with_dense_solve,
    equals,
    has_force,
    one_cell_force,
    scales,
    turns_with_surface,
)
from bench.stability.solver.setup import DELTA
from bench.stability.solver.topographies import CELL, SIDE, SMALL, Field, paper

HEIGHT_ROUNDING = 1e-6
"""Heights times a power of ten are rounded anew: two solves then differ by their tolerance."""

LONG_CELLS = (
    "rows of cells hardly differ across their short side: H is nearly singular there, and the"
    " preconditioner, made for square cells, further from its inverse"
)


DENSE = (agrees_with_dense_solve(),)


def cases() -> Iterator[Case]:
    """Family after family."""
    yield from _materials()
    yield from _sizes()
    yield from _displacements()
    yield from _grids()
    yield from _patches()
    yield from _arrays()
    reason = "it is asked for more digits than the ordinary solve"
    for rtol in (1e-2, 1e-9, 1e-12, 1e-14):
        yield contact_case("tolerance", f"rtol = {rtol:g}", paper, rtol=rtol, reason=reason)


def _materials() -> Iterator[Case]:
    case = partial(contact_case, "material")
    for modulus in (1e-12, 1e-6, 1e6, 1e15):
        yield case(f"E = {modulus:g} MPa", paper, modulus=modulus, checks=(scales(modulus),))
    for poisson in (-0.99, -0.5, 0.3, 0.5):
        check = scales(1 / (1 - poisson**2))
        yield case(f"ν = {poisson:g}", paper, poisson=poisson, checks=(check,))


def _sizes() -> Iterator[Case]:
    case = partial(contact_case, "size")
    for side in (1e-9, 1.0, 1e9):
        yield case(f"L = {side:g} um", paper, side=side, checks=(scales(side / SIDE),))
    for factor, name, allowed in (
        (1e-12, "1e-12", HEIGHT_ROUNDING),
        (1e12, "1e12", HEIGHT_ROUNDING),
        (2.0**-40, "2^-40", FOUR_ULP),
        (2.0**40, "2^40", FOUR_ULP),
    ):
        taller = partial(topographies.taller_paper, factor)
        check = scales(factor, allowed)
        yield case(f"heights and Δ times {name}", taller, DELTA * factor, checks=(check,))
    for size, factor, delta, side, modulus, force in (
        ("small", 1e-12, 25e-12, 1e-9, 1e-12, 1e-36),
        ("large", 1e12, 25e12, 1e9, 1e15, 1e33),
    ):
        taller = partial(topographies.taller_paper, factor)
        checks = (scales(force, HEIGHT_ROUNDING),)
        name = f"E, L, heights and Δ {size}"
        yield case(name, taller, delta, side=side, modulus=modulus, checks=checks)


def _displacements() -> Iterator[Case]:
    case = partial(contact_case, "displacement")
    untouched = has_force("nothing touches", 0.0, 0.0)
    for delta in (0.0, -1.0, -1e300):
        yield case(f"Δ = {delta:g}", paper, delta, checks=(untouched,))
    ulp = float(np.spacing(paper().max()))
    for name, delta in (
        ("one ulp of the highest node", ulp),
        ("1e-300 um", 1e-300),
    ):
        check = has_force("one cell", one_cell_force(delta, CELL), 1e-6)
        yield case(f"first touch by {name}", paper, delta, checks=(check,))
    for name, factor in (
        ("1e-3 short of", 1 - 1e-3),
        ("at", 1.0),
        ("1e-3 beyond", 1 + 1e-3),
        ("10 times", 10.0),
    ):
        small, reaching = partial(paper, SMALL), partial(_to_full_contact, factor)
        yield case(f"{name} full contact", small, reaching, checks=DENSE)
    for times in (1.0, 10.0, 1e3, 1e6):
        yield case(f"Δ of {times:g} height ranges", paper, times * float(np.ptp(paper())))


def _to_full_contact(factor: float, heights: Field) -> float:
    return factor * dense.full_contact_delta(heights, "uniform-pressure")


def _grids() -> Iterator[Case]:
    case = partial(contact_case, "grid")
    for k in range(1, 12):
        checks: tuple[Check, ...] = DENSE if k <= 5 else ()
        checks += (turns_with_surface(),) if k == 7 else ()
        surface = partial(paper, 2**k + 1)
        yield case(f"k = {k}", surface, checks=checks, slow=k >= 10, ordinary=True)
    check = has_force("one cell", one_cell_force(3, 2), 1e-6)
    yield case("a single node", topographies.flat((1, 1)), 3.0, spacing=2.0, checks=(check,))
    for name, shape in (("one row", (1, 129)), ("one column", (129, 1)), ("four nodes", (2, 2))):
        corner = partial(topographies.cropped_paper, shape)
        yield case(name, corner, 10.0, spacing=7.8125, checks=DENSE)


def _patches() -> Iterator[Case]:
    """Patches and cells that are not square."""
    case = partial(contact_case, "grid")
    strip = partial(topographies.cropped_paper, (3, 129))
    yield case("a patch of 1:64", strip, side=(1000 / 64, 1000.0), checks=DENSE)
    for sides in ((1000.0, 64000.0), (64000.0, 1000.0)):
        name = f"cells of {sides[0] / 1000:g}:{sides[1] / 1000:g}"
        long = partial(case, side=sides, reason=LONG_CELLS)
        yield long(f"{name}, coarse", partial(paper, SMALL), checks=DENSE)
        yield long(name, paper)
        yield long(f"{name}, large contact", paper, 500.0)


def _arrays() -> Iterator[Case]:
    case, whole = partial(contact_case, "array"), topographies.whole_numbers
    for name, given in (
        ("float32", lambda: paper().astype(np.float32)),
        ("float16", lambda: paper().astype(np.float16)),
        ("big-endian", lambda: paper().astype(">f8")),
        ("int64", lambda: whole().astype(np.int64)),
        ("uint8", lambda: whole().astype(np.uint8)),
        ("Fortran order", lambda: np.asfortranarray(paper())),
        ("every other column of a wider array", lambda: np.repeat(paper(), 2, axis=1)[:, ::2]),
        ("read-only", paper),
    ):
        yield case(name, given, checks=(equals("a float64 copy", np.array),))
    far = equals("the same without the offset", partial(np.add, -1e8))
    name = "an offset of 1e8 um, roughness of 1 um"
    yield case(name, partial(topographies.offset_paper, 1e8), 0.5, checks=(far,))
