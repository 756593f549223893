"""The weights of `bem.derived.border`, by least squares over regular waves.

Westergaard's waves have a closed form; waves that cross have areas from a grid of 128 nodes a wave.
Both come at all angles to the grid, from 3 to 64 nodes long, with light contact and nearly full.
`python -m bench.border_weights` prints the table in some minutes.
"""

import numpy as np
import typer

import bem
from bem.derived.border import WEIGHTS, edges_of, terms
from gen.arrays import Heights, Values

HEIGHT = 0.01
FINE = 512, 4  # nodes and periods a side of the grid that crossed waves are held against
NODES = 12, 260  # a side


def wave(nodes: int, periods: tuple[int, int], phases: Values, *, crossed: bool) -> Heights:
    """Return one wave, or two of half its height that cross, (nodes, nodes)."""
    x = 2 * np.pi * np.arange(nodes) / nodes
    along, across = periods
    first = np.cos(np.add.outer(along * x, across * x) + phases[0])
    if not crossed:
        return np.asarray(HEIGHT * first)
    second = np.cos(np.add.outer(-across * x, along * x) + phases[1])
    return np.asarray(HEIGHT / 2 * (first + second))


def press(heights: Heights, periods: tuple[int, int], share: float) -> bem.Contact:
    """Press waves by a share of the pressure at which one of them is in full contact."""
    full = np.pi * HEIGHT * np.hypot(*periods)
    return bem.solve(heights, 1.0, pressure=share * full, boundary="periodic")


def truth(share: float, *, crossed: bool) -> float:
    """Return the area in the continuum [%]."""
    if not crossed:
        return float(200 / np.pi * np.arcsin(np.sqrt(share)))
    nodes, periods = FINE
    heights = wave(nodes, (periods, 0), np.array([0.3, 0.7]), crossed=True)
    return press(heights, (periods, 0), share).continuum_area_percent


def sums(contact: bem.Contact) -> Values:
    """Return the terms of all edges, summed by how many edges beside them are in line, (12,)."""
    found = np.zeros_like(WEIGHTS)
    for edges, compliance in edges_of(contact.problem, contact.pressure, contact.gap, None):
        np.add.at(found, edges.aligned, terms(edges, compliance))
    return found.ravel()


def weights(waves: int, random: np.random.Generator) -> Values:
    """Fit the weights to a number of waves, (3, 4)."""
    rows: list[Values] = []
    excesses: list[float] = []
    while len(rows) < waves:
        crossed, size = bool(random.random() < 0.5), random.uniform(2, 12)
        angle = random.uniform(0, np.pi / 2)
        if random.random() < 0.2:  # along the grid and its diagonal, which other angles hardly meet
            angle = np.pi / 4 * random.integers(3)
        periods = round(size * np.cos(angle)), round(size * np.sin(angle))
        nodes = round(np.hypot(*periods) * np.exp(random.uniform(np.log(3), np.log(64))))
        if not NODES[0] <= nodes <= NODES[1]:
            continue
        share = np.exp(random.uniform(np.log(0.003), np.log(0.85)))
        if not crossed:
            share = random.uniform(0.02, 0.85)
        phases = random.uniform(0, 2 * np.pi, 2)
        contact = press(wave(nodes, periods, phases, crossed=crossed), periods, share)
        exact = truth(share, crossed=crossed)
        if not 0 < contact.area_percent < 100 or not 0 < exact < 100:
            continue
        found = sums(contact)
        edges = found.reshape(WEIGHTS.shape)[:, 0].sum()
        rows.append(found / np.sqrt(edges))
        excess = contact.contact_nodes - exact / 100 * contact.pressure.size
        excesses.append(excess / np.sqrt(edges))
    fitted, *_ = np.linalg.lstsq(np.array(rows), np.array(excesses), rcond=None)
    return np.asarray(fitted.reshape(WEIGHTS.shape))


if __name__ == "__main__":
    typer.echo(weights(3300, np.random.default_rng(11)).round(3))
