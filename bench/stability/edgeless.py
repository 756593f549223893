"""Random contacts without edges: beside dense references, mirror images, and cyclic shifts.

The pressure is compared with the reference under the same total load, where it depends smoothly on
the input even in full contact; the displacement is judged by the gaps that it leaves.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

import bem
from bench.references.edgeless import Boundary, Patch
from bench.references.half_space import Field
from bench.references.surfaces import Random
from bench.stability.case import Case, Finding
from bench.stability.setup import Setup, blocks, surface_and_aspect

SALT = 25  # keeps these draws apart from those of other tables with the same seeds
# Nodes a side at most: of every 50th problem, every 10th, all others.
MOST_NODES = {50: 24, 10: 16, 1: 10}
MOST_MIRRORED = 40  # of patches that are compared with their mirror images or shifted
LARGEST_ASPECT = 30.0  # largest ratio of a cell's sides, either way [1]
LARGEST_DELTA = 4.0  # largest displacement of bodies that yield [that of full elastic contact]
RTOL = 1e-10  # tolerance of the solves [Delta]
ROUNDING = 1e-11  # what gaps may differ by through rounding alone [range of heights]


def cases() -> Iterator[Case]:
    """Ten blocks beside dense references, two of mirror images, one of cyclic shifts."""
    yield from blocks(
        "dense references", 1000, "1 to 24 nodes a side, rtol = 1e-10", problem, judge
    )
    yield from blocks("mirror images", 200, "1 to 40 nodes a side", mirrored_problem, judge_images)
    yield from blocks(
        "cyclic shifts", 100, "1 to 40 nodes a side, periodic", periodic_problem, judge_shift
    )


def problem(seed: int, most: int | None = None) -> Setup:
    """Draw a problem: boundary, grid, cells, surface, load, which kind of load, and hardness.

    The load is log-uniform, from 1e-3 of full elastic contact to twice as much. Half of the bodies
    yield, at 1 to 100 times the mean pressure. A given displacement is log-uniform up to that of
    full elastic contact, or its distance from that is; bodies that yield are pressed further.
    """
    random = np.random.default_rng((SALT, seed))
    most = most or next(nodes for every, nodes in MOST_NODES.items() if seed % every == 0)
    heights, aspect = surface_and_aspect(random, (1, most), LARGEST_ASPECT)
    asked = Setup(
        heights,
        spacing=(1.0, aspect),
        boundary="mirror" if random.random() < 0.5 else "periodic",
        modulus=float(10 ** random.uniform(-2, 6)) if random.random() < 0.5 else 1.0,
        rtol=RTOL,
    )
    return _with_load(asked, random)


def mirrored_problem(seed: int) -> Setup:
    """Draw a mirrored patch of any grid."""
    return replace(problem(seed, MOST_MIRRORED), boundary="mirror", rtol=1e-12)


def periodic_problem(seed: int) -> Setup:
    """Draw a periodic patch of any grid."""
    return replace(problem(seed, MOST_MIRRORED), boundary="periodic", rtol=1e-12)


def _with_load(asked: Setup, random: Random) -> Setup:
    """Draw load and hardness, as reduced forces: sums of the nodes' pressures for E* = 1 MPa."""
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
    return replace(asked, delta=delta) if delta > ROUNDING else replace(asked, pressure=pressure)


def patch_of(asked: Setup) -> Patch:
    """Return the dense reference of a problem, for E* = 1 MPa."""
    nodes, cells = asked.surface.shape, asked.cell
    hardness = asked.bound / asked.modulus
    sides = nodes[0] * cells[0], nodes[1] * cells[1]
    boundary: Boundary = "mirror" if asked.boundary == "mirror" else "periodic"
    return Patch(asked.surface, sides, boundary, hardness)


def judge(asked: Setup, contact: bem.Contact) -> Iterator[Finding]:
    """Look at the load, at the conditions of contact by the dense matrix, and at the reference."""
    patch, pressure = patch_of(asked), contact.pressure / asked.modulus
    yield Finding("load off", load_error(asked, contact), 1e-12)
    beyond = int(np.count_nonzero(~((pressure >= 0) & (pressure <= patch.hardness))))
    yield Finding("nodes in tension or above the hardness", beyond, 0)
    gap = patch.matrix @ pressure.reshape(-1) - patch.below - contact.delta
    wrong = violation(pressure.reshape(-1), gap, patch.hardness)
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


def violation(pressure: Field, gap: Field, hardness: float) -> float:
    """Return the largest violation of the conditions of contact by a pressure and its gap [um]."""
    yielded = pressure >= hardness * (1 - 1e-15)
    between = (pressure > 0) & ~yielded
    opened, closed = np.abs(gap[between]).max(initial=0.0), -gap[~yielded].min(initial=0.0)
    return float(max(opened, closed, gap[yielded].max(initial=0.0)))


def images(field: Field) -> Field:
    """(2 nx, 2 ny) field beside its mirror images."""
    return np.block([[field, field[:, ::-1]], [field[::-1], field[::-1, ::-1]]])


def judge_images(asked: Setup, contact: bem.Contact) -> Iterator[Finding]:
    """Compare a mirrored patch with the periodic one of itself and its images."""
    force = None if asked.force is None else 4 * asked.force
    whole = replace(asked, heights=images(asked.surface), boundary="periodic", force=force).solve()
    yield from alike(asked, contact, whole, images)


def judge_shift(asked: Setup, contact: bem.Contact) -> Iterator[Finding]:
    """Compare a periodic patch with the same one that begins elsewhere."""
    steps = tuple(nodes // 3 for nodes in asked.surface.shape)

    def shift(field: Field) -> Field:
        return np.roll(field, steps, (0, 1))

    shifted = replace(asked, heights=shift(asked.surface)).solve()
    yield from alike(asked, contact, shifted, shift)


def alike(
    asked: Setup, contact: bem.Contact, other: bem.Contact, placed: Callable[[Field], Field]
) -> Iterator[Finding]:
    """Compare pressures with those of the same contact placed otherwise, and both operators."""
    wanted = placed(contact.pressure)
    largest = float(wanted.max())
    yield Finding("pressure off", float(np.abs(wanted - other.pressure).max()) / largest, 1e-8)
    displacement = replace(other, pressure=wanted).displacement
    error = float(np.abs(placed(contact.displacement) - displacement).max())
    sides = (nodes * cell for nodes, cell in zip(contact.pressure.shape, asked.cell, strict=True))
    yield Finding("operator off", error / (largest / asked.modulus * max(sides)), 1e-13)
