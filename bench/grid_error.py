"""The share of true errors inside the bars of `Contact.grid_error`, on surfaces of eleven kinds.

True values are computed on a finer grid of the surface, the exact grid. It is at least four times
as fine, and finer until the shortest wave has 32 nodes, but has at most 1040 nodes a side. It is
exactly four times as fine for the fractal kind, the paper's generator, spheres and machined maps,
and eight times for turned surfaces. Loads are forces or displacements. A third of the loads is on
bodies that yield.
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
"""Names of the quantities that a contact answers with bars."""

LOADS = 2
"""Number of loads on every surface."""

ENOUGH = 32
"""Fewest nodes in the shortest wave of an exact grid, unless these take more than `FINEST`."""

FINEST = 1040
"""Most nodes a side of an exact grid, unless the grid is only twice as fine as the judged one."""

FEWEST_NODES_A_WAVE = 3.0
"""Fewest nodes in the shortest wave of a judged grid."""

MOST_NODES_A_WAVE = 32
"""Most nodes in the shortest wave of a judged grid, before the number of waves is rounded down."""

FEWEST_WAVES = 3
"""Fewest periods of the shortest wave on a side."""

SOLVER_ERROR = 1e-6
"""Share of a value by which a bar is widened, for the tolerances of both solves [1]."""


@dataclass(frozen=True)
class Sample:
    """A surface on a patch with sides of 1, the grid that is judged, and the exact grid."""

    boundary: Boundary
    # Takes the nodes a side, n; returns the heights, (n, n) [side of the patch].
    surface: Callable[[int], Heights]
    nodes: int  # nodes a side of the grid that is judged
    finer: int  # spacing of the judged grid over that of the exact grid

    @property
    def exact(self) -> int:
        """Nodes a side of the exact grid.

        On free and periodic patches the exact grid contains all nodes of the judged grid.
        """
        # The nodes of a free patch include both borders.
        edge = 1 if self.boundary == "free" else 0
        return (self.nodes - edge) * self.finer + edge


Draw = Callable[[np.random.Generator], Sample]
"""A function that draws a sample of its kind; it moves the state of the random generator."""


@dataclass(frozen=True)
class Bar:
    """The true error of one answer, and the bar that should contain it."""

    error: float  # size of the error over that of the answer [1]
    bar: float  # bar over the size of the answer [1]

    @property
    def holds(self) -> bool:
        """Whether the error is inside the bar."""
        return self.error <= self.bar


@dataclass(frozen=True)
class Judgement:
    """The bars of one contact, with the true errors."""

    resolved: bool  # whether the contact says that the bar of its area holds
    # Bars by the name of the answer, without answers that are zero or infinite, and without those
    # of which the contact says that their bars do not hold.
    bars: dict[str, Bar]


def grid_error(surfaces: int) -> list[Row]:
    """Judge the bars of contacts on surfaces of every kind, and print the progress.

    Parameters
    ----------
    surfaces : int
        Number of surfaces of each kind.

    Returns
    -------
    list of Row
        A row for each kind and one for all kinds. The columns are the kind and those of `_summary`.
    """
    rows: list[Row] = []
    of_all_kinds: list[Judgement] = []
    for number, (kind, draw) in enumerate(KINDS.items()):
        judgements: list[Judgement] = []
        for seed in range(surfaces):
            random = np.random.default_rng((number, seed))
            judgements.extend(_judged(draw, random))
        rows.append({"kind": kind, **_summary(judgements)})
        of_all_kinds += judgements
        remark(f"{kind}: {len(judgements)} contacts")
    rows.append({"kind": "all", **_summary(of_all_kinds)})
    return rows


def _summary(judgements: list[Judgement]) -> Row:
    """Return the columns of a row about some contacts.

    The columns are the number of contacts, and the share of contacts that call their grid resolved
    [%]. The further columns are about resolved contacts alone: for each answer the share of errors
    inside their bars [%], and the median bar and median error of the area [% of the area]. A column
    is "" if there are no contacts for it.
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
    """Draw a surface and `LOADS` loads, and yield a judgement for each load.

    Loads without a solution or without contact are left out. The state of `random` moves.
    """
    sample = draw(random)
    coarse = sample.surface(sample.nodes)  # heights on the judged grid
    fine = sample.surface(sample.exact)  # heights on the exact grid
    # The spacing is about 1 / nodes, as the patch has a side of 1.
    steps = [np.diff(coarse, axis=axis).std() for axis in (0, 1)]
    rms_slope = math.hypot(*steps) * sample.nodes
    for _ in range(LOADS):
        load = _draw_load(random, rms_slope)
        solve = partial(
            bem.solve, side=1.0, boundary=sample.boundary, hardness=load.hardness
        )
        try:
            contact = solve(coarse, pressure=load.pressure)
            if load.by_displacement:
                # Solved again by its displacement, so that the force is an answer.
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

    pressure: float  # mean pressure of a first solve of the judged grid [MPa]
    hardness: float | None  # [MPa]; None for elastic bodies
    # Whether both grids are pressed by the displacement of the first solve. If not, the exact grid
    # is pressed by its force.
    by_displacement: bool


