"""Judgements of an answer of the solver that do not rely on it, and contacts as cases.

The problem is strictly convex: a pressure that is not negative, whose gap is not negative and
which is zero where the gap is not, is its solution. `complementarity` proves that of every answer,
with coefficients and a convolution of its own; the others look at what the answer states. Those
that take further arguments before the problem and its contact are given them by
`functools.partial`.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

import bem
from bem.influence import Kernel
from bench.references.half_space import Field, displacement, flat_punch
from bench.stability.case import Answer, Case, Finding, Refusal, one_line
from bench.stability.setup import DELTA, Setup, cropped_paper, paper
from gen.quantities import AREA, FORCE

ROUNDING = 1e-9  # what two convolutions of the same pressure may differ by [Delta]

FOUR_ULP = 4 * float(np.finfo(np.float64).eps)

Check = Callable[[Setup, bem.Contact], Iterable[Finding]]
Displace = Callable[[Field, Kernel, float], Field]


def complementarity(asked: Setup, contact: bem.Contact) -> Iterator[Finding]:
    """The conditions of contact, from the pressure alone."""
    tension = int(np.count_nonzero(~(contact.pressure >= 0)))
    beyond = int(np.count_nonzero(contact.pressure > asked.bound))
    yield Finding("gap", violation(asked, contact.pressure), asked.rtol + ROUNDING)
    if tension:
        yield Finding("nodes in tension", tension, 0)
    if beyond:
        yield Finding("nodes above the hardness", beyond, 0)


def honesty(
    asked: Setup, contact: bem.Contact, displace: Displace = displacement
) -> Iterator[Finding]:
    """Residual, force and area are those of the pressure."""
    share = 100 * float(np.mean(contact.pressure > 0))
    recomputed = violation(asked, contact.pressure, displace)
    yield Finding("residual off", abs(contact.residual - recomputed), ROUNDING)
    force = float(contact.pressure.sum()) * asked.cell_area
    yield Finding("force off its pressure", deviation(contact.force, force), 1e-12)
    yield Finding("area off its nodes", abs(contact.area_percent - share), 1e-12)


def says_what_yields(
    asked: Setup, contact: bem.Contact, displace: Displace = displacement
) -> Iterator[Finding]:
    """Share, depth and flattened heights are those of the pressure."""
    yielded = contact.pressure == asked.hardness
    share = 100 * float(yielded.mean())
    yield Finding("yielded share off", abs(contact.yielded_percent - share), 1e-12)
    gap = gap_under(asked, contact.pressure, displace)
    depth = np.where(yielded, np.maximum(-gap, 0.0), 0.0)
    off = float(np.abs(contact.yielded_depth / asked.delta - depth).max())
    yield Finding("yielded depth off", off, 1e-9)
    off = float(np.abs(contact.flattened - (asked.surface - contact.yielded_depth)).max())
    height = float(np.abs(asked.surface).max()) or 1.0
    yield Finding("flattened heights off", off / height, 1e-15)


def violation(asked: Setup, pressure: Field, displace: Displace = displacement) -> float:
    """Largest |gap| under pressure or penetration elsewhere [Delta; um where Delta <= 0].

    At yielded nodes only a gap counts, no penetration: that is the depth to which they yield.
    """
    return worst_gap(pressure, gap_under(asked, pressure, displace), asked.bound)


def worst_gap(pressure: Field, gap: Field, bound: float) -> float:
    """Return the largest violation of the conditions of contact by a pressure and its gap."""
    wrong = np.where(pressure > 0, np.abs(gap), -gap)
    worst = float(np.where(pressure >= bound * (1 - 1e-15), gap, wrong).max())
    return np.inf if np.isnan(worst) else max(0.0, worst)


def gap_under(asked: Setup, pressure: Field, displace: Displace = displacement) -> Field:
    """Return the (nx, ny) distance left between the surfaces [Delta; um where Delta <= 0]."""
    unit = asked.delta if asked.delta > 0 else 1.0
    with np.errstate(
        all="ignore"
    ):  # what no number can hold fails as such, in `violation`
        reduced: Field = pressure * (asked.compliance / unit)
        approach = asked.delta / unit
        if asked.far_field == "compliant":
            punch = flat_punch(pressure.shape, asked.kernel, asked.aspect)
            approach += float(reduced.sum() / punch.sum())
        overlap = (asked.surface - asked.surface.max()) / unit + approach
        gap: Field = displace(reduced, asked.kernel, asked.aspect) - overlap
    return gap


def unlike(first: ArrayLike, second: ArrayLike, decided: ArrayLike = True) -> int:
    """Count decided nodes at which two fields differ."""
    return int(np.count_nonzero(np.not_equal(first, second) & decided))


def has_force(
    name: str, force: float, allowed: float, _asked: Setup, contact: bem.Contact
) -> Iterator[Finding]:
    """The force [uN] is that of a closed form; `allowed` includes what the grid costs [1]."""
    yield Finding(f"force off {name}", deviation(contact.force, force), allowed)


@lru_cache(maxsize=1)
def _ordinary_contact() -> bem.Contact:
    return Setup(paper(), DELTA).solve()


def scales(
    force: float, allowed: float, _asked: Setup, contact: bem.Contact
) -> Iterator[Finding]:
    """The ordinary contact in other units: its force times `force` [1], the same nodes."""
    ordinary = _ordinary_contact()
    yield Finding(
        "force off similarity", deviation(contact.force, force * ordinary.force), allowed
    )
    yield Finding("nodes off", unlike(contact.pressure > 0, ordinary.pressure > 0), 0)


def is_nearly_elastic(asked: Setup, contact: bem.Contact) -> Iterator[Finding]:
    """Force and contact nodes are those of the elastic contact, to the tolerance of both."""
    elastic = replace(asked, hardness=None).solve()
    yield Finding(
        "force off the elastic one", abs(contact.force / elastic.force - 1), asked.rtol
    )
    off = unlike(contact.pressure > 0, elastic.pressure > 0)
    yield Finding("nodes off the elastic contact", off, 0)


def is_bearing_area(asked: Setup, contact: bem.Contact) -> Iterator[Finding]:
    """The pressure is the hardness wherever the undeformed surfaces overlap."""
    overlap = asked.surface - asked.surface.max() + asked.delta > 0
    expected = np.where(overlap, asked.hardness or 0.0, 0.0)
    yield Finding("nodes off the bearing area", unlike(contact.pressure, expected), 0)


def deviation(value: float, expected: float) -> float:
    """Relative deviation; zero where both are zero."""
    if value == expected:
        return 0.0
    return abs(value / expected - 1) if expected else np.inf


# Iterations over those of the ordinary contact on the same grid, unless a case takes more.
MOST_TIMES_ORDINARY = 3.0


def contact_case(
    family: str,
    name: str,
    surface: ArrayLike | Callable[[], ArrayLike],
    delta: float | Callable[[Field], float] = DELTA,
    *,
    checks: Sequence[Check] = (),
    most: float = MOST_TIMES_ORDINARY,
    refusal: Refusal | None = None,
    slow: bool = False,
    **arguments: Any,
) -> Case:
    """Make a case that solves a contact.

    The surface may be a function that makes it when the case is run [um], and `delta` one of its
    heights [um]. `checks` and `most` are those of `judge`, further arguments fields of `Setup`.
    """

    def examine() -> Answer:
        heights = surface() if callable(surface) else surface
        wanted = delta(np.asarray(heights, np.float64)) if callable(delta) else delta
        asked = Setup(heights, wanted, **arguments)
        try:
            contact = asked.solve()
        except Exception as error:  # whatever it is, `run_case` judges it
            return Answer(one_line(error), asked=asked.describe(), raised=error)
        if asked.pressure is not None:
            asked = replace(asked, delta=contact.approach)
        return judge(asked, contact, checks, most)

    return Case(family, name, "", examine, refusal, slow)


def judge(
    asked: Setup,
    contact: bem.Contact,
    checks: Sequence[Check] = (),
    most: float = MOST_TIMES_ORDINARY,
) -> Answer:
    """Judge the contact that the solver has returned.

    `checks` come besides complementarity, which every answer has to fulfil. A contact may take
    `most` times the iterations of the ordinary one on its grid.
    """
    first = ordinary_iterations(contact.pressure.shape)
    findings = [
        finding
        for check in (*checks, complementarity)
        for finding in check(asked, contact)
    ]
    findings += [
        Finding("iterations", contact.iterations, asked.max_iterations),
        Finding("times ordinary", contact.iterations / first, most),
        *honesty(asked, contact),
    ]
    numbers = {
        AREA.name: contact.area_percent,
        FORCE.in_tables: contact.force,
        "residual": contact.residual,
        "iterations": contact.iterations,
        "ordinary_iterations": first,
    }
    out = f"{contact.area_percent:.4g} %, {contact.force:.6g} µN"
    return Answer(out, findings, asked.describe(), numbers)


@lru_cache(maxsize=64)
def ordinary_iterations(shape: tuple[int, int]) -> int:
    """Count iterations for the paper's surface, cropped to this grid, at Delta = 25 um."""
    return max(Setup(cropped_paper(shape), spacing=1.0).solve().iterations, 1)
