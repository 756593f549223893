"""How far the answers of one grid are from those of the continuum: the same contact on half of it.

A contact on about every second node costs a quarter of the one asked about. How far the two are
apart bounds the error of the finer one where both see the same surface, and says that there is no
limit where roughness goes on down to the grid. Two things make the difference small by chance, and
have a share of the bar of their own: the place of the border in the cells, which goes with what
counting nodes adds to the area; and the highest node, from which Delta counts, which lies below the
summit by an unknown share of its cell. What a higher summit changes at a given Delta follows from
the work W that the load has done: of a force that grows like the power m of the approach d,
W = F d / (m + 1), and W is known from pressure and displacement.
"""

from __future__ import annotations  # short signatures in help()

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from bem.arrays import Field
from bem.problem import Boundary, NoSolution, Problem, check_solvable
from bem.threads import computed_once

if TYPE_CHECKING:
    from bem.contact import Contact

# Share of the difference of two grids in the bars, and what a bar has at least, in units of its
# answer times the share of the area that counting nodes adds. Both are chosen so that at least 90 %
# of true errors lie inside (`bench grid-error`).
OF_DIFFERENCE = 1.2
AT_LEAST = {"area": 0.10, "gap": 0.02, "stiffness": 0.25}

# Share of the highest node's second differences by which its summit lies higher, where the error
# falls with the spacing itself: a smooth summit has a third of it.
OF_SUMMIT = 0.3

# By how much the power of area and force exceeds its mean towards full contact of a patch without
# edges, per share of the area in contact; free patches have none. Stiffness grows by its square.
STEEPENING = 2.0

# Order of the mean square slope in the spacing from which a surface has an end of its waves above
# the grid: it is 2 for waves much longer than a cell, 1 for edges, and negative for fractals.
LEAST_ORDER = 0.4

# Relative difference of the mean square slopes below which a surface is smooth: waves of 60 nodes.
SMOOTH = 3e-3

# Relative difference of the areas of two grids above which neither is near the continuum.
LARGEST_DIFFERENCE = 0.3

# Share of the area, beyond what bears the load at the hardness, up to which yielding has decided it
# whatever the waves below the grid.
NEARLY_YIELDED = 0.03

# Nodes along an axis below which half of them say nothing.
FEWEST = 8

# Tolerance of the coarser contact: its errors stay far below its distance from the finer one. On
# 1,100 contacts the bars hold as many true errors as with 1e-4 (`bench grid-error`).
COARSE_RTOL = 3e-3


@dataclass(frozen=True, eq=False)
class GridError:
    """Half-widths of 90 % bars of a contact's answers, from the same contact on a coarser grid.

    Attributes
    ----------
    resolved : bool
        Whether the grid resolves the surface, so that the bars hold.
    reason : str
        Why they hold, or why not, without a full stop.
    order : float
        Order in the spacing of the surface's mean square slope: 2 for smooth surfaces, negative
        where roughness goes on down to the grid [1].
    remaining : float
        Error left over that taken off by halving the spacing, from 1/3 to 2.5 [1].
    summit : float
        How much the summit may lie above the highest node [um].
    growth : float
        Share by which such a summit makes area and force grow, 0 under a given load [1].
    counted : float
        Share of the area in the continuum that counting nodes adds [1].
    spare : float
        Share of the area above load / hardness, below which no area can lie [1].
    contact, coarse : Contact
        The contact, and the same one on about every second node; None if there is none.
    """

    resolved: bool
    reason: str
    order: float
    remaining: float
    summit: float
    growth: float
    counted: float
    spare: float
    contact: Contact = field(repr=False)
    coarse: Contact | None = field(repr=False)

    @computed_once
    def area_percent(self) -> float:
        """Of `Contact.continuum_area_percent` [%]."""
        spacing, percent = (
            self.contact.problem.spacing,
            self.contact.continuum_area_percent,
        )
        scale = percent / (area_within(self.contact) or 1.0)
        floor = AT_LEAST["area"] * self.counted
        if self.order < LEAST_ORDER and self.spare <= NEARLY_YIELDED:
            floor = max(floor, self.spare)
        return self._bar(
            lambda contact: scale * area_within(contact, spacing),
            floor * percent,
            percent * self.growth,
        )

    @computed_once
    def delta(self) -> float:
        """Of `Contact.delta`, 0 where it was given [um]."""
        if self.contact.problem.delta is not None:
            return 0.0
        return self._bar(
            lambda contact: contact.delta - contact.problem.heights.max(), self.summit
        )

    @computed_once
    def force(self) -> float:
        """Of `Contact.force`, 0 where it was given [uN]."""
        if self.contact.problem.force is not None:
            return 0.0
        return self._bar(lambda contact: contact.force, self.contact.force * self.growth)

    @computed_once
    def mean_gap(self) -> float:
        """Of `Contact.mean_gap` [um]."""
        floor, raised = AT_LEAST["gap"] * self.counted * self.contact.mean_gap, 0.0
        if (
            self.contact.problem.delta is not None
        ):  # the bodies approach, and deform the more
            raised = self.summit - self.growth * float(self.contact.displacement.mean())
        return self._bar(lambda contact: contact.mean_gap, floor, raised)

    @computed_once
    def stiffness(self) -> float:
        """Of `Contact.stiffness`, by one more linear solve on either grid [MPa um]."""
        here = self.contact.stiffness
        if not math.isfinite(here):  # full contact without edges
            return 0.0
        raised = here * self.growth * _steepening(self.contact)
        floor = AT_LEAST["stiffness"] * self.counted * here
        return self._bar(lambda contact: contact.stiffness, floor, raised)

    def _bar(self, answer: Callable[[Contact], float], *parts: float) -> float:
        """Return the half-width of an answer's bar, from further parts of it in its unit."""
        if self.coarse is None:
            return math.inf
        apart = answer(self.contact) - answer(self.coarse)
        return math.hypot(OF_DIFFERENCE * max(1.0, self.remaining) * apart, *parts)


