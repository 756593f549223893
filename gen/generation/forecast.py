"""Forecasts of a run: its planned loads, and the time that its samples take on this machine."""

import time
from typing import NamedTuple

import numpy as np

from gen.generation.plan import parameters
from gen.generation.sample import compute_rows
from gen.scene import Scene

COUNTED_ROWS = 1_000_000
"""Largest number of rows whose planned loads are summarised."""

MEASURED_SURFACES = 16
"""Largest number of surfaces that are made to measure the time of samples."""

MEASURED_LOADS = 4
"""Largest number of samples that are computed on each of these surfaces."""


class PlannedLoads(NamedTuple):
    """Smallest, mean and largest load of planned rows, each in the scene's quantity."""

    smallest: float
    mean: float
    largest: float


class MeasuredTime(NamedTuple):
    """Time that samples have taken on this machine."""

    mean: float  # mean time of a sample, with its share of the time for its surface [s]
    samples: int  # number of samples of which it is the mean


def planned_loads(scene: Scene) -> PlannedLoads:
    """Summarise the loads of the first rows of the plan, without making a surface.

    Parameters
    ----------
    scene : Scene
        A completed scene.

    Returns
    -------
    PlannedLoads
        Smallest, mean and largest load of all rows, or of the first `COUNTED_ROWS` rows if there
        are more.
    """
    rows = min(scene.samples, COUNTED_ROWS)
    loads = parameters(scene, start=0, stop=rows).load
    return PlannedLoads(
        smallest=float(loads.min()),
        mean=float(loads.mean()),
        largest=float(loads.max()),
    )


def measured_time(scene: Scene) -> MeasuredTime:
    """Measure the time of samples of a scene on this machine, by computing some of them.

    `MEASURED_SURFACES` surfaces are chosen at equal distances from the first to the last one of the
    plan. On each of them the first `MEASURED_LOADS` samples are computed, or all if it has fewer.

    Parameters
    ----------
    scene : Scene
        A completed scene, whose surfaces are ready (`make_ready`).

    Returns
    -------
    MeasuredTime
        Mean time of a sample, and the number of samples of which it is the mean.
    """
    per_surface = scene.samples_per_surface
    surfaces = np.linspace(0, scene.surfaces - 1, MEASURED_SURFACES).astype(int)
    # The first sample of a process also takes the time to prepare Fourier transforms, which a run
    # needs only once. It is computed before the clock starts.
    compute_rows(scene, start=0, stop=1)
    measured = 0
    began = time.perf_counter()
    for surface in np.unique(surfaces).tolist():  # a short scene has fewer surfaces
        start = surface * per_surface
        stop = min(start + min(per_surface, MEASURED_LOADS), scene.samples)
        compute_rows(scene, start, stop)
        measured += stop - start
    elapsed = time.perf_counter() - began
    return MeasuredTime(mean=elapsed / measured, samples=measured)
