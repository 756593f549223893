"""Judgements of the solver's answers that do not rely on the solver, and contacts as cases.

The problem of elastic contact is strictly convex. Its solution is the only pressure that is not
negative, whose gap is not negative, and which is zero where the gap is positive. `complementarity`
verifies this for every answer, with influence coefficients and a convolution that share no code
with the solver. The other checks compare the numbers that an answer states.

A check is called with the problem and its contact. `functools.partial` supplies the arguments that
some checks take before these two.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

import bem
from bem.bodies import Kernel
from bench.references.half_space import Field, displacement, flat_punch
from bench.stability.case import Answer, Case, Finding, Refusal, one_line
from bench.stability.setup import DELTA, Setup, cropped_paper, paper
from gen.quantities import AREA, FORCE

ROUNDING = 1e-9
"""Largest difference of two convolutions of one pressure through rounding [Delta]."""

SUM_ROUNDING = 1e-12
"""Largest difference of two sums over a grid through rounding: relative for forces [1], in
percentage points for shares of the patch [%]."""

ONE_ROUNDING = 1e-15
"""Largest relative difference of two numbers that a few roundings make [1]."""

FOUR_ULP = 4 * float(np.finfo(np.float64).eps)
"""Largest relative error through a handful of roundings [1]."""

MOST_TIMES_ORDINARY = 3.0
"""Largest number of iterations over that of the ordinary contact, unless a case allows more [1]."""

Check = Callable[[Setup, bem.Contact], Iterable[Finding]]
"""A function that takes a problem and its contact, and returns findings about the contact."""

Displace = Callable[[Field, Kernel, float], Field]
"""A function that takes a pressure, (nx, ny), the kernel, and the second side of a cell over its
first; it returns the displacement, (nx, ny), as `half_space.displacement` does."""


def complementarity(problem: Setup, contact: bem.Contact) -> Iterator[Finding]:
    """Check the conditions of contact, from the pressure alone.

    Parameters
    ----------
    problem : Setup
        The problem.
    contact : bem.Contact
        Its contact.

    Yields
    ------
    Finding
        The largest violation by a gap [Delta, or um if Delta <= 0]. If there are any, the number of
        nodes in tension, and the number of nodes above the hardness.
    """
    tension = int(np.count_nonzero(~(contact.pressure >= 0)))  # also counts NaN
    too_high = int(np.count_nonzero(contact.pressure > problem.bound))
    worst = violation(problem, contact.pressure)
    yield Finding(
        name="gap",
        error=worst,
        allowed=problem.rtol + ROUNDING,
    )
    if tension:
        yield Finding(
            name="nodes in tension",
            error=tension,
            allowed=0,
        )
    if too_high:
        yield Finding(
            name="nodes above the hardness",
            error=too_high,
            allowed=0,
        )


def honesty(
    problem: Setup, contact: bem.Contact, displace: Displace = displacement
) -> Iterator[Finding]:
    """Recompute the residual, force and area of a contact from its pressure, and compare.

    Parameters
    ----------
    problem : Setup
        The problem.
    contact : bem.Contact
        Its contact.
    displace : callable
        Function that returns the displacement under a pressure.

    Yields
    ------
    Finding
        Difference of the stated residual from the recomputed violation [Delta, or um if
        Delta <= 0], relative difference of the force [1], and difference of the area [% of the
        patch].
    """
    recomputed = violation(problem, contact.pressure, displace)
    yield Finding(
        name="residual off",
        error=abs(contact.residual - recomputed),
        allowed=ROUNDING,
    )
    force = float(contact.pressure.sum()) * problem.cell_area
    yield Finding(
        name="force off its pressure",
        error=deviation(contact.force, force),
        allowed=SUM_ROUNDING,
    )
    percent = 100 * float(np.mean(contact.pressure > 0))
    yield Finding(
        name="area off its nodes",
        error=abs(contact.area_percent - percent),
        allowed=SUM_ROUNDING,
    )


def says_what_yields(
    problem: Setup, contact: bem.Contact, displace: Displace = displacement
) -> Iterator[Finding]:
    """Recompute from a contact's pressure the numbers about yielded nodes that it states; compare.

    Parameters
    ----------
    problem : Setup
        The problem, with a hardness and a Delta above 0.
    contact : bem.Contact
        Its contact.
    displace : callable
        Function that returns the displacement under a pressure.

    Yields
    ------
    Finding
        Differences of the yielded share [% of the patch], of the yielded depth [Delta], and of the
        flattened heights [largest height].
    """
    yielded = contact.pressure == problem.hardness
    percent = 100 * float(yielded.mean())
    yield Finding(
        name="yielded share off",
        error=abs(contact.yielded_percent - percent),
        allowed=SUM_ROUNDING,
    )
    gap = gap_under(problem, contact.pressure, displace)
    depth = np.where(yielded, np.maximum(-gap, 0.0), 0.0)
    stated = contact.yielded_depth / problem.delta
    yield Finding(
        name="yielded depth off",
        error=float(np.abs(stated - depth).max()),
        allowed=ROUNDING,
    )
    flattened = problem.surface - contact.yielded_depth
    off = float(np.abs(contact.flattened - flattened).max())
    largest = float(np.abs(problem.surface).max()) or 1.0  # any unit for heights of zero
    yield Finding(
        name="flattened heights off",
        error=off / largest,
        allowed=ONE_ROUNDING,
    )


def violation(
    problem: Setup, pressure: Field, displace: Displace = displacement
) -> float:
    """Compute the largest violation of the conditions of contact by a pressure.

    Parameters
    ----------
    problem : Setup
        The problem.
    pressure : ndarray, shape (nx, ny)
        Contact pressure [MPa].
    displace : callable
        Function that returns the displacement under a pressure.

    Returns
    -------
    float
        The largest violation, at least 0, as `worst_gap` defines it [Delta, or um if Delta <= 0].
    """
    gap = gap_under(problem, pressure, displace)
    return worst_gap(pressure, gap, problem.bound)


def worst_gap(pressure: Field, gap: Field, bound: float) -> float:
    """Return the largest violation of the conditions of contact by a pressure and its gap.

    Elastic nodes under pressure violate them by a gap or a penetration, and nodes without pressure
    by a penetration. Yielded nodes violate them by a gap only: they may penetrate, by the depth to
    which they yield.

    Parameters
    ----------
    pressure : ndarray
        Contact pressure, of any shape.
    gap : ndarray
        Distance of the surfaces, of the shape of the pressure, negative where they penetrate.
    bound : float
        Hardness in the unit of the pressure; infinite for elastic bodies.

    Returns
    -------
    float
        The largest violation, at least 0, in the unit of the gap; infinite if one is NaN.
    """
    elastic = np.where(pressure > 0, np.abs(gap), -gap)
    # Pressure and hardness may have been divided by a modulus, which rounds both.
    yielded = pressure >= bound * (1 - ONE_ROUNDING)
    worst = float(np.where(yielded, gap, elastic).max())
    if np.isnan(worst):
        return np.inf
    return max(0.0, worst)


def gap_under(
    problem: Setup, pressure: Field, displace: Displace = displacement
) -> Field:
    """Compute the distance that a pressure leaves between the surfaces.

    Parameters
    ----------
    problem : Setup
        The problem.
    pressure : ndarray, shape (nx, ny)
        Contact pressure [MPa].
    displace : callable
        Function that returns the displacement under a pressure.

    Returns
    -------
    ndarray, shape (nx, ny)
        Distance, negative where the surfaces penetrate [Delta, or um if Delta <= 0].
    """
    unit = problem.delta if problem.delta > 0 else 1.0
    # Numbers that overflow here make the gap infinite or NaN, which `violation` reports.
    with np.errstate(all="ignore"):
        reduced: Field = pressure * (problem.compliance / unit)
        approach = problem.delta / unit
        if problem.far_field == "compliant":
            # The far field moves back by the displacement of a flat punch under this force.
            punch = flat_punch(pressure.shape, problem.kernel, problem.aspect)
            approach += float(reduced.sum() / punch.sum())
        depth = (problem.surface - problem.surface.max()) / unit
        overlap = depth + approach
        moved = displace(reduced, problem.kernel, problem.aspect)
        gap: Field = moved - overlap
    return gap


def unlike(first: ArrayLike, second: ArrayLike, decided: ArrayLike = True) -> int:
    """Count the nodes at which two fields differ.

    Parameters
    ----------
    first, second : array_like
        Fields of equal shape.
    decided : array_like of bool
        Nodes that are compared: a field of that shape, or True for all nodes.

    Returns
    -------
    int
        Number of nodes that are compared and differ.
    """
    return int(np.count_nonzero(np.not_equal(first, second) & decided))


def has_force(
    name: str, force: float, allowed: float, _problem: Setup, contact: bem.Contact
) -> Iterator[Finding]:
    """Compare the force of a contact with a closed form.

    Parameters
    ----------
    name : str
        Name of the closed form.
    force : float
        Its force [uN].
    allowed : float
        Largest relative deviation, which includes the error of the grid [1].
    _problem : Setup
        The problem, which is not needed.
    contact : bem.Contact
        Its contact.

    Yields
    ------
    Finding
        Relative deviation of the force [1].
    """
    yield Finding(
        name=f"force off {name}",
        error=deviation(contact.force, force),
        allowed=allowed,
    )


@lru_cache(maxsize=1)
def _ordinary_contact() -> bem.Contact:
    """Return the contact of the paper's surface at an ordinary displacement; solved once."""
    return Setup(paper(), DELTA).solve()


