"""Random contacts that yield, and random contacts without edges, beside independent references.

A case has `BLOCK` contacts. Bodies that yield are compared with bounded least squares. Patches
without edges are compared with a dense reference. Their pressure is compared with that under an
equal load, on which it depends smoothly even in full contact. Their displacement is judged by the
gaps that it leaves. Mirrored patches are also compared with periodic patches that contain their
mirror images, and periodic patches with shifted ones.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from unittest import mock

import numpy as np

import bem
from bem.bodies import Kernel
from bem.operators import patch
from bench.references import dense, surfaces
from bench.references.edgeless import Boundary, Patch
from bench.references.half_space import Field
from bench.references.surfaces import Random
from bench.stability.case import Answer, Case, Finding
from bench.stability.checks import (
    ONE_ROUNDING,
    SUM_ROUNDING,
    honesty,
    says_what_yields,
    unlike,
    violation,
    worst_gap,
)
from bench.stability.setup import Setup
from gen.runtime.farm import time_limit

YIELDING_SEED = 24
"""First word of the seeds of contacts that yield."""

EDGELESS_SEED = 25
"""First word of the seeds of contacts without edges; it differs, so that the surfaces differ."""

RTOL = 1e-10
"""Tolerance of the solves that are compared with references [Delta]."""

ROUNDING = 1e-11
"""Largest difference of gaps through rounding alone [Delta, or um for heights of range 1 um]."""

BLOCK = 100
"""Number of contacts in a case; the quick table has the first block only."""

SECONDS = 60.0
"""Largest wall-clock time of a solve [s]. A longer one is ended, and has no answer."""

Problem = Callable[[int], Setup]
"""A function that takes a seed, and returns the problem that it draws by this seed."""

Comparison = Callable[[Setup, bem.Contact], Iterable[Finding]]
"""A function that takes a problem and its contact, and returns findings about the contact."""


def _blocks(
    family: str, contacts: int, text: str, draw: Problem, compare: Comparison
) -> Iterator[Case]:
    """Yield the cases of a family, of `BLOCK` contacts each; all but the first case are slow.

    `contacts` is the number of contacts of the family, and `text` describes the input.
    """
    for first in range(0, contacts, BLOCK):
        seeds = range(first, first + BLOCK)
        yield Case(
            family=family,
            name=f"seeds {first} to {first + BLOCK - 1}",
            input=text,
            examine=partial(examine, seeds, draw, compare),
            slow=first > 0,
        )


@dataclass(frozen=True, eq=False)
class _DrawnSurface:
    """The surface of a random contact."""

    heights: Field  # shape (nx, ny); the range is 1 um, or 0 if the surface is flat [um]
    aspect: float  # second side of a cell over its first [1]


def _draw_surface(
    random: Random, *, fewest: int, most_nodes: int, largest_aspect: float
) -> _DrawnSurface:
    """Draw a surface of a random kind, with `fewest` to `most_nodes` nodes a side.

    Half of the surfaces have square cells. The aspect of the others is log-uniform between
    `largest_aspect` and its inverse.
    """
    rows, columns = random.integers(fewest, most_nodes + 1, 2)
    kinds = list(surfaces.SURFACES.values())
    kind = random.integers(len(kinds))
    heights = kinds[kind](random, (int(rows), int(columns)))
    height_range = np.ptp(heights) or 1.0  # a flat surface is not scaled
    aspect = 1.0
    if random.random() < 0.5:
        exponent = random.uniform(-1, 1)
        aspect = float(largest_aspect**exponent)
    return _DrawnSurface(heights / height_range, aspect)


def examine(seeds: range, draw: Problem, compare: Comparison) -> Answer:
    """Solve the problems of some seeds, judge them, and keep the worst finding of each name.

    A solve that raises an error or takes longer than `SECONDS` has no answer, and is not judged.

    Parameters
    ----------
    seeds : range
        Seeds of the problems.
    draw : callable
        Function that takes a seed and returns a problem.
    compare : callable
        Function that takes a problem and its contact, and returns findings.

    Returns
    -------
    Answer
        The number of solves, and the median and largest number of iterations, in words. The first
        finding is the number of solves without an answer; its name has the first three errors. The
        worst finding of each name follows.
    """
    iterations: list[int] = []
    unanswered: list[str] = []
    worst: dict[str, Finding] = {}
    for seed in seeds:
        problem = draw(seed)
        try:
            with time_limit(SECONDS):
                contact = problem.solve()
        except Exception as error:  # any error, also `gen.runtime.farm.Overtime`
            unanswered.append(f"{type(error).__name__} at seed {seed}")
            continue
        iterations.append(contact.iterations)
        for finding in compare(problem, contact):
            so_far = worst.get(finding.name, finding)
            worst[finding.name] = max(so_far, finding, key=lambda finding: finding.rank)
    middle, largest = np.percentile(iterations or [0], (50, 100))
    counts = f"{middle:.0f} iterations in the middle, {largest:.0f} at most"
    name = ", ".join(["without an answer", *unanswered[:3]])
    findings = [Finding(name=name, error=len(unanswered), allowed=0)]
    findings.extend(worst.values())
    return Answer(f"{len(seeds)} solves, {counts}", findings)


def _most_nodes(seed: int, *, rare: int, seldom: int, usual: int) -> int:
    """Return the largest number of nodes a side that may be drawn by a seed.

    It is `rare` if the seed is a multiple of 50, else `seldom` if it is a multiple of 10, and
    `usual` for the other seeds.
    """
    if seed % 50 == 0:
        return rare
    if seed % 10 == 0:
        return seldom
    return usual


HARDNESS = (1e-4, 10.0)
"""Smallest and largest hardness [E*]."""

UNDECIDED = 1e-8
"""Largest pressure over the hardness, and gap over Delta, with which a node is undecided [1].

