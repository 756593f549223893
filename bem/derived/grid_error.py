"""Error bars of a contact's answers for the error of its grid, from a contact on a coarser grid.

The coarser grid has about every second node along both axes, and its contact costs a quarter of the
contact in question. Where both grids see the same surface, the difference of their answers bounds
the error of the finer one. Where roughness continues down to the grid, it shows that the answers
have no limit. A third grid of about every fourth node costs a sixteenth: the areas of two grids
agree by chance more often than those of three.

Errors fall with the square of the spacing on smooth surfaces, and in proportion to it where the
surface touches at creases, such as the ridges of a turned profile.

For two reasons the differences may still be small by chance, and each of them adds a part to the
bar. The first one is the place of the border within the cells: its part is proportional to the area
that counting nodes adds. The second one is the highest node, from which Delta counts: it is below
the summit of the surface by an unknown part of the height differences to its neighbours. How much a
higher summit changes the answers at a given Delta follows from the work W that the load has done: a
force F that grows with the power m of the approach d has W = F d / (m + 1), and W is known from
pressure and displacement.
"""

from __future__ import annotations  # short signatures in help()

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from bem.arrays import Field, Values
from bem.far_field import BeyondCriticalDelta
from bem.problem import Boundary, NoSolution, Problem, check_solvable
from bem.threads import computed_once

if TYPE_CHECKING:
    from bem.contact import Contact

# Factor on the differences between the grids' answers in a bar, by the answer [1]. It is chosen
# together with `AT_LEAST` on 1,300 contacts of waves, spheres and turned profiles, so that bars
# hold 93 to 99 % of the true errors; other kinds of surfaces test them.
OF_DIFFERENCE = {
    "area": 0.65,
    "delta": 0.80,
    "force": 0.80,
    "mean_gap": 0.70,
    "stiffness": 0.65,
}

# Further factor on these differences on a free patch. Its outer cells make grids differ in
# proportion to the spacing [1].
OF_OUTER_CELLS = 1.5

# Part of a bar for the place of the border, by the answer. It is relative to the answer, and to the
# share of the area that counting nodes adds (`GridError.counted`) [1].
AT_LEAST = {
    "area": 0.10,
    "delta": 0.0,
    "force": 0.0,
    "mean_gap": 0.02,
    "stiffness": 0.25,
}

# The same part where the surface touches at creases [1].
AT_LEAST_AT_CREASES = {
    "area": 1.0,
    "delta": 0.02,
    "force": 0.3,
    "mean_gap": 0.1,
    "stiffness": 0.5,
}

# Ratio of the mean squares of second differences over two nodes and over one, in contact, below
# which the surface touches at creases [1]. It is 16 on a smooth surface, 8 at creases, 11.7 where
# all waves have 8 nodes and 9 where they have 6.
OF_CREASES = 9.0

# Largest bar of the area at creases that counts as resolved [area].
LARGEST_AT_CREASES = 0.05

# Height of the summit above the highest node, over the sum of this node's second differences along
# both axes, on a surface whose errors fall in proportion to the spacing [1]. On a smooth surface,
# where they fall with its square, the height is a third of it (`GridError.remaining`).
OF_SUMMIT = 0.3

# Rate at which the power of the approach by which area and force rise, over its mean power, grows
# with the share of a patch without edges that is in contact [1]. On free patches it does not grow.
# The bar of the stiffness takes the resulting factor of `_steepening` twice.
STEEPENING = 2.0

# Least order in the spacing of the mean square slope of a surface whose waves end above the grid
# [1]. The order is 2 for waves much longer than a cell, 1 for sharp edges, negative for fractals.
LEAST_ORDER = 0.4

# Largest relative difference of the mean square slopes over two distances for which a surface is
# smooth [1]: its shortest waves have 60 nodes.
SMOOTH = 3e-3

# Largest relative difference of the areas on both grids for which the finer one is near the
# continuum [1].
LARGEST_DIFFERENCE = 0.3

# Largest share of the area beyond load / hardness for which yielding has decided the area, whatever
# waves there are below the grid [1].
NEARLY_YIELDED = 0.03

# Fewest nodes along an axis for which a grid of every second node tells an error.
FEWEST = 8

# Least tolerance of the coarser contact [Delta]: the errors that it allows are far below the
# difference from the finer contact. On 1,100 contacts the bars hold as many true errors as with
# 1e-4 (`python -m bench grid-error`).
COARSE_RTOL = 3e-3

