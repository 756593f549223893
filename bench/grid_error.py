"""The share of true errors inside the bars of `Contact.grid_error`, on surfaces of eleven kinds.

True values are computed on a finer grid of the surface, with at least 32 nodes in the shortest wave
or four times as fine. Loads are forces or displacements. A third of them is on bodies that yield.
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
"""Names of the answers that have bars."""

LOADS = 2
"""Number of loads on every surface."""

ENOUGH = 32
"""Fewest nodes in the shortest wave of an exact grid, unless `FINEST` forbids as many."""

FINEST = 1040
"""Most nodes a side of an exact grid, unless it is only twice as fine."""

SOLVER_ERROR = 1e-6
"""Share of a value by which a bar is widened, for the tolerances of both solves [1]."""


@dataclass(frozen=True)
class Sample:
    """A surface, the grid that is judged, and the exact grid."""

    boundary: Boundary
    surface: Callable[[int], Heights]  # returns heights, (n, n), for nodes a side [side]
    nodes: int  # nodes a side of the grid that is judged
    finer: int  # spacing of that grid over that of the exact grid

    @property
    def exact(self) -> int:
        """Nodes a side of the exact grid; on free and periodic patches it has all coarse nodes."""
        # The nodes of a free patch include both borders.
        edge = 1 if self.boundary == "free" else 0
        return (self.nodes - edge) * self.finer + edge


Draw = Callable[[np.random.Generator], Sample]
"""A function that draws a sample of its kind; it moves the state of the generator."""


@dataclass(frozen=True)
class Bar:
    """An answer's true error, and the bar that should hold it."""

    error: float  # over the value [1]
    bar: float  # over the value [1]

    @property
    def holds(self) -> bool:
        """Whether the error is inside the bar."""
        return self.error <= self.bar


@dataclass(frozen=True)
class Judgement:
    """What became of the bars of one contact."""

    resolved: bool  # whether the contact calls its grid resolved
    bars: dict[
        str, Bar
    ]  # by the name of the answer; not of answers that are zero or infinite


def grid_error(surfaces: int) -> list[Row]:
    """Judge the bars of contacts on surfaces of every kind, and print the progress.

    Parameters
    ----------
    surfaces : int
        Number of surfaces of each kind.

    Returns
    -------
    list of Row
        A row for each kind and one for all kinds, as of `_summary`.
    """
    rows: list[Row] = []
    of_all_kinds: list[Judgement] = []
    for number, (kind, draw) in enumerate(KINDS.items()):
        judgements: list[Judgement] = []
        for seed in range(surfaces):
            judgements.extend(_judged(draw, np.random.default_rng((number, seed))))
        rows.append({"kind": kind, **_summary(judgements)})
        of_all_kinds += judgements
        remark(f"{kind}: {len(judgements)} contacts")
    rows.append({"kind": "all", **_summary(of_all_kinds)})
    return rows


def _summary(judgements: list[Judgement]) -> Row:
    """Return the columns of a row about some contacts, "" for a number without contacts.

    The columns are the number of contacts, the share that is called resolved, of these the share of
    errors inside their bars for each answer, and the median bar and error of the area [all %].
    """
    resolved = [judgement.bars for judgement in judgements if judgement.resolved]
    row: Row = {"contacts": len(judgements), "resolved_percent": ""}
    if judgements:
        row["resolved_percent"] = 100 * len(resolved) / len(judgements)
    for name in ANSWERS:
        inside = [bars[name].holds for bars in resolved if name in bars]
        row[f"{name}_inside_percent"] = ""
        if inside:
            row[f"{name}_inside_percent"] = 100 * float(np.mean(inside))
    row["area_bar_percent"] = ""
    row["area_error_percent"] = ""
    if resolved:
        areas = [bars[AREA.name] for bars in resolved]
        row["area_bar_percent"] = 100 * np.median([area.bar for area in areas])
        row["area_error_percent"] = 100 * np.median([area.error for area in areas])
    return row


def _judged(draw: Draw, random: np.random.Generator) -> Iterator[Judgement]:
    """Draw a surface and its loads, and yield the judgement of each contact with any area."""
    sample = draw(random)
    coarse = sample.surface(sample.nodes)
    fine = sample.surface(sample.exact)
    steps = [np.diff(coarse, axis=axis).std() for axis in (0, 1)]
    slope = math.hypot(*steps) * sample.nodes
    for _ in range(LOADS):
        load = _drawn_load(random, slope)
        solve = partial(
            bem.solve, side=1.0, boundary=sample.boundary, hardness=load.hardness
        )
        try:
            contact = solve(coarse, pressure=load.pressure)
            if load.by_displacement:
                contact = solve(coarse, delta=contact.delta)
                exact = solve(fine, delta=contact.delta)
            else:
                exact = solve(fine, force=contact.force)
        except bem.NoSolution:  # a displacement beyond full contact
            continue
        if contact.contact_nodes:
            yield _compared(contact, exact)