An undecided node may be in contact or not, and yielded or not.
"""

LIMITS = {
    "residual off": RTOL + ROUNDING,
    "yielded depth off": RTOL + ROUNDING,
}
"""Largest errors that pass, by the name of the finding. They replace larger ones of `honesty` and
`says_what_yields` [Delta]."""


def yielding() -> Iterator[Case]:
    """Make the cases in which bodies with a hardness are compared with least squares.

    They have 1,000 contacts, `BLOCK` in each case. The quick table has the first case.

    Yields
    ------
    Case
        The cases, in the order of their seeds.
    """
    yield from _blocks(
        family="least squares",
        contacts=1000,
        text="2 to 33 nodes a side, cells to 1:100, H from 1e-4 to 10 E*, rtol = 1e-10",
        draw=yielding_problem,
        compare=judge_both_ways,
    )


def yielding_problem(seed: int) -> Setup:
    """Draw a problem with a hardness.

    The displacement is log-uniform from a thousandth of that of full elastic contact to that of
    full elastic contact. For even seeds the hardness is log-uniform over `HARDNESS`. For odd seeds
    it is 1 % to 100 % of the largest elastic pressure, so that some nodes yield and others do not.

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
    most_nodes = _most_nodes(seed, rare=33, seldom=20, usual=12)
    surface = _draw_surface(random, fewest=2, most_nodes=most_nodes, largest_aspect=100.0)
    heights = surface.heights
    aspect = surface.aspect
    kernel: Kernel = "uniform-pressure"
    # Concentrated forces are for square cells only.
    if aspect == 1.0 and random.random() < 0.4:
        kernel = "concentrated-force"
    # The displacement of full contact is 0 on a flat surface.
    deepest = dense.full_contact_delta(heights, kernel, aspect) or 1.0
    exponent = min(random.uniform(-3, 0.2), 0)  # one draw in sixteen is full contact
    delta = deepest * float(10**exponent)
    lowest, highest = np.log(HARDNESS)
    hardness = float(np.exp(random.uniform(lowest, highest)))
    if seed % 2:
        elastic = dense.press(heights, delta, kernel, aspect)
        share = float(10 ** random.uniform(-2, 0))
        largest_pressure = delta * elastic.pressure.max()
        hardness = float(np.clip(share * largest_pressure, *HARDNESS))
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

    A second call for a problem returns the first result.

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
        delta=problem.delta,
        hardness=problem.bound,
        kernel=problem.kernel,
        aspect=problem.aspect,
        find_start=dense.by_least_squares,
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
        The relative difference of the force from that of least squares [1]; the number of nodes in
        contact or yielded in only one solution; the number of impossible pressures; the largest
        violation by a gap [Delta]; and the findings of `honesty` and `says_what_yields`.
    """
    hardness = problem.bound
    reference = expected(problem)
    pressure = reference.pressure
    gap = reference.gap
    force = float(pressure.sum()) * problem.cell_area
    yield Finding(
        name="force off least squares",
        error=abs(contact.force / force - 1),
        allowed=1e-8,
    )
    tiny_pressure = UNDECIDED * hardness
    tiny_gap = UNDECIDED * problem.delta
    # Nodes with a tiny pressure and a tiny gap may be in contact or not.
    is_decided = (pressure > tiny_pressure) | (gap > tiny_gap)
    touching_unlike = unlike(contact.pressure > 0, pressure > 0, is_decided)
    # Nodes that nearly have the hardness, and penetrate by a tiny depth, may have yielded or not.
    is_decided = (hardness - pressure > tiny_pressure) | (gap < -tiny_gap)
    has_yielded = pressure >= hardness * (1 - ONE_ROUNDING)
    yielded_unlike = unlike(contact.pressure == hardness, has_yielded, is_decided)
    yield Finding(
        name="nodes off least squares",
        error=touching_unlike + yielded_unlike,
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
    """Compare a contact with least squares, then solve the problem by iterations and compare again.

    The second solve never factorises the matrix of the nodes in contact.

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
    # With a limit of 0 nodes, no set of nodes is small enough to be factorised.
    with mock.patch.object(patch, "FEW_FREE", ((0.0, 1.0),)):
        yield from judge_yielding(problem, problem.solve())


