"""Forecasts of a run: the loads that are planned, and the time that its samples take here."""

import time
from typing import NamedTuple

import numpy as np

from gen.generation.plan import parameters
from gen.generation.sample import compute_rows
from gen.scene import Scene

COUNTED_ROWS = 1_000_000  # most planned rows whose loads are summarised
MEASURED_SURFACES = 16  # surfaces of an estimate of time
MEASURED_LOADS = 4  # most samples of an estimate on each of these surfaces


class PlannedLoads(NamedTuple):
    """Smallest, mean and largest load of planned rows, in the scene's quantity."""

    smallest: float
    mean: float
    largest: float


class MeasuredTime(NamedTuple):
    """Time that samples have taken on this machine."""

    mean: float  # of a sample, with its share of the time for the surface [s]
    samples: int  # number of samples that were computed


def planned_loads(scene: Scene) -> PlannedLoads:
    """Summarise the loads of the first planned rows; nothing is computed for it.

    Parameters
    ----------
    scene : Scene
        A completed scene.

    Returns
    -------
    PlannedLoads
        Smallest, mean and largest load of the first `COUNTED_ROWS` rows.
    """
    loads = parameters(scene, 0, min(scene.samples, COUNTED_ROWS)).load
    return PlannedLoads(float(loads.min()), float(loads.mean()), float(loads.max()))


def measured_time(scene: Scene) -> MeasuredTime:
    """Measure the time of samples of a scene on this machine, by computing some of them.

    The samples are the first ones on surfaces that lie evenly in the plan.

    Parameters
    ----------
    scene : Scene
        A completed scene.

    Returns
    -------
    MeasuredTime
        Mean time of a sample, and the number of samples that were computed.
    """
    m = scene.samples_per_surface
    surfaces = np.linspace(0, scene.surfaces - 1, MEASURED_SURFACES).astype(int)
    compute_rows(scene, 0, 1)  # plans are made once a run, not once a sample
    measured = 0
    began = time.perf_counter()
    for surface in np.unique(surfaces).tolist():
        start = surface * m
        stop = min(start + min(m, MEASURED_LOADS), scene.samples)
        compute_rows(scene, start, stop)
        measured += stop - start
    elapsed = time.perf_counter() - began
    return MeasuredTime(elapsed / measured, measured)