# Bounds to which the order is cut off before it sets how much error remains after halving the
# spacing [1].
ORDERS = math.log2(1.4), 2.0

# Index of the lower node of the first pair between whose nodes slopes are measured, by the pair's
# distance [nodes]. With these indices, slopes over all three distances are around the same places.
FIRST_PLACE = {1: 2, 2: 1, 4: 0}


@dataclass(frozen=True, eq=False)
class GridError:
    """Half-widths of 90 % bars of a contact's answers, from the same contact on coarser grids.

    Attributes
    ----------
    verdicts : mapping of str to bool
        Whether the bar of an answer holds, by its name: "area", "delta", "force", "mean_gap",
        "stiffness".
    reason : str
        Reason why the bar of the area holds or does not hold, without a full stop.
    order : float
        Order in the spacing of the surface's mean square slope: 2 for smooth surfaces, negative
        where roughness continues down to the grid [1].
    remaining : float
        Error that remains over the error removed by halving the spacing, from 1/3 to 2.5 [1].
    creased : bool
        Whether the surface touches at creases, where errors fall in proportion to the spacing.
    summit : float
        Height by which the summit may be above the highest node; 0 where the problem has a datum
        of its own, from which Delta counts on every grid [um].
    growth : float
        Share by which a summit of this height makes area and force grow, 0 under a given load [1].
    counted : float
        Share of the area in the continuum that counting nodes adds [1].
    spare : float
        Share of the area beyond load / hardness, which is the least possible area [1].
    contact : Contact
        The contact whose answers are judged.
    coarse : Contact or None
        The same contact on about every second node, None if it has no solution.
    coarsest : Contact or None
        The same contact on about every fourth node, None if it has no solution or too few nodes.
    """

    verdicts: Mapping[str, bool]
    reason: str
    order: float
    remaining: float
    creased: bool
    summit: float
    growth: float
    counted: float
    spare: float
    contact: Contact = field(repr=False)
    coarse: Contact | None = field(repr=False)
    coarsest: Contact | None = field(repr=False)

    @property
    def resolved(self) -> bool:
        """Whether the grid resolves the surface, so that the bars of all answers hold."""
        return all(self.verdicts.values())

    @computed_once
    def area_percent(self) -> float:
        """Half-width of the bar of `Contact.continuum_area_percent` [%]."""
        spacing = self.contact.problem.spacing
        percent = self.contact.continuum_area_percent
        percent_per_area = percent / (area_within(self.contact) or 1.0)
        least = 0.0
        # Without a limit of the area, only load / hardness bounds it from below.
        if self.order < LEAST_ORDER and self.spare <= NEARLY_YIELDED:
            least = self.spare * percent
        return self._bar(
            "area",
            lambda contact: percent_per_area * area_within(contact, spacing),
            value=percent,
            at_least=max(least, self._opened.area_percent),
            by_summit=percent * self.growth,
        )

    @computed_once
    def delta(self) -> float:
        """Half-width of the bar of `Contact.delta`, 0 where Delta was given [um]."""
        if self.contact.problem.delta is not None:
            return 0.0
        return self._bar(
            "delta",
            lambda contact: contact.delta - contact.problem.datum_height,
            value=self.contact.delta,
            at_least=self._opened.gap,
            by_summit=self.summit,
        )

    @computed_once
    def force(self) -> float:
        """Half-width of the bar of `Contact.force`, 0 where the force was given [uN]."""
        if self.contact.problem.force is not None:
            return 0.0
        return self._bar(
            "force",
            lambda contact: contact.force,
            value=self.contact.force,
            by_summit=self.contact.force * self.growth,
        )

    @computed_once
    def mean_gap(self) -> float:
        """Half-width of the bar of `Contact.mean_gap` [um]."""
        by_summit = 0.0
        if self.contact.problem.delta is not None:
            # A higher summit moves the bodies apart, and the larger force deforms them more.
            displaced = self.growth * float(self.contact.displacement.mean())
            by_summit = self.summit - displaced
        return self._bar(
            "mean_gap",
            lambda contact: contact.mean_gap,
            value=self.contact.mean_gap,
            at_least=self._opened.gap,
            by_summit=by_summit,
        )

    @computed_once
    def stiffness(self) -> float:
        """Half-width of the bar of `Contact.stiffness` [MPa um].

        It takes one more linear solve on each grid.
        """
        stiffness = self.contact.stiffness
        if not math.isfinite(stiffness):  # full contact without edges
            return 0.0 if self._opened.area_percent == 0 else math.inf
        return self._bar(
            "stiffness",
            lambda contact: contact.stiffness,
            value=stiffness,
            by_summit=stiffness * self.growth * _steepening(self.contact),
        )

    @computed_once
    def _opened(self) -> _Opened:
        """What may open between the nodes of a full contact."""
        return _opened_between_nodes(self.contact)

    def _bar(
        self,
        name: str,
        answer: Callable[[Contact], float],
        *,
        value: float,
        at_least: float = 0.0,
        by_summit: float = 0.0,
    ) -> float:
        """Return the half-width of an answer's bar in its unit, infinite without a coarser contact.

        The difference to the second coarser grid is reduced to the error that would remain of it on
        the first one. Both differences are small by chance less often than one of them.

        Parameters
        ----------
        name : str
            Name of the answer.
        answer : callable
            Function that returns the answer of a contact.
        value : float
            The answer itself, of which the place of the border needs a share.
        at_least : float
            Least part of the bar, in the unit of the answer.
        by_summit : float
            Part of the bar for the place of the summit, in the unit of the answer.
        """
        if self.coarse is None:
            return math.inf
        is_free = self.contact.problem.boundary == "free"
        lowest_order, highest_order = ORDERS
        if self.creased or is_free:
            highest_order = 1.0
        reduction = 2 ** -min(max(self.order, lowest_order), highest_order)
        coarse_answer = answer(self.coarse)
        difference = answer(self.contact) - coarse_answer
        earlier = difference
        if self.coarsest is not None:
            coarsest_answer = answer(self.coarsest)
            if math.isfinite(coarsest_answer):  # the stiffness of full contact is not
                earlier = reduction * (coarse_answer - coarsest_answer)
        by_difference = math.hypot(difference, earlier)
        by_difference *= OF_DIFFERENCE[name] * max(1.0, self.remaining)
        if is_free:
            by_difference *= OF_OUTER_CELLS
        of_border = AT_LEAST_AT_CREASES if self.creased else AT_LEAST
        by_border = of_border[name] * self.counted * abs(value)
        return math.hypot(by_difference, max(by_border, at_least), by_summit)