def _draw_load(random: np.random.Generator, rms_slope: float) -> _Load:
    """Draw a load on a surface with an rms slope [1].

    The mean pressure is log-uniform from 0.005 to 0.5 E* times the rms slope. One load in three is
    on bodies that yield, at 1.5 to 20 times the mean pressure.
    """
    log_share = random.uniform(math.log(0.005), math.log(0.5))
    pressure = rms_slope * math.exp(log_share)
    hardness = None
    if random.random() >= 2 / 3:
        hardness = pressure * random.uniform(1.5, 20)
    by_displacement = random.random() < 0.5
    return _Load(pressure=pressure, hardness=hardness, by_displacement=by_displacement)


def _compared(contact: bem.Contact, exact: bem.Contact) -> Judgement:
    """Compare a contact and its bars with the contact on the exact grid.

    Answers that are zero or infinite are left out.
    """
    estimate = contact.grid_error()
    patch_area = contact.pressure.size * math.prod(contact.problem.spacing)
    # Border cells of a free patch reach half a spacing beyond its nodes. Those of the exact grid
    # are extended to those of the judged grid, so that both areas are shares of one patch.
    exact_area = area_within(exact, contact.problem.spacing)
    # Values on the judged grid and on the exact grid, by the name of the answer.
    values = {
        AREA.name: (contact.continuum_area_percent, 100 * exact_area / patch_area),
        MEAN_GAP.name: (contact.mean_gap, exact.mean_gap),
        UNLOADING.name: (contact.stiffness, exact.stiffness),
    }
    # Of force and displacement, the one that is not given is an answer.
    if contact.problem.force is None:
        values[FORCE.name] = (contact.force, exact.force)
    else:
        values[DELTA.name] = (contact.delta, exact.delta)
    bars: dict[str, Bar] = {}
    for name, (value, truth) in values.items():
        holds = estimate.verdicts[name.removesuffix("_percent")]
        if holds and value and math.isfinite(value) and math.isfinite(truth):
            bars[name] = Bar(
                error=abs(value - truth) / abs(value),
                bar=getattr(estimate, name) / abs(value) + SOLVER_ERROR,
            )
    return Judgement(resolved=estimate.verdicts["area"], bars=bars)


def _finer(nodes: int, nodes_a_wave: float) -> int:
    """Return the spacing of a judged grid over that of its exact grid, a power of two.

    The judged grid has `nodes` nodes a side, and `nodes_a_wave` in the shortest wave. The result is
    4, or more if the shortest wave of the exact grid would have fewer than `ENOUGH` nodes. It is
    less, but at least 2, if the exact grid would have more than `FINEST` nodes a side.
    """
    finer = 4
    while nodes_a_wave * finer < ENOUGH:
        finer *= 2
    while finer > 2 and finer * nodes > FINEST:
        finer //= 2
    return finer