@dataclass(frozen=True)
class _Load:
    """A load, for E* = 1 MPa."""

    pressure: float  # mean pressure [MPa]
    hardness: float | None  # [MPa]; None for elastic bodies
    # Whether the exact grid is given the displacement of the judged contact, or else its force.
    by_displacement: bool


def _drawn_load(random: np.random.Generator, slope: float) -> _Load:
    """Draw a load on a surface with an rms slope [1]."""
    exponent = random.uniform(math.log(0.005), math.log(0.5))
    pressure = slope * math.exp(exponent)
    hardness = None
    if random.random() >= 2 / 3:
        hardness = pressure * random.uniform(1.5, 20)
    return _Load(pressure, hardness, by_displacement=random.random() < 0.5)


def _compared(contact: bem.Contact, exact: bem.Contact) -> Judgement:
    """Compare a contact and its bars with the contact on the exact grid."""
    estimate = contact.grid_error()
    patch = contact.pressure.size * math.prod(contact.problem.spacing)
    exact_area = area_within(exact, contact.problem.spacing)
    # Values on the judged grid and on the exact one, by the name of the answer.
    values = {
        AREA.name: (contact.continuum_area_percent, 100 * exact_area / patch),
        MEAN_GAP.name: (contact.mean_gap, exact.mean_gap),
        UNLOADING.name: (contact.stiffness, exact.stiffness),
    }
    if contact.problem.force is None:
        values[FORCE.name] = (contact.force, exact.force)
    else:
        values[DELTA.name] = (contact.delta, exact.delta)
    bars: dict[str, Bar] = {}
    for name, (value, truth) in values.items():
        if value and math.isfinite(value) and math.isfinite(truth):
            bars[name] = Bar(
                error=abs(value - truth) / abs(value),
                bar=getattr(estimate, name) / abs(value) + SOLVER_ERROR,
            )
    return Judgement(estimate.resolved, bars)


def _finer(nodes: int, nodes_a_wave: float) -> int:
    """Return how much finer the exact grid is than one of `nodes` a side: a power of two.

    It is at least 4, more if the shortest wave then has fewer than `ENOUGH` nodes, and less if the
    grid would have more than `FINEST` nodes a side, but at least 2.
    """
    finer = 4
    while nodes_a_wave * finer < ENOUGH:
        finer *= 2
    while finer > 2 and finer * nodes > FINEST:
        finer //= 2
    return finer


def _grid(random: np.random.Generator, *nodes: int) -> tuple[int, int]:
    """Draw one of the given nodes a side, and waves a side of a shortest one of 3 to 32 nodes.

    There are at least 3 waves a side.
    """
    chosen = int(random.choice(nodes))
    exponent = random.uniform(math.log(3.0), math.log(32))
    nodes_a_wave = math.exp(exponent)
    return chosen, max(int(chosen / nodes_a_wave), 3)


def _waves(random: np.random.Generator, aspect: float = 1.0) -> Sample:
    """Draw waves with a shortest one, on a periodic patch; `aspect` times as long along y."""
    nodes, shortest = _grid(random, 64, 96, 128, 129)
    hurst = random.uniform(0.2, 0.9)
    longest = int(random.choice([1, 2]))
    surface = random_waves(longest, shortest, hurst, random, aspect)
    return Sample(
        boundary="periodic",
        surface=lambda n: surface(np.arange(n) / n),
        nodes=nodes,
        finer=_finer(nodes, nodes / shortest),
    )


def _window(random: np.random.Generator) -> Sample:
    """Draw a free patch that is cut out of a larger surface, nine tenths of its period."""
    nodes, shortest = _grid(random, 64, 65, 97, 129)
    surface = random_waves(1, shortest, random.uniform(0.2, 0.9), random)
    return Sample(
        boundary="free",
        surface=lambda n: surface(np.linspace(0.01, 0.91, n)),
        nodes=nodes,
        finer=_finer(nodes, nodes / shortest / 0.9),
    )