@dataclass(frozen=True, eq=False)
class _Verdict:
    """Whether the bar of the area holds, and why.

    Attributes
    ----------
    resolved : bool
        Whether the bar of the area holds.
    reason : str
        Reason, without a full stop.
    """

    resolved: bool
    reason: str


@dataclass(frozen=True)
class _Opened:
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


def grid_error_of(contact: Contact, coarse: Contact | None = None) -> GridError:
    """Return the error bars of a contact, by solving it again on about every second node.

    It is solved once more on about every fourth node, where these are enough.

    Parameters
    ----------
    contact : Contact
        The contact.
    coarse : Contact, optional
        The same contact on about every second node if it is known, with its own bars; by default it
        is solved.

    Returns
    -------
    GridError
        The bars of its answers, infinite where the coarser contact has no solution.
    """
    problem = contact.problem
    order = slope_order(problem.heights, problem.boundary)
    lowest_order, highest_order = ORDERS
    creased = _touches_at_creases(contact)
    if creased:
        highest_order = 1.0
    # An error in proportion to spacing**p is 2**p times as large on the coarser grid.
    remaining = 1 / (2 ** min(max(order, lowest_order), highest_order) - 1)
    summit = 0.0
    if problem.datum is None:
        summit = OF_SUMMIT * remaining * _drop_from_highest(problem.heights)
    area = area_within(contact)
    spare = 1.0
    if problem.hardness is not None and area:
        spare = 1 - contact.force / problem.hardness / area
    percent = contact.continuum_area_percent
    counted = 0.0
    if percent:
        counted = abs(contact.area_percent / percent - 1)
    growth = 0.0
    if problem.delta is not None:
        growth = _growth(contact, summit)
    fault = ""
    coarsest = None
    if coarse is not None:
        coarsest = coarse.grid_error().coarse
    else:
        coarse, fault = _on_half_of_the_nodes(contact, summit)
        if coarse is not None:
            # The coarsest contact is compared only: its summit needs no check.
            coarsest, _ = _on_half_of_the_nodes(coarse, summit=0.0)
    # Judging the bars needs the bars, so that the verdicts are filled in afterwards.
    error = GridError(
        verdicts={},
        reason=fault,
        order=order,
        remaining=remaining,
        creased=creased,
        summit=summit,
        growth=growth,
        counted=counted,
        spare=spare,
        contact=contact,
        coarse=coarse,
        coarsest=coarsest,
    )
    verdict = _Verdict(resolved=False, reason=fault)
    if coarse is not None:
        verdict = _judged(error, coarse)
    verdicts = dict.fromkeys(OF_DIFFERENCE, verdict.resolved)
    if spare <= NEARLY_YIELDED or error._opened.area_percent > 0:
        # Where the hardness decides the area, or a full contact may open between nodes, the
        # stiffness still depends on spots that the grid does not show.
        verdicts["stiffness"] = False
    return replace(error, verdicts=verdicts, reason=verdict.reason)