def scales(
    force_ratio: float, allowed: float, _problem: Setup, contact: bem.Contact
) -> Iterator[Finding]:
    """Compare a contact with the ordinary contact, of which it is a copy in other units.

    Parameters
    ----------
    force_ratio : float
        Expected force over that of the ordinary contact [1].
    allowed : float
        Largest relative deviation of the force [1].
    _problem : Setup
        The problem, which is not needed.
    contact : bem.Contact
        Its contact.

    Yields
    ------
    Finding
        Relative deviation of the force [1], and number of nodes that are in contact in only one of
        the two contacts.
    """
    ordinary = _ordinary_contact()
    yield Finding(
        name="force off similarity",
        error=deviation(contact.force, force_ratio * ordinary.force),
        allowed=allowed,
    )
    yield Finding(
        name="nodes off",
        error=unlike(contact.pressure > 0, ordinary.pressure > 0),
        allowed=0,
    )


def is_nearly_elastic(problem: Setup, contact: bem.Contact) -> Iterator[Finding]:
    """Compare the force and the nodes in contact with those of elastic bodies, which are solved.

    Parameters
    ----------
    problem : Setup
        The problem, whose hardness is near the largest elastic pressure or above it.
    contact : bem.Contact
        Its contact.

    Yields
    ------
    Finding
        Relative deviation of the force [1], and number of nodes that are in contact in only one of
        the two contacts.
    """
    elastic = replace(problem, hardness=None).solve()
    yield Finding(
        name="force off the elastic one",
        error=abs(contact.force / elastic.force - 1),
        allowed=problem.rtol,
    )
    yield Finding(
        name="nodes off the elastic contact",
        error=unlike(contact.pressure > 0, elastic.pressure > 0),
        allowed=0,
    )


