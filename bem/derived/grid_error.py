"""Error bars of a contact's answers for the error of its grid, from a contact on a coarser grid.

The coarser grid has about every second node along both axes, and its contact costs a quarter of the
contact in question. Where both grids see the same surface, the difference of their answers bounds
the error of the finer one. Where roughness continues down to the grid, it shows that the answers
have no limit.

Errors fall with the square of the spacing on smooth surfaces, and in proportion to it where the
surface touches at creases, such as the ridges of a turned profile.

For two reasons the difference may still be small by chance, and each of them adds parts to the bar.
The first one is the place of the border within the cells: its parts follow from the signs of
`bem.derived.border_signs`, and from what a single node is of all nodes. The second one is the
highest node, from which Delta counts: it is below the summit of the surface. On a smooth surface
the quadric through this node and its neighbours tells by how much. How much a higher summit changes
the answers at a given Delta follows from the work W that the load has done: a force F that grows
with the power m of the approach d has W = F d / (m + 1), and W is known from pressure and
displacement.

All parts add in squares. Their weights (`bem.derived.bar_weights`) are fitted, by the answer and by
the kind of surface.
"""

from __future__ import annotations  # short signatures in help()

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from bem.arrays import Field, Nodes
from bem.derived.bar_weights import WEIGHTS
from bem.derived.border_signs import BorderSigns, border_signs
from bem.derived.coarser import at_coarser_nodes, coarser
from bem.derived.opened import Opened, opened_unseen
from bem.far_field import BeyondCriticalDelta
from bem.problem import Boundary, NoSolution, check_solvable
from bem.threads import computed_once

if TYPE_CHECKING:
    from bem.contact import Contact


# Ratio of the mean squares of second differences over two nodes and over one, in contact, below
# which the surface touches at creases [1]. It is 16 on a smooth surface, 8 at creases, 11.7 where
# all waves have 8 nodes and 9 where they have 6.
OF_CREASES = 9.0

# Ratio below which the surface touches at creases if the ratio of the mean squares over four nodes
# and over two is above the second number [1]. At creases the latter is 8, too. Where all waves have
# 6 or 8 nodes it is 1 or 4, and at most 5.4 on the surfaces to which the weights were fitted.
OF_BLUNT_CREASES = 10.5
FROM_TWO_TO_FOUR = 5.8

# Least error that remains on a free patch without a datum, over the one removed by halving the
# spacing [1]. The outer cells of the coarser grid reach further there, which adds an error in
# proportion to the spacing.
ON_LARGER_CELLS = 1.4

# Largest bar of the area at creases that counts as resolved [area].
LARGEST_AT_CREASES = 0.05

# Height by which the summit may be above the highest node at creases, over the sum of this node's
# second differences along both axes [1].
OF_DROP_AT_CREASES = 0.3

# Greatest height of the quadric through the highest node and its neighbours over that sum [1]. No
# neighbour is higher than the node.
STEEPEST_SUMMIT = 0.25

# Least determinant of the second differences over the square of their sum, 1/4 for a round summit,
# below which a summit is the crest of a ridge [1].
FLATTEST_SUMMIT = 1e-3

# Answers that depend on the open nodes as much as on those in contact. Near full contact few nodes
# are open, so that the border is a large share of them.
OF_OPEN_NODES = ("delta", "force", "mean_gap", "stiffness")

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

# Bounds to which the order is cut off before it sets how much error remains after halving the
# spacing [1].
ORDERS = math.log2(1.4), 2.0

# Index of the lower node of the first pair between whose nodes slopes are measured, by the pair's
# distance [nodes]. With these indices, slopes over all three distances are around the same places.
FIRST_PLACE = {1: 2, 2: 1, 4: 0}