def grid_error_of(contact: Contact) -> GridError:
    """Return the errors of a contact, which is solved once more on about every second node."""
    heights, percent = contact.problem.heights, contact.continuum_area_percent
    order, lower = slope_order(heights, contact.problem.boundary), 0.0
    row, column = np.unravel_index(int(heights.argmax()), heights.shape)
    for line, place in ((heights[:, column], row), (heights[row], column)):
        # The nodes on both sides of the highest one; at a border the inner one twice.
        beside = np.pad(line, 1, mode="reflect")[[place, place + 2]]
        lower += float(2 * line[place] - beside.sum())
    remaining = 1 / (2 ** min(max(order, math.log2(1.4)), 2.0) - 1)
    summit = OF_SUMMIT * remaining * lower
    growth = 0.0 if contact.problem.delta is None else _growth(contact, summit)
    counted = abs(contact.area_percent / percent - 1) if percent else 0.0
    here, hardness = area_within(contact), contact.problem.hardness
    spare = 1.0 if hardness is None or here == 0 else 1 - contact.force / hardness / here
    coarse, (resolved, reason) = None, (False, "half of the nodes are in full contact")
    if min(heights.shape) < FEWEST:
        reason = f"{heights.shape[0]} x {heights.shape[1]} nodes are too few to tell"
    else:
        try:
            half, near = coarser(contact.problem, contact.pressure)
            half = replace(half, delta=None, force=contact.force)
            if contact.problem.delta is not None:
                delta = contact.delta - float(heights.max() - half.heights.max())
                half = replace(half, delta=delta, force=None)
                check_solvable(
                    replace(half, delta=delta + summit)
                )  # also under a higher summit
            # A full contact without edges needs no start: the coarser one is known to be full too.
            full = half.boundary != "free" and contact.contact_nodes == heights.size
            coarse = contact.again(half, None if full else near)
            there = area_within(coarse, contact.problem.spacing)
            resolved, reason = _verdict(contact.force, here, there, order, spare)
        except NoSolution:
            pass
        except ArithmeticError as error:
            reason = f"half of the nodes: {error}"
    made = order, remaining, summit, growth, counted, spare
    return GridError(resolved, reason, *made, contact=contact, coarse=coarse)


def _verdict(
    force: float, here: float, there: float, order: float, spare: float
) -> tuple[bool, str]:
    """Return whether the bars hold, and why, from the areas on both grids."""
    if here == 0 < force:
        return False, "no spot of contact is as large as a cell of the grid"
    change = there / here - 1 if here else float(there > 0)
    share, more = float(f"{100 * abs(change):.2g}"), "more" if change > 0 else "less"
    # Below this share it is rounding.
    words = f"half of the nodes give {f'{share:g} % {more}' if share > 1e-9 else 'the same'} area"
    if spare <= NEARLY_YIELDED:
        borne = f"{100 * (1 - spare):.3g} %"
        return True, f"yielding decides it: load / hardness alone is {borne} of this area"
    if order < LEAST_ORDER:
        return (
            False,
            f"waves go on down to the grid, so that the area has no limit: {words}",
        )
    if abs(change) > LARGEST_DIFFERENCE:
        return False, f"too few nodes in a wave, or in contact: {words}"
    return True, words


def _growth(contact: Contact, summit: float) -> float:
    """Return by what share a higher summit makes area and force grow at a given Delta [1]."""
    if contact.force == 0:
        return 0.0
    approach, touching = contact.approach, contact.pressure > 0
    pressure = contact.pressure[touching]
    pressed = (
        contact.problem.heights[touching] - contact.problem.heights.max()
    ) / approach + 1
    if contact.problem.hardness is not None:
        pressed += contact.yielded_depth[touching] / approach
    work = np.average(pressed, weights=pressure / pressure.max()) / 2  # [F d]
    power = _steepening(contact) * (1 / float(work) - 1)
    # A compliant far field gives way too.
    yielded = power * (1 - contact.delta / approach)
    return power * summit / approach / max(1 - yielded, 1e-3)


