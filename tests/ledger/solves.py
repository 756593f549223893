"""The solves of the ledger: contacts on surfaces of the paper preset, each item a few dozen."""

from collections.abc import Callable, Iterable, Iterator
from functools import cache
from typing import Any

import numpy as np

import bem
from gen.arrays import Columns, Heights
from gen.generation.plan import parameters
from gen.generation.sample import compute_rows, surface_of
from gen.scene import Scene, load
from gen.schema import Status
from tests.ledger.table import Key

SIDE = 1000.0
"""Scan length of the surfaces [um]."""

ROWS = 32
"""Surfaces of most items: enough that one convolution more is less than 2 % of them."""

EXTREME_ROWS = 96
"""Rows of the extreme scene, from the touch of one node to full contact."""


@cache
def surfaces(count: int = ROWS, nodes: int = 129) -> tuple[Heights, ...]:
    """Generate the first surfaces of the paper preset, heights (nodes, nodes) [um]."""
    paper = load("paper")
    scene = paper.model_copy(update={"surface": paper.surface.model_copy(update={"nodes": nodes})})
    plan = parameters(scene, 0, count)
    return tuple(surface_of(scene, plan, row) for row in range(count))


def cells() -> Iterable[Heights]:
    """Return the same surfaces without their last row and column, for patches without edges."""
    return (heights[:-1, :-1] for heights in surfaces())


def _each(
    heights: Iterable[Heights], side: float | tuple[float, float] = SIDE, **arguments: Any
) -> Iterator[bem.Contact]:
    """Solve the same load on every surface."""
    return (bem.solve(surface, side, **arguments) for surface in heights)


Solves = Callable[[], Iterable[bem.Contact]]

SOLVES: dict[str, Solves] = {
    "Delta = 1 um": lambda: _each(surfaces(), delta=1.0),
    "Delta = 5 um": lambda: _each(surfaces(), delta=5.0),
    "Delta = 15 um": lambda: _each(surfaces(), delta=15.0),
    "Delta = 45 um": lambda: _each(surfaces(), delta=45.0),
    "Delta = 300 um": lambda: _each(surfaces(), delta=300.0),
    "rtol = 1e-10": lambda: _each(surfaces(), delta=15.0, rtol=1e-10),
    "compliant far field": lambda: _each(surfaces(), delta=5.0, far_field="compliant"),
    "given force": lambda: _each(surfaces(), force=1e4),
    "given pressure": lambda: _each(surfaces(), pressure=0.05),
    "concentrated force": lambda: _each(surfaces(), delta=15.0, kernel="concentrated-force"),
    "oblong cells, 1:4": lambda: _each(surfaces(), (SIDE, 4 * SIDE), delta=15.0),
    "oblong grid, 129 x 65": lambda: _each(
        (heights[:, :65] for heights in surfaces()), (SIDE, SIDE / 2), delta=15.0
    ),
    "257 nodes": lambda: _each(surfaces(16, 257), delta=15.0),
    "513 nodes": lambda: _each(surfaces(8, 513), delta=15.0),
    "ladder of 41 Delta": lambda: bem.ladder(surfaces()[0], SIDE, np.linspace(5, 45, 41)),
    "ladder of 21 pressures": lambda: bem.ladder(
        surfaces()[0], SIDE, pressures=np.geomspace(1e-3, 1e-1, 21)
    ),
    "hardness of 0.005 E*": lambda: _each(surfaces(), delta=15.0, hardness=0.005),
    "hardness of 0.05 E*": lambda: _each(surfaces(), delta=15.0, hardness=0.05),
    "hardness of 0.2 E*": lambda: _each(surfaces(), delta=15.0, hardness=0.2),
    "hardness of 0.05 E*, given pressure": lambda: _each(surfaces(), pressure=0.005, hardness=0.05),
    "hardness of 0.05 E*, ladder of 21 pressures": lambda: bem.ladder(
        surfaces()[0], SIDE, pressures=np.geomspace(1e-4, 1e-2, 21), hardness=0.05
    ),
    "periodic, given Delta": lambda: _each(cells(), delta=5.0, boundary="periodic"),
    "periodic, given pressure": lambda: _each(cells(), pressure=0.02, boundary="periodic"),
    "mirror, given Delta": lambda: _each(cells(), delta=5.0, boundary="mirror"),
    "mirror, given pressure": lambda: _each(cells(), pressure=0.02, boundary="mirror"),
    "mirror, nearly full contact": lambda: _each(cells(), pressure=0.2, boundary="mirror"),
    "mirror, hardness of 0.05 E*": lambda: _each(
        cells(), pressure=0.005, hardness=0.05, boundary="mirror"
    ),
}
"""The items and their solves."""

STIFF = ("Delta = 15 um", "257 nodes", "mirror, given pressure", "hardness of 0.05 E*")
"""Items whose contacts are asked for their stiffness too."""


def solve_counts() -> dict[Key, int]:
    """Count the work and the contact nodes of all items of `SOLVES`, and of the extreme scene."""
    counts = {}
    for item, solves in SOLVES.items():
        contacts = list(solves())
        counts[Key(item, "solves")] = len(contacts)
        for count in ("iterations", "convolutions", "contact_nodes"):
            total = sum(getattr(contact, count) for contact in contacts)
            counts[Key(item, count.replace("_", " "))] = total
        if item in STIFF:
            taken = sum(contact.punch.effort.convolutions for contact in contacts)
            counts[Key(item, "convolutions of the stiffness")] = taken
        if contacts[0].problem.hardness is not None:
            yielded = sum(contact.yielded_percent * contact.pressure.size for contact in contacts)
            counts[Key(item, "yielded nodes")] = round(yielded / 100)
    return counts | row_counts("extreme scene", load("extreme"), EXTREME_ROWS)


def row_counts(item: str, scene: Scene, rows: int) -> dict[Key, int]:
    """Compute the first rows of a scene, and count them."""
    return column_counts(item, compute_rows(scene, 0, rows))


def column_counts(item: str, columns: Columns) -> dict[Key, int]:
    """Count rows, done rows, iterations, convolutions and contact nodes by their columns."""
    status = columns["status"]
    counts = {
        Key(item, "rows"): status.size,
        Key(item, "rows done"): int(np.count_nonzero(status == Status.DONE)),
    }
    for count in ("iterations", "convolutions", "contact_nodes"):
        counts[Key(item, count.replace("_", " "))] = int(columns[count].sum())
    return counts
