"""Judgements of an answer of the solver that do not rely on it, and contacts as cases.

The problem is strictly convex: a pressure that is not negative, whose gap is not negative and
which is zero where the gap is not, is its solution. `complementarity` proves that of every answer,
with coefficients and a convolution of its own; the others look at it from another side. Those that
take further arguments before the problem and its contact are given them by `functools.partial`.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

import bem
from bem.influence import Kernel
from bench.references import dense
from bench.references.half_space import Field, displacement, flat_punch
from bench.stability.case import Answer, Case, Finding, Refusal, attempt, one_line
from bench.stability.setup import DELTA, Setup, cropped_paper, paper

ROUNDING = 1e-9  # what two convolutions of the same pressure may differ by [Delta]
UNDECIDED = 1e-5  # pressures and gaps in reduced units below which a node may be in contact or not
MISPLACED = 1e-4  # share of the load that a residual of 1e-6 may leave at another place [1]

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
    gap = gap_under(asked, pressure, displace)
    wrong = np.where(pressure > 0, np.abs(gap), -gap)
    if asked.hardness is not None:
        wrong = np.where(pressure == asked.hardness, gap, wrong)
    worst = float(wrong.max())
    return np.inf if np.isnan(worst) else max(0.0, worst)


def gap_under(asked: Setup, pressure: Field, displace: Displace = displacement) -> Field:
    """Return the (nx, ny) distance left between the surfaces [Delta; um where Delta <= 0]."""
    unit = asked.delta if asked.delta > 0 else 1.0
    with np.errstate(all="ignore"):  # what no number can hold fails as such, in `violation`
        reduced: Field = pressure * (asked.compliance / unit)
        approach = asked.delta / unit
        if asked.far_field == "compliant":
            punch = flat_punch(pressure.shape, asked.kernel, asked.aspect)
            approach += float(reduced.sum() / punch.sum())
        overlap = (asked.surface - asked.surface.max()) / unit + approach
        gap: Field = displace(reduced, asked.kernel, asked.aspect) - overlap
    return gap


def agrees_with_dense_solve(
    asked: Setup, contact: bem.Contact, allowed: float = MISPLACED
) -> Iterator[Finding]:
    """Load and nodes in contact are those of a direct solve with the dense matrix.

    At most the share `allowed` of the load may be elsewhere [1].
    """
    press = dense.press_compliant if asked.far_field == "compliant" else dense.press
    pressure, gap = press(asked.surface, asked.delta, asked.kernel, asked.aspect)
    reduced = contact.pressure * (asked.compliance / asked.delta)
    yield Finding("load off a dense solve", _misplaced(reduced, pressure), allowed)
    decided = (pressure > UNDECIDED) | (gap > UNDECIDED)
    yield Finding("nodes off", unlike(reduced > 0, pressure > 0, decided), 0)


def yields_as_by_dense_solve(asked: Setup, contact: bem.Contact) -> Iterator[Finding]:
    """Force, contact nodes and yielded nodes are those of the dense matrix."""
    hardness = asked.bound * asked.compliance
    arguments = asked.surface, asked.delta, hardness, asked.kernel, asked.aspect
    pressure, gap = dense.press_yielding(*arguments)
    pressure = pressure / asked.compliance
    force = float(pressure.sum()) * asked.cell_area
    yield Finding("force off a dense solve", abs(contact.force / force - 1), 1e-4)
    little, close = UNDECIDED * float(pressure.max()), UNDECIDED * asked.delta
    touching, yielded = unlike_nodes(asked, contact, (pressure, gap), little, close)
    yield Finding("nodes off", touching, 0)
    yield Finding("yielded nodes off", yielded, 0)


def unlike_nodes(
    asked: Setup, contact: bem.Contact, expected: tuple[Field, Field], little: float, close: float
) -> tuple[int, int]:
    """Count nodes whose contact, and whose yielding, differs from that of a pressure and its gap.

    Those may differ whose pressure is `little` away from a bound [MPa], and that are `close` [um].
    """
    pressure, gap = expected
    hardness = asked.bound
    yielded = contact.pressure == hardness, pressure >= hardness * (1 - 1e-15)
    return (
        unlike(contact.pressure > 0, pressure > 0, (pressure > little) | (gap > close)),
        unlike(*yielded, (hardness - pressure > little) | (gap < -close)),
    )


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


def scales(force: float, allowed: float, _asked: Setup, contact: bem.Contact) -> Iterator[Finding]:
    """The ordinary contact in other units: its force times `force` [1], the same nodes."""
    ordinary = _ordinary_contact()
    yield Finding("force off similarity", deviation(contact.force, force * ordinary.force), allowed)
    yield Finding("nodes off", unlike(contact.pressure > 0, ordinary.pressure > 0), 0)


def is_nearly_elastic(asked: Setup, contact: bem.Contact) -> Iterator[Finding]:
    """Force and contact nodes are those of the elastic contact, to the tolerance of both."""
    elastic = replace(asked, hardness=None).solve()
    yield Finding("force off the elastic one", abs(contact.force / elastic.force - 1), asked.rtol)
    off = unlike(contact.pressure > 0, elastic.pressure > 0)
    yield Finding("nodes off the elastic contact", off, 0)


def is_bearing_area(asked: Setup, contact: bem.Contact) -> Iterator[Finding]:
    """The pressure is the hardness wherever the undeformed surfaces overlap."""
    overlap = asked.surface - asked.surface.max() + asked.delta > 0
    expected = np.where(overlap, asked.hardness or 0.0, 0.0)
    yield Finding("nodes off the bearing area", unlike(contact.pressure, expected), 0)


def is_symmetric(_asked: Setup, contact: bem.Contact) -> Iterator[Finding]:
    """The pressure has the 8 symmetries of the square, as the surface has."""
    misplaced = [_misplaced(image, contact.pressure) for image in images(contact.pressure)]
    yield Finding("load off symmetry", max(misplaced), MISPLACED)


def turns_with_surface(asked: Setup, contact: bem.Contact) -> Iterator[Finding]:
    """The 8 images of the surface have the 8 images of the pressure."""
    turned = [replace(asked, heights=image).solve() for image in images(asked.surface)]
    pairs = zip(turned, images(contact.pressure), strict=True)
    misplaced = [_misplaced(other.pressure, image) for other, image in pairs]
    yield Finding("load off symmetry", max(misplaced), MISPLACED)


def images(field: Field) -> list[Field]:
    """The field turned and mirrored: the 8 symmetries of the square."""
    return [np.rot90(face, turns) for face in (field, field.T) for turns in range(4)]


def _misplaced(pressure: Field, expected: Field) -> float:
    """Share of the expected load that is elsewhere [1]."""
    total = float(expected.sum())
    return float(np.abs(pressure - expected).sum()) / total if total else np.inf


def deviation(value: float, expected: float) -> float:
    """Relative deviation; zero where both are zero."""
    if value == expected:
        return 0.0
    return abs(value / expected - 1) if expected else np.inf


# Iterations over those of the ordinary contact on the same grid that need no reason.
MOST_TIMES_ORDINARY = 3.0


def contact_case(
    family: str,
    name: str,
    surface: ArrayLike | Callable[[], ArrayLike],
    delta: float | Callable[[Field], float] = DELTA,
    *,
    checks: Sequence[Check] = (),
    reason: str = "",
    refusal: Refusal | None = None,
    slow: bool = False,
    **arguments: Any,
) -> Case:
    """Make a case that solves a contact.

    The surface may be a function that makes it when the case is run [um], and `delta` one of its
    heights [um]. `checks` and `reason` are those of `judge`, further arguments fields of `Setup`.
    """

    def examine() -> Answer:
        heights = surface() if callable(surface) else surface
        wanted = delta(np.asarray(heights, np.float64)) if callable(delta) else delta
        return solve(Setup(heights, wanted, **arguments), checks, reason)

    return Case(family, name, "", examine, refusal, slow)


def solve(asked: Setup, checks: Sequence[Check] = (), reason: str = "") -> Answer:
    """Solve a problem and judge the answer; parameters as for `judge`."""
    found, warned = attempt(asked.solve)
    if isinstance(found, bem.Contact) and asked.pressure is not None:
        asked = replace(asked, delta=found.approach)
    conduct = Finding(f"warnings {'; '.join(dict.fromkeys(warned))}".rstrip(), len(warned), 0)
    return judge(asked, found, checks, reason, [conduct])


def judge(
    asked: Setup,
    found: object,
    checks: Sequence[Check] = (),
    reason: str = "",
    conduct: Sequence[Finding] = (),
) -> Answer:
    """Judge the contact that the solver has returned, or the error that it has raised.

    `checks` come besides complementarity, which every answer has to fulfil, and `conduct` is how
    the solver behaved otherwise. With a `reason` a contact may take more than `MOST_TIMES_ORDINARY`
    times the iterations of the ordinary one on its grid.
    """
    raised = found if isinstance(found, Exception) else None
    findings: list[Finding] = []
    if isinstance(found, bem.Contact):
        contact = found
        for check in (*checks, complementarity):
            findings += check(asked, contact)
    elif isinstance(found, bem.NotConverged):
        contact = found.contact
        findings.append(Finding("rtol over residual", asked.rtol / contact.residual, 1))
    else:
        return Answer(one_line(found), conduct, asked.describe(), raised=raised)
    first = ordinary_iterations(contact.pressure.shape)
    times = contact.iterations / first
    findings += [
        *conduct,
        Finding("iterations", contact.iterations, asked.max_iterations),
        Finding("times ordinary", times, math.inf if reason else MOST_TIMES_ORDINARY),
        *honesty(asked, contact),
    ]
    numbers = {
        "area_percent": contact.area_percent,
        "force_uN": contact.force,
        "residual": contact.residual,
        "iterations": contact.iterations,
        "ordinary_iterations": first,
        "reason": reason if times > MOST_TIMES_ORDINARY else "",
    }
    out = one_line(raised) if raised else f"{contact.area_percent:.4g} %, {contact.force:.6g} µN"
    return Answer(out, findings, asked.describe(), numbers, raised)


@lru_cache(maxsize=64)
def ordinary_iterations(shape: tuple[int, int]) -> int:
    """Count iterations for the paper's surface, cropped to this grid, at Delta = 25 um."""
    return max(Setup(cropped_paper(shape), spacing=1.0).solve().iterations, 1)
