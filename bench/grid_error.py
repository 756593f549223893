"""How many true errors lie inside the bars of `Contact.grid_error`: surfaces of eleven kinds.

The truth is the same surface on a grid of at least 32 nodes in the shortest wave, or four times
finer. Loads are forces or displacements, a third of them on bodies that yield.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.interpolate import RectBivariateSpline

import bem
from bem.derived.grid_error import area_within
from bem.problem import Boundary
from bench.files import Row
from bench.made_maps import KINDS as MACHINED
from bench.made_maps import MadeMap
from bench.made_maps import surface as made_surface
from bench.report import remark
from bench.resolution import random_waves
from gen.arrays import Heights
from gen.quantities import AREA, DELTA, FORCE, MEAN_GAP, UNLOADING
from gen.surface import generate

ANSWERS = (AREA.name, DELTA.name, FORCE.name, MEAN_GAP.name, UNLOADING.name)
LOADS = 2  # of every surface
ENOUGH = 32  # nodes in the shortest wave of an exact grid
FINEST = 1040  # nodes a side of an exact grid at most


@dataclass(frozen=True)
class Sample:
    """A surface, the grid that is judged, and how much finer the exact one is."""

    boundary: Boundary
    surface: Callable[[int], Heights]  # by nodes a side
    nodes: int
    finer: int

    @property
    def exact(self) -> int:
        """Nodes a side of the exact grid, whose nodes are those of the other one and more."""
        edge = self.boundary == "free"
        return (self.nodes - edge) * self.finer + edge


Draw = Callable[[np.random.Generator], Sample]
Judged = tuple[bool, dict[str, tuple[float, float]]]
"""Whether a contact is called resolved, and each answer's error and bar over its value."""


def grid_error(surfaces: int) -> list[Row]:
    """Judge the bars of contacts on surfaces of every kind, and of all of them together."""
    rows, everything = [], []
    for number, (kind, draw) in enumerate(KINDS.items()):
        judged = [
            each
            for seed in range(surfaces)
            for each in _judged(draw, np.random.default_rng((number, seed)))
        ]
        rows.append({"kind": kind, **_summary(judged)})
        everything += judged
        remark(f"{kind}: {len(judged)} contacts")
    return [*rows, {"kind": "all", **_summary(everything)}]


def _summary(judged: list[Judged]) -> Row:
    """Return the share called resolved [%], and of these the errors inside their bars [%]."""
    resolved = [errors for is_resolved, errors in judged if is_resolved]
    share = 100 * len(resolved) / len(judged) if judged else ""
    row: Row = {"contacts": len(judged), "resolved_percent": share}
    for name in ANSWERS:
        pairs = np.array([each[name] for each in resolved if name in each]).reshape(-1, 2)
        inside = 100 * float(np.mean(pairs[:, 0] <= pairs[:, 1])) if len(pairs) else ""
        row[f"{name}_inside_percent"] = inside
    areas = np.array([each["area_percent"] for each in resolved]).reshape(-1, 2)
    error, bar = 100 * np.median(areas, axis=0) if len(areas) else ("", "")
    return row | {"area_bar_percent": bar, "area_error_percent": error}


def _judged(draw: Draw, random: np.random.Generator) -> Iterator[Judged]:
    """Yield what becomes of the bars of one surface."""
    sample = draw(random)
    coarse, fine = sample.surface(sample.nodes), sample.surface(sample.exact)
    slope = (
        math.hypot(*(np.diff(coarse, axis=axis).std() for axis in (0, 1))) * sample.nodes
    )
    for _ in range(LOADS):
        pressure = slope * math.exp(random.uniform(math.log(0.005), math.log(0.5)))
        hardness = None if random.random() < 2 / 3 else pressure * random.uniform(1.5, 20)
        solve = partial(bem.solve, side=1.0, boundary=sample.boundary, hardness=hardness)
        by_delta = random.random() < 0.5
        try:
            contact = solve(coarse, pressure=pressure)
            if by_delta:
                contact = solve(coarse, delta=contact.delta)
                exact = solve(fine, delta=contact.delta)
            else:
                exact = solve(fine, force=contact.force)
        except bem.NoSolution:  # a displacement beyond full contact
            continue
        if contact.contact_nodes:
            yield _compared(contact, exact)


