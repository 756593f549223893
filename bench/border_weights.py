"""The weights of `bem.derived.border`, fitted again by least squares over regular waves.

A single wave has Westergaard's closed form; two crossed waves have the area of a finer grid, of 128
nodes a wave. Both come at all angles to the grid, with 3 to 64 nodes a wave and from light to
nearly full contact. The weighted sum of the terms of a contact's edges has to equal the excess of
its count of nodes over the area in the continuum. The weights fulfil this in the sense of least
squares over all waves, with a variance in proportion to the number of edges.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

import bem
from bem.derived.border import WEIGHTS, border_edges
from bench.files import Row
from bench.report import Report, remark
from gen.arrays import Heights, Values

# Seed of the random waves to which the weights of the product are fitted.
SEED = 11

# Amplitude of a single wave [side of the patch]. Each of two crossed waves has half of it.
AMPLITUDE = 0.01

# Nodes a wave of the grid that gives the area of crossed waves in the continuum.
FINE_NODES = 128

# Phases of the waves on that grid [rad]: any values that place the crests between nodes.
FINE_PHASES = np.array([0.3, 0.7])

# Bounds of the number of nodes a side; on oblong cells, of its geometric mean over both sides.
FEWEST_NODES = 12
MOST_NODES = 260

# Names of the terms, which are the columns of `WEIGHTS`.
TERMS = ("one", "f", "pressure ratio", "gap ratio")

# Share of the waves that are along an axis or the diagonal, directions that random angles rarely
# have [1].
ON_THE_GRID = 0.2

# Number of waves between two remarks on the progress.
PROGRESS = 500


@dataclass(frozen=True, eq=False)
class Wave:
    """One wave on a square patch without edges, or two that cross at a right angle, under a load.

    Attributes
    ----------
    periods : tuple of int
        Periods of the first wave along the first and the second side of the patch.
    phases : ndarray, shape (2,)
        Phases of both waves [rad].
    crossed : bool
        Whether there is a second wave.
    load : float
        Mean pressure over that at which a single wave of `AMPLITUDE` is in full contact [1].
    shape : tuple of int
        Nodes (nx, ny) of the grid.
    """

    periods: tuple[int, int]
    phases: Values
    crossed: bool
    load: float
    shape: tuple[int, int]

    @property
    def heights(self) -> Heights:
        """Heights at the nodes, (nx, ny) [side of the patch]."""
        x, y = (2 * np.pi * np.arange(nodes) / nodes for nodes in self.shape)
        along, across = self.periods
        first = np.cos(np.add.outer(along * x, across * y) + self.phases[0])
        if not self.crossed:
            return np.asarray(AMPLITUDE * first)
        second = np.cos(np.add.outer(-across * x, along * y) + self.phases[1])
        return np.asarray(AMPLITUDE / 2 * (first + second))

    def pressed(self) -> bem.Contact:
        """Solve the contact, with lengths in sides of the patch and E* = 1.

        Returns
        -------
        bem.Contact
            The contact.
        """
        full = np.pi * AMPLITUDE * np.hypot(*self.periods)
        return bem.solve(
            self.heights,
            (1.0, 1.0),
            pressure=self.load * full,
            boundary="periodic",
            threads=1,
        )

    def exact_area_percent(self) -> float:
        """Return the area of contact in the continuum [%].

        Returns
        -------
        float
            Westergaard's area of a single wave. That of crossed waves depends on the load alone,
            and comes from one period along the axes of a fine grid.
        """
        if not self.crossed:
            return float(200 / np.pi * np.arcsin(np.sqrt(self.load)))
        period = replace(
            self, periods=(1, 0), phases=FINE_PHASES, shape=(FINE_NODES, FINE_NODES)
        )
        return period.pressed().continuum_area_percent


@dataclass(frozen=True, eq=False)
class Sample:
    """The equation that one contact adds to the least squares, and its area.

    Attributes
    ----------
    sums : ndarray, shape (12,)
        Sums of the edges' terms, in the order of `WEIGHTS` [1].
    excess : float
        Nodes in contact less the area in the continuum [cells].
    exact : float
        Area in the continuum [cells].
    crossed : bool
        Whether it is that of crossed waves.
    """

    sums: Values
    excess: float
    exact: float
    crossed: bool

    @property
    def edges(self) -> float:
        """Number of edges between contact and gap."""
        return float(self.sums.reshape(WEIGHTS.shape)[:, 0].sum())

    def error_percent(self, weights: Values) -> float:
        """Return the error of the area that weights give.

        Parameters
        ----------
        weights : ndarray, shape (12,)
            Weights in the order of `WEIGHTS` [spacing].

        Returns
        -------
        float
            Error [% of the area].
        """
        return 100 * float(self.excess - self.sums @ weights) / self.exact


def border_weights(waves: int, aspect: float) -> Report:
    """Fit the weights of the border to regular waves, and measure the errors of areas by them.

    Parameters
    ----------
    waves : int
        Number of contacts, at least as many as there are weights.
    aspect : float
        Second side of a cell over its first [1].

    Returns
    -------
    Report
        A table of the fitted weights beside the product's, and a table of the errors of the areas.
    """
    random = np.random.default_rng(SEED)
    samples = list(_samples(waves, aspect, random))
    fitted, deviations = _fit(samples)
    product = WEIGHTS.ravel()
    weights = []
    for place, (aligned, column) in enumerate(np.ndindex(WEIGHTS.shape)):
        row: Row = {
            "aligned_edges": aligned,
            "term": TERMS[column],
            "product": product[place],
            "fitted": fitted[place],
            "deviation": deviations[place],
            "difference_percent": 100 * (fitted[place] / product[place] - 1),
        }
        weights.append(row)
    areas = [
        _errors("single waves", [item for item in samples if not item.crossed], fitted),
        _errors("crossed waves", [item for item in samples if item.crossed], fitted),
    ]
    return Report({"border-weights": weights, "border-areas": areas})


def _samples(waves: int, aspect: float, random: np.random.Generator) -> Iterator[Sample]:
    """Yield a sample for each of a number of waves, without contacts that have no border."""
    done = 0
    while done < waves:
        wave = _draw_wave(aspect, random)
        if wave is None:
            continue
        contact = wave.pressed()
        exact_percent = wave.exact_area_percent()
        if not 0 < contact.area_percent < 100 or not 0 < exact_percent < 100:
            continue
        yield _sample(contact, exact_percent, crossed=wave.crossed)
        done += 1
        if done % PROGRESS == 0:
            remark(f"{done} of {waves} waves")


def _draw_wave(aspect: float, random: np.random.Generator) -> Wave | None:
    """Draw a wave on a grid with cells of about this aspect, None if it has too many nodes or few.

    A change in the order of the draws changes the fitted weights by their standard deviations.
    """
    crossed = bool(random.random() < 0.5)
    size = random.uniform(2, 12)  # periods a side
    angle = random.uniform(0, np.pi / 2)
    if random.random() < ON_THE_GRID:
        angle = np.pi / 4 * random.integers(3)
    periods = round(size * np.cos(angle)), round(size * np.sin(angle))
    nodes_a_wave = np.exp(random.uniform(np.log(3), np.log(64)))
    shape = _shape(round(np.hypot(*periods) * nodes_a_wave), aspect)
    if not FEWEST_NODES <= math.sqrt(shape[0] * shape[1]) <= MOST_NODES:
        return None
    load = float(np.exp(random.uniform(np.log(0.003), np.log(0.85))))
    if not crossed:  # the area of single waves rises with the root of the load
        load = random.uniform(0.02, 0.85)
    phases = random.uniform(0, 2 * np.pi, 2)
    return Wave(periods, phases, crossed, load, shape)


def _shape(nodes: int, aspect: float) -> tuple[int, int]:
    """Return the nodes (nx, ny) of a square patch with `nodes` along its coarser axis."""
    return round(nodes * max(aspect, 1.0)), round(nodes * max(1 / aspect, 1.0))


def _sample(contact: bem.Contact, exact_percent: float, *, crossed: bool) -> Sample:
    """Return the equation of a contact of which the area in the continuum is known [%]."""
    sums = np.zeros_like(WEIGHTS)
    for edges in border_edges(contact.problem, contact.pressure, contact.gap, None):
        np.add.at(sums, edges.aligned, edges.terms)
    exact = exact_percent / 100 * contact.pressure.size
    return Sample(sums.ravel(), contact.contact_nodes - exact, exact, crossed)


def _fit(samples: list[Sample]) -> tuple[Values, Values]:
    """Return the weights by least squares and their standard deviations, (12,) each [spacing]."""
    roots = np.sqrt([sample.edges for sample in samples])
    matrix = np.array([sample.sums for sample in samples]) / roots[:, None]
    excesses = np.array([sample.excess for sample in samples]) / roots
    weights, *_ = np.linalg.lstsq(matrix, excesses, rcond=None)
    freedom = max(len(samples) - weights.size, 1)
    variance = float(np.sum((excesses - matrix @ weights) ** 2)) / freedom
    covariance = variance * np.linalg.pinv(matrix.T @ matrix)
    return np.asarray(weights, np.float64), np.sqrt(np.diag(covariance))


def _errors(kind: str, samples: list[Sample], fitted: Values) -> Row:
    """Return root mean squares of the errors of areas, by counting and by both sets of weights."""
    row: Row = {"kind": kind, "contacts": len(samples)}
    ways = {"count": np.zeros(WEIGHTS.size), "product": WEIGHTS.ravel(), "fitted": fitted}
    for name, weights in ways.items():
        errors = [sample.error_percent(weights) for sample in samples]
        row[f"{name}_error_percent"] = float(np.sqrt(np.mean(np.square(errors))))
    return row
