"""What a scene is going to cost: its plan in numbers, and a few samples measured."""

import resource
import time
from dataclasses import dataclass

import numpy as np

from gen.generation.plan import parameters
from gen.generation.sample import compute_rows
from gen.scene import Scene
from gen.schema import row_bytes

MEASURED_SURFACES = 16
"""Surfaces computed for an estimate, spread evenly over the plan."""

COUNTED_ROWS = 1_000_000
"""Planned rows that are looked at one by one; more are as their distribution says."""

MEASURED_LOADS = 4
"""Samples computed on each of them, at most."""


@dataclass(frozen=True)
class Plan:
    """A scene's plan in numbers.

    Attributes
    ----------
    samples, surfaces, nodes : numbers of rows, of surfaces and of nodes a side
    delta : smallest, mean and largest displacement [um], of the planned rows, or of what they are
        drawn from if they are more than `COUNTED_ROWS`
    file_bytes : size of the database's columns [bytes]
    """

    samples: int
    surfaces: int
    nodes: int
    delta: tuple[float, float, float]
    file_bytes: int


@dataclass(frozen=True)
class Estimate:
    """A run's cost, extrapolated from measured samples.

    Attributes
    ----------
    measured : number of rows that were computed
    milliseconds : mean time of a sample on one worker [ms]
    workers : processes that compute
    seconds : of the run [s]
    memory_bytes : of all processes [bytes]
    """

    measured: int
    milliseconds: float
    workers: int
    seconds: float
    memory_bytes: int


def plan_of(scene: Scene) -> Plan:
    """Look at the plan of a scene without computing anything, in a time that no scene exceeds.

    Parameters
    ----------
    scene : what to generate
    """
    return Plan(
        samples=scene.samples,
        surfaces=scene.surfaces,
        nodes=scene.surface.nodes,
        delta=_displacements(scene),
        file_bytes=scene.samples * row_bytes(scene.store, scene.surface.nodes),
    )


def _displacements(scene: Scene) -> tuple[float, float, float]:
    """Smallest, mean and largest displacement [um]."""
    if scene.samples <= COUNTED_ROWS:
        delta = parameters(scene, 0, scene.samples).delta
        return float(delta.min()), float(delta.mean()), float(delta.max())
    pieces = scene.delta.pieces
    low, high = zip(*(piece.range for piece in pieces), strict=True)
    mean = sum(piece.share * (0.5 * piece.range[0] + 0.5 * piece.range[1]) for piece in pieces)
    return min(low), mean, max(high)


def estimate(scene: Scene, ranks: int) -> Estimate:
    """Measure a few samples here and extrapolate to a run.

    Parameters
    ----------
    scene : what to generate
    ranks : processes under mpiexec, of which rank 0 hands out the work; 1 works alone
    """
    m = scene.samples_per_surface
    surfaces = np.unique(np.linspace(0, scene.surfaces - 1, MEASURED_SURFACES).astype(int)).tolist()
    compute_rows(scene, 0, 1)  # plans are made once a run, not once a sample
    began, measured = time.perf_counter(), 0
    for surface in surfaces:
        stop = min(surface * m + min(m, MEASURED_LOADS), scene.samples)
        compute_rows(scene, surface * m, stop)
        measured += stop - surface * m
    mean = (time.perf_counter() - began) / measured
    workers = max(ranks - 1, 1)
    # Linux counts the largest resident set in KiB. A master holds less than a worker.
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 * max(ranks, 1)
    return Estimate(measured, 1e3 * mean, workers, scene.samples * mean / workers, memory)
