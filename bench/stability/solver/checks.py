"""Judgements of an answer that do not rely on the solver.

The problem is strictly convex: a pressure that is not negative, whose gap is not negative and
which is zero where the gap is not, is its solution. `complementarity` proves that of every answer,
with coefficients and a convolution of its own; the others look at it from another side.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import lru_cache

import numpy as np

import bem
from bem.influence import Kernel
from bench.references import dense
from bench.references.half_space import displacement, flat_punch, influence_coefficients
from bench.stability.case import Finding
from bench.stability.solver.setup import DELTA, Setup
from bench.stability.solver.topographies import Field, paper

ROUNDING = 1e-9
"""What two convolutions of the same pressure may differ by [Delta]."""

UNDECIDED = 1e-5
"""Pressures and gaps in reduced units below which a node may be in contact or not."""

MISPLACED = 1e-4
"""Share of the load that a residual of 1e-6 may leave at another place [1]."""

FOUR_ULP = 4 * float(np.finfo(np.float64).eps)


Check = Callable[[Setup, bem.Contact], Iterable[Finding]]


def complementarity(asked: Setup, contact: bem.Contact) -> Iterator[Finding]:
    """The conditions of contact, from the pressure alone."""
    tension = int(np.count_nonzero(~(contact.pressure >= 0)))
    beyond = int(np.count_nonzero(contact.pressure > (asked.hardness or np.inf)))
    yield Finding("gap", violation(asked, contact.pressure), asked.rtol + ROUNDING)
    if tension:
        yield Finding("nodes in tension", tension, 0)
    if beyond:
        yield Finding("nodes above the hardness", beyond, 0)


def honesty(asked: Setup, contact: bem.Contact) -> Iterator[Finding]:
    """Residual, force and area are those of the pressure."""
    length, width = asked.cell
    share = 100 * float(np.mean(contact.pressure > 0))
    recomputed = violation(asked, contact.pressure)
    yield Finding("residual off", abs(contact.residual - recomputed), ROUNDING)
    force = float(contact.pressure.sum()) * length * width
    yield Finding("force off its pressure", _deviation(contact.force, force), 1e-12)
    yield Finding("area off its nodes", abs(contact.area_percent - share), 1e-12)


def violation(asked: Setup, pressure: Field) -> float:
    """Largest |gap| under pressure or penetration elsewhere [Delta; um where Delta <= 0].

    At yielded nodes only a gap counts, no penetration: that is the depth to which they yield.

    Parameters
    ----------
    asked : the problem
    pressure : (nx, ny) [MPa]
    """
    gap = gap_under(asked, pressure)
    wrong = np.where(pressure > 0, np.abs(gap), -gap)
    if asked.hardness is not None:
        wrong = np.where(pressure == asked.hardness, gap, wrong)
    worst = float(wrong.max())
    return np.inf if np.isnan(worst) else max(0.0, worst)


def gap_under(asked: Setup, pressure: Field) -> Field:
    """Return the (nx, ny) distance left between the surfaces [Delta; um where Delta <= 0]."""
    unit = asked.delta if asked.delta > 0 else 1.0
    with np.errstate(all="ignore"):  # what no number can hold fails as such, in `violation`
        reduced = _reduced(asked, pressure, unit)
        approach = asked.delta / unit
        if asked.far_field == "compliant":
            punch = flat_punch(pressure.shape, asked.kernel, asked.aspect)
            approach += float(reduced.sum() / punch.sum())
        overlap = (asked.surface - asked.surface.max()) / unit + approach
        gap: Field = displacement(reduced, asked.kernel, asked.aspect) - overlap
    return gap


def _reduced(asked: Setup, pressure: Field, unit: float) -> Field:
    """Pressure in units of E* unit / first side of a cell."""
    reduced: Field = pressure * (asked.cell[0] / asked.plane_strain_modulus / unit)
    return reduced


def agrees_with_dense_solve(allowed: float = MISPLACED) -> Check:
    """Load and nodes in contact are those of a direct solve with the dense matrix.

    Parameters
    ----------
    allowed : share of the load that may be elsewhere [1]
    """

    def check(asked: Setup, contact: bem.Contact) -> Iterator[Finding]:
        press = dense.press_compliant if asked.far_field == "compliant" else dense.press
        pressure, gap = press(asked.surface, asked.delta, asked.kernel, asked.aspect)
        reduced = _reduced(asked, contact.pressure, asked.delta)
        yield Finding("load off a dense solve", _misplaced(reduced, pressure), allowed)
        decided = (pressure > UNDECIDED) | (gap > UNDECIDED)
        unlike = ((reduced > 0) != (pressure > 0)) & decided
        yield Finding("nodes off", int(np.count_nonzero(unlike)), 0)

    return check


def has_force(name: str, force: float, allowed: float) -> Check:
    """The force is that of a closed form.

    Parameters
    ----------
    name : whose
    force : [uN]
    allowed : deviation, that of the grid included [1]
    """

    def check(_asked: Setup, contact: bem.Contact) -> Iterator[Finding]:
        yield Finding(f"force off {name}", _deviation(contact.force, force), allowed)

    return check


def one_cell_force(delta: float, spacing: float, kernel: Kernel = "uniform-pressure") -> float:
    """Force that presses one square cell down by Delta, E* = 1 MPa [uN]."""
    return delta * spacing / float(influence_coefficients((1, 1), kernel)[0, 0])


@lru_cache(maxsize=1)
def _ordinary_contact() -> bem.Contact:
    return Setup(paper(), DELTA).solve()


def scales(force: float, allowed: float = FOUR_ULP) -> Check:
    """The ordinary contact in other units: force in proportion, the same nodes in contact.

    Parameters
    ----------
    force : over that of the paper's surface with E* = 1 MPa, L = 1000 um, Delta = 25 um [1]
    allowed : deviation [1]
    """

    def check(_asked: Setup, contact: bem.Contact) -> Iterator[Finding]:
        ordinary = _ordinary_contact()
        deviation = _deviation(contact.force, force * ordinary.force)
        yield Finding("force off similarity", deviation, allowed)
        unlike = (contact.pressure > 0) != (ordinary.pressure > 0)
        yield Finding("nodes off", int(np.count_nonzero(unlike)), 0)

    return check


def equals(name: str, twin: Callable[[Field], Field]) -> Check:
    """The pressure is that of another array of the same heights, to the last bit.

    Parameters
    ----------
    name : of the other array
    twin : makes it from the heights in double precision
    """

    def check(asked: Setup, contact: bem.Contact) -> Iterator[Finding]:
        other = replace(asked, heights=twin(asked.surface)).solve()
        unlike = int(np.count_nonzero(contact.pressure != other.pressure))
        yield Finding(f"nodes off {name}", unlike, 0)

    return check


def is_symmetric(allowed: float = MISPLACED) -> Check:
    """The pressure has the 8 symmetries of the square, as the surface has.

    Parameters
    ----------
    allowed : share of the load that may be elsewhere [1]
    """

    def check(_asked: Setup, contact: bem.Contact) -> Iterator[Finding]:
        misplaced = [_misplaced(image, contact.pressure) for image in images(contact.pressure)]
        yield Finding("load off symmetry", max(misplaced), allowed)

    return check


def turns_with_surface(allowed: float = MISPLACED) -> Check:
    """The 8 images of the surface have the 8 images of the pressure; parameter as above."""

    def check(asked: Setup, contact: bem.Contact) -> Iterator[Finding]:
        turned = [replace(asked, heights=image).solve() for image in images(asked.surface)]
        pairs = zip(turned, images(contact.pressure), strict=True)
        misplaced = [_misplaced(other.pressure, image) for other, image in pairs]
        yield Finding("load off symmetry", max(misplaced), allowed)

    return check


def images(field: Field) -> list[Field]:
    """The field turned and mirrored: the 8 symmetries of the square."""
    return [np.rot90(face, turns) for face in (field, field.T) for turns in range(4)]


def _misplaced(pressure: Field, expected: Field) -> float:
    """Share of the expected load that is elsewhere [1]."""
    total = float(expected.sum())
    return float(np.abs(pressure - expected).sum()) / total if total else np.inf


def _deviation(value: float, expected: float) -> float:
    """Relative, zero where both are zero."""
    if value == expected:
        return 0.0
    return abs(value / expected - 1) if expected else np.inf