def _touches_at_creases(contact: Contact) -> bool:
    """Return whether slopes jump at single nodes where the surface touches.

    On a smooth surface the sum of the squares of second differences over two nodes is 16 times that
    over one. At creases it is 8 times: those over two are twice as large, and twice as many. The
    axis with the larger sum over one node decides.
    """
    heights = contact.problem.heights
    rows, columns = np.nonzero(contact.pressure > 0)
    sums: list[tuple[float, float]] = []
    for axis, lines in ((0, heights), (1, heights.T)):
        along, across = (rows, columns) if axis == 0 else (columns, rows)
        nodes = lines.shape[0]
        if nodes < FEWEST:
            continue
        if contact.problem.boundary != "periodic":  # pairs beyond a border are unknown
            inside = (along >= 2) & (along < nodes - 2)
            along, across = along[inside], across[inside]
        squares = []
        for distance in (1, 2):
            before = lines[along - distance, across]
            after = lines[(along + distance) % nodes, across]
            second = before + after - 2 * lines[along, across]
            squares.append(float(second @ second))
        sums.append((squares[0], squares[1]))
    over_one, over_two = max(sums, default=(0.0, 0.0))
    rounding = (1e-13 * float(np.ptp(heights))) ** 2 * heights.size
    return over_one > rounding and over_two < OF_CREASES * over_one


def _opened_between_nodes(contact: Contact) -> _Opened:
    """Return what may open between the nodes of a full contact without edges.

    The pressure of a full contact is a sum of waves. Where it is negative between nodes, the
    surfaces part. A round pit of the pressure opens 1.5 times, a long one twice, the area over
    which the pressure of full contact is negative. Its gap is at most that of one round crack of
    the whole open area.
    """
    from scipy import fft  # here, because few contacts need it

    problem = contact.problem
    nodes = problem.heights.shape
    is_full = contact.contact_nodes == problem.heights.size
    if not is_full or problem.boundary == "free" or problem.hardness is not None:
        return _Opened(0.0, 0.0)
    pressure = contact.pressure
    for axis in (0, 1):
        twice = 2 * nodes[axis]
        lines = np.moveaxis(pressure, axis, -1)
        if problem.boundary == "periodic":
            between = fft.irfft(fft.rfft(lines, norm="forward"), twice, norm="forward")
        else:
            between = fft.idct(fft.dct(lines, norm="forward"), n=twice, norm="forward")
        pressure = np.moveaxis(np.asarray(between, dtype=np.float64), -1, axis)
    # A pressure of rounding alone is no tension.
    negative = np.minimum(pressure + 1e-12 * contact.pressure.max(), 0.0)
    share = 2 * float(np.mean(negative < 0))
    side = math.prod(problem.spacing) * problem.heights.size
    radius = math.sqrt(share * side / math.pi)
    gap = 8 / 3 * radius * float(-negative.mean()) / problem.modulus
    return _Opened(100 * min(share, 1.0), gap)


def _drop_from_highest(heights: Field) -> float:
    """Return by how much the highest node is above its neighbours, never negative [um].

    It is the sum of 2 z - z_before - z_after over both axes. At a border the inner neighbour counts
    twice, on every kind of patch.
    """
    row, column = np.unravel_index(int(heights.argmax()), heights.shape)
    drop = 0.0
    for line, place in ((heights[:, column], row), (heights[row], column)):
        neighbours = np.pad(line, 1, mode="reflect")[[place, place + 2]]
        drop += float(2 * line[place] - neighbours.sum())
    return drop


