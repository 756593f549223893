"""A contact whose answers have the errors that are asked for, on the coarsest grid that gives them.

The time of a contact grows with the square of its nodes a side, and an area to one per cent rarely
needs all nodes of a map. `solve_within` therefore solves the same surface on fewer nodes. It begins
with the fewest nodes for which the bars of `Contact.grid_error` are expected to be as short as
asked, and refines until they are. Half of the nodes of a grid are solved first, which the bars need
anyway: they tell the length of the border of contact, which makes most of the bar of an area, and
give a start for the grid itself.

A contact on fewer nodes stands for that of the given map in three ways:

- Its cells cover the same patch (`bem.coarsening`), so that force, mean pressure, area and mean gap
  need no conversion. The border of a free patch, too, stays half a spacing of the given map beyond
  its outer nodes.
- Delta counts from the highest node of the given map, see `Problem.datum`.
- The error includes a part for the waves that the grid drops. A bar compares a grid with a coarser
  one, and cannot see waves that are on neither of them. Their part follows from their share of the
  mean square slope. Under light loads the area is proportional to the inverse of the rms slope
  (Persson 2001, J. Chem. Phys. 115), so that its relative error is half of the share. The part is
  twice as large as this.
"""

from __future__ import annotations  # short signatures in help()

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

from numpy.typing import ArrayLike

from bem.answers import ANSWERS, Answer
from bem.bodies import Body
from bem.budget import Budget, ErrorParts, Trial
from bem.checks import Range, real_number, shown
from bem.coarsening import Coarsening, CoarserMap
from bem.contact import Contact
from bem.derived.coarser import coarser
from bem.derived.grid_error import FEWEST, LEAST_ORDER, GridError, part_of_border
from bem.problem import (
    RTOL,
    NoSolution,
    Problem,
    check_solvable,
    checked,
    pose,
    under_load,
)
from bem.solving import solve_posed
from bem.threads import computed_once, on_threads

# Factor from a bar of 90 % to one of 95 % [1]. `asperity bench accuracy` counts the errors that
# are inside.
TO_95_PERCENT = 1.25

# Relative error of the area per share of the mean square slope that is dropped [1]. For shares of
# 3 % and more, 95 % of the errors are below it. For smaller shares, errors are proportional to the
# root of the share. Together with the error of the grid, they stay within the error asked for
# (`asperity bench accuracy`).
OF_DROPPED = 1.0

# Largest part of the error asked for that the waves dropped by a grid may use up; grids that drop
# more are not tried [1].
MOST_FOR_WAVES = 0.5

# Tolerance of the solver over the error that is asked for [1], and the loosest one [Delta].
OF_TOLERANCE = 0.1
LOOSEST = 1e-2

# Largest violation that the solver may leave, over the mean gap times the error that is asked for
# [1]. Near full contact the gap is a small part of Delta, and a violation that is as large as the
# gap closes it. A violation of a tenth of the gap changes gap, force and stiffness by at most 1 %.
OF_GAP = 3.0

# Fewest nodes along an axis of a grid that is tried. A grid of half of them judges it. With fewer
# than 16 nodes there, the areas on both grids agree by chance too often.
FEWEST_TRIED = 4 * FEWEST

# Ratio of the nodes a side of two grids that follow each other [1].
STEP = math.sqrt(2)

# The next numbers only tell which grids are tried. They are those with which searches on spectral
# surfaces cost least; `asperity bench accuracy` measures this cost.

# Ratio of the nodes a side of two grids of a search that follow each other [1].
SEARCH_STEP = math.sqrt(STEP)

# Bar at 95 % of the area that is expected on the first grid: its ratio to the area is a factor
# times a power of the share of the mean square slope that twice the spacing loses
# (`Coarsening.lost_slope`) [1].
EXPECTED_BAR = 0.07
EXPECTED_POWER = 0.8

