"""The weights of `bem.derived.border`, fitted again by least squares over regular waves.

The exact area of a single wave is Westergaard's closed form; that of two crossed waves comes from a
finer grid, with 128 nodes a wave. Waves have any angle to the grid, and 3 to 64 nodes a wave; the
contact is from light to nearly full. Each edge between contact and gap has some terms. Their
weighted sum over all edges has to equal the number of nodes in contact less the exact area. The
weights fulfil this by least squares over all waves. The variance of the errors is assumed to be
proportional to the number of edges.
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

# Amplitude of a single wave [first side of the patch]. Each of two crossed waves has half of it.
AMPLITUDE = 0.01

# Nodes a wave of the grid on which the exact area of crossed waves is computed.
FINE_NODES = 128

# Phases of the waves on the fine grid [rad]: any values for which the crests are between nodes.
FINE_PHASES = np.array([0.3, 0.7])

# Smallest and largest number of nodes a side. On oblong cells the geometric mean of both sides is
# bounded.
FEWEST_NODES = 12
MOST_NODES = 260

# Names of the terms of an edge; each has a column of `WEIGHTS`.
TERMS = ("one", "f", "pressure ratio", "gap ratio")

# Share of the waves that are set along an axis or the diagonal [1]. Random angles rarely are there.
ON_THE_GRID = 0.2

# Number of waves between two remarks on the progress.
PROGRESS = 500


@dataclass(frozen=True, eq=False)
class Wave:
    """One wave, or two that cross at a right angle, on a periodic patch under a load.

    Attributes
    ----------
    periods : tuple of int
        Number of periods of the first wave along x and y.
    phases : ndarray, shape (2,)
        Phases of both waves [rad]; the second is not used if there is one wave.
    crossed : bool
        Whether there is a second wave.
    load : float
        Mean pressure over that of full contact of a single wave with `AMPLITUDE` [1].
    shape : tuple of int
        Nodes (nx, ny) of the grid.
    length : float
        Second side of the patch over its first; waves that cross need a square patch, 1.
    """

    periods: tuple[int, int]
    phases: Values
    crossed: bool
    load: float
    shape: tuple[int, int]
    length: float = 1.0

    @property
    def heights(self) -> Heights:
        """Heights at the nodes, (nx, ny) [first side of the patch]."""
        x, y = (2 * np.pi * np.arange(nodes) / nodes for nodes in self.shape)
        along, across = self.periods
        first = np.cos(np.add.outer(along * x, across * y) + self.phases[0])
        if not self.crossed:
            return np.asarray(AMPLITUDE * first)
        second = np.cos(np.add.outer(-across * x, along * y) + self.phases[1])
        return np.asarray(AMPLITUDE / 2 * (first + second))

    def pressed(self) -> bem.Contact:
        """Solve the contact, with lengths in first sides of the patch and E* = 1.

        Returns
        -------
        bem.Contact
            The contact.
        """
        along, across = self.periods
        full_contact = np.pi * AMPLITUDE * np.hypot(along, across / self.length)
        return bem.solve(
            self.heights,
            (1.0, self.length),
            pressure=self.load * full_contact,
            boundary="periodic",
            threads=1,
        )

    def exact_area_percent(self) -> float:
        """Return the area of contact in the continuum.

        The area of a single wave is Westergaard's. The area of crossed waves depends on the load
        alone; one period of waves along the axes of a fine grid is solved for it.

        Returns
        -------
        float
            Area [% of the patch].
        """
        if not self.crossed:
            return float(200 / np.pi * np.arcsin(np.sqrt(self.load)))
        period = replace(
            self, periods=(1, 0), phases=FINE_PHASES, shape=(FINE_NODES, FINE_NODES)
        )
        return period.pressed().continuum_area_percent


@dataclass(frozen=True, eq=False)
class Sample:
    """The equation of one contact in the least squares, and the area of the contact.

    Attributes
    ----------
    sums : ndarray, shape (12,)
        Sum over all edges of the factor of each weight, in the order of `WEIGHTS.ravel()` [1].
    excess : float
        Number of nodes in contact less the area in the continuum [cells].
    exact : float
        Area in the continuum [cells].
    edges : int
        Number of edges between contact and gap.
    crossed : bool
        Whether the contact is that of crossed waves.
    """

    sums: Values
    excess: float
    exact: float
    edges: int
    crossed: bool

    def error_percent(self, weights: Values) -> float:
        """Return the error of the area that results from some weights.

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


def border_weights(waves: int, aspect: float, length: float) -> Report:
    """Fit the weights of the border to regular waves, and measure the errors of areas with them.

    Prints the progress on standard error.

    Parameters
    ----------
    waves : int
        Number of contacts, at least as many as there are weights.
    aspect : float
        Second side of a cell over its first [1].
    length : float
        Second side of the patch over its first [1]. On patches that are not square, all waves are
        single ones.

    Returns
    -------
    Report
        Table `border-weights` with the fitted weights beside those of the product, and table
        `border-areas` with the errors of the areas.
    """
    random = np.random.default_rng(SEED)
    samples = list(_samples(waves, aspect, length, random))
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
    areas = []
    for kind, crossed in (("single waves", False), ("crossed waves", True)):
        of_kind = [sample for sample in samples if sample.crossed == crossed]
        if of_kind:
            areas.append(_errors(kind, of_kind, fitted))
    return Report({"border-weights": weights, "border-areas": areas})