def _on_half_of_the_nodes(contact: Contact, summit: float) -> tuple[Contact | None, str]:
    """Return a contact on about every second node, or None and the reason why there is none.

    `summit` is the height by which the summit may be above the highest node [um].
    """
    nodes = contact.problem.heights.shape
    if min(nodes) < FEWEST:
        return None, f"{nodes[0]} x {nodes[1]} nodes are too few to tell"
    try:
        return _solve_coarser(contact, summit), ""
    except (BeyondCriticalDelta, ArithmeticError) as error:
        return None, f"half of the nodes: {error}"
    except NoSolution:
        return None, "half of the nodes are in full contact"


def _too_coarse_to_judge(contact: Contact, area: float) -> str:
    """Return why no coarser grid can tell the error of an area [um^2], or "" if one can."""
    if not contact.problem.is_deeper_than_cells:
        return "a cell is no smaller than the layer, whose material rules at the border"
    if area == 0 and contact.force > 0:
        return "no spot of contact is as large as a cell of the grid"
    return ""


def _judged(error: GridError, coarse: Contact) -> _Verdict:
    """Judge by the areas on both grids whether the bar of the area holds.

    The first reason counts.
    """
    contact = error.contact
    area = area_within(contact)
    coarse_area = area_within(coarse, contact.problem.spacing)
    too_coarse = _too_coarse_to_judge(contact, area)
    if too_coarse:
        return _Verdict(resolved=False, reason=too_coarse)
    if area:
        change = coarse_area / area - 1
    elif coarse_area > 0:  # nothing touches here: any area counts as 100 % more
        change = 1.0
    else:
        change = 0.0
    comparison = _in_words(change)
    if error.spare <= NEARLY_YIELDED:
        borne = f"{100 * (1 - error.spare):.3g} %"
        reason = f"yielding decides it: load / hardness alone is {borne} of this area"
        return _Verdict(resolved=True, reason=reason)
    if error.order < LEAST_ORDER:
        reason = "waves go on down to the grid, so that the area has no limit"
        return _Verdict(resolved=False, reason=f"{reason}: {comparison}")
    if abs(change) > LARGEST_DIFFERENCE:
        reason = "too few nodes in a wave, or in contact"
        return _Verdict(resolved=False, reason=f"{reason}: {comparison}")
    if error.creased:
        largest = LARGEST_AT_CREASES * contact.continuum_area_percent
        # A full contact may open at creases, between any nodes.
        is_full = contact.contact_nodes == contact.pressure.size
        reason = f"it touches at creases or at waves of few nodes: {comparison}"
        resolved = not is_full and error.area_percent <= largest
        return _Verdict(resolved=resolved, reason=reason)
    return _Verdict(resolved=True, reason=comparison)


def _in_words(change: float) -> str:
    """Say how the area on half of the nodes compares.

    `change` is the difference relative to the area on all nodes.
    """
    percent = float(f"{100 * abs(change):.2g}")
    if percent <= 1e-9:  # rounding
        return "half of the nodes give the same area"
    if change > 0:
        return f"half of the nodes give {percent:g} % more area"
    return f"half of the nodes give {percent:g} % less area"


def _solve_coarser(contact: Contact, summit: float) -> Contact:
    """Solve a contact on about every second node.

    A problem with a datum, a height other than the highest node's from which Delta counts, keeps
    this height and its load. Otherwise a given force is kept, or a given Delta is reduced by what
    the highest node of the coarser grid is lower, so that the far field stays in its place.

    Raise NoSolution at a given Delta at which the coarser grid would be in full contact; without a
    datum, at which a grid would be whose summit is higher by `summit` [um]. Raise
    BeyondCriticalDelta, a NoSolution, if Delta is not below Delta* of the coarser surface on a
    compliant far field. ArithmeticError passes through.
    """
    problem = contact.problem
    half, near = coarser(problem, contact.pressure)
    if problem.datum is not None:
        half = replace(half, datum=problem.datum_height - float(half.heights.max()))
        check_solvable(half)
    elif problem.delta is None:
        half = replace(half, delta=None, force=contact.force)
    else:
        lost = float(problem.heights.max() - half.heights.max())
        half = replace(half, delta=contact.delta - lost, force=None)
        # This summit is in full contact earlier, so that `half` needs no check of its own.
        higher = replace(half, delta=contact.delta - lost + summit)
        check_solvable(higher)
    is_full = contact.contact_nodes == problem.heights.size
    if is_full and half.boundary != "free":
        return contact.again(half, None)  # it is full too, and needs no start
    return contact.again(half, near)


