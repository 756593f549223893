"""Forecast of a scene: the loads of its plan, and its cost from the time of a few samples."""

import resource
import time
from dataclasses import dataclass

import numpy as np

from gen.generation.plan import parameters
from gen.generation.sample import compute_rows
from gen.scene import Scene

MEASURED_SURFACES = 16
"""Surfaces computed for an estimate, spread evenly over the plan."""

COUNTED_ROWS = 1_000_000
"""Largest number of planned rows that are drawn: more would hardly change the summary."""

MEASURED_LOADS = 4
"""Largest number of samples computed on each of these surfaces."""


@dataclass(frozen=True)
class Estimate:
    """Cost of a run, extrapolated from measured samples.

    Attributes
    ----------
    measured : int
        Number of rows that were computed.
    milliseconds : float
        Mean time of a sample on one worker [ms].
    workers : int
        Number of processes that compute.
    seconds : float
        Time of the run [s].
    memory_bytes : int
        Memory of all processes [bytes].
    """

    measured: int
    milliseconds: float
    workers: int
    seconds: float
    memory_bytes: int


def planned_loads(scene: Scene) -> tuple[float, float, float]:
    """Return smallest, mean and largest load of the first `COUNTED_ROWS` planned rows."""
    load = parameters(scene, 0, min(scene.samples, COUNTED_ROWS)).load
    return float(load.min()), float(load.mean()), float(load.max())


def estimate(scene: Scene, ranks: int) -> Estimate:
    """Measure a few samples on this machine and extrapolate to a run with `ranks` processes."""
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
