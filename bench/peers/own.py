"""What the peers are compared with: `bem.solve`, and the paper's algorithm."""

import math
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from importlib import metadata

import numpy as np

from bem import influence
from bem.half_space import HalfSpace
from bench import nnls
from bench.peers.peer import LADDER, Control
from bench.work_precision.case import Case
from bench.work_precision.solvers import Answer, BoundaryElements


@dataclass(frozen=True)
class Ours(BoundaryElements):
    """`bem.solve` as its users call it; the tolerance is its rtol."""

    control: Control = "displacement"
    ladder: tuple[float, ...] = LADDER
    largest_contact: float = math.inf

    @property
    def version(self) -> str:
        """Of this distribution."""
        return metadata.version("asperity")

    def set_up(self, nodes: int, spacing: float) -> object:
        """Tabulate, transform and plan for the whole grid; most contacts need a part of it."""
        influence._table.cache_clear()
        shape, everywhere = (nodes, nodes), np.arange(nodes * nodes)
        with ThreadPoolExecutor(1) as pool:  # plans belong to a thread: a new one has none
            made = pool.submit(HalfSpace, shape, "uniform-pressure", 1.0, everywhere)
            return made.result()


@dataclass(frozen=True)
class PapersAlgorithm:
    """Bemporad and Paggi's active set (`bench.nnls`), at the tolerance that MIRCO has built in."""

    name: str = "paper's NNLS"
    precision: str = "float64"
    control: Control = "displacement"
    ladder: tuple[float, ...] = (1e-8,)
    largest_contact: float = 1200.0  # the time grows with the fourth power of this

    @property
    def version(self) -> str:
        """Of this distribution."""
        return metadata.version("asperity")

    def set_up(self, nodes: int, spacing: float) -> object:
        """Tabulate influence coefficients."""
        influence._table.cache_clear()
        return influence.influence_coefficients((nodes, nodes))

    def solve(self, case: Case, rtol: float) -> Answer:
        """Solve a case; its iterations are dense solves."""
        began = time.perf_counter()
        pressure, solves = nnls.press(case.heights, case.delta, kernel=case.kernel, rtol=rtol)
        pressure *= case.delta / case.spacing
        return Answer(pressure, time.perf_counter() - began, solves, None)
