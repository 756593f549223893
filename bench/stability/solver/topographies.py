"""Surfaces of the stability cases: (nx, ny) heights [um]."""

from functools import lru_cache

import numpy as np

from bem.analytic import Indenter, distances_to_centre
from bench.references.half_space import Field
from gen.generation.plan import parameters, surface_random
from gen.scene import load
from gen.surface import generate

NODES = 129  # nodes a side, unless a case is about another grid
SMALL = 33  # nodes a side where all may touch and the dense matrix is to judge
SIDE = 1000.0  # scan length of the paper's surfaces [um]
CELL = SIDE / (NODES - 1)  # spacing of the nodes then [um]


@lru_cache(maxsize=16)
def paper(nodes: int = NODES, hurst: float | None = None, sigma0: float | None = None) -> Field:
    """The surface of the paper preset's first row, read-only; its coarse nodes are always the same.

    Hurst exponent [1] and standard deviation of the first displacement [um] may replace the row's.
    """
    scene = load("paper")
    row = parameters(scene, 0, 1)
    heights = generate(
        scene.surface.generator,
        nodes,
        float(row.drawn["hurst"][0]) if hurst is None else hurst,
        float(row.drawn["sigma0"][0]) if sigma0 is None else sigma0,
        surface_random(scene, 0),
    )
    heights.setflags(write=False)
    return heights


def cropped_paper(shape: tuple[int, int]) -> Field:
    """A corner of the smallest of these surfaces that holds the grid."""
    nodes = 2 ** max(max(shape) - 2, 1).bit_length() + 1
    return paper(nodes)[: shape[0], : shape[1]]


def terraces(nodes: int = NODES) -> Field:
    """The paper's surface in steps of 10 um: plateaus of exact ties."""
    return np.asarray(np.round(paper(nodes) / 10.0) * 10.0)


def flat(nodes: int = NODES) -> Field:
    """All nodes at one height."""
    return np.zeros((nodes, nodes))


def with_middle_at(height: float, base: Field) -> Field:
    """The middle node at another height: a spike, a needle, a pit."""
    heights = base.copy()
    heights[heights.shape[0] // 2, heights.shape[1] // 2] = height
    return heights


def checkerboard(nodes: int = NODES) -> Field:
    """Heights of 0 and 1 in turn, the shortest waves of a grid; the corners are high."""
    return np.where(np.indices((nodes, nodes)).sum(axis=0) % 2 == 0, 1.0, 0.0)


def step(nodes: int = NODES) -> Field:
    """One half of the patch 1 um above the other."""
    return np.where(np.indices((nodes, nodes))[0] < nodes // 2, 1.0, 0.0)


def white_noise(nodes: int = NODES) -> Field:
    """Independent normal heights of unit variance."""
    return np.random.default_rng(0).standard_normal((nodes, nodes))


def indenter(body: Indenter, nodes: int = NODES) -> Field:
    """A body of revolution over the centre of the patch, its tip at height 0."""
    return body.heights(distances_to_centre((nodes, nodes), SIDE))