@dataclass(frozen=True, eq=False)
class GridError:
    """Half-widths of 90 % bars of a contact's answers, from the same contact on a coarser grid.

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
        Height of the summit above the highest node; 0 where the problem has a datum of its own,
        from which Delta counts on every grid [um].
    growth : float
        Share by which a summit of this height makes area and force grow, 0 under a given load [1].
    border : BorderSigns
        Signs of the errors by the border of contact.
    yielded_share : float
        Share of the nodes in contact that has yielded [1].
    spare : float
        Share of the area beyond load / hardness, which is the least possible area [1].
    contact : Contact
        The contact whose answers are judged.
    coarse : Contact or None
        The same contact on about every second node, None if it has no solution.
    """

    verdicts: Mapping[str, bool]
    reason: str
    order: float
    remaining: float
    creased: bool
    summit: float
    growth: float
    border: BorderSigns
    yielded_share: float
    spare: float
    contact: Contact = field(repr=False)
    coarse: Contact | None = field(repr=False)

    @property
    def kind(self) -> str:
        """Kind of the surface, by which the weights of the bars are chosen: a key of `WEIGHTS`."""
        if self.creased:
            return "creased"
        if self.contact.problem.boundary == "free":
            return "free"
        return "edgeless"

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
        lower_bound = 0.0
        # Without a limit of the area, only load / hardness bounds it from below.
        if self.order < LEAST_ORDER and self.spare <= NEARLY_YIELDED:
            lower_bound = self.spare * percent
        return self._bar(
            "area",
            lambda contact: percent_per_area * area_within(contact, spacing),
            value=percent,
            at_least=max(lower_bound, self._opened.area_percent),
            by_outer_nodes=percent * self._area_by_outer_nodes,
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
            by_work=self.border.work,
            by_open_scatter=self._gap_by_scatter,
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
            by_outer_nodes=self.contact.force * self.border.outer,
            by_summit=self.contact.force * self.growth,
        )

    @computed_once
    def mean_gap(self) -> float:
        """Half-width of the bar of `Contact.mean_gap` [um]."""
        contact = self.contact
        by_work = self.border.work
        by_open_scatter = self._gap_by_scatter
        by_summit = 0.0
        if contact.problem.delta is not None:
            # A higher summit moves the bodies apart, and the larger force deforms them more.
            displaced = self.growth * float(contact.displacement.mean())
            by_summit = self.summit - displaced
            if contact.problem.boundary != "free":
                # Without edges the mean gap follows from Delta alone.
                by_work = 0.0
                by_open_scatter = 0.0
        gap_of_open_nodes = contact.mean_gap * contact.pressure.size / self._open_nodes
        return self._bar(
            "mean_gap",
            lambda contact: contact.mean_gap,
            value=contact.mean_gap,
            at_least=self._opened.gap,
            by_outer_nodes=gap_of_open_nodes * self.border.outer,
            by_work=by_work,
            by_open_scatter=by_open_scatter,
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
            by_outer_nodes=stiffness * self.border.outer,
            by_summit=stiffness * self.growth * _steepening(self.contact),
        )

    @property
    def _least_remaining(self) -> float:
        """Least of `remaining` that counts for the bars [1]."""
        problem = self.contact.problem
        if problem.boundary == "free" and problem.datum is None:
            return ON_LARGER_CELLS
        return 1.0

    @property
    def _open_nodes(self) -> int:
        """Number of open nodes, at least 1."""
        return max(self.contact.pressure.size - self.contact.contact_nodes, 1)

    @property
    def _gap_by_scatter(self) -> float:
        """Mean gap times the scatter of the border as a share of the open nodes [um]."""
        contact = self.contact
        scatter = self.border.scatter * contact.contact_nodes / self._open_nodes
        return contact.mean_gap * scatter

    @property
    def _area_by_outer_nodes(self) -> float:
        """Share of the area by which the border moves if the outer nodes change the approach.

        They change it in proportion to their share, less the settlement of a body below. The border
        moves by this change over the gap beside it, in nodes.
        """
        if self.border.gap == 0:
            return 0.0
        contact = self.contact
        change = self.border.outer * contact.approach / contact.problem.settlement_ratio
        return self.border.share * change / self.border.gap

    @computed_once
    def _opened(self) -> Opened:
        """What may open in a full contact where its nodes do not show it."""
        return opened_unseen(self.contact.problem, self.contact.pressure)

    def _bar(
        self,
        name: str,
        answer: Callable[[Contact], float],
        *,
        value: float,
        at_least: float = 0.0,
        by_outer_nodes: float = 0.0,
        by_work: float = 0.0,
        by_open_scatter: float = 0.0,
        by_summit: float = 0.0,
    ) -> float:
        """Return the half-width of an answer's bar in its unit, infinite without a coarser contact.

        Parameters
        ----------
        name : str
            Name of the answer.
        answer : callable
            Function that returns the answer of a contact.
        value : float
            The answer itself, of which the place of the border needs a share.
        at_least : float
            Least part of the bar for the place of the border, in the unit of the answer.
        by_outer_nodes : float
            Part of the bar for the outer nodes of a free patch, in the unit of the answer.
        by_work : float
            Part of the bar for the work of the border, in the unit of the answer.
        by_open_scatter : float
            Part of the bar for the scatter of the border among the open nodes, in the unit of the
            answer.
        by_summit : float
            Part of the bar for the place of the summit, in the unit of the answer.
        """
        if self.coarse is None:
            return math.inf
        weights = WEIGHTS[self.kind][name]
        difference = answer(self.contact) - answer(self.coarse)
        deciding_nodes = max(self.contact.contact_nodes, 1)
        by_border = abs(value)
        if name in OF_OPEN_NODES:
            deciding_nodes = self._open_nodes
            by_border *= self.contact.pressure.size / deciding_nodes
        by_node = 0.0
        if self.border.share > 0:  # full contact and no contact have none
            by_node = abs(value) / deciding_nodes
        share = self.border.share * math.sqrt(self.contact.problem.elongation)
        yielded_scatter = self.border.least_scatter * self.yielded_share
        return math.hypot(
            weights.difference * max(self._least_remaining, self.remaining) * difference,
            max(weights.border * share * by_border, at_least),
            weights.scatter * self.border.scatter * by_border,
            weights.yielded * yielded_scatter * by_border,
            weights.outer * by_outer_nodes,
            weights.work * by_work,
            weights.open_scatter * by_open_scatter,
            weights.node * by_node,
            weights.summit * by_summit,
        )


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