def _samples(
    waves: int, aspect: float, length: float, random: np.random.Generator
) -> Iterator[Sample]:
    """Yield `waves` samples of random waves, and remark on the progress.

    Waves without a grid, and contacts without a border, are replaced by further draws.
    """
    done = 0
    while done < waves:
        wave = _draw_wave(aspect, length, random)
        if wave is None:  # its grid is too small or too large
            continue
        contact = wave.pressed()
        exact_percent = wave.exact_area_percent()
        if not 0 < contact.area_percent < 100 or not 0 < exact_percent < 100:
            continue
        yield _sample(contact, exact_percent, crossed=wave.crossed)
        done += 1
        if done % PROGRESS == 0:
            remark(f"{done} of {waves} waves")


def _draw_wave(aspect: float, length: float, random: np.random.Generator) -> Wave | None:
    """Draw a wave on a patch of the sides 1 and `length`, with cells of about this aspect.

    Return None if the grid has too many nodes or too few. The state of `random` moves. Another
    order of the draws below would change the fitted weights, by about their standard deviations.
    """
    crossed = bool(random.random() < 0.5) and length == 1
    size = random.uniform(2, 12)  # periods a side
    angle = random.uniform(0, np.pi / 2)
    if random.random() < ON_THE_GRID:
        angle = np.pi / 4 * random.integers(3)
    periods = round(size * np.cos(angle)), round(size * np.sin(angle))
    nodes_a_wave = np.exp(random.uniform(np.log(3), np.log(64)))
    shape = _shape(round(np.hypot(*periods) * nodes_a_wave), aspect / length)
    if not FEWEST_NODES <= math.sqrt(shape[0] * shape[1]) <= MOST_NODES:
        return None
    load = float(np.exp(random.uniform(np.log(0.003), np.log(0.85))))
    if not crossed:  # the area of single waves rises with the root of the load
        load = random.uniform(0.02, 0.85)
    phases = random.uniform(0, 2 * np.pi, 2)
    return Wave(
        periods=periods,
        phases=phases,
        crossed=crossed,
        load=load,
        shape=shape,
        length=length,
    )


def _shape(nodes: int, ratio: float) -> tuple[int, int]:
    """Return the nodes (nx, ny) of a patch with `nodes` along its coarser axis.

    `ratio` is the number of nodes along the first axis over the number along the second.
    """
    return round(nodes * max(ratio, 1.0)), round(nodes * max(1 / ratio, 1.0))


def _sample(contact: bem.Contact, exact_percent: float, *, crossed: bool) -> Sample:
    """Return the equation of a contact, whose area in the continuum is `exact_percent` [%]."""
    sums = np.zeros_like(WEIGHTS)
    number = 0
    for edges in border_edges(contact.problem, contact.pressure, contact.gap, None):
        sums += edges.row_factors().T @ edges.terms
        number += len(edges.terms)
    exact = exact_percent / 100 * contact.pressure.size
    return Sample(
        sums=sums.ravel(),
        excess=contact.contact_nodes - exact,
        exact=exact,
        edges=number,
        crossed=crossed,
    )


def _fit(samples: list[Sample]) -> tuple[Values, Values]:
    """Return the weights by least squares and their standard deviations, (12,) each [spacing]."""
    # Dividing by the root of the number of edges gives all equations an equal variance.
    roots = np.sqrt([sample.edges for sample in samples])
    matrix = np.array([sample.sums for sample in samples]) / roots[:, None]
    excesses = np.array([sample.excess for sample in samples]) / roots
    weights, *_ = np.linalg.lstsq(matrix, excesses, rcond=None)
    freedom = max(len(samples) - weights.size, 1)  # degrees of freedom
    variance = float(np.sum((excesses - matrix @ weights) ** 2)) / freedom
    covariance = variance * np.linalg.pinv(matrix.T @ matrix)
    return np.asarray(weights, np.float64), np.sqrt(np.diag(covariance))


def _errors(kind: str, samples: list[Sample], fitted: Values) -> Row:
    """Return the row of a kind: root mean squares of the errors of areas [%].

    Areas are counts of nodes, or are corrected by the weights of the product or the fitted ones.
    """
    row: Row = {"kind": kind, "contacts": len(samples)}
    ways = {"count": np.zeros(WEIGHTS.size), "product": WEIGHTS.ravel(), "fitted": fitted}
    for name, weights in ways.items():
        errors = [sample.error_percent(weights) for sample in samples]
        row[f"{name}_error_percent"] = float(np.sqrt(np.mean(np.square(errors))))
    return row
