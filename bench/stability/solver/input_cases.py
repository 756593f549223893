"""Cases about what is given: material, size, displacement, grid, array and tolerance."""

from collections.abc import Iterator
from functools import partial

import numpy as np

from bench.references import dense
from bench.stability.solver import topographies
from bench.stability.solver.case import Case
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
from bench.stability.solver.setup import DELTA, pressed
from bench.stability.solver.topographies import CELL, SIDE, SMALL, Field, paper

HEIGHT_ROUNDING = 1e-6
"""Heights times a power of ten are rounded anew: two solves then differ by their tolerance."""

LONG_CELLS = (
    "rows of cells hardly differ across their short side: H is nearly singular there, and the"
    " preconditioner, made for square cells, further from its inverse"
)


def _materials() -> Iterator[Case]:
    for modulus in (1e-12, 1e-6, 1e6, 1e15):
        setup = pressed(paper, modulus=modulus)
        yield Case("material", f"E = {modulus:g} MPa", setup, (scales(modulus),))
    for poisson in (-0.99, -0.5, 0.3, 0.5):
        check = scales(1 / (1 - poisson**2))
        yield Case("material", f"ν = {poisson:g}", pressed(paper, poisson=poisson), (check,))


def _sizes() -> Iterator[Case]:
    for side in (1e-9, 1.0, 1e9):
        yield Case("size", f"L = {side:g} um", pressed(paper, side=side), (scales(side / SIDE),))
    for factor, name, allowed in (
        (1e-12, "1e-12", HEIGHT_ROUNDING),
        (1e12, "1e12", HEIGHT_ROUNDING),
        (2.0**-40, "2^-40", FOUR_ULP),
        (2.0**40, "2^40", FOUR_ULP),
    ):
        setup = pressed(partial(topographies.taller_paper, factor), DELTA * factor)
        yield Case("size", f"heights and Δ times {name}", setup, (scales(factor, allowed),))
    small = pressed(partial(topographies.taller_paper, 1e-12), 25e-12, side=1e-9, modulus=1e-12)
    yield Case("size", "E, L, heights and Δ small", small, (scales(1e-36, HEIGHT_ROUNDING),))
    large = pressed(partial(topographies.taller_paper, 1e12), 25e12, side=1e9, modulus=1e15)
    yield Case("size", "E, L, heights and Δ large", large, (scales(1e33, HEIGHT_ROUNDING),))


def _displacements() -> Iterator[Case]:
    untouched = has_force("nothing touches", 0.0, 0.0)
    for delta in (0.0, -1.0, -1e300):
        yield Case("displacement", f"Δ = {delta:g}", pressed(paper, delta), (untouched,))
    ulp = float(np.spacing(paper().max()))
    for name, delta in (
        ("one ulp of the highest node", ulp),
        ("1e-300 um", 1e-300),
    ):
        check = has_force("one cell", one_cell_force(delta, CELL), 1e-6)
        yield Case("displacement", f"first touch by {name}", pressed(paper, delta), (check,))
    for name, factor in (
        ("1e-3 short of", 1 - 1e-3),
        ("at", 1.0),
        ("1e-3 beyond", 1 + 1e-3),
        ("10 times", 10.0),
    ):
        setup = pressed(partial(paper, SMALL), partial(_to_full_contact, factor))
        yield Case("displacement", f"{name} full contact", setup, (agrees_with_dense_solve(),))
    for times in (1.0, 10.0, 1e3, 1e6):
        setup = pressed(paper, times * float(np.ptp(paper())))
        yield Case("displacement", f"Δ of {times:g} height ranges", setup)


def _to_full_contact(factor: float, heights: Field) -> float:
    return factor * dense.full_contact_delta(heights, "uniform-pressure")


def _grids() -> Iterator[Case]:
    for k in range(1, 12):
        setup = pressed(partial(paper, 2**k + 1))
        checks: tuple[Check, ...] = (agrees_with_dense_solve(),) if k <= 5 else ()
        checks += (turns_with_surface(),) if k == 7 else ()
        yield Case("grid", f"k = {k}", setup, checks, slow=k >= 10, ordinary=True)
    single = pressed(partial(topographies.flat, (1, 1)), 3.0, spacing=2.0)
    yield Case(
        "grid", "a single node", single, (has_force("one cell", one_cell_force(3, 2), 1e-6),)
    )
    for name, shape in (("one row", (1, 129)), ("one column", (129, 1)), ("four nodes", (2, 2))):
        setup = pressed(partial(topographies.cropped_paper, shape), 10.0, spacing=7.8125)
        yield Case("grid", name, setup, (agrees_with_dense_solve(),))
    strip = pressed(partial(topographies.cropped_paper, (3, 129)), side=(1000 / 64, 1000.0))
    yield Case("grid", "a patch of 1:64", strip, (agrees_with_dense_solve(),))
    for sides in ((1000.0, 64000.0), (64000.0, 1000.0)):
        name = f"cells of {sides[0] / 1000:g}:{sides[1] / 1000:g}"
        small = pressed(partial(paper, SMALL), side=sides)
        dense = (agrees_with_dense_solve(),)
        yield Case("grid", f"{name}, coarse", small, dense, reason=LONG_CELLS)
        yield Case("grid", name, pressed(paper, side=sides), reason=LONG_CELLS)
        large = pressed(paper, 500.0, side=sides)
        yield Case("grid", f"{name}, large contact", large, reason=LONG_CELLS)


def _arrays() -> Iterator[Case]:
    whole = topographies.whole_numbers
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
        yield Case("array", name, pressed(given), (equals("a float64 copy", np.array),))
    far = equals("the same without the offset", partial(np.add, -1e8))
    setup = pressed(partial(topographies.offset_paper, 1e8), 0.5)
    yield Case("array", "an offset of 1e8 um, roughness of 1 um", setup, (far,))


def _tolerances() -> Iterator[Case]:
    reason = "it is asked for more digits than the ordinary solve"
    for rtol in (1e-2, 1e-9, 1e-12, 1e-14):
        yield Case("tolerance", f"rtol = {rtol:g}", pressed(paper, rtol=rtol), reason=reason)


def cases() -> Iterator[Case]:
    """Family after family."""
    yield from _materials()
    yield from _sizes()
    yield from _displacements()
    yield from _grids()
    yield from _arrays()
    yield from _tolerances()
