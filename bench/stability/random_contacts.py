"""Random contacts that yield, and random contacts without edges, beside independent references.

A case has many contacts. Bodies that yield are compared with bounded least squares. Patches
without edges are compared with a dense reference. Their pressure is compared under one total load,
on which it depends smoothly even in full contact. Their displacement is compared by the gaps that
it leaves. Mirrored patches are also compared with periodic ones that hold their images, and
periodic patches with shifted ones.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import lru_cache, partial
from unittest import mock

import numpy as np

import bem
from bem.influence import Kernel
from bem.operators import patch
from bench.references import dense, surfaces
from bench.references.edgeless import Boundary, Patch
from bench.references.half_space import Field
from bench.references.surfaces import Random
from bench.stability.case import Answer, Case, Finding
from bench.stability.checks import honesty, says_what_yields, unlike, violation, worst_gap
from bench.stability.setup import Setup
from gen.runtime.farm import Overtime, time_limit

YIELDING_SEED = 24
"""First word of the seeds of contacts that yield."""

EDGELESS_SEED = 25
"""First word of the seeds of contacts without edges, so that both tables draw other surfaces."""

RTOL = 1e-10
"""Tolerance of the solves that are compared with references [Delta]."""

ROUNDING = 1e-11
"""Largest difference of gaps through rounding alone [Delta, or range of heights]."""

BLOCK = 100
"""Number of contacts in a case; the quick table has the first block only."""

SECONDS = 60.0
"""Wall-clock time after which a solve counts as an endless loop [s]."""

Problem = Callable[[int], Setup]
"""A function that draws a problem by its seed."""

Comparison = Callable[[Setup, bem.Contact], Iterable[Finding]]
"""A function that compares the contact of a problem with a reference."""


def _blocks(
    family: str, contacts: int, text: str, draw: Problem, compare: Comparison
) -> Iterator[Case]:
    """Yield the cases of a family, of `BLOCK` contacts each; all but the first are slow."""
    for first in range(0, contacts, BLOCK):
        seeds = range(first, first + BLOCK)
        yield Case(
            family=family,
            name=f"seeds {first} to {first + BLOCK - 1}",
            input=text,
            examine=partial(examine, seeds, draw, compare),
            slow=first > 0,
        )


def _surface_and_aspect(
    random: Random, fewest: int, largest: int, largest_aspect: float
) -> tuple[Field, float]:
    """Draw heights and the aspect of their cells.

    The heights, (nx, ny), have `fewest` to `largest` nodes a side and a range of 1 um, or of 0 if
    they are flat. Half of the cells are square, the aspect of the others is log-uniform between
    `largest_aspect` and its inverse.
    """
    rows, columns = random.integers(fewest, largest + 1, 2)
    kinds = list(surfaces.SURFACES.values())
    kind = random.integers(len(kinds))
    heights = kinds[kind](random, (int(rows), int(columns)))
    span = np.ptp(heights) or 1.0
    aspect = 1.0
    if random.random() < 0.5:
        exponent = random.uniform(-1, 1)
        aspect = float(largest_aspect**exponent)
    return heights / span, aspect


def examine(seeds: range, draw: Problem, compare: Comparison) -> Answer:
    """Solve the problems of some seeds, compare them, and keep the worst finding of each name.

    An error, and a solve of more than `SECONDS`, counts as a solve without an answer.

    Parameters
    ----------
    seeds : range
        Seeds of the problems.
    draw : callable
        Function that draws a problem by its seed.
    compare : callable
        Function that yields the findings about a problem and its contact.

    Returns
    -------
    Answer
        The number of solves without an answer, and the worst finding of each name.
    """
    iterations: list[int] = []
    unanswered: list[str] = []
    worst: dict[str, Finding] = {}
    for seed in seeds:
        problem = draw(seed)
        try:
            with time_limit(SECONDS):
                contact = problem.solve()
        except (Overtime, Exception) as error:
            unanswered.append(f"{type(error).__name__} at seed {seed}")
            continue
        iterations.append(contact.iterations)
        for finding in compare(problem, contact):
            worse = worst.get(finding.name, finding)
            worst[finding.name] = max(worse, finding, key=lambda finding: finding.rank)
    middle, largest = np.percentile(iterations or [0], (50, 100))
    counts = f"{middle:.0f} iterations in the middle, {largest:.0f} at most"
    name = ", ".join(["without an answer", *unanswered[:3]])
    findings = [Finding(name, len(unanswered), allowed=0)]
    findings.extend(worst.values())
    return Answer(f"{len(seeds)} solves, {counts}", findings)


def _most_nodes(seed: int, *, rare: int, seldom: int, usual: int) -> int:
    """Return the most nodes a side: `rare` for every 50th seed, `seldom` for every 10th."""
    if seed % 50 == 0:
        return rare
    if seed % 10 == 0:
        return seldom
    return usual


HARDNESS = (1e-4, 10.0)
"""Smallest and largest hardness [E*]."""

UNDECIDED = 1e-8
"""Pressure over the hardness, and gap over Delta, below which a node may count either way [1]."""

LIMITS = dict.fromkeys(("residual off", "yielded depth off"), RTOL + ROUNDING)
"""Allowed numbers by the names of findings that have smaller bounds here than in their check."""


def yielding() -> Iterator[Case]:
    """Yield ten blocks of bodies that yield, which are compared with least squares."""
    squares = "2 to 33 nodes a side, cells to 1:100, H from 1e-4 to 10 E*, rtol = 1e-10"
    yield from _blocks("least squares", 1000, squares, yielding_problem, judge_both_ways)


def yielding_problem(seed: int) -> Setup:
    """Draw a problem with a hardness.

    The displacement is log-uniform up to that of full elastic contact. For even seeds the hardness
    is log-uniform over its range. For odd seeds it is a share of the largest elastic pressure, from
    1 % to 100 %, so that some nodes yield and others do not.

    Parameters
    ----------
    seed : int
        Seed of the problem.

    Returns
    -------
    Setup
        The problem, with E* = 1 MPa and a first side of a cell of 1 um.
    """
    random = np.random.default_rng((YIELDING_SEED, seed))
    largest = _most_nodes(seed, rare=33, seldom=20, usual=12)
    heights, aspect = _surface_and_aspect(random, 2, largest, largest_aspect=100.0)
    # Concentrated forces are for square cells only.
    concentrated = aspect == 1.0 and random.random() < 0.4
    kernel: Kernel = "concentrated-force" if concentrated else "uniform-pressure"
    # The displacement of full contact is 0 on a flat surface.
    deepest = dense.full_contact_delta(heights, kernel, aspect) or 1.0
    exponent = min(random.uniform(-3, 0.2), 0)  # one in sixteen is full contact
    delta = deepest * float(10**exponent)
    lowest, highest = np.log(HARDNESS)
    hardness = float(np.exp(random.uniform(lowest, highest)))
    if seed % 2:
        elastic = dense.press(heights, delta, kernel, aspect)
        share = float(10 ** random.uniform(-2, 0))
        hardest = delta * elastic.pressure.max()
        hardness = float(np.clip(share * hardest, *HARDNESS))
    return Setup(
        heights,
        delta,
        spacing=(1.0, aspect),
        kernel=kernel,
        hardness=hardness,
        rtol=RTOL,
    )


@lru_cache(maxsize=128)
def expected(problem: Setup) -> dense.DenseContact:
    """Solve a problem with a hardness by bounded least squares.

    A problem is solved once.

    Parameters
    ----------
    problem : Setup
        The problem, of `yielding_problem`.

    Returns
    -------
    DenseContact
        Pressure [MPa] and gap [um], (nx, ny).
    """
    return dense.press_yielding(
        problem.surface,
        problem.delta,
        problem.bound,
        problem.kernel,
        problem.aspect,
        sides=dense.by_least_squares,
    )


def judge_yielding(problem: Setup, contact: bem.Contact) -> Iterator[Finding]:
    """Compare a contact with least squares, and check the conditions of contact.

    The conditions are checked with the dense matrix.

    Parameters
    ----------
    problem : Setup
        The problem, of `yielding_problem`.
    contact : bem.Contact
        Its contact.

    Yields
    ------
    Finding
        Differences from least squares in the force [1] and in the sets of nodes, violations of the
        conditions of contact, and differences between the pressure and the stated results.
    """
    hardness = problem.bound
    reference = expected(problem)
    pressure = reference.pressure
    gap = reference.gap
    force = float(pressure.sum()) * problem.aspect
    yield Finding(
        name="force off least squares",
        error=abs(contact.force / force - 1),
        allowed=1e-8,
    )
    little = UNDECIDED * hardness
    close = UNDECIDED * problem.delta
    # Nodes with next to no pressure and no gap may count as in contact or not. Nodes next to the
    # hardness and with next to no penetration may count as yielded or not.
    is_decided = (pressure > little) | (gap > close)
    touching = unlike(contact.pressure > 0, pressure > 0, is_decided)
    is_decided = (hardness - pressure > little) | (gap < -close)
    yields = pressure >= hardness * (1 - 1e-15)
    yielded = unlike(contact.pressure == hardness, yields, is_decided)
    yield Finding(
        name="nodes off least squares",
        error=touching + yielded,
        allowed=0,
    )
    is_possible = (contact.pressure >= 0) & (contact.pressure <= hardness)
    impossible = int(np.count_nonzero(~is_possible))
    yield Finding(
        name="nodes in tension or above the hardness",
        error=impossible,
        allowed=0,
    )
    worst = violation(problem, contact.pressure, dense.displace)
    yield Finding(
        name="gap",
        error=worst,
        allowed=RTOL + ROUNDING,
    )
    for check in (honesty, says_what_yields):
        for finding in check(problem, contact, dense.displace):
            allowed = LIMITS.get(finding.name, finding.allowed)
            yield replace(finding, allowed=allowed)


def judge_both_ways(problem: Setup, contact: bem.Contact) -> Iterator[Finding]:
    """Compare a contact with least squares, and again the contact solved by iterations alone.

    The second solve uses no dense algebra on the nodes in contact.

    Parameters
    ----------
    problem : Setup
        The problem, of `yielding_problem`.
    contact : bem.Contact
        Its contact.

    Yields
    ------
    Finding
        The findings of `judge_yielding` about both contacts.
    """
    yield from judge_yielding(problem, contact)
    with mock.patch.object(patch, "FEW_FREE", ((0.0, 1.0),)):
        yield from judge_yielding(problem, problem.solve())


MOST_MIRRORED = 40
"""Most nodes a side of patches that are compared with their mirror images or shifted."""

LARGEST_DELTA = 4.0
"""Largest displacement of bodies that yield, over that of full elastic contact [1]."""


def edgeless() -> Iterator[Case]:
    """Yield ten blocks beside dense references, two of mirror images, one of cyclic shifts."""
    small = "1 to 24 nodes a side, rtol = 1e-10"
    yield from _blocks("dense references", 1000, small, edgeless_problem, judge_edgeless)
    nodes = "1 to 40 nodes a side"
    yield from _blocks("mirror images", 200, nodes, mirrored_problem, judge_images)
    periodic = f"{nodes}, periodic"
    yield from _blocks("cyclic shifts", 100, periodic, periodic_problem, judge_shift)


def edgeless_problem(seed: int, largest: int | None = None) -> Setup:
    """Draw a problem without edges: its boundary, grid, cells, surface, modulus, load and hardness.

    The load is a mean pressure, a force or a displacement. Pressure and force are log-uniform, from
    1e-3 of full elastic contact to twice that. Half of the bodies yield, at 1 to 100 times the mean
    pressure. A displacement, or its distance from that of full elastic contact, is log-uniform.
    Bodies that yield are pressed up to `LARGEST_DELTA` times as deep.

    Parameters
    ----------
    seed : int
        Seed of the problem.
    largest : int, optional
        Most nodes a side; by default it depends on the seed.

    Returns
    -------
    Setup
        The problem, with a first side of a cell of 1 um.
    """
    random = np.random.default_rng((EDGELESS_SEED, seed))
    if not largest:
        largest = _most_nodes(seed, rare=24, seldom=16, usual=10)
    heights, aspect = _surface_and_aspect(random, 1, largest, largest_aspect=30.0)
    # The order of the draws below decides what each seed means.
    boundary: Boundary = "mirror" if random.random() < 0.5 else "periodic"
    modulus = 1.0
    if random.random() < 0.5:
        modulus = float(10 ** random.uniform(-2, 6))
    problem = Setup(
        heights, spacing=(1.0, aspect), boundary=boundary, modulus=modulus, rtol=RTOL
    )
    reference = patch_of(problem)
    pressure = _mean_pressure(random, problem, reference)
    ratio = float(10 ** random.uniform(0.001, 2))
    if random.random() < 0.5:
        problem = replace(problem, hardness=ratio * pressure)
    kind_of_load = random.integers(3)
    if kind_of_load == 0:
        return replace(problem, pressure=pressure)
    if kind_of_load == 1:
        force = pressure * problem.surface.size * problem.cell_area
        return replace(problem, force=force)
    delta = _displacement(random, problem, reference)
    if delta > ROUNDING:
        return replace(problem, delta=delta)
    return replace(problem, pressure=pressure)  # a flat surface is in full contact at 0


def _mean_pressure(random: Random, problem: Setup, reference: Patch) -> float:
    """Draw a mean pressure over the patch [MPa]."""
    # The load of full contact is the sum of the nodes' pressures for E* = 1 MPa.
    full = reference.full_contact_load
    if full <= ROUNDING:  # a flat surface
        full = 1.0
    load = full * float(10 ** random.uniform(-3, 0.3))
    return load / problem.surface.size * problem.modulus


def _displacement(random: Random, problem: Setup, reference: Patch) -> float:
    """Draw a displacement [um]; it is 0 for a flat surface."""
    share = float(10 ** random.uniform(-5, 0))
    if random.random() >= 0.5:
        share = 1 - share
    delta = reference.full_contact_delta * share
    if problem.hardness is not None:
        delta *= float(LARGEST_DELTA ** random.random())
    return delta


def _compared_problem(boundary: Boundary, seed: int) -> Setup:
    """Draw a problem whose patch is compared with its mirror images or shifted."""
    problem = edgeless_problem(seed, MOST_MIRRORED)
    return replace(problem, boundary=boundary, rtol=1e-12)


mirrored_problem = partial(_compared_problem, "mirror")
"""Draws a mirrored patch by its seed."""

periodic_problem = partial(_compared_problem, "periodic")
"""Draws a periodic patch by its seed."""


def patch_of(problem: Setup) -> Patch:
    """Make the dense reference of a problem without edges.

    Parameters
    ----------
    problem : Setup
        The problem.

    Returns
    -------
    Patch
        The patch for E* = 1 MPa: pressures and hardness are over the modulus.
    """
    rows, columns = problem.surface.shape
    dx, dy = problem.cell
    boundary: Boundary = "mirror" if problem.boundary == "mirror" else "periodic"
    return Patch(
        heights=problem.surface,
        sides=(rows * dx, columns * dy),
        boundary=boundary,
        hardness=problem.bound / problem.modulus,
    )


def judge_edgeless(problem: Setup, contact: bem.Contact) -> Iterator[Finding]:
    """Check the load and the conditions of contact by the dense matrix, and compare the pressure.

    Parameters
    ----------
    problem : Setup
        The problem, of `edgeless_problem`.
    contact : bem.Contact
        Its contact.

    Yields
    ------
    Finding
        Deviation of the load [1], violations of the conditions of contact [um], differences
        between the pressure and the stated results, and the difference from the reference
        [MPa for E* = 1 MPa], unless all nodes have yielded.
    """
    reference = patch_of(problem)
    pressure = contact.pressure / problem.modulus
    yield Finding(
        name="load off",
        error=load_error(problem, contact),
        allowed=1e-12,
    )
    is_possible = (pressure >= 0) & (pressure <= reference.hardness)
    impossible = int(np.count_nonzero(~is_possible))
    yield Finding(
        name="nodes in tension or above the hardness",
        error=impossible,
        allowed=0,
    )
    displacement = reference.matrix @ pressure.reshape(-1)
    gap = displacement - reference.below - contact.delta
    worst = worst_gap(pressure.reshape(-1), gap, reference.hardness)
    allowed = RTOL * contact.delta + ROUNDING
    yield Finding(
        name="gap",
        error=worst,
        allowed=allowed,
    )
    yield Finding(
        name="residual off",
        error=abs(contact.residual * contact.delta - worst),
        allowed=ROUNDING,
    )
    percent = 100 * float(np.mean(pressure > 0))
    yield Finding(
        name="area off",
        error=abs(contact.area_percent - percent),
        allowed=1e-12,
    )
    # If all nodes have yielded, the pressure is the hardness, which is checked above.
    if pressure.min() < reference.hardness:
        compared = reference.press(float(pressure.sum()))
        # The stiffest mode turns a gap into at most this times the pressure.
        stiffness = float(1 / reference.compliances.min())
        stiffest = stiffness * pressure.size**0.5
        error = float(np.linalg.norm(pressure - compared))
        yield Finding(
            name="pressure off the reference",
            error=error,
            allowed=stiffest * 2 * allowed,
        )


def load_error(problem: Setup, contact: bem.Contact) -> float:
    """Compute the relative deviation of the load of a contact from the given load.

    Parameters
    ----------
    problem : Setup
        The problem, with a displacement, a force or a mean pressure.
    contact : bem.Contact
        Its contact.

    Returns
    -------
    float
        Relative deviation [1]; for a force or a mean pressure the larger one of the stated force
        and of the sum of pressures.
    """
    force = problem.given_force
    if not force:
        return abs(contact.delta / problem.delta - 1)
    mean = float(contact.pressure.mean())
    total = mean * contact.pressure.size * problem.cell_area
    stated_off = abs(contact.force / force - 1)
    return max(stated_off, abs(total / force - 1))


def images(field: Field) -> Field:
    """Put a field beside its mirror images.

    Parameters
    ----------
    field : ndarray, shape (nx, ny)
        Values at the nodes.

    Returns
    -------
    ndarray, shape (2 nx, 2 ny)
        The field and its three images.
    """
    reversed_y = field[:, ::-1]
    reversed_x = field[::-1]
    reversed_both = field[::-1, ::-1]
    return np.block([[field, reversed_y], [reversed_x, reversed_both]])


def judge_images(problem: Setup, contact: bem.Contact) -> Iterator[Finding]:
    """Compare a mirrored patch with the periodic patch of itself and its images.

    Solves the periodic patch.

    Parameters
    ----------
    problem : Setup
        The problem, of `mirrored_problem`.
    contact : bem.Contact
        Its contact.

    Yields
    ------
    Finding
        The findings of `alike`.
    """
    force = problem.force
    if force is not None:
        force = 4 * force
    heights = images(problem.surface)
    periodic = replace(problem, heights=heights, boundary="periodic", force=force)
    yield from alike(problem, contact, periodic.solve(), images)


def judge_shift(problem: Setup, contact: bem.Contact) -> Iterator[Finding]:
    """Compare a periodic patch with the patch that is shifted by a third of its sides.

    Solves the shifted patch.

    Parameters
    ----------
    problem : Setup
        The problem, of `periodic_problem`.
    contact : bem.Contact
        Its contact.

    Yields
    ------
    Finding
        The findings of `alike`.
    """
    steps = tuple(nodes // 3 for nodes in problem.surface.shape)

    def shift(field: Field) -> Field:
        """Return a field that begins at another node, (nx, ny)."""
        return np.roll(field, steps, (0, 1))

    shifted = replace(problem, heights=shift(problem.surface)).solve()
    yield from alike(problem, contact, shifted, shift)


def alike(
    problem: Setup,
    contact: bem.Contact,
    transformed: bem.Contact,
    transform: Callable[[Field], Field],
) -> Iterator[Finding]:
    """Compare a contact with that of its transformed surface: pressures, and both operators.

    Parameters
    ----------
    problem : Setup
        The problem of the contact.
    contact : bem.Contact
        The contact.
    transformed : bem.Contact
        Contact of the transformed surface.
    transform : callable
        Function that mirrors or shifts a field of the contact, (nx, ny).

    Yields
    ------
    Finding
        Largest difference of the pressures [largest pressure], and of the displacements that both
        operators compute from one pressure [largest pressure times longest side over E].
    """
    pressure = transform(contact.pressure)
    largest = float(pressure.max())
    off = float(np.abs(pressure - transformed.pressure).max())
    yield Finding(
        name="pressure off",
        error=off / largest,
        allowed=1e-8,
    )
    displacement = replace(transformed, pressure=pressure).displacement
    compared = transform(contact.displacement)
    off = float(np.abs(compared - displacement).max())
    rows, columns = contact.pressure.shape
    dx, dy = problem.cell
    longest = max(rows * dx, columns * dy)
    unit = largest / problem.modulus * longest
    yield Finding(
        name="operator off",
        error=off / unit,
        allowed=1e-13,
    )