def is_bearing_area(problem: Setup, contact: bem.Contact) -> Iterator[Finding]:
    """Check that the pressure is the hardness wherever the undeformed surfaces overlap.

    Parameters
    ----------
    problem : Setup
        The problem, whose hardness is so small that nothing deforms elastically.
    contact : bem.Contact
        Its contact.

    Yields
    ------
    Finding
        Number of nodes at which the pressure is not the hardness where the surfaces overlap, or not
        0 elsewhere.
    """
    overlaps = problem.surface - problem.surface.max() + problem.delta > 0
    expected = np.where(overlaps, problem.hardness or 0.0, 0.0)
    yield Finding(
        name="nodes off the bearing area",
        error=unlike(contact.pressure, expected),
        allowed=0,
    )


def deviation(value: float, expected: float) -> float:
    """Return the relative deviation of a value from the expected one.

    Parameters
    ----------
    value, expected : float
        Numbers of the same unit.

    Returns
    -------
    float
        Relative deviation, at least 0 [1]. It is infinite if `expected` is 0 and `value` is not.
    """
    if value == expected:
        return 0.0
    if not expected:
        return np.inf
    return abs(value / expected - 1)


def contact_case(
    family: str,
    name: str,
    surface: ArrayLike | Callable[[], ArrayLike],
    delta: float | Callable[[Field], float] = DELTA,
    *,
    checks: Sequence[Check] = (),
    largest_ratio: float = MOST_TIMES_ORDINARY,
    refusal: Refusal | None = None,
    slow: bool = False,
    **arguments: Any,
) -> Case:
    """Make a case that solves a contact and judges it.

    Parameters
    ----------
    family : str
        Kind of the extreme.
    name : str
        Name of the case within its family.
    surface : array_like, shape (nx, ny), or callable
        Heights [um], or a function that makes them when the case is run.
    delta : float or callable
        Displacement [um], or a function that returns it for heights [um]. It is not used if the
        further arguments hold a pressure or a force other than 0.
    checks : sequence of Check
        Checks besides complementarity and honesty, which every contact has to pass.
    largest_ratio : float
        Largest number of iterations that passes, over that of the ordinary contact on the grid [1].
    refusal : Refusal, optional
        How the input has to be refused; None if it has an answer.
    slow : bool
        Whether only the full table has the case.
    **arguments
        Further fields of `Setup`.

    Returns
    -------
    Case
        The case, whose answer describes its input.
    """

    def examine() -> Answer:
        """Solve the contact and judge it; an error of the solve becomes the answer."""
        heights = surface() if callable(surface) else surface
        given_delta = delta
        if callable(given_delta):
            given_delta = given_delta(np.asarray(heights, np.float64))
        problem = Setup(heights, given_delta, **arguments)
        try:
            contact = problem.solve()
        except Exception as error:  # any error: `run_case` judges it
            return Answer(one_line(error), input=problem.describe(), raised=error)
        if problem.given_force:
            # The checks need the displacement that belongs to the force or the mean pressure.
            problem = replace(problem, delta=contact.approach)
        return judge(problem, contact, checks, largest_ratio)

    return Case(
        family=family,
        name=name,
        input="",  # the answer describes it
        examine=examine,
        refusal=refusal,
        slow=slow,
    )


