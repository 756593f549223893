"""What may open between the nodes of a full contact, or at its edges."""

import math
from dataclasses import dataclass

import numpy as np

from bem.arrays import Field
from bem.problem import Problem


@dataclass(frozen=True)
class Opened:
    """What may open in a full contact where its nodes do not show it.

    Attributes
    ----------
    area_percent : float
        Area that may be open [%].
    gap : float
        Mean gap that it may have [um].
    """

    area_percent: float
    gap: float


def opened_unseen(problem: Problem, pressure: Field) -> Opened:
    """Return what may open in a full contact where its nodes do not show it.

    Without edges, the pressure of a full contact of elastic bodies is a sum of waves. Where it is
    negative between nodes, the surfaces part. A round pit of the pressure opens 1.5 times, a long
    one twice, the area over which the pressure of full contact is negative. On a free patch, cells
    may be open at its edges. They are if the pressure is negative there, extrapolated from the two
    outermost nodes. The gap is at most that of one round crack of the whole open area.

    Parameters
    ----------
    problem : Problem
        The problem.
    pressure : ndarray, shape (nx, ny)
        The pressure that solves it [MPa].

    Returns
    -------
    Opened
        Area and mean gap. Both are 0 unless all nodes are in contact. They are also 0 for bodies
        that have yielded on a patch without edges.
    """
    if pressure.min() <= 0:
        return Opened(area_percent=0.0, gap=0.0)
    if problem.boundary == "free":
        tension = _tension_at_edges(pressure)
        share = float(np.mean(tension > 0))
    else:
        if problem.hardness is not None and pressure.max() >= problem.hardness:
            return Opened(area_percent=0.0, gap=0.0)
        tension = _tension_between_nodes(
            pressure, is_periodic=problem.boundary == "periodic"
        )
        share = 2 * float(np.mean(tension > 0))
    area = math.prod(problem.spacing) * problem.heights.size
    radius = math.sqrt(share * area / math.pi)
    # A uniform tension p opens a round crack of this radius a by the volume 8 a^3 p / (3 E*)
    # (Sneddon 1946). Divided by the area of the patch, this is less than the gap below.
    gap = 8 / 3 * radius * float(tension.mean()) / problem.modulus
    return Opened(area_percent=100 * min(share, 1.0), gap=gap)


def _tension_between_nodes(pressure: Field, *, is_periodic: bool) -> Field:
    """Return how far below zero pressures are, (2 nx, 2 ny), at the nodes and between them [MPa].

    `pressure`, (nx, ny), is that of a periodic patch or of one that is continued by mirror images.
    """
    from scipy import fft  # here, because few contacts need it

    largest = float(pressure.max())
    for axis, nodes in enumerate(pressure.shape):
        lines = np.moveaxis(pressure, axis, -1)
        if is_periodic:
            between = fft.irfft(
                fft.rfft(lines, norm="forward"), 2 * nodes, norm="forward"
            )
        else:
            between = fft.idct(
                fft.dct(lines, norm="forward"), n=2 * nodes, norm="forward"
            )
        pressure = np.moveaxis(np.asarray(between, dtype=np.float64), -1, axis)
    # Pressures below zero by rounding alone are no tension.
    return np.maximum(-pressure - 1e-12 * largest, 0.0)


def _tension_at_edges(pressure: Field) -> Field:
    """Return how far below zero pressures are at the edges of a free patch [MPa].

    The result, (nx, ny), is zero at all nodes but the outermost ones. The edges are half a cell
    beyond these.
    """
    tension = np.zeros_like(pressure)
    for axis, nodes in enumerate(pressure.shape):
        if nodes == 1:
            continue
        lines = np.moveaxis(pressure, axis, 0)
        tension_of_lines = np.moveaxis(tension, axis, 0)  # a view, which fills `tension`
        for outermost, next_inside in ((0, 1), (-1, -2)):
            # half a cell beyond the outermost node, on the line through both
            at_edge = 1.5 * lines[outermost] - 0.5 * lines[next_inside]
            np.maximum(
                tension_of_lines[outermost], -at_edge, out=tension_of_lines[outermost]
            )
    return tension
