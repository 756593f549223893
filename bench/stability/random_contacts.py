"""Random contacts that yield, and without edges, beside dense references: many as one case.

Bodies that yield stand beside bounded least squares. Of patches without edges the pressure is
compared under the same total load, on which it depends smoothly even in full contact, and the
displacement by the gaps that it leaves; mirrored patches stand beside their images, periodic ones
beside their shifts.
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

YIELDING, EDGELESS = (
    24,
    25,
)  # keep draws apart from those of another table with the same seeds
RTOL = 1e-10  # tolerance of the solves beside references [Delta]
ROUNDING = (
    1e-11  # what gaps may differ by through rounding alone [Delta, or range of heights]
)
BLOCK = 100  # problems of a case; the first block is in the quick table
SECONDS = 60.0  # wall-clock time after which a solve counts as a loop


def _blocks(
    family: str,
    problems: int,
    asked: str,
    draw: Callable[[int], Setup],
    compare: Callable[[Setup, bem.Contact], Iterable[Finding]],
) -> Iterator[Case]:
    """Cut many problems, each drawn with a seed and then compared, into cases."""
    for first in range(0, problems, BLOCK):
        name, block = f"seeds {first} to {first + BLOCK - 1}", range(first, first + BLOCK)
        yield Case(
            family, name, asked, partial(examine, block, draw, compare), slow=first > 0
        )


def _surface_and_aspect(
    random: Random, nodes: tuple[int, int], largest_aspect: float
) -> tuple[Field, float]:
    """Draw heights with a range of 1, fewest to most nodes a side; half of the cells are oblong."""
    rows, columns = (int(each) for each in random.integers(nodes[0], nodes[1] + 1, 2))
    kinds = list(surfaces.SURFACES.values())
    heights = kinds[random.integers(len(kinds))](random, (rows, columns))
    oblong = random.random() < 0.5
    aspect = float(largest_aspect ** random.uniform(-1, 1)) if oblong else 1.0
    return heights / (np.ptp(heights) or 1.0), aspect


def examine(
    seeds: range,
    draw: Callable[[int], Setup],
    compare: Callable[[Setup, bem.Contact], Iterable[Finding]],
) -> Answer:
    """Solve the problems of some seeds, and keep the worst finding of each name.

    A solve of more than `SECONDS` counts as an endless loop, without an answer.
    """
    iterations, astray = [], []
    largest: dict[str, Finding] = {}
    for seed in seeds:
        asked = draw(seed)
        try:
            with time_limit(SECONDS):
                contact = asked.solve()
        except (Overtime, Exception) as error:
            astray.append(f"{type(error).__name__} at seed {seed}")
            continue
        iterations.append(contact.iterations)
        for finding in compare(asked, contact):
            worst = largest.get(finding.what, finding)
            largest[finding.what] = max(worst, finding, key=lambda each: each.rank)
    middle, most = np.percentile(iterations or [0], (50, 100))
    out = (
        f"{len(seeds)} solves, {middle:.0f} iterations in the middle, {most:.0f} at most"
    )
    unanswered = Finding(", ".join(["without an answer", *astray[:3]]), len(astray), 0)
    return Answer(out, [unanswered, *largest.values()])


def _most(seed: int, *most: int) -> int:
    """Return nodes a side at most: of every 50th problem, every 10th, and all others."""
    return most[0] if seed % 50 == 0 else most[1 if seed % 10 == 0 else 2]


HARDNESS = (1e-4, 10.0)  # least and largest hardness [E*]
# Pressures, over the hardness, and gaps, over the displacement, that may be either [1].
UNDECIDED = 1e-8
# Bounds that are tighter here than in the solver's table.
LIMITS = dict.fromkeys(("residual off", "yielded depth off"), RTOL + ROUNDING)


def yielding() -> Iterator[Case]:
    """Ten blocks beside least squares."""
    squares = "2 to 33 nodes a side, cells to 1:100, H from 1e-4 to 10 E*, rtol = 1e-10"
    yield from _blocks("least squares", 1000, squares, yielding_problem, judge_both_ways)


def yielding_problem(seed: int) -> Setup:
    """Draw a problem.

    The displacement is log-uniform up to that of full elastic contact. The hardness is log-uniform
    over its range for even seeds; for odd ones it is a share, from 1 down to 1 %, of the largest
    elastic pressure, so that it matters and yet not all nodes yield.
    """
    random = np.random.default_rng((YIELDING, seed))
    heights, aspect = _surface_and_aspect(random, (2, _most(seed, 33, 20, 12)), 100.0)
    concentrated = aspect == 1.0 and random.random() < 0.4
    kernel: Kernel = "concentrated-force" if concentrated else "uniform-pressure"
    deepest = dense.full_contact_delta(heights, kernel, aspect) or 1.0
    delta = deepest * float(10 ** min(random.uniform(-3, 0.2), 0))
    hardness = float(np.exp(random.uniform(*np.log(HARDNESS))))
    if seed % 2:
        elastic, _ = dense.press(heights, delta, kernel, aspect)
        share = float(10 ** random.uniform(-2, 0))
        hardness = float(np.clip(share * delta * elastic.max(), *HARDNESS))
    cell = (1.0, aspect)
    return Setup(
        heights, delta, spacing=cell, kernel=kernel, hardness=hardness, rtol=RTOL
    )


@lru_cache(maxsize=128)
def expected(asked: Setup) -> tuple[Field, Field]:
    """(nx, ny) pressure [MPa] and gap [um] of a problem by bounded least squares."""
    given = asked.surface, asked.delta, asked.bound, asked.kernel, asked.aspect
    return dense.press_yielding(*given, sides=dense.by_least_squares)


def judge_yielding(asked: Setup, contact: bem.Contact) -> Iterator[Finding]:
    """Compare with least squares, and look at the conditions of contact by the dense matrix."""
    (pressure, gap), hardness = expected(asked), asked.bound
    off = abs(contact.force / (float(pressure.sum()) * asked.aspect) - 1)
    yield Finding("force off least squares", off, 1e-8)
    little, close = UNDECIDED * hardness, UNDECIDED * asked.delta
    touching = unlike(
        contact.pressure > 0, pressure > 0, (pressure > little) | (gap > close)
    )
    bound, apart = hardness * (1 - 1e-15), (hardness - pressure > little) | (gap < -close)
    yielded = unlike(contact.pressure == hardness, pressure >= bound, apart)
    yield Finding("nodes off least squares", touching + yielded, 0)
    beyond = int(
        np.count_nonzero(~((contact.pressure >= 0) & (contact.pressure <= hardness)))
    )
    yield Finding("nodes in tension or above the hardness", beyond, 0)
    wrong = violation(asked, contact.pressure, dense.displace)
    yield Finding("gap", wrong, RTOL + ROUNDING)
    for check in (honesty, says_what_yields):
        for finding in check(asked, contact, dense.displace):
            yield finding._replace(allowed=LIMITS.get(finding.what, finding.allowed))


def judge_both_ways(asked: Setup, contact: bem.Contact) -> Iterator[Finding]:
    """Compare a contact, and the one by iterations alone, with least squares."""
    yield from judge_yielding(asked, contact)
    with mock.patch.object(patch, "FEW_FREE", ((0.0, 1.0),)):
        yield from judge_yielding(asked, asked.solve())


MOST_MIRRORED = 40  # of patches that are compared with their mirror images or shifted
LARGEST_DELTA = (
    4.0  # largest displacement of bodies that yield [that of full elastic contact]
)


def edgeless() -> Iterator[Case]:
    """Ten blocks beside dense references, two of mirror images, one of cyclic shifts."""
    small, nodes = "1 to 24 nodes a side, rtol = 1e-10", "1 to 40 nodes a side"
    yield from _blocks("dense references", 1000, small, edgeless_problem, judge_edgeless)
    yield from _blocks("mirror images", 200, nodes, mirrored_problem, judge_images)
    yield from _blocks(
        "cyclic shifts", 100, f"{nodes}, periodic", periodic_problem, judge_shift
    )


def edgeless_problem(seed: int, most: int | None = None) -> Setup:
    """Draw a problem: boundary, grid, cells, surface, load, which kind of load, and hardness.

    The load is log-uniform, from 1e-3 of full elastic contact to twice as much. Half of the bodies
    yield, at 1 to 100 times the mean pressure. A given displacement is log-uniform up to that of
    full elastic contact, or its distance from that is; bodies that yield are pressed further.
    """
    random = np.random.default_rng((EDGELESS, seed))
    heights, aspect = _surface_and_aspect(
        random, (1, most or _most(seed, 24, 16, 10)), 30.0
    )
    asked = Setup(
        heights,
        spacing=(1.0, aspect),
        boundary="mirror" if random.random() < 0.5 else "periodic",
        modulus=float(10 ** random.uniform(-2, 6)) if random.random() < 0.5 else 1.0,
        rtol=RTOL,
    )
    # Load and hardness as reduced forces: sums of the nodes' pressures for E* = 1 MPa.
    patch = patch_of(asked)
    full = patch.full_contact_load
    reduced = (full if full > ROUNDING else 1.0) * float(10 ** random.uniform(-3, 0.3))
    pressure = reduced / asked.surface.size * asked.modulus
    ratio = float(10 ** random.uniform(0.001, 2))
    if random.random() < 0.5:
        asked = replace(asked, hardness=ratio * pressure)
    kind = random.integers(3)
    if kind == 0:
        return replace(asked, pressure=pressure)
    if kind == 1:
        return replace(asked, force=pressure * asked.surface.size * asked.cell_area)
    share = float(10 ** random.uniform(-5, 0))
    delta = patch.full_contact_delta * (share if random.random() < 0.5 else 1 - share)
    if asked.hardness is not None:
        delta *= float(LARGEST_DELTA ** random.random())
    return (
        replace(asked, delta=delta)
        if delta > ROUNDING
        else replace(asked, pressure=pressure)
    )


def _compared_problem(boundary: Boundary, seed: int) -> Setup:
    """Draw a patch of any grid that is compared with its images or shifted."""
    return replace(edgeless_problem(seed, MOST_MIRRORED), boundary=boundary, rtol=1e-12)


mirrored_problem = partial(_compared_problem, "mirror")
periodic_problem = partial(_compared_problem, "periodic")


def patch_of(asked: Setup) -> Patch:
    """Return the dense reference of a problem, for E* = 1 MPa."""
    nodes, cells = asked.surface.shape, asked.cell
    hardness = asked.bound / asked.modulus
    sides = nodes[0] * cells[0], nodes[1] * cells[1]
    boundary: Boundary = "mirror" if asked.boundary == "mirror" else "periodic"
    return Patch(asked.surface, sides, boundary, hardness)


def judge_edgeless(asked: Setup, contact: bem.Contact) -> Iterator[Finding]:
    """Look at the load, at the conditions of contact by the dense matrix, and at the reference."""
    patch, pressure = patch_of(asked), contact.pressure / asked.modulus
    yield Finding("load off", load_error(asked, contact), 1e-12)
    beyond = int(np.count_nonzero(~((pressure >= 0) & (pressure <= patch.hardness))))
    yield Finding("nodes in tension or above the hardness", beyond, 0)
    gap = patch.matrix @ pressure.reshape(-1) - patch.below - contact.delta
    wrong = worst_gap(pressure.reshape(-1), gap, patch.hardness)
    allowed = RTOL * contact.delta + ROUNDING
    yield Finding("gap", wrong, allowed)
    off = abs(contact.residual * contact.delta - wrong)
    yield Finding("residual off", off, ROUNDING)
    share = 100 * float(np.mean(pressure > 0))
    yield Finding("area off", abs(contact.area_percent - share), 1e-12)
    if pressure.min() < patch.hardness:
        expected = patch.press(float(pressure.sum()))
        # The stiffest mode turns a gap into no more pressure than this.
        stiffest = float(1 / patch.compliances.min()) * pressure.size**0.5
        error = float(np.linalg.norm(pressure - expected))
        yield Finding("pressure off the reference", error, stiffest * 2 * allowed)


def load_error(asked: Setup, contact: bem.Contact) -> float:
    """Return the relative deviation of the load of a contact from the given one."""
    force = asked.given_force
    if not force:
        return abs(contact.delta / asked.delta - 1)
    mean = float(contact.pressure.mean()) * contact.pressure.size * asked.cell_area
    return max(abs(contact.force / force - 1), abs(mean / force - 1))


def images(field: Field) -> Field:
    """(2 nx, 2 ny) field beside its mirror images."""
    return np.block([[field, field[:, ::-1]], [field[::-1], field[::-1, ::-1]]])


def judge_images(asked: Setup, contact: bem.Contact) -> Iterator[Finding]:
    """Compare a mirrored patch with the periodic one of itself and its images."""
    force = None if asked.force is None else 4 * asked.force
    whole = replace(
        asked, heights=images(asked.surface), boundary="periodic", force=force
    ).solve()
    yield from alike(asked, contact, whole, images)


def judge_shift(asked: Setup, contact: bem.Contact) -> Iterator[Finding]:
    """Compare a periodic patch with the same one that begins elsewhere."""
    steps = tuple(nodes // 3 for nodes in asked.surface.shape)

    def shift(field: Field) -> Field:
        return np.roll(field, steps, (0, 1))

    shifted = replace(asked, heights=shift(asked.surface)).solve()
    yield from alike(asked, contact, shifted, shift)


def alike(
    asked: Setup,
    contact: bem.Contact,
    other: bem.Contact,
    placed: Callable[[Field], Field],
) -> Iterator[Finding]:
    """Compare pressures with those of the same contact placed otherwise, and both operators."""
    wanted = placed(contact.pressure)
    largest = float(wanted.max())
    yield Finding(
        "pressure off", float(np.abs(wanted - other.pressure).max()) / largest, 1e-8
    )
    displacement = replace(other, pressure=wanted).displacement
    error = float(np.abs(placed(contact.displacement) - displacement).max())
    sides = (
        nodes * cell
        for nodes, cell in zip(contact.pressure.shape, asked.cell, strict=True)
    )
    yield Finding("operator off", error / (largest / asked.modulus * max(sides)), 1e-13)