# Number of the shortest waves on a side of the patch to which this bar belongs, and the power of
# the number with which it falls: errors of many spots of contact cancel in part [1].
EXPECTED_WAVES = 16.0
BY_WAVES = -0.4

# Factor of this bar on free patches [1].
ON_FREE_PATCH = 2.0

# Mean pressure to which this bar belongs, if the load is known, and the power of the pressure with
# which it falls [E* times the rms slope, 1].
EXPECTED_LOAD = 0.05
BY_LOAD = -0.3

# Least mean pressure for which this law is used [E* times the rms slope].
LIGHTEST = 0.005

# Largest lost share with which bars are expected to hold [1]. Waves of 9 nodes lose this share.
MOST_LOST = 0.11

# Power of the lost share by which bars fall from grid to grid [1].
BY_LOST_SLOPE = 0.7

# Largest expected error over the error asked for with which a grid is tried after another [1].
EXPECTED_MARGIN = 0.9

# Least ratio of a grid's nodes a side to those of the last trial with which it is tried whatever is
# expected of it [1].
FURTHEST = 2.0

# Error that is expected on a grid, over the part for the place of the border on half of its nodes
# a side [1]. This part alone becomes 0.51 to 0.6 times as large on rough surfaces.
OF_BORDER_ON_HALF = 0.7

# Error that is expected on the given map, over the error asked for, above which the map is not
# tried after a coarser grid [1]. Bars are hardly ever shorter than expected by more than this.
HOPELESS = 6.0

# Errors that may be asked for. A tenth of the least one is a tolerance that the solver takes.
ERRORS = Range(1e-14, 1, "above 1e-14 and below 1: 0.01 is one per cent")


class NotReachable(ArithmeticError):
    """No grid gives the answers within the errors that were asked for.

    Attributes
    ----------
    budget : Budget
        The grids that were tried; none where the given map alone tells that no grid is fine enough.
    contact : Contact or None
        The contact with the smallest errors, None if no contact has a bar that holds.
    """

    def __init__(
        self, message: str, budget: Budget, contact: Contact | None = None
    ) -> None:
        super().__init__(message)
        self.budget = budget
        self.contact = contact

    def __reduce__(self) -> tuple[type[NotReachable], tuple[str, Budget, Contact | None]]:
        """Let the error be pickled, so that worker processes can raise it."""
        return NotReachable, (str(self), self.budget, self.contact)


def solve_within(
    heights: ArrayLike,
    side: float | tuple[float, float],
    error: float | Mapping[str, float],
    *,
    delta: float | None = None,
    force: float | None = None,
    pressure: float | None = None,
    threads: int | None = None,
    **settings: Any,
) -> Contact:
    """Solve a contact on the coarsest grid of a surface that gives the answers within an error.

    No grid is finer than the given map. The same call takes the same grid on every machine, because
    grids are chosen by their bars alone and never by times. Several loads on one surface take less
    time by `Surface`.

    Parameters
    ----------
    heights : array_like, shape (nx, ny)
        Heights z of the surface; Delta counts from the highest of them [um].
    side : float or tuple of float
        Scan length L, one for a square grid or one for each axis [um].
    error : float or mapping of str to float
        Largest relative error of the area in the continuum, at 95 %. Or the errors of some answers,
        by their names: "area", "mean_gap", "stiffness", "delta", "force" [1].
    delta : float, optional
        Far-field displacement Delta [um]. Exactly one of `delta`, `force` and `pressure` is needed.
    force : float, optional
        Total normal force F [uN].
    pressure : float, optional
        Mean pressure over the cells of all nodes of the given map [MPa].
    threads : int, optional
        Threads that share the work, see `bem.solve`.
    **settings
        Further arguments of `bem.solve`, without `rtol`, which follows from the error, and without
        `near`. MIRCO's kernel and far field are refused: they are statements about its own grid.

    Returns
    -------
    Contact
        The contact on the chosen grid. Its `budget` has the parts of the errors and all trials.

    Raises
    ------
    ValueError
        For input that no contact problem can have, for unknown names of answers, and for errors
        that are not above 1e-14 and below 1.
        NoSolution, a ValueError, for a load that no equilibrium carries, see `bem.solve`.
    NotReachable
        If no grid up to the given map has bars as short as asked. Its message has the best bar, and
        the reason why there is no better one.
    """
    errors = checked_errors(error)
    surface = Surface(heights, side, **settings)
    return surface.solve_within(
        errors, delta=delta, force=force, pressure=pressure, threads=threads
    )