def _steepening(contact: Contact) -> float:
    """Return how much steeper forces grow than their mean power says, as a patch fills [1]."""
    edgeless = contact.problem.boundary != "free"
    return 1 + STEEPENING * contact.area_percent / 100 * edgeless


def area_within(contact: Contact, spacing: tuple[float, float] | None = None) -> float:
    """Return the area of contact in the continuum [um2].

    Cells at the borders of a free patch reach half a spacing beyond its nodes: those of a coarser
    grid count as far as those of the finer one, whose `spacing` is given.
    """
    own = contact.problem.spacing
    area = contact.continuum_area_percent / 100 * contact.pressure.size * own[0] * own[1]
    if spacing is None or contact.problem.boundary != "free":
        return area
    touching = contact.pressure > 0
    for axis in (0, 1):
        edge = int(np.count_nonzero(touching.take([0, -1], axis)))
        area -= edge * (own[axis] - spacing[axis]) / 2 * own[1 - axis]
    return max(area, 0.0)


def slope_order(heights: Field, boundary: Boundary) -> float:
    """Return the order in the spacing of a surface's mean square slope, the smaller of both axes.

    It compares the slopes between nodes one, two and four spacings apart.
    """
    orders = []
    periodic = boundary == "periodic"
    for lines in (heights, heights.T):
        nodes, columns = lines.shape
        if nodes < FEWEST:
            continue
        slopes = []
        for lag, first in ((1, 2), (2, 1), (4, 0)):  # around the same places
            if periodic:
                rise = np.roll(lines, -lag, axis=0) - lines
            else:
                rise = (
                    lines[first + lag : nodes - first]
                    - lines[first : nodes - first - lag]
                )
            squares = np.einsum("ij,ij->i", rise, rise) / columns
            halved = lag > 1 and not periodic  # the first and the last place
            ends = (squares[0] + squares[-1]) / 2 if halved else 0.0
            slopes.append(float(squares.sum() - ends) / (squares.size - halved) / lag**2)
        near, far = abs(slopes[0] - slopes[1]), abs(slopes[1] - slopes[2])
        if max(near, far) > SMOOTH * slopes[0]:
            orders.append(math.log2(max(far, 1e-300) / max(near, 1e-300)))
    return min(orders, default=math.inf)


def coarser(problem: Problem, pressure: Field) -> tuple[Problem, Field]:
    """Return the same problem on about every second node along each axis, and a pressure there.

    Every second node is taken where they cover the patch: an even number of nodes on a patch that
    repeats itself, an odd one on a free patch. Elsewhere the surface is read between its nodes, by
    its own waves where the patch has no edges, and by cubic splines on free patches; the pressure
    is that of the nearest node.
    """
    heights, spacing, free = (
        problem.heights,
        list(problem.spacing),
        problem.boundary == "free",
    )
    for axis in (0, 1):
        nodes = heights.shape[axis]
        if nodes == 1:
            continue
        number = (nodes + 1) // 2
        step = (nodes - 1) / (number - 1) if free else nodes / number
        first = 0.5 * step - 0.5 if problem.boundary == "mirror" else 0.0
        places = first + step * np.arange(number)  # of its nodes, (number,) [spacing]
        heights = _read(heights, axis, places, problem.boundary)
        pressure = pressure.take(np.rint(places).astype(np.intp), axis)
        spacing[axis] *= places[1] - places[0]
    if (
        problem.kernel == "concentrated-force"
    ):  # which needs square cells, to the last digit
        spacing = [float(np.sqrt(spacing[0] * spacing[1]))] * 2
    rtol = max(problem.rtol, COARSE_RTOL)
    half = replace(problem, heights=heights, spacing=(spacing[0], spacing[1]), rtol=rtol)
    return half, pressure


def _read(heights: Field, axis: int, places: Field, boundary: Boundary) -> Field:
    """Return the heights at places between the nodes along one axis."""
    nodes = heights.shape[axis]
    whole = places.astype(np.intp)
    if np.array_equal(whole, places):
        return np.ascontiguousarray(heights.take(whole, axis=axis))
    if boundary == "free":
        from scipy.interpolate import (
            make_interp_spline,
        )  # here, because few grids need it

        spline = make_interp_spline(np.arange(nodes), heights, 3, axis=axis)
        return np.ascontiguousarray(spline(places))
    if boundary == "periodic":
        waves = 2j * np.pi / nodes * (np.arange(nodes) - (nodes - 1) // 2)
        there, here = (np.exp(np.outer(x, waves)) for x in (places, np.arange(nodes)))
        kernel = (there @ here.conj().T).real / nodes
    else:
        waves = np.pi / nodes * np.arange(nodes)
        there, here = (
            np.cos(np.outer(x + 0.5, waves)) for x in (places, np.arange(nodes))
        )
        kernel = (there * np.where(waves == 0, 1.0, 2.0)) @ here.T / nodes
    read: Field = np.moveaxis(np.tensordot(kernel, heights, (1, axis)), 0, axis)
    return np.ascontiguousarray(read)
