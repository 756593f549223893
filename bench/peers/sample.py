"""The contacts that are compared on."""

from collections.abc import Sequence
from functools import lru_cache

from bench.solvers.case import Case
from gen.arrays import Heights
from gen.generation.plan import surface_random
from gen.scene import load
from gen.surface import generate

SIDE = 1000.0  # um
SIGMA0 = 20.0  # um

# Of the paper preset's surfaces one on which, at 129 nodes a side, H = 0.8 and Delta = 5 um, 6 to
# 18 nodes touch, where MIRCO is at its best; at H = 0.65 its contacts are of middling size.
SURFACE = 18

HURST = 0.65
PAPERS_HURST = 0.8
PAPERS_NODES = 129
PAPERS_DELTAS = (5.0, 15.0, 25.0)  # um


@lru_cache(maxsize=64)  # the same case has its exact solution found once
def sample(nodes: int, delta: float, hardness: float | None = None, hurst: float = HURST) -> Case:
    """Return the surface, 2^k + 1 nodes a side, pressed by Delta [um]; the hardness is over E*."""
    name = f"H = {hurst}, Delta = {delta:g} um"
    if hardness is not None:
        name += f", hardness {hardness:g} E*"
    return Case(name, _heights(nodes, hurst), SIDE, delta, hardness=hardness, hurst=hurst)


def samples(
    nodes: Sequence[int], deltas: Sequence[float], hardnesses: Sequence[float] = ()
) -> list[Case]:
    """Return the peers' surface at every load on every grid, elastic and with every hardness.

    Without a hardness, contacts of the paper's algorithm are added at its grid.
    """
    bounds = (None, *sorted(hardnesses, reverse=True))
    found = []
    for size in nodes:
        found += [sample(size, delta, bound) for delta in deltas for bound in bounds]
        if size == PAPERS_NODES and not hardnesses:
            found += [sample(size, delta, hurst=PAPERS_HURST) for delta in PAPERS_DELTAS]
    return found


@lru_cache(maxsize=8)
def _heights(nodes: int, hurst: float) -> Heights:
    """Generate the (nodes, nodes) surface [um]."""
    random = surface_random(load("paper"), SURFACE)
    heights = generate("diamond-square", nodes, hurst, SIGMA0, random)
    heights.setflags(write=False)
    return heights