def grid_error_of(contact: Contact, coarse: Contact | None = None) -> GridError:
    """Return the error bars of a contact, by solving it again on about every second node.

    Parameters
    ----------
    contact : Contact
        The contact.
    coarse : Contact, optional
        The same contact on about every second node if it is known; by default it is solved.

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
        summit = _summit(problem.heights, problem.boundary, creased=creased)
    area = area_within(contact)
    spare = 1.0
    if problem.hardness is not None and area:
        spare = 1 - contact.force / problem.hardness / area
    growth = 0.0
    if problem.delta is not None:
        growth = _growth(contact, summit)
    fault = ""
    if coarse is None:
        coarse, fault = _on_half_of_the_nodes(contact, summit)
    border = border_signs(
        contact.pressure, contact.gap, problem.heights, problem.boundary
    )
    yielded = int(np.count_nonzero(contact.yielded))
    # Judging the bars needs the bars, so that the verdicts are filled in afterwards.
    error = GridError(
        verdicts={},
        reason=fault,
        order=order,
        remaining=remaining,
        creased=creased,
        summit=summit,
        growth=growth,
        border=border,
        yielded_share=yielded / max(contact.contact_nodes, 1),
        spare=spare,
        contact=contact,
        coarse=coarse,
    )
    verdict = _Verdict(resolved=False, reason=fault)
    if coarse is not None:
        verdict = _judged(error, coarse)
    verdicts = dict.fromkeys(WEIGHTS[error.kind], verdict.resolved)
    if spare <= NEARLY_YIELDED or error._opened.area_percent > 0:
        # Where the hardness decides the area, or a full contact may open unseen, the
        # stiffness still depends on spots that the grid does not show.
        verdicts["stiffness"] = False
    return replace(error, verdicts=verdicts, reason=verdict.reason)


def _touches_at_creases(contact: Contact) -> bool:
    """Return whether slopes jump at single nodes where the surface touches.

    On a smooth surface the sum of the squares of second differences over two nodes is 16 times that
    over one. At creases it is 8 times: those over two are twice as large, and twice as many. The
    same holds for the sums over four nodes and over two. These tell blunt creases from short waves.
    The axis with the larger sum over one node decides.
    """
    problem = contact.problem
    heights = problem.heights
    is_periodic = problem.boundary == "periodic"
    rows, columns = np.nonzero(contact.pressure > 0)
    sections = [
        _Section(heights, along=rows, across=columns, is_periodic=is_periodic),
        _Section(heights.T, along=columns, across=rows, is_periodic=is_periodic),
    ]
    sections = [section for section in sections if section.lines.shape[0] >= FEWEST]
    if not sections:
        return False
    section = max(sections, key=lambda section: section.squared_bends(1, reach=2))
    over_one = section.squared_bends(1, reach=2)
    over_two = section.squared_bends(2, reach=2)
    rounding = (1e-13 * float(np.ptp(heights))) ** 2 * heights.size
    if over_one <= rounding or over_two >= OF_BLUNT_CREASES * over_one:
        return False
    if over_two < OF_CREASES * over_one:
        return True
    over_four = section.squared_bends(4, reach=4)
    return over_four > FROM_TWO_TO_FOUR * section.squared_bends(2, reach=4)


@dataclass(frozen=True, eq=False)
class _Section:
    """The lines of a surface along one axis, and the nodes where they touch.

    Attributes
    ----------
    lines : ndarray, shape (n, k)
        Heights; the first axis is the one along the lines [um].
    along, across : ndarray, shape (m,)
        Indices of the nodes in contact along both axes of `lines`.
    is_periodic : bool
        Whether the lines continue periodically.
    """

    lines: Field
    along: Nodes
    across: Nodes
    is_periodic: bool

    def squared_bends(self, distance: int, *, reach: int) -> float:
        """Sum the squares of second differences around the nodes in contact [um2].

        The other two nodes of a difference are at a distance from each node. Without periodicity,
        only nodes count that are `reach` nodes or more from both ends of their line.
        """
        nodes = self.lines.shape[0]
        along = self.along
        across = self.across
        if not self.is_periodic:
            is_inside = (along >= reach) & (along < nodes - reach)
            along = along[is_inside]
            across = across[is_inside]
        before = self.lines[along - distance, across]
        after = self.lines[(along + distance) % nodes, across]
        bend = before + after - 2 * self.lines[along, across]
        return float(bend @ bend)


def _summit(heights: Field, boundary: Boundary, *, creased: bool) -> float:
    """Return the height by which the summit may be above the highest node, never negative [um].

    On a smooth surface it is the height of the quadric through the highest node and its neighbours.
    At creases it is a share of the height differences to them. The surface is continued
    periodically on a periodic patch, and by its mirror image beyond the borders of other patches.
    """
    row, column = np.unravel_index(int(heights.argmax()), heights.shape)
    mode: Literal["wrap", "symmetric"] = "symmetric"
    if boundary == "periodic":
        mode = "wrap"
    around = np.pad(heights, 1, mode)[row : row + 3, column : column + 3]
    around = around - around[1, 1]
    drop = -float(around[[0, 2, 1, 1], [1, 1, 0, 2]].sum())
    if drop == 0:
        return 0.0
    if creased:
        return OF_DROP_AT_CREASES * drop
    around /= drop
    slopes = np.array([around[2, 1] - around[0, 1], around[1, 2] - around[1, 0]]) / 2
    twist = float(around[2, 2] + around[0, 0] - around[2, 0] - around[0, 2]) / 4
    bends = np.array(
        [[-around[0, 1] - around[2, 1], -twist], [-twist, -around[1, 0] - around[1, 2]]]
    )
    if np.linalg.det(bends) > FLATTEST_SUMMIT:
        rise = float(slopes @ np.linalg.solve(bends, slopes)) / 2
    else:  # a ridge rises across its crest alone
        rise = float(slopes @ slopes) / 2
    return min(rise, STEEPEST_SUMMIT) * drop


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

    Of several reasons the first one decides.
    """
    contact = error.contact
    area = area_within(contact)
    coarse_area = area_within(coarse, contact.problem.spacing)
    too_coarse = _too_coarse_to_judge(contact, area)
    if too_coarse:
        return _Verdict(resolved=False, reason=too_coarse)
    if area:
        change = coarse_area / area - 1
    elif coarse_area > 0:  # nothing touches on the finer grid: any area is 100 % more
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
    """Return a comparison of the area on half of the nodes with that on all nodes, in words.

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

    If the problem has a datum, the coarser one keeps the height from which Delta counts, and the
    load. Otherwise a given force is kept. A given Delta is reduced by the difference between the
    highest nodes of both grids, so that the far field stays in its place.

    Raise NoSolution at a given Delta if the coarser grid would be in full contact. Without a datum,
    raise it also if a coarser grid would be whose summit is higher by `summit` [um]. Raise
    BeyondCriticalDelta, a NoSolution, if Delta is not below Delta* of the coarser surface on a
    compliant far field. ArithmeticError passes through.
    """
    problem = contact.problem
    half = coarser(problem)
    near = at_coarser_nodes(problem, contact.pressure)
    if problem.datum is not None:
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