def _growth(contact: Contact, summit: float) -> float:
    """Return the share by which a higher summit [um] makes area and force grow at a given Delta."""
    if contact.force == 0:
        return 0.0
    heights = contact.problem.heights
    approach = contact.approach
    touching = contact.pressure > 0
    pressure = contact.pressure[touching]
    displaced = (
        heights[touching] - contact.problem.datum_height
    ) / approach + 1  # [approach]
    if contact.problem.hardness is not None:
        displaced += contact.yielded_depth[touching] / approach
    work = float(np.average(displaced, weights=pressure / pressure.max())) / 2  # [F d]
    power = _steepening(contact) * (1 / work - 1)
    # A compliant far field gives way to the larger force, by which the approach grows further.
    given_way = power * (1 - contact.delta / approach)
    return power * summit / approach / max(1 - given_way, 1e-3)


def _steepening(contact: Contact) -> float:
    """Return the power of the force's growth over its mean power: above 1 as a patch fills [1]."""
    if contact.problem.boundary == "free":
        return 1.0
    return 1 + STEEPENING * contact.area_percent / 100


def area_within(contact: Contact, spacing: tuple[float, float] | None = None) -> float:
    """Return the area of contact in the continuum.

    Cells at the borders of a free patch reach half a spacing beyond its nodes. To compare a coarser
    grid with a finer one, its border cells can be counted only as far as those of the finer one.
    Grids with a datum of their own cover the same patch, see `coarser`.

    Parameters
    ----------
    contact : Contact
        The contact.
    spacing : tuple of float, optional
        Spacing along both axes of the grid that bounds the area, by default the contact's own grid
        [um].

    Returns
    -------
    float
        Area [um2].
    """
    cell = contact.problem.spacing
    area = (
        contact.continuum_area_percent / 100 * contact.pressure.size * cell[0] * cell[1]
    )
    problem = contact.problem
    if spacing is None or problem.boundary != "free" or problem.datum is not None:
        return area
    touching = contact.pressure > 0
    for axis in (0, 1):
        border_nodes = int(np.count_nonzero(touching.take([0, -1], axis)))
        area -= border_nodes * (cell[axis] - spacing[axis]) / 2 * cell[1 - axis]
    return max(area, 0.0)