@dataclass(frozen=True)
class _Grid:
    """A judged grid, and the shortest wave on it."""

    nodes: int  # nodes a side
    shortest_waves: int  # number of periods of the shortest wave on a side

    @property
    def nodes_a_wave(self) -> float:
        """Number of nodes in the shortest wave."""
        return self.nodes / self.shortest_waves


def _draw_grid(random: np.random.Generator, *nodes: int) -> _Grid:
    """Draw the nodes a side from `nodes`, and the number of the shortest waves that fit on a side.

    The shortest wave has a log-uniform number of nodes, from `FEWEST_NODES_A_WAVE` to
    `MOST_NODES_A_WAVE`. It has fewer if fewer than `FEWEST_WAVES` would fit.
    """
    chosen = int(random.choice(nodes))
    log_nodes = random.uniform(math.log(FEWEST_NODES_A_WAVE), math.log(MOST_NODES_A_WAVE))
    nodes_a_wave = math.exp(log_nodes)
    waves = max(int(chosen / nodes_a_wave), FEWEST_WAVES)
    return _Grid(nodes=chosen, shortest_waves=waves)


def _waves(random: np.random.Generator, aspect: float = 1.0) -> Sample:
    """Draw self-affine waves on a periodic square patch.

    A wave along y is `aspect` times as long as the wave of the same amplitude along x.
    """
    grid = _draw_grid(random, 64, 96, 128, 129)  # one of these numbers of nodes a side
    hurst = random.uniform(0.2, 0.9)
    longest = int(random.choice([1, 2]))
    surface = random_waves(longest, grid.shortest_waves, hurst, random, aspect)
    return Sample(
        boundary="periodic",
        surface=lambda n: surface(np.arange(n) / n),
        nodes=grid.nodes,
        finer=_finer(grid.nodes, grid.nodes_a_wave),
    )


def _window(random: np.random.Generator) -> Sample:
    """Draw a free patch, cut out of periodic waves; its side is nine tenths of the period."""
    grid = _draw_grid(random, 64, 65, 97, 129)
    hurst = random.uniform(0.2, 0.9)
    surface = random_waves(1, grid.shortest_waves, hurst, random)
    return Sample(
        boundary="free",
        surface=lambda n: surface(np.linspace(0.01, 0.91, n)),
        nodes=grid.nodes,
        finer=_finer(grid.nodes, grid.nodes_a_wave / 0.9),
    )


def _mirrored(random: np.random.Generator) -> Sample:
    """Draw self-affine waves on a patch that is continued by its mirror images."""
    grid = _draw_grid(random, 64, 97, 128)
    hurst = random.uniform(0.2, 0.9)
    # The patch is half a period of these waves.
    surface = random_waves(2, 2 * grid.shortest_waves, hurst, random)

    def even(n: int) -> Heights:
        """Return the heights of n nodes a side."""
        # The sum of the surface and its mirror images is even along both axes.
        places = (np.arange(n) + 0.5) / (2 * n)
        heights = surface(np.concatenate([places, -places]))
        quarters = heights.reshape(2, n, 2, n)
        return np.asarray(quarters.sum(axis=(0, 2)) / 2)

    return Sample(
        boundary="mirror",
        surface=even,
        nodes=grid.nodes,
        finer=_finer(grid.nodes, grid.nodes_a_wave),
    )


def _sphere(random: np.random.Generator) -> Sample:
    """Draw a paraboloid on a free patch, with its tip near the middle."""
    nodes = int(random.choice([33, 64, 65, 129]))
    radius = random.uniform(2, 6)  # radius of curvature at the tip [side of the patch]
    tip = random.uniform(0.4, 0.6, 2)

    def heights(n: int) -> Heights:
        """Return the heights of n nodes a side."""
        x = np.linspace(0, 1, n) - tip[0]
        y = np.linspace(0, 1, n) - tip[1]
        squares = np.add.outer(x**2, y**2)
        return np.asarray(-squares / (2 * radius))

    return Sample(boundary="free", surface=heights, nodes=nodes, finer=4)