class Surface:
    """A surface and its bodies, prepared once for contacts within errors under several loads.

    The loads share the checks of the map, its waves, and the surface on fewer nodes. A contact is
    the same as that of the function `solve_within`, whatever loads were solved before.

    Parameters
    ----------
    heights : array_like, shape (nx, ny)
        Heights z of the surface; Delta counts from the highest of them [um].
    side : float or tuple of float
        Scan length L, one for a square grid or one for each axis [um].
    **settings
        Further arguments of the function `solve_within`, except error, load and `threads`.

    Raises
    ------
    ValueError
        For input that no contact problem can have, as `solve_within` raises it.
    """

    def __init__(
        self, heights: ArrayLike, side: float | tuple[float, float], **settings: Any
    ) -> None:
        _refuse_settings(settings)
        for name in ("delta", "force", "pressure", "threads"):
            if name in settings:
                raise ValueError(
                    f"{name} is given: a surface is prepared for all loads; give it to solve_within"
                )
        # With a datum, even of 0, the cells of all grids cover the same patch (`coarser`).
        self._unloaded = replace(pose(heights, side, 0.0, **settings), datum=0.0)
        self._coarsening = Coarsening(
            self._unloaded.heights,
            self._unloaded.boundary,
            self._unloaded.aspect,
            self._unloaded.reduced_body,
        )

    def solve_within(
        self,
        error: float | Mapping[str, float],
        *,
        delta: float | None = None,
        force: float | None = None,
        pressure: float | None = None,
        threads: int | None = None,
    ) -> Contact:
        """Solve a contact on the coarsest grid that gives the answers within an error.

        Parameters
        ----------
        error : float or mapping of str to float
            See the function `solve_within` [1].
        delta : float, optional
            Far-field displacement Delta [um]. Exactly one of `delta`, `force` and `pressure` is
            needed.
        force : float, optional
            Total normal force [uN].
        pressure : float, optional
            Mean pressure over the cells of all nodes [MPa].
        threads : int, optional
            Threads that share the work, see `bem.solve`.

        Returns
        -------
        Contact
            The contact on the chosen grid, with its `budget`.

        Raises
        ------
        ValueError, NoSolution, NotReachable
            As the function `solve_within` raises them.
        """
        errors = checked_errors(error)
        tolerance_by_errors = tolerance_for(errors)
        tolerance = tolerance_by_errors / self._unloaded.settlement_ratio
        # The settlement alone asks for no tolerance below the default one.
        tolerance = max(tolerance, min(RTOL, tolerance_by_errors))
        unloaded = replace(self._unloaded, rtol=checked("rtol", tolerance))
        problem = under_load(unloaded, delta, force=force, pressure=pressure)
        with on_threads(None if threads is None else checked("threads", threads)):
            return _Search(problem, self._coarsening, errors).solve()


def checked_errors(error: float | Mapping[str, float]) -> dict[str, float]:
    """Return the largest relative error of each answer that is asked for.

    Parameters
    ----------
    error : float or mapping of str to float
        Error of the area in the continuum, or the errors of some answers by their names in
        `ANSWERS` [1].

    Returns
    -------
    dict of str to float
        The errors by the names of the answers [1].

    Raises
    ------
    ValueError
        If there is no error, a name is unknown, or an error is not above 1e-14 and below 1.
    """
    if not isinstance(error, Mapping):
        error = {"area": error}
    if not error:
        raise ValueError(f"error is empty: name at least one of {', '.join(ANSWERS)}")
    for name in error:
        if name not in ANSWERS:
            raise ValueError(
                f"error of {shown(name)}: answers with an error are {', '.join(ANSWERS)}"
            )
    return {
        name: real_number(f"error of {name}", value, ERRORS)
        for name, value in error.items()
    }