MOST_MIRRORED = 40
"""Largest number of nodes a side of patches that are compared with mirror images or shifted."""

LARGEST_DELTA = 4.0
"""Largest factor by which a displacement is larger if the bodies yield [1]."""


def edgeless() -> Iterator[Case]:
    """Yield ten blocks beside dense references, two of mirror images, one of cyclic shifts."""
    yield from _blocks(
        family="dense references",
        contacts=1000,
        text="1 to 24 nodes a side, rtol = 1e-10",
        draw=edgeless_problem,
        compare=judge_edgeless,
    )
    yield from _blocks(
        family="mirror images",
        contacts=200,
        text="1 to 40 nodes a side",
        draw=mirrored_problem,
        compare=judge_images,
    )
    yield from _blocks(
        family="cyclic shifts",
        contacts=100,
        text="1 to 40 nodes a side, periodic",
        draw=periodic_problem,
        compare=judge_shift,
    )


def edgeless_problem(seed: int, most_nodes: int | None = None) -> Setup:
    """Draw a problem without edges: its boundary, grid, cells, surface, modulus, load and hardness.

    The load is a mean pressure, a force or a displacement. Pressure and force are log-uniform, from
    1e-3 to twice those of full elastic contact. A displacement, or its distance from that of full
    elastic contact, is log-uniform. Half of the bodies yield, at 1 to 100 times the mean pressure.
    If they are given a displacement, it is up to `LARGEST_DELTA` times as large.

    Parameters
    ----------
    seed : int
        Seed of the problem.
    most_nodes : int, optional
        Largest number of nodes a side; by default it depends on the seed.

    Returns
    -------
    Setup
        The problem, with a first side of a cell of 1 um.
    """
    random = np.random.default_rng((EDGELESS_SEED, seed))
    if most_nodes is None:
        most_nodes = _most_nodes(seed, rare=24, seldom=16, usual=10)
    surface = _draw_surface(random, fewest=1, most_nodes=most_nodes, largest_aspect=30.0)
    # Another order of the draws below would change the problem of each seed.
    boundary: Boundary = "mirror" if random.random() < 0.5 else "periodic"
    modulus = 1.0
    if random.random() < 0.5:
        modulus = float(10 ** random.uniform(-2, 6))
    problem = Setup(
        surface.heights,
        spacing=(1.0, surface.aspect),
        boundary=boundary,
        modulus=modulus,
        rtol=RTOL,
    )
    reference = patch_of(problem)
    pressure = _mean_pressure(random, problem, reference)
    hardness_ratio = float(10 ** random.uniform(0.001, 2))
    if random.random() < 0.5:
        problem = replace(problem, hardness=hardness_ratio * pressure)
    kind_of_load = random.integers(3)
    if kind_of_load == 0:
        return replace(problem, pressure=pressure)
    if kind_of_load == 1:
        force = pressure * problem.surface.size * problem.cell_area
        return replace(problem, force=force)
    delta = _displacement(random, problem, reference)
    if delta > ROUNDING:
        return replace(problem, delta=delta)
    # A flat surface is in full contact at a displacement of 0, whatever the load.
    return replace(problem, pressure=pressure)


def _mean_pressure(random: Random, problem: Setup, reference: Patch) -> float:
    """Draw a mean pressure over the patch [MPa].

    The pressure is log-uniform from a thousandth of the mean pressure of full elastic contact to
    twice this pressure. A flat surface has full contact under any pressure. There the pressure of
    full contact is replaced by E* over the number of nodes.
    """
    # Loads are sums of the nodes' pressures for E* = 1 MPa.
    full_contact = reference.full_contact_load
    if full_contact <= ROUNDING:  # a flat surface
        full_contact = 1.0
    load = full_contact * float(10 ** random.uniform(-3, 0.3))
    return load / problem.surface.size * problem.modulus


def _displacement(random: Random, problem: Setup, reference: Patch) -> float:
    """Draw a displacement [um]; it is 0 for a flat surface.

    Half of the time it is log-uniform up to that of full elastic contact, and half of the time its
    distance from that is. On bodies that yield it is then enlarged by up to `LARGEST_DELTA`.
    """
    share = float(10 ** random.uniform(-5, 0))
    if random.random() >= 0.5:
        share = 1 - share
    delta = reference.full_contact_delta * share
    if problem.hardness is not None:
        delta *= float(LARGEST_DELTA ** random.random())
    return delta