def _regular(random: np.random.Generator, *, crossed: bool) -> Sample:
    """Draw one wave at an angle on a periodic patch, or two at a right angle if `crossed`."""
    nodes = int(random.choice([32, 48, 64, 65]))
    along = int(random.integers(1, 6))  # periods of the first wave along x
    across = int(random.integers(0, 6))  # and along y
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
    return Sample(boundary="periodic", surface=heights, nodes=nodes, finer=finer)


def _turned(random: np.random.Generator) -> Sample:
    """Draw a turned surface on a periodic patch: grooves along y on gentle waves.

    The grooves are parabolas as a round tool leaves them, with sharp ridges between them. The exact
    grid is 8 times as fine as the judged one, because of these ridges.
    """
    nodes = int(random.choice([64, 96, 128]))
    grooves = int(random.choice([2, 3, 4, 6]))
    waves = random_waves(longest=1, shortest=4, hurst=0.8, random=random)
    amplitude = random.uniform(0, 0.3)  # factor of the waves [1]

    def heights(n: int) -> Heights:
        """Return the heights of n nodes a side."""
        places = np.arange(n) / n
        # Distance from the middle of a groove [width of a groove]. The phase of 0.37 is arbitrary:
        # no ridge is at the border.
        from_middle = (places * grooves + 0.37) % 1 - 0.5
        groove = 0.2 / grooves * from_middle**2  # profile along x [side of the patch]
        return np.asarray(groove[:, None] + amplitude * waves(places))

    return Sample(boundary="periodic", surface=heights, nodes=nodes, finer=8)


def _fractal(random: np.random.Generator) -> Sample:
    """Draw self-affine waves on a periodic patch that the judged grid cannot resolve.

    The shortest wave is as long as half a spacing of this grid.
    """
    nodes = int(random.choice([64, 128]))
    hurst = random.uniform(0.2, 0.95)
    surface = random_waves(1, 2 * nodes, hurst, random)
    return Sample(
        boundary="periodic",
        surface=lambda n: surface(np.arange(n) / n),
        nodes=nodes,
        finer=4,
    )


def _paper(random: np.random.Generator) -> Sample:
    """Draw a surface of the paper's generator on a free patch.

    The judged grid has every fourth node along each axis of the exact grid.
    """
    exponent = int(random.choice([6, 7]))
    nodes = 2 ** (exponent + 2) + 1  # nodes a side of the exact grid
    hurst = random.uniform(0.3, 0.9)
    finest = generate("diamond-square", nodes, hurst, sigma0=0.01, random=random)

    def heights(n: int) -> Heights:
        """Return the heights of n nodes a side, which are nodes of the exact grid."""
        step = (len(finest) - 1) // (n - 1)
        return finest[::step, ::step]

    judged_nodes = 2**exponent + 1
    return Sample(boundary="free", surface=heights, nodes=judged_nodes, finer=4)


def _made_map(random: np.random.Generator) -> Sample:
    """Draw a map of a machined surface on a free patch, continued between its nodes by a spline.

    The shortest wave has 4 nodes of the map. The judged grid has the spacing of the map, or half of
    it.
    """
    nodes = 97  # nodes a side of the map
    steps = int(random.integers(1, 3))  # steps of the judged grid in a spacing of the map
    kind = random.choice(sorted(MACHINED))
    number = int(random.integers(1000))
    rms = random.uniform(0.3, 2.0)  # rms height [um]
    length = random.uniform(15, 40)  # length of the roughness [um]
    description = MadeMap(
        kind=kind, number=number, shape=(nodes, nodes), rms=rms, length=length
    )
    surface = made_surface(description)  # [um], with nodes 1 um apart
    places = np.linspace(0, 1, nodes)
    # The map is nodes - 1 um long: this makes its heights multiples of its side.
    spline = RectBivariateSpline(places, places, surface / (nodes - 1))

    def heights(n: int) -> Heights:
        """Return the heights of n nodes a side."""
        along = np.linspace(0, 1, n)
        return np.asarray(spline(along, along))

    judged_nodes = (nodes - 1) * steps + 1
    return Sample(boundary="free", surface=heights, nodes=judged_nodes, finer=4)


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
"""Function that draws a sample of each kind, by the name of the kind in the table."""