def _refuse_settings(settings: Mapping[str, Any]) -> None:
    """Refuse arguments of `bem.solve` that do not go with an error."""
    for name in ("rtol", "near"):
        if name in settings:
            raise ValueError(f"{name} is given: with an error it follows from the error")
    kernel = settings.get("kernel", "uniform-pressure")
    if isinstance(settings.get("body"), Body):
        kernel = settings["body"].kernel
    if kernel != "uniform-pressure":
        raise ValueError(
            f"kernel = {shown(kernel)}: with an error use 'uniform-pressure', because"
            " the other one belongs to its grid"
        )
    if settings.get("far_field", "rigid") != "rigid":
        raise ValueError(
            f"far_field = {shown(settings['far_field'])}: with an error use 'rigid', because the"
            " other one belongs to its grid"
        )


class _Search:
    """The search for the coarsest grid of a problem whose answers are within some errors.

    Parameters
    ----------
    problem : Problem
        The problem on the given map, with a datum.
    coarsening : Coarsening
        The map on fewer nodes.
    asked_errors : dict of str to float
        Largest relative errors, by the names of the answers [1].
    """

    def __init__(
        self, problem: Problem, coarsening: Coarsening, asked_errors: dict[str, float]
    ) -> None:
        self.map_problem = problem
        self.coarsening = coarsening
        self.asked_errors = asked_errors
        self.trials: list[Trial] = []
        # Error ratio of the last trial, or the expected one if its own grid was not solved.
        self.last_ratio = math.inf
        # The contact of the trial with the smallest error ratio.
        self.best_contact: Contact | None = None
        # The contacts of all trials by the nodes of their grids.
        self.contact_by_nodes: dict[tuple[int, ...], Contact] = {}

    @property
    def budget(self) -> Budget:
        """The grids that were tried so far."""
        rows, columns = self.map_problem.heights.shape
        return Budget((rows, columns), self.map_problem.rtol, tuple(self.trials))

    def solve(self) -> Contact:
        """Return the contact on the coarsest grid that meets the errors, with its budget.

        Raises
        ------
        NotReachable
            If no grid meets the errors.
        """
        if not self._is_loaded:  # nothing touches, which is exact on any grid
            return solve_posed(self.map_problem).with_budget(self.budget)
        self._refuse_unjudged_map()
        for nodes in grids(self.map_problem.heights.shape, SEARCH_STEP):
            if not self._is_worth_trying(nodes):
                continue
            coarser_map = self.coarsening.on(nodes)
            dropped = coarser_map.dropped
            # The waves that this grid drops would alone use up too much of the error.
            if OF_DROPPED * dropped > MOST_FOR_WAVES * min(self.asked_errors.values()):
                continue
            problem = on_coarser_map(self.map_problem, coarser_map)
            if not self._may_hold(problem):
                continue
            contact = self._try_grid(problem, dropped)
            if contact is not None and self.trials[-1].meets_errors:
                return contact.with_budget(self.budget)
        raise NotReachable(self._message(), self.budget, self.best_contact)

    @property
    def _is_loaded(self) -> bool:
        """Whether the force or the displacement is above zero."""
        if self.map_problem.delta is None:
            return bool(self.map_problem.force)
        return self.map_problem.delta > 0

    def _is_worth_trying(self, nodes: tuple[int, int]) -> bool:
        """Return whether a grid may meet the errors, judging by the last trial or the map alone."""
        map_nodes = self.map_problem.heights.shape
        is_map = nodes == map_nodes
        smallest_error = min(self.asked_errors.values())
        if not self.trials:
            if is_map or self._expected_bar(nodes) <= smallest_error:
                return True
            if FURTHEST * max(nodes) < max(map_nodes):
                return False
            # If even the map is expected to miss the errors, a grid of half of its nodes a side
            # costs less, and tells whether the map is hopeless.
            return HOPELESS * smallest_error < self._expected_bar(map_nodes) < math.inf
        last_nodes = self.trials[-1].nodes
        is_far = max(nodes) >= FURTHEST * max(last_nodes)
        if self.last_ratio == math.inf:
            return is_map or is_far
        lost = self.coarsening.lost_slope(nodes) / self.coarsening.lost_slope(last_nodes)
        expected_ratio = self.last_ratio * math.pow(lost, BY_LOST_SLOPE)
        if is_map:
            return expected_ratio <= HOPELESS
        return is_far or expected_ratio <= EXPECTED_MARGIN

    def _expected_bar(self, nodes: tuple[int, ...]) -> float:
        """Return the relative bar of the area that is expected on a grid by the map's slopes [1].

        It is infinite where most bars do not hold.
        """
        lost = self.coarsening.lost_slope(nodes)
        if lost > MOST_LOST:
            return math.inf
        # A wave of n nodes loses about the share (pi / n)^2, see `Coarsening.lost_slope`. The share
        # therefore tells how many of the shortest waves are on a side of the patch.
        waves = math.sqrt(math.prod(nodes) * lost) / math.pi
        bar = EXPECTED_BAR * math.pow(lost, EXPECTED_POWER) * self._factor_of_load
        bar *= math.pow(waves / EXPECTED_WAVES, BY_WAVES)
        return ON_FREE_PATCH * bar if self.map_problem.boundary == "free" else bar

    @computed_once
    def _factor_of_load(self) -> float:
        """Factor of the expected bar for the load, 1 if the displacement is given [1]."""
        problem = self.map_problem
        slope = self.coarsening.rms_slope / problem.spacing[0]
        if not problem.force or not slope > 0:
            return 1.0
        area = problem.heights.size * problem.spacing[0] * problem.spacing[1]
        load = problem.force / area / problem.modulus / slope
        return math.pow(max(load, LIGHTEST) / EXPECTED_LOAD, BY_LOAD)

    def _refuse_unjudged_map(self) -> None:
        """Refuse a map on whose own grid no bar holds, whatever its contact is.

        Raises
        ------
        NotReachable
            If elastic bodies have no area in the continuum, because roughness continues down to
            the grid; or if the cells are too large to resolve a layer.
        """
        if self._has_endless_waves(self.map_problem):
            reason = (
                "waves go on down to the grid of the given map, so that no bar holds: give a map"
                " whose shortest wave has 8 nodes or more"
            )
        elif not self.map_problem.is_deeper_than_cells:
            reason = (
                "a cell of the given map is no smaller than the layer, so that no bar holds: give"
                " a map with more nodes"
            )
        else:
            return
        raise NotReachable(
            f"{_in_words(self.asked_errors)} not reachable on any grid: {reason}",
            self.budget,
        )

    def _may_hold(self, problem: Problem) -> bool:
        """Return whether bars may hold on the grid of a problem; the given map has been tested."""
        if problem.heights.shape == self.map_problem.heights.shape:
            return True
        return problem.is_deeper_than_cells and not self._has_endless_waves(problem)

    def _has_endless_waves(self, problem: Problem) -> bool:
        """Return whether waves continue down to a grid, so that the area has no limit.

        It is False for bodies that may yield, whose area the hardness bounds.
        """
        if problem.hardness is not None:
            return False
        rows, columns = problem.heights.shape
        return self.coarsening.slope_order((rows, columns)) < LEAST_ORDER

    def _try_grid(self, problem: Problem, dropped: float) -> Contact | None:
        """Solve on a grid, judge the contact and append the trial; return None without a contact.

        Half of the nodes are solved first: their contact is a start for that of the grid, and tells
        how long the border of contact is on the grid. There is no contact if the border alone makes
        the error too large, or if the solver fails. ArithmeticError of a linear solve for an answer
        passes through.

        Parameters
        ----------
        problem : Problem
            The problem on this grid.
        dropped : float
            Share of the given map's mean square slope that the grid lacks [1].
        """
        rows, columns = problem.heights.shape
        trial = Trial(
            nodes=(rows, columns),
            waves_dropped=dropped,
            errors={},
            reason="",
            convolutions=0.0,
            work=0.0,
        )
        # If an earlier trial was on half of the nodes a side, its contact is the coarser one. That
        # trial has the convolutions of this contact.
        coarse = self.contact_by_nodes.get(((rows + 1) // 2, (columns + 1) // 2))
        if coarse is None:
            coarse = _on_half_of_the_nodes(problem)
            if coarse is not None:
                share = work(coarse.pressure.shape) / work((rows, columns))
                trial = self._with_convolutions(trial, coarse.convolutions * share)
        expected_ratio = self._expected_ratio(coarse)
        is_map = problem.heights.shape == self.map_problem.heights.shape
        # Leave out the solve if the border alone makes the error too large. But above `HOPELESS`
        # even the map may miss the errors; this contact is then solved for the bar of the message.
        if 1 < expected_ratio <= HOPELESS and not is_map:
            reason = (
                "half of the nodes tell that the border alone makes the error too large"
            )
            self._append(replace(trial, reason=reason), expected_ratio=expected_ratio)
            return None
        try:
            contact = self._solved(problem, coarse)
        except ArithmeticError as failure:
            self._append(replace(trial, reason=str(failure)))
            return None
        self.contact_by_nodes[rows, columns] = contact
        trial = self._with_convolutions(trial, contact.convolutions)
        bars = contact.grid_error(coarse)
        errors = {
            name: error_parts(
                contact, bars, name, asked_error=asked_error, dropped=dropped
            )
            for name, asked_error in self.asked_errors.items()
        }
        smallest_ratio = min(
            (earlier.error_ratio for earlier in self.trials), default=math.inf
        )
        trial = replace(trial, errors=errors, reason=bars.reason)
        if trial.error_ratio < smallest_ratio:
            self.best_contact = contact
        self._append(trial)
        return contact

    def _with_convolutions(self, trial: Trial, convolutions: float) -> Trial:
        """Return a trial with more convolutions on its grid, and their work."""
        total = trial.convolutions + convolutions
        share = work(trial.nodes) / work(self.map_problem.heights.shape)
        return replace(trial, convolutions=total, work=total * share)

    def _append(self, trial: Trial, expected_ratio: float = math.inf) -> None:
        """Append a trial; `expected_ratio` is its expected error ratio if it was not solved."""
        self.trials.append(trial)
        self.last_ratio = min(trial.error_ratio, expected_ratio)

    def _expected_ratio(self, coarse: Contact | None) -> float:
        """Return the expected error ratio of a grid from the contact on half of its nodes [1].

        It is the ratio of the area, from the part for the place of the border. It is 0 if `coarse`
        is None or has no contact, or if no error of the area is asked for.
        """
        if coarse is None or coarse.contact_nodes == 0 or "area" not in self.asked_errors:
            return 0.0
        part = OF_BORDER_ON_HALF * part_of_border(coarse, "area")
        return TO_95_PERCENT * part / self.asked_errors["area"]

    def _solved(self, problem: Problem, coarse: Contact | None) -> Contact:
        """Solve on a grid, and again with a tighter tolerance if the gap is small against Delta.

        The start is `coarse`, the contact on half of the nodes, unless it is None. The returned
        contact has the convolutions of both solves.
        """
        near = None
        if coarse is not None:
            rows, columns = problem.heights.shape
            near = coarse.pressure.repeat(2, axis=0).repeat(2, axis=1)[:rows, :columns]
        contact = solve_posed(problem, near)
        tolerance_unit = abs(contact.delta - problem.mean_displacement)  # [um]
        if tolerance_unit == 0:  # a flat surface
            return contact
        gap = max(contact.mean_gap, 0.0)
        largest_violation = OF_GAP * min(self.asked_errors.values()) * gap  # [um]
        tolerance = max(largest_violation / tolerance_unit, min(RTOL, problem.rtol))
        if problem.rtol <= tolerance:
            return contact
        tighter = solve_posed(replace(problem, rtol=tolerance), contact.pressure)
        convolutions = contact.convolutions + tighter.convolutions
        return replace(tighter, convolutions=convolutions)

    def _message(self) -> str:
        """Return the message that the errors are not reachable, with the best bars and a reason."""
        asked_text = _in_words(self.asked_errors)
        unreachable = f"{asked_text} not reachable on the nodes of the given map"
        judged = [trial for trial in self.trials if trial.error_ratio < math.inf]
        if not judged:
            reason = self.trials[-1].reason if self.trials else "no grid could be tried"
            return f"{unreachable}, no bar holds: {reason}"
        best = min(judged, key=lambda trial: trial.error_ratio)
        reached_text = _in_words(
            {name: _rounded_up(parts.total) for name, parts in best.errors.items()}
        )
        rows, columns = best.nodes
        untried = ""
        if self.trials[-1].nodes != self.map_problem.heights.shape:
            untried = (
                ", from which all nodes were not expected to reach it and were not tried"
            )
        return (
            f"{unreachable}: the best is {reached_text}, on {rows} x {columns} nodes, where"
            f" {best.reason}{untried}: ask for {reached_text} or more, or give a map with more"
            " nodes in a wave"
        )


def _on_half_of_the_nodes(problem: Problem) -> Contact | None:
    """Solve a problem with a datum on about every second node; None if it has no solution.

    It is None, too, if the nodes are too few to have a coarser grid.
    """
    if min(problem.heights.shape) < FEWEST:
        return None
    try:
        half = coarser(problem)
        check_solvable(half)
        return solve_posed(half)
    except (NoSolution, ArithmeticError):
        return None


def _rounded_up(error: float) -> float:
    """Return an error, rounded up to two digits: asking for it again is granted [1]."""
    if error == 0:
        return 0.0
    unit: float = 10.0 ** (math.floor(math.log10(error)) - 1)
    return math.ceil(error / unit) * unit


def _in_words(errors: Mapping[str, float]) -> str:
    """Return errors as text, for example "area to 1 %"."""
    return ", ".join(f"{name} to {100 * value:.2g} %" for name, value in errors.items())


def error_parts(
    contact: Contact, bars: GridError, name: str, *, asked_error: float, dropped: float
) -> ErrorParts:
    """Return the relative error of an answer at 95 %, by its causes.

    The part for dropped waves is that of the area, whatever the answer is. The part for the solver
    follows from the largest violation of the conditions of contact that the solver has left.

    Parameters
    ----------
    contact : Contact
        A solved contact.
    bars : GridError
        Its `Contact.grid_error`.
    name : str
        Name of the answer in `ANSWERS`.
    asked_error : float
        Largest relative error that is asked for [1].
    dropped : float
        Share of the surface's mean square slope that the contact's grid lacks [1].

    Returns
    -------
    ErrorParts
        The parts; that of the grid is infinite where no bar holds.

    Raises
    ------
    ArithmeticError
        If a linear solve for the stiffness does not converge.
    """
    return ErrorParts(
        asked_error=asked_error,
        grid=TO_95_PERCENT * _relative_bar(contact, bars, name),
        waves=OF_DROPPED * dropped,
        solver=_error_of_solver(contact, ANSWERS[name]),
    )


def _error_of_solver(contact: Contact, answer: Answer) -> float:
    """Return the relative error at 95 % that the solver leaves in an answer [1]."""
    error = answer.by_violation * contact.residual
    if contact.mean_gap > 0:  # full contact has no gap
        error *= (abs(contact.delta) / contact.mean_gap) ** answer.gap_power
    return error


def tolerance_for(asked_errors: Mapping[str, float]) -> float:
    """Return the tolerance of the solver for errors that are asked for.

    Parameters
    ----------
    asked_errors : mapping of str to float
        Largest relative errors by the names of the answers [1].

    Returns
    -------
    float
        A tenth of the least error, at most `LOOSEST` [Delta].
    """
    return min(OF_TOLERANCE * min(asked_errors.values()), LOOSEST)


def _relative_bar(contact: Contact, error: GridError, name: str) -> float:
    """Return the half-width of an answer's 90 % bar over its value, infinite if it does not hold.

    Where waves continue down to the grid, the bar of the area may hold because yielding decides the
    area. The bars of the other answers do not hold then.
    """
    if not error.verdicts[name] or contact.contact_nodes == 0:
        return math.inf
    if name != "area" and error.order < LEAST_ORDER:
        return math.inf
    value = abs(ANSWERS[name].value(contact))
    if not math.isfinite(value):  # the stiffness of full contact
        return 0.0
    bar = ANSWERS[name].bar(error)
    return bar / value if value > 0 else math.inf


def work(nodes: tuple[int, ...]) -> float:
    """Return the work of a convolution on a grid: its nodes times their logarithm [1].

    Parameters
    ----------
    nodes : tuple of int
        Nodes along the axes.

    Returns
    -------
    float
        Work, in an arbitrary unit.
    """
    size = math.prod(nodes)
    return size * math.log2(max(size, 2))


# Grids of the same surface


def grids(shape: tuple[int, ...], step: float = STEP) -> Iterator[tuple[int, int]]:
    """Yield the nodes of the grids of a map, from the coarsest one to the map itself.

    Their numbers suit fast transforms and the coarser grids of `bem.derived.grid_error`.

    Parameters
    ----------
    shape : tuple of int
        Nodes (nx, ny) of the map.
    step : float
        Approximate ratio of the nodes a side of a grid to those of the grid before it [1].

    Yields
    ------
    tuple of int
        Nodes (mx, my).
    """
    rows, columns = shape
    steps = math.floor(math.log(max(min(rows, columns) / FEWEST_TRIED, 1), step))
    last = (0, 0)
    for number in range(steps, 0, -1):
        coarse = _fast_nodes(rows / step**number), _fast_nodes(columns / step**number)
        if coarse[0] < 0.85 * rows and coarse[1] < 0.85 * columns and coarse != last:
            yield coarse
            last = coarse
    yield rows, columns


def _fast_nodes(nodes: float) -> int:
    """Return a number of nodes, at least `nodes`, that is four times a fast length."""
    from scipy.fft import next_fast_len  # here, because few contacts need it

    return 4 * int(next_fast_len(math.ceil(nodes / 4), real=True))


def on_coarser_map(problem: Problem, coarser_map: CoarserMap) -> Problem:
    """Return a problem on fewer nodes of its map, with the same datum and load.

    Parameters
    ----------
    problem : Problem
        The problem on the given map, with a datum.
    coarser_map : CoarserMap
        The map on fewer nodes.

    Returns
    -------
    Problem
        The problem there; the given one on the given map itself.
    """
    heights = coarser_map.heights
    if heights.shape == problem.heights.shape:
        return problem
    spacing = (
        problem.spacing[0] * problem.heights.shape[0] / heights.shape[0],
        problem.spacing[1] * problem.heights.shape[1] / heights.shape[1],
    )
    datum = problem.datum_height - float(heights.max())
    return replace(problem, heights=heights, spacing=spacing, datum=datum)