def _compared_problem(boundary: Boundary, seed: int) -> Setup:
    """Draw a problem by a seed as `edgeless_problem`, but with this boundary.

    It has at most `MOST_MIRRORED` nodes a side, and a tolerance of 1e-12.
    """
    problem = edgeless_problem(seed, MOST_MIRRORED)
    return replace(problem, boundary=boundary, rtol=1e-12)


mirrored_problem = partial(_compared_problem, "mirror")
"""Takes a seed, and returns a problem of a mirrored patch."""

periodic_problem = partial(_compared_problem, "periodic")
"""Takes a seed, and returns a problem of a periodic patch."""


def patch_of(problem: Setup) -> Patch:
    """Make the dense reference of a problem without edges.

    Parameters
    ----------
    problem : Setup
        The problem.

    Returns
    -------
    Patch
        The patch for E* = 1 MPa: its pressures and its hardness are over the modulus, which is E*
        because these problems have a Poisson's ratio of 0.
    """
    rows, columns = problem.surface.shape
    dx, dy = problem.cell
    # The boundary is never "free" here; this narrows its type.
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
        Relative deviation of the load [1]; number of impossible pressures; largest violation by a
        gap [um]; differences of the stated residual [um] and area [%] from the pressure; and the
        norm of the difference from the pressure of the reference [MPa for E* = 1 MPa]. There is no
        last one if all nodes have yielded.
    """
    reference = patch_of(problem)
    pressure = contact.pressure / problem.modulus
    yield Finding(
        name="load off",
        error=load_error(problem, contact),
        allowed=SUM_ROUNDING,
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
        allowed=SUM_ROUNDING,
    )
    # If all nodes have yielded, the pressure is the hardness, which is checked above.
    if pressure.min() < reference.hardness:
        compared = reference.press(float(pressure.sum()))
        # Largest change of the pressure, in the 2-norm, by a gap that is nowhere above 1 um.
        largest_stiffness = float(1 / reference.compliances.min())
        change_by_gap = largest_stiffness * pressure.size**0.5
        error = float(np.linalg.norm(pressure - compared))
        yield Finding(
            name="pressure off the reference",
            error=error,
            allowed=change_by_gap * 2 * allowed,  # both pressures may leave a gap
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
        Relative deviation [1]. For a force or a mean pressure it is the larger of two: that of the
        stated force, and that of the sum of pressures.
    """
    force = problem.given_force
    if not force:
        return abs(contact.delta / problem.delta - 1)
    mean = float(contact.pressure.mean())
    total = mean * contact.pressure.size * problem.cell_area
    stated_off = abs(contact.force / force - 1)
    return max(stated_off, abs(total / force - 1))


def images(field: Field) -> Field:
    """Join a field with its mirror images.

    Parameters
    ----------
    field : ndarray, shape (nx, ny)
        Values at the nodes.

    Returns
    -------
    ndarray, shape (2 nx, 2 ny)
        The field, its image along each axis beside it, and its image along both axes.
    """
    reversed_y = field[:, ::-1]
    reversed_x = field[::-1]
    reversed_both = field[::-1, ::-1]
    return np.block([[field, reversed_y], [reversed_x, reversed_both]])


def judge_images(problem: Setup, contact: bem.Contact) -> Iterator[Finding]:
    """Compare a mirrored patch with the periodic patch that consists of it and its mirror images.

    The periodic patch is solved here.

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
        force = 4 * force  # the periodic patch has four times the area
    heights = images(problem.surface)
    periodic = replace(problem, heights=heights, boundary="periodic", force=force)
    yield from alike(problem, contact, periodic.solve(), images)


def judge_shift(problem: Setup, contact: bem.Contact) -> Iterator[Finding]:
    """Compare a periodic patch with a patch that is shifted by a third of its sides.

    The shifted patch is solved here.

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
        """Return a field, (nx, ny), cyclically shifted by `steps` nodes."""
        return np.roll(field, steps, (0, 1))

    shifted = replace(problem, heights=shift(problem.surface)).solve()
    yield from alike(problem, contact, shifted, shift)


def alike(
    problem: Setup,
    contact: bem.Contact,
    transformed: bem.Contact,
    transform: Callable[[Field], Field],
) -> Iterator[Finding]:
    """Compare a contact with that of the mirrored or shifted surface.

    Compared are the pressures, and the displacements that the operators of both problems compute
    from one pressure.

    Parameters
    ----------
    problem : Setup
        The problem of the contact.
    contact : bem.Contact
        The contact.
    transformed : bem.Contact
        Contact of the transformed surface.
    transform : callable
        Function that mirrors or shifts a field of the contact, (nx, ny), like its surface.

    Yields
    ------
    Finding
        Largest difference of the pressures [largest pressure], and largest difference of the
        displacements [largest pressure times longest side over E].
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