def part_of_border(contact: Contact, name: str) -> float:
    """Return the part of an answer's bar for the place of the border, over the answer.

    It is half as large on twice the nodes a side, so that it tells the least bar of a finer grid.

    Parameters
    ----------
    contact : Contact
        A contact of at least one node, on a surface without creases.
    name : str
        Name of an answer, which does not depend on the open nodes.

    Returns
    -------
    float
        Share [1].
    """
    kind = "free" if contact.problem.boundary == "free" else "edgeless"
    border = sum(contact.border_edges) / contact.contact_nodes
    return WEIGHTS[kind][name].border * border


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


def slope_order(heights: Field, boundary: Boundary) -> float:
    """Return the order in the spacing of a surface's mean square slope.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights of the surface [um].
    boundary : str
        "free", "periodic" or "mirror", see `bem.solve`.

    Returns
    -------
    float
        Order, see `slope_order_of_lines` [1].
    """
    return slope_order_of_lines((heights, heights.T), boundary)


def slope_order_of_lines(lines: tuple[Field, Field], boundary: Boundary) -> float:
    """Return the order in the spacing of the mean square slope of lines of a surface.

    It compares the slopes between nodes that are one, two and four spacings apart.

    Parameters
    ----------
    lines : tuple of ndarray, shapes (nx, k) and (ny, m)
        Lines along both axes, whose nodes follow each other along the arrays' first axis [um].
    boundary : str
        "free", "periodic" or "mirror", see `bem.solve`.

    Returns
    -------
    float
        The smaller order of both axes; infinite if the surface is smooth along both, or has fewer
        than `FEWEST` nodes along them [1].
    """
    orders = []
    for lines_of_axis in lines:
        if len(lines_of_axis) < FEWEST:
            continue
        slopes = [
            _mean_square_slope(lines_of_axis, distance, periodic=boundary == "periodic")
            for distance in FIRST_PLACE
        ]
        orders.append(order_of_slopes(*slopes))
    return min(orders, default=math.inf)


def order_of_slopes(over_one: float, over_two: float, over_four: float) -> float:
    """Return the order in the spacing of mean square slopes between nodes.

    Parameters
    ----------
    over_one, over_two, over_four : float
        Mean square slopes over one, two and four spacings, in any unit.

    Returns
    -------
    float
        Order, infinite if the surface is smooth [1].
    """
    near = abs(over_one - over_two)
    far = abs(over_two - over_four)
    if max(near, far) <= SMOOTH * over_one:
        return math.inf
    return math.log2(max(far, 1e-300) / max(near, 1e-300))


def _mean_square_slope(lines: Field, distance: int, *, periodic: bool) -> float:
    """Return the mean square slope between nodes at a distance along the first axis [um2/node2]."""
    nodes, columns = lines.shape
    if periodic:
        rise = np.empty_like(lines)
        np.subtract(lines[distance:], lines[:-distance], out=rise[:-distance])
        np.subtract(lines[:distance], lines[-distance:], out=rise[-distance:])
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
