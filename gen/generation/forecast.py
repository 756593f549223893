"""Forecast of a scene's cost: its plan in numbers, and the time of a few samples."""

import resource
import time
from dataclasses import dataclass

import numpy as np

from gen.generation.plan import parameters
from gen.generation.sample import compute_rows
from gen.scene import Scene
from gen.scene.columns import row_bytes
from gen.scene.tables import Quantity

MEASURED_SURFACES = 16
"""Surfaces computed for an estimate, spread evenly over the plan."""

COUNTED_ROWS = 1_000_000
"""Largest number of planned rows that are drawn: more would hardly change the summary."""

MEASURED_LOADS = 4
"""Largest number of samples computed on each of these surfaces."""


@dataclass(frozen=True)
class Plan:
    """A scene's plan in numbers.

    Attributes
    ----------
    samples, surfaces : int
        Numbers of rows and of surfaces.
    shape : tuple of int
        Nodes along x and y.
    load : tuple of float
        Smallest, mean and largest load of the planned rows, of the first `COUNTED_ROWS` if there
        are more.
    quantity : str
        Quantity of these loads, one of `gen.scene.tables.UNITS`.
    file_bytes : int
        Size of the database's columns [bytes].
    hardness : tuple of float or None
        Smallest and largest hardness [MPa] of the distribution; None for elastic bodies.
    boundary : str
        "free", "periodic" or "mirror".
    two_rough : bool
        Whether a second rough body is pressed against each surface.
    doubts : tuple of str
        What no solid has.
    """

    samples: int
    surfaces: int
    shape: tuple[int, int]
    load: tuple[float, float, float]
    quantity: Quantity
    file_bytes: int
    hardness: tuple[float, float] | None
    boundary: str
    two_rough: bool = False
    doubts: tuple[str, ...] = ()


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


def plan_of(scene: Scene) -> Plan:
    """Summarise the plan of a scene without computing a row, in a bounded time.

    Parameters
    ----------
    scene : Scene
        Description of the samples.

    Returns
    -------
    Plan
        The plan in numbers.
    """
    return Plan(
        samples=scene.samples,
        surfaces=scene.surfaces,
        shape=scene.shape,
        load=_loads(scene),
        quantity=scene.quantity,
        file_bytes=scene.samples * row_bytes(scene),
        hardness=scene.contact.hardness_limits,
        boundary=scene.contact.boundary,
        two_rough=scene.surface.against is not None,
        doubts=tuple(scene.contact.doubts),
    )


def _loads(scene: Scene) -> tuple[float, float, float]:
    """Return the smallest, the mean and the largest load in the scene's quantity."""
    load = parameters(scene, 0, min(scene.samples, COUNTED_ROWS)).load
    return float(load.min()), float(load.mean()), float(load.max())


def estimate(scene: Scene, ranks: int) -> Estimate:
    """Measure a few samples on this machine and extrapolate to a run.

    Parameters
    ----------
    scene : Scene
        Description of the samples.
    ranks : int
        Number of processes under mpiexec, of which rank 0 hands out the work; 1 works alone.

    Returns
    -------
    Estimate
        Time and memory of the run.
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