def _compared(contact: bem.Contact, exact: bem.Contact) -> Judged:
    """Return the true errors of a contact beside its bars."""
    error = contact.grid_error()
    cells = contact.pressure.size * math.prod(contact.problem.spacing)
    area = area_within(exact, contact.problem.spacing)
    answers = {
        AREA.name: (contact.continuum_area_percent, 100 * area / cells),
        MEAN_GAP.name: (contact.mean_gap, exact.mean_gap),
        UNLOADING.name: (contact.stiffness, exact.stiffness),
    }
    conjugate = "force" if contact.problem.force is None else "delta"
    answers[conjugate] = getattr(contact, conjugate), getattr(exact, conjugate)
    errors = {}
    for name, (found, true) in answers.items():
        if found and math.isfinite(found) and math.isfinite(true):
            # Both solutions have the solver's own tolerance.
            bar = getattr(error, name) / abs(found) + 1e-6
            errors[name] = abs(found - true) / abs(found), bar
    return error.resolved, errors


def _finer(nodes: int, nodes_a_wave: float) -> int:
    """Return how much finer the exact grid is: a power of two."""
    finer = 4
    while nodes_a_wave * finer < ENOUGH:
        finer *= 2
    while finer > 2 and finer * nodes > FINEST:
        finer //= 2
    return finer


def _grid(random: np.random.Generator, *nodes: int) -> tuple[int, int]:
    """Draw nodes a side, and the waves a side of a shortest one of 3 to 32 nodes."""
    chosen = int(random.choice(nodes))
    return chosen, max(
        int(chosen / math.exp(random.uniform(math.log(3.0), math.log(32)))), 3
    )


def _waves(random: np.random.Generator, aspect: float = 1.0) -> Sample:
    """Draw waves with a shortest one, without edges."""
    nodes, shortest = _grid(random, 64, 96, 128, 129)
    hurst, longest = random.uniform(0.2, 0.9), int(random.choice([1, 2]))
    surface = random_waves(longest, shortest, hurst, random, aspect)
    finer = _finer(nodes, nodes / shortest)
    return Sample("periodic", lambda n: surface(np.arange(n) / n), nodes, finer)


def _window(random: np.random.Generator) -> Sample:
    """Draw a free patch cut out of a larger surface, nine tenths of its period."""
    nodes, shortest = _grid(random, 64, 65, 97, 129)
    surface = random_waves(1, shortest, random.uniform(0.2, 0.9), random)
    finer = _finer(nodes, nodes / shortest / 0.9)
    return Sample("free", lambda n: surface(np.linspace(0.01, 0.91, n)), nodes, finer)


def _mirrored(random: np.random.Generator) -> Sample:
    """Draw a patch that is continued by its mirror images."""
    nodes, shortest = _grid(random, 64, 97, 128)
    surface = random_waves(2, 2 * shortest, random.uniform(0.2, 0.9), random)

    def even(n: int) -> Heights:
        places = (np.arange(n) + 0.5) / (2 * n)
        four = surface(np.concatenate([places, -places])).reshape(2, n, 2, n)
        return np.asarray(four.sum(axis=(0, 2)) / 2)

    return Sample("mirror", even, nodes, _finer(nodes, nodes / shortest))


def _sphere(random: np.random.Generator) -> Sample:
    """Draw a paraboloid with its tip anywhere near the middle."""
    nodes, radius = int(random.choice([33, 64, 65, 129])), random.uniform(2, 6)
    tip = random.uniform(0.4, 0.6, 2)

    def heights(n: int) -> Heights:
        x, y = (np.linspace(0, 1, n) - place for place in tip)
        return np.asarray(-np.add.outer(x**2, y**2) / (2 * radius))

    return Sample("free", heights, nodes, 4)