def slope_order(heights: Field, boundary: Boundary, lines: int | None = None) -> float:
    """Return the order in the spacing of a surface's mean square slope.

    It compares the slopes between nodes that are one, two and four spacings apart.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights of the surface [um].
    boundary : str
        "free", "periodic" or "mirror", see `bem.solve`.
    lines : int, optional
        Number of lines along each axis, about, on which slopes are measured; by default all of
        them.

    Returns
    -------
    float
        The smaller order of both axes; infinite if the surface is smooth along both, or has fewer
        than `FEWEST` nodes along them [1].
    """
    orders = []
    for all_lines in (heights, heights.T):
        if len(all_lines) < FEWEST:
            continue
        sampled = all_lines
        if lines is not None:
            sampled = all_lines[:, :: max(1, all_lines.shape[1] // lines)]
        slopes = [
            _mean_square_slope(sampled, distance, periodic=boundary == "periodic")
            for distance in FIRST_PLACE
        ]
        near = abs(slopes[0] - slopes[1])
        far = abs(slopes[1] - slopes[2])
        if max(near, far) > SMOOTH * slopes[0]:
            orders.append(math.log2(max(far, 1e-300) / max(near, 1e-300)))
    return min(orders, default=math.inf)


def _mean_square_slope(lines: Field, distance: int, *, periodic: bool) -> float:
    """Return the mean square slope between nodes at a distance along the first axis [um2/node2]."""
    nodes, columns = lines.shape
    if periodic:
        rise = np.roll(lines, -distance, axis=0) - lines
    else:
        first = FIRST_PLACE[distance]
        rise = (
            lines[first + distance : nodes - first]
            - lines[first : nodes - first - distance]
        )
    squares = np.einsum("ij,ij->i", rise, rise) / columns
    total = squares.sum()
    count = squares.size
    if distance > 1 and not periodic:
        # Half of the first and of the last pair is beyond the places of pairs of neighbours.
        total -= (squares[0] + squares[-1]) / 2
        count -= 1
    return float(total) / int(count) / distance**2


def coarser(problem: Problem, pressure: Field) -> tuple[Problem, Field]:
    """Return the same problem on about every second node along each axis, and a pressure there.

    The coarser grid consists of nodes of the finer one where every second node covers the patch:
    with an even number of nodes on a patch that repeats itself, with an odd one on a free patch.
    Otherwise the surface is read between its nodes: by its own waves where the patch has no edges,
    by cubic splines on free patches. The outer nodes of a free patch stay on its border, so that
    its outer cells reach further beyond it. Where the problem has a datum of its own, the cells of
    both grids cover the same patch instead.

    Parameters
    ----------
    problem : Problem
        The problem.
    pressure : ndarray, shape (nx, ny)
        Contact pressure at the problem's nodes [MPa].

    Returns
    -------
    problem : Problem
        The problem on the coarser grid, with a tolerance of at least `COARSE_RTOL` and the same
        load.
    pressure : ndarray, shape of the coarser heights
        Pressure at the finer grid's nodes nearest to the coarser ones [MPa].
    """
    heights = problem.heights
    spacing = list(problem.spacing)
    for axis in (0, 1):
        nodes = heights.shape[axis]
        if nodes == 1:  # there is nothing to halve
            continue
        on_border = problem.boundary == "free" and problem.datum is None
        centred = problem.boundary != "periodic"
        places = _coarser_places(nodes, on_border=on_border, centred=centred)
        heights = _read(heights, axis, places, problem.boundary)
        pressure = pressure.take(np.rint(places).astype(np.intp), axis)
        spacing[axis] *= places[1] - places[0]
    if problem.kernel == "concentrated-force":  # it needs square cells, to the last digit
        spacing = [float(np.sqrt(spacing[0] * spacing[1]))] * 2
    half = replace(
        problem,
        heights=heights,
        spacing=(spacing[0], spacing[1]),
        rtol=max(problem.rtol, COARSE_RTOL),
    )
    return half, pressure


def _coarser_places(nodes: int, *, on_border: bool, centred: bool) -> Values:
    """Return the places of the coarser grid's nodes along an axis, (m,) [spacing].

    The outer nodes of both grids are `on_border`, or all nodes are centres of cells that cover the
    same length: `centred` cells begin half a spacing before the first node, on both grids, and
    otherwise the first nodes of both are the same.
    """
    number = (nodes + 1) // 2
    places: Values = np.arange(number, dtype=np.float64)
    if on_border:
        places *= (nodes - 1) / (number - 1)
        return places
    step = nodes / number
    places *= step
    if centred:
        places += 0.5 * step - 0.5
    return places


def _read(heights: Field, axis: int, places: Values, boundary: Boundary) -> Field:
    """Return the heights [um] at places [spacing] along one axis, which may be between nodes."""
    nodes = heights.shape[axis]
    indices = places.astype(np.intp)
    if np.array_equal(indices, places):  # all places are nodes
        return np.ascontiguousarray(heights.take(indices, axis=axis))
    if boundary == "free":
        # Imported here, because few grids need it.
        from scipy.interpolate import make_interp_spline

        spline = make_interp_spline(np.arange(nodes), heights, 3, axis=axis)
        return np.ascontiguousarray(spline(places))
    weights = _wave_interpolation(nodes, places, boundary)
    read: Field = np.moveaxis(np.tensordot(weights, heights, (1, axis)), 0, axis)
    return np.ascontiguousarray(read)


def _wave_interpolation(nodes: int, places: Values, boundary: Boundary) -> Field:
    """Return weights of the nodes in the values at places, by trigonometric interpolation, (m, n).

    The waves have the period of a patch that repeats itself, or are cosines on a mirrored one.
    """
    at_nodes = np.arange(nodes)
    weights: Field
    if boundary == "periodic":
        exponents = 2j * np.pi / nodes * (at_nodes - (nodes - 1) // 2)
        waves = np.exp(np.outer(places, exponents))
        node_waves = np.exp(np.outer(at_nodes, exponents))
        weights = (waves @ node_waves.conj().T).real / nodes
        return weights
    numbers = np.pi / nodes * at_nodes
    cosines = np.cos(np.outer(places + 0.5, numbers))
    node_cosines = np.cos(np.outer(at_nodes + 0.5, numbers))
    weights = (cosines * np.where(numbers == 0, 1.0, 2.0)) @ node_cosines.T / nodes
    return weights
