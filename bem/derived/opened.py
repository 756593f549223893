"""What may open between the nodes of a full contact without edges."""

import math
from dataclasses import dataclass

import numpy as np

from bem.arrays import Field
from bem.problem import Problem


@dataclass(frozen=True)
class Opened:
    """What may open between the nodes of a full contact of elastic bodies without edges.

    Attributes
    ----------
    area_percent : float
        Area that may be open [%].
    gap : float
        Mean gap that it may have [um].
    """

    area_percent: float
    gap: float


def opened_between_nodes(problem: Problem, pressure: Field) -> Opened:
    """Return what may open between the nodes of a full contact without edges.

    The pressure of a full contact is a sum of waves. Where it is negative between nodes, the
    surfaces part. A round pit of the pressure opens 1.5 times, a long one twice, the area over
    which the pressure of full contact is negative. Its gap is at most that of one round crack of
    the whole open area.

    Parameters
    ----------
    problem : Problem
        The problem.
    pressure : ndarray, shape (nx, ny)
        The pressure that solves it [MPa].

    Returns
    -------
    Opened
        Area and mean gap; both are 0 unless elastic bodies without edges are in full contact.
    """
    from scipy import fft  # here, because few contacts need it

    nodes = problem.heights.shape
    has_yielded = problem.hardness is not None and pressure.max() >= problem.hardness
    if pressure.min() <= 0 or problem.boundary == "free" or has_yielded:
        return Opened(area_percent=0.0, gap=0.0)
    largest = float(pressure.max())
    for axis in (0, 1):
        twice = 2 * nodes[axis]
        lines = np.moveaxis(pressure, axis, -1)
        if problem.boundary == "periodic":
            between = fft.irfft(fft.rfft(lines, norm="forward"), twice, norm="forward")
        else:
            between = fft.idct(fft.dct(lines, norm="forward"), n=twice, norm="forward")
        pressure = np.moveaxis(np.asarray(between, dtype=np.float64), -1, axis)
    # Pressures below zero by rounding alone are no tension.
    negative = np.minimum(pressure + 1e-12 * largest, 0.0)
    share = 2 * float(np.mean(negative < 0))
    area = math.prod(problem.spacing) * problem.heights.size
    radius = math.sqrt(share * area / math.pi)
    gap = 8 / 3 * radius * float(-negative.mean()) / problem.modulus
    return Opened(area_percent=100 * min(share, 1.0), gap=gap)
