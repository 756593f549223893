"""What takes part in the comparison, and how the solvers of other people are called."""

import importlib.util
import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from importlib import metadata
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from bench.work_precision.case import Case, find_exact
from bench.work_precision.solvers import Answer, Failure

Field = NDArray[np.float64]
Control = Literal["displacement", "force"]

MAX_ITERATIONS = 1000
"""Bound on the steps of a peer; a run that meets it counts as failed."""

REFERENCE_RTOL = 1e-12

LADDER = tuple(10.0 ** (-half_decades / 2) for half_decades in range(2, 25))
"""Tolerances that are tried, falling from 0.1 to 1e-12."""


class Contender(Protocol):
    """A solver of contacts on a rigid far field, ours or another's."""

    @property
    def name(self) -> str:
        """What the tables call it."""

    @property
    def precision(self) -> str:
        """Of the numbers that it iterates with: "mixed" or "float64"."""

    @property
    def control(self) -> Control:
        """Which of the two is given to it: displacement of the far field, or force."""

    @property
    def ladder(self) -> tuple[float, ...]:
        """Tolerances that are tried, falling."""

    @property
    def largest_contact(self) -> float:
        """Nodes in contact beyond which it is not tried."""

    @property
    def version(self) -> str:
        """Of the package."""

    def set_up(self, nodes: int, spacing: float) -> object:
        """Make anew what serves all contacts on one grid; its result is thrown away."""

    def solve(self, case: Case, rtol: float) -> Answer:
        """Solve to the solver's own notion of a tolerance; `Failure` if it cannot.

        What serves all contacts on a grid is made in the first of them and kept.
        """


@dataclass(frozen=True, eq=False)
class Load:
    """A contact as a peer is given it, for E* = 1 MPa.

    Attributes
    ----------
    heights : (m, m) surface, with a margin that never touches where the peer's grid is larger [um]
    spacing : of the nodes [um]
    delta : displacement of the far field from first touch on [um]
    force : the force that this takes, from the reference, for peers that are given one [uN]
    """

    heights: Field
    spacing: float
    delta: float
    force: float

    @property
    def mean_pressure(self) -> float:
        """Force over the area of all cells [MPa]."""
        return self.force / (self.spacing**2 * self.heights.size)


class Session(Protocol):
    """A peer that is set up for a grid of square cells."""

    def press(self, load: Load, tolerance: float) -> tuple[Field, int | None]:
        """(m, m) pressure [MPa], and iterations if they are told; `Failure` if there is none."""


def same_grid(nodes: int) -> int:
    """No margin."""
    return nodes


@dataclass(frozen=True)
class Peer:
    """A solver by other people.

    Attributes
    ----------
    name : what the tables call it: package, method and, if it has one, margin
    package : what it is imported as, and what the index calls it
    install : how to get it
    open_session : sets it up for (nodes a side, spacing [um])
    control : what is given to it
    grid : nodes a side that it runs on; beyond the surface's own lies a margin that never touches
    precision : of the numbers it iterates with, "mixed" or "float64"
    ladder : tolerances that are tried
    largest_contact : nodes in contact beyond which it is not tried
    """

    name: str
    package: str
    install: str
    open_session: Callable[[int, float], Session]
    control: Control = "displacement"
    grid: Callable[[int], int] = same_grid
    precision: str = "float64"
    ladder: tuple[float, ...] = LADDER
    largest_contact: float = math.inf

    @property
    def installed(self) -> bool:
        """Whether the package can be imported; nothing is imported to find out."""
        return importlib.util.find_spec(self.package) is not None

    @property
    def version(self) -> str:
        """Of the package."""
        return metadata.version(self.package)

    def set_up(self, nodes: int, spacing: float) -> Session:
        """Set it up for a grid, anew."""
        return self.open_session(self.grid(nodes), spacing)

    def solve(self, case: Case, rtol: float) -> Answer:
        """Solve a case; the package documents what its tolerance is."""
        if case.kernel != "uniform-pressure":
            raise Failure(f"{self.name} has no kernel {case.kernel!r}")
        session = _kept_session(self, case.nodes, case.spacing)
        load = pose(case, self.grid(case.nodes))
        began = time.perf_counter()
        try:
            pressure, iterations = session.press(load, rtol)
        except Failure:
            raise
        except Exception as fault:  # other people's code may fail in any way
            raise Failure(f"{type(fault).__name__}: {fault}") from fault
        seconds = time.perf_counter() - began
        return Answer(pressure[: case.nodes, : case.nodes], seconds, iterations, None)


@lru_cache(maxsize=16)
def _kept_session(peer: Peer, nodes: int, spacing: float) -> Session:
    return peer.set_up(nodes, spacing)


def pose(case: Case, nodes: int) -> Load:
    """Put a case on a grid of as many nodes a side or more.

    The margin lies two Delta below the highest node, so that it changes nothing but the grid.
    """
    heights = np.full((nodes, nodes), case.heights.max() - 2 * case.delta)
    heights[: case.nodes, : case.nodes] = case.heights
    return Load(heights, case.spacing, case.delta, find_exact(case, REFERENCE_RTOL).force)