def _mirrored(random: np.random.Generator) -> Sample:
    """Draw a patch that its mirror images continue."""
    nodes, shortest = _grid(random, 64, 97, 128)
    surface = random_waves(2, 2 * shortest, random.uniform(0.2, 0.9), random)

    def even(n: int) -> Heights:
        """Return the heights of n nodes a side."""
        # The sum of the surface and its mirror images is even along both axes.
        places = (np.arange(n) + 0.5) / (2 * n)
        heights = surface(np.concatenate([places, -places]))
        quarters = heights.reshape(2, n, 2, n)
        return np.asarray(quarters.sum(axis=(0, 2)) / 2)

    return Sample("mirror", even, nodes, finer=_finer(nodes, nodes / shortest))


def _sphere(random: np.random.Generator) -> Sample:
    """Draw a paraboloid with its tip near the middle."""
    nodes = int(random.choice([33, 64, 65, 129]))
    radius = random.uniform(2, 6)
    tip = random.uniform(0.4, 0.6, 2)

    def heights(n: int) -> Heights:
        """Return the heights of n nodes a side."""
        x = np.linspace(0, 1, n) - tip[0]
        y = np.linspace(0, 1, n) - tip[1]
        squares = np.add.outer(x**2, y**2)
        return np.asarray(-squares / (2 * radius))

    return Sample("free", heights, nodes, finer=4)


def _regular(random: np.random.Generator, *, crossed: bool) -> Sample:
    """Draw one wave at an angle or, if `crossed`, two waves."""
    nodes = int(random.choice([32, 48, 64, 65]))
    along = int(random.integers(1, 6))
    across = int(random.integers(0, 6))
    phases = random.uniform(0, 2 * np.pi, 2)

    def heights(n: int) -> Heights:
        """Return the heights of n nodes a side."""
        angles = 2 * np.pi * np.arange(n) / n
        phase = np.add.outer(along * angles, across * angles)
        wave = np.cos(phase + phases[0])
        if crossed:
            phase = np.add.outer(-across * angles, along * angles)
            wave = wave + np.cos(phase + phases[1])
        return np.asarray(0.01 * wave)

    finer = _finer(nodes, nodes / math.hypot(along, across))
    return Sample("periodic", heights, nodes, finer)


def _turned(random: np.random.Generator) -> Sample:
    """Draw grooves of a round tool on gentle waves, with sharp ridges between the grooves."""
    nodes = int(random.choice([64, 96, 128]))
    grooves = int(random.choice([2, 3, 4, 6]))
    waves = random_waves(1, 4, 0.8, random)
    share = random.uniform(0, 0.3)

    def heights(n: int) -> Heights:
        """Return the heights of n nodes a side."""
        places = np.arange(n) / n
        from_middle = (places * grooves + 0.37) % 1 - 0.5
        groove = 0.2 / grooves * from_middle**2
        return np.asarray(groove[:, None] + share * waves(places))

    return Sample("periodic", heights, nodes, finer=8)


def _fractal(random: np.random.Generator) -> Sample:
    """Draw waves down to half of the spacing, which no grid here resolves."""
    nodes = int(random.choice([64, 128]))
    surface = random_waves(1, 2 * nodes, random.uniform(0.2, 0.95), random)
    return Sample("periodic", lambda n: surface(np.arange(n) / n), nodes, finer=4)


def _paper(random: np.random.Generator) -> Sample:
    """Draw a surface of the paper's generator, and judge the grid of its every fourth node."""
    exponent = int(random.choice([6, 7]))
    nodes = 2 ** (exponent + 2) + 1
    finest = generate("diamond-square", nodes, random.uniform(0.3, 0.9), 0.01, random)

    def heights(n: int) -> Heights:
        """Return the heights of n nodes a side."""
        step = (len(finest) - 1) // (n - 1)
        return finest[::step, ::step]

    return Sample("free", heights, 2**exponent + 1, finer=4)


def _made_map(random: np.random.Generator) -> Sample:
    """Draw a map of a machined surface, whose shortest wave has 4 nodes, and read a spline of it.

    The map is judged on its own nodes, or on twice as many.
    """
    nodes = 97
    between = int(random.integers(1, 3))
    kind = random.choice(sorted(MACHINED))
    number = int(random.integers(1000))
    rms = random.uniform(0.3, 2.0)
    length = random.uniform(15, 40)
    surface = made_surface(MadeMap(kind, number, (nodes, nodes), rms, length))
    places = np.linspace(0, 1, nodes)
    spline = RectBivariateSpline(places, places, surface / (nodes - 1))

    def heights(n: int) -> Heights:
        """Return the heights of n nodes a side."""
        along = np.linspace(0, 1, n)
        return np.asarray(spline(along, along))

    judged_nodes = (nodes - 1) * between + 1
    return Sample("free", heights, judged_nodes, finer=4)


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
"""Functions that draw the samples of each kind."""