def judge(
    problem: Setup,
    contact: bem.Contact,
    checks: Sequence[Check] = (),
    largest_ratio: float = MOST_TIMES_ORDINARY,
) -> Answer:
    """Judge a contact that the solver has returned.

    Parameters
    ----------
    problem : Setup
        The problem, with the displacement that belongs to a given pressure.
    contact : bem.Contact
        Its contact.
    checks : sequence of Check
        Checks besides complementarity and honesty, which every contact has to pass.
    largest_ratio : float
        Largest number of iterations over that of the ordinary contact on the grid [1].

    Returns
    -------
    Answer
        The findings of all checks and about the number of iterations, with values for the columns
        `NUMBERS` of the row.
    """
    ordinary = ordinary_iterations(contact.pressure.shape)
    findings: list[Finding] = []
    for check in (*checks, complementarity):
        findings.extend(check(problem, contact))
    iterations = Finding(
        name="iterations",
        error=contact.iterations,
        allowed=problem.max_iterations,
    )
    times_ordinary = Finding(
        name="times ordinary",
        error=contact.iterations / ordinary,
        allowed=largest_ratio,
    )
    findings += [iterations, times_ordinary]
    findings.extend(honesty(problem, contact))
    numbers = {
        AREA.name: contact.area_percent,
        FORCE.in_tables: contact.force,
        "residual": contact.residual,
        "iterations": contact.iterations,
        "ordinary_iterations": ordinary,
    }
    return Answer(
        out=f"{contact.area_percent:.4g} %, {contact.force:.6g} µN",
        findings=findings,
        input=problem.describe(),
        numbers=numbers,
    )


@lru_cache(maxsize=64)
def ordinary_iterations(shape: tuple[int, int]) -> int:
    """Count the iterations of the ordinary contact on a grid.

    The ordinary contact is the paper's surface, cropped to the grid, with a spacing of 1 um, at
    Delta = 25 um. A later call for the same grid returns the first result.

    Parameters
    ----------
    shape : (int, int)
        Nodes along x and y.

    Returns
    -------
    int
        Number of iterations, at least 1.
    """
    contact = Setup(cropped_paper(shape), spacing=1.0).solve()
    return max(contact.iterations, 1)