def _regular(random: np.random.Generator, *, crossed: bool) -> Sample:
    """Draw one wave at an angle, or two that cross."""
    nodes = int(random.choice([32, 48, 64, 65]))
    along, across = int(random.integers(1, 6)), int(random.integers(0, 6))
    phases = random.uniform(0, 2 * np.pi, 2)

    def heights(n: int) -> Heights:
        x = 2 * np.pi * np.arange(n) / n
        wave = np.cos(np.add.outer(along * x, across * x) + phases[0])
        if crossed:
            wave = wave + np.cos(np.add.outer(-across * x, along * x) + phases[1])
        return np.asarray(0.01 * wave)

    finer = _finer(nodes, nodes / math.hypot(along, across))
    return Sample("periodic", heights, nodes, finer)


def _turned(random: np.random.Generator) -> Sample:
    """Draw grooves of a round tool, with sharp ridges between them, on gentle waves."""
    nodes, grooves = int(random.choice([64, 96, 128])), int(random.choice([2, 3, 4, 6]))
    waves, share = random_waves(1, 4, 0.8, random), random.uniform(0, 0.3)

    def heights(n: int) -> Heights:
        places = np.arange(n) / n
        groove = ((places * grooves + 0.37) % 1 - 0.5) ** 2
        return np.asarray(0.2 / grooves * groove[:, None] + share * waves(places))

    return Sample("periodic", heights, nodes, 8)


def _fractal(random: np.random.Generator) -> Sample:
    """Draw waves that go on to a quarter of the spacing, which no grid here resolves."""
    nodes = int(random.choice([64, 128]))
    surface = random_waves(1, 2 * nodes, random.uniform(0.2, 0.95), random)
    return Sample("periodic", lambda n: surface(np.arange(n) / n), nodes, 4)


def _paper(random: np.random.Generator) -> Sample:
    """Draw a surface by random midpoint displacement, the paper's, and its every fourth node."""
    exponent = int(random.choice([6, 7]))
    nodes = 2 ** (exponent + 2) + 1
    finest = generate("diamond-square", nodes, random.uniform(0.3, 0.9), 0.01, random)

    def heights(n: int) -> Heights:
        step = (len(finest) - 1) // (n - 1)
        return finest[::step, ::step]

    return Sample("free", heights, 2**exponent + 1, 4)


def _made_map(random: np.random.Generator) -> Sample:
    """Draw a map as of a machined surface, whose shortest wave has 4 nodes, and read it between.

    It is judged on its own nodes, or on twice as many.
    """
    nodes, between = 97, int(random.integers(1, 3))
    kind, number = random.choice(sorted(MACHINED)), int(random.integers(1000))
    made = MadeMap(
        kind, number, (nodes, nodes), random.uniform(0.3, 2.0), random.uniform(15, 40)
    )
    places = np.linspace(0, 1, nodes)
    spline = RectBivariateSpline(places, places, made_surface(made) / (nodes - 1))

    def heights(n: int) -> Heights:
        return np.asarray(spline(np.linspace(0, 1, n), np.linspace(0, 1, n)))

    return Sample("free", heights, (nodes - 1) * between + 1, 4)


KINDS: dict[str, Draw] = {
    "waves, no edges": _waves,
    "waves, 3 times longer one way": partial(_waves, aspect=3.0),
    "waves, free patch": _window,
    "waves, mirrored": _mirrored,
    "sphere": _sphere,
    "one wave": partial(_regular, crossed=False),
    "crossed waves": partial(_regular, crossed=True),
    "turned": _turned,
    "machined maps": _made_map,
    "fractal": _fractal,
    "midpoint displacement": _paper,
}
