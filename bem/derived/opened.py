"""What may open between the nodes of a full contact without edges."""

from __future__ import annotations  # short signatures in help()

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from bem.contact import Contact


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


def opened_between_nodes(contact: Contact) -> Opened:
    """Return what may open between the nodes of a full contact without edges.

    The pressure of a full contact is a sum of waves. Where it is negative between nodes, the
    surfaces part. A round pit of the pressure opens 1.5 times, a long one twice, the area over
    which the pressure of full contact is negative. Its gap is at most that of one round crack of
    the whole open area.

    Parameters
    ----------
    contact : Contact
        The contact; all but full contacts of elastic bodies without edges have nothing to open.

    Returns
    -------
    Opened
        Area and mean gap.
    """
    from scipy import fft  # here, because few contacts need it

    problem = contact.problem
    nodes = problem.heights.shape
    is_full = contact.contact_nodes == problem.heights.size
    if not is_full or problem.boundary == "free" or contact.yielded.any():
        return Opened(area_percent=0.0, gap=0.0)
    pressure = contact.pressure
    for axis in (0, 1):
        twice = 2 * nodes[axis]
        lines = np.moveaxis(pressure, axis, -1)
        if problem.boundary == "periodic":
            between = fft.irfft(fft.rfft(lines, norm="forward"), twice, norm="forward")
        else:
            between = fft.idct(fft.dct(lines, norm="forward"), n=twice, norm="forward")
        pressure = np.moveaxis(np.asarray(between, dtype=np.float64), -1, axis)
    # Pressures below zero by rounding alone are no tension.
    negative = np.minimum(pressure + 1e-12 * contact.pressure.max(), 0.0)
    share = 2 * float(np.mean(negative < 0))
    area = math.prod(problem.spacing) * problem.heights.size
    radius = math.sqrt(share * area / math.pi)
    gap = 8 / 3 * radius * float(-negative.mean()) / problem.modulus
    return Opened(area_percent=100 * min(share, 1.0), gap=gap)
