"""A contact whose answers have the errors that are asked for, on the coarsest grid that gives them.

The time of a contact grows with the square of its nodes a side. Whoever needs an area to a per cent
rarely needs all nodes of a map. `solve_within` therefore solves the same surface on fewer nodes,
beginning with the fewest that keep its waves, and refines until the bars of `Contact.grid_error`
are as short as asked.

Four things make a contact on fewer nodes that of the given map:

- Its cells cover the same patch. The nodes are the centres of the larger cells, so that force, mean
  pressure, area and mean gap need no conversion. Also the border of a free patch stays half a
  spacing of the given map beyond its outer nodes.
- The surface is read there by its own waves: by Fourier's on a periodic patch, by cosines on a
  mirrored one. On a free patch it is read by polynomials of the fifth degree between the nodes;
  where each larger cell has an odd number of cells along both axes these are every third or every
  fifth node of the map.
- Delta counts from the highest node of the given map, see `Problem.datum`.
- A bar compares a grid with a coarser one, and cannot see the waves that both of them have not.
  Their part of the error follows from their share of the mean square slope. Under light loads the
  area goes with the inverse of the rms slope (Persson 2001, J. Chem. Phys. 115), so that its
  relative error is half of the share; the part that is counted is twice as large.
"""

from __future__ import annotations  # short signatures in help()

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bem.arrays import Field, Nodes, Values
from bem.budget import Budget, ErrorParts, Trial
from bem.checks import Range, real_number, shown
from bem.contact import Contact
from bem.derived.grid_error import FEWEST, LEAST_ORDER, GridError, slope_order
from bem.problem import Problem, checked, pose
from bem.solving import solve_posed
from bem.threads import computed_once, on_threads

# Factor from a bar of 90 % to one of 95 %, as for normal errors [1].
TO_95_PERCENT = 1.2

# Relative error of the area per share of the mean square slope that is dropped [1].
OF_DROPPED = 1.0

# Largest part of the error asked for that the waves dropped by a grid may use up; grids that drop
# more are not tried [1].
MOST_FOR_WAVES = 0.5

# Tolerance of the solver over the error that is asked for [1], and the loosest one [Delta].
OF_TOLERANCE = 0.1
LOOSEST = 1e-2

# Fewest nodes along an axis of a grid that is tried. Half of them judge it, and where these are
# fewer than 16, areas of both grids agree by chance too often.
FEWEST_TRIED = 4 * FEWEST

# Ratio of the nodes a side of two grids that follow each other [1].
STEP = math.sqrt(2)

# Largest order by which an error may fall with the spacing [1]. Grids on which it would still be
# too large at this order are skipped, but none with more than `FURTHEST` times the nodes a side of
# the last trial [1]: where few nodes are in a wave, an error can fall faster.
BEST_ORDER = 2.0
FURTHEST = 2.0

# Number of nodes along an axis from whose heights one between them is interpolated, on free maps.
NODES_BESIDE = 6

# Most lines of a map, about, on which slopes are measured along each axis.
LINES = 64

# Errors that may be asked for. A tenth of the least one is a tolerance that the solver takes.
ERRORS = Range(1e-14, 1, "above 1e-14 and below 1: 0.01 is one per cent")


@dataclass(frozen=True)
class Answer:
    """An answer of a contact that can be asked for with an error.

    Attributes
    ----------
    value : callable
        Function that returns the answer of a contact.
    bar : callable
        Function that returns the half-width of its 90 % bar, in the same unit.
    """

    value: Callable[[Contact], float]
    bar: Callable[[GridError], float]


ANSWERS = {
    "area": Answer(
        lambda contact: contact.continuum_area_percent, lambda error: error.area_percent
    ),
    "mean_gap": Answer(lambda contact: contact.mean_gap, lambda error: error.mean_gap),
    "stiffness": Answer(lambda contact: contact.stiffness, lambda error: error.stiffness),
    "delta": Answer(lambda contact: contact.delta, lambda error: error.delta),
    "force": Answer(lambda contact: contact.force, lambda error: error.force),
}
"""Answers that can be asked for, by their names."""


class NotReachable(ArithmeticError):
    """No grid gives the answers within the errors that were asked for.

    Attributes
    ----------
    budget : Budget
        What was tried; empty where the given map alone tells that no grid will do.
    contact : Contact or None
        The contact with the smallest errors, None if there is none with a bar.
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
    grids are chosen by their bars alone and never by times.

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
        If no grid up to the given map has bars as short as asked. It says what the best bar is, and
        why there is no better one.
    """
    asked = checked_errors(error)
    _refuse_settings(settings)
    tolerance = min(OF_TOLERANCE * min(asked.values()), LOOSEST)
    problem = pose(
        heights,
        side,
        delta,
        force=force,
        pressure=pressure,
        rtol=tolerance,
        **settings,
    )
    with on_threads(None if threads is None else checked("threads", threads)):
        return _Search(problem, asked).solve()


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
    if settings.get("kernel", "uniform-pressure") != "uniform-pressure":
        raise ValueError(
            f"kernel = {shown(settings['kernel'])}: with an error use 'uniform-pressure', because"
            " the other one belongs to its grid"
        )
    if settings.get("body") is not None:
        raise ValueError(
            "body is given: with an error the body is a half-space, by modulus and poisson"
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
        The problem on the given map.
    asked : dict of str to float
        Largest relative errors, by the names of the answers [1].
    """

    def __init__(self, problem: Problem, asked: dict[str, float]) -> None:
        # A datum, though 0, makes the cells of all grids cover the same patch (`coarser`).
        self.map_problem = replace(problem, datum=0.0)
        self.asked_errors = asked
        self.trials: list[Trial] = []
        self.best_contact: Contact | None = (
            None  # of the trial with the smallest error ratio
        )
        self.contact_by_nodes: dict[tuple[int, ...], Contact] = {}  # of all trials

    @property
    def budget(self) -> Budget:
        """What was tried up to now."""
        rows, columns = self.map_problem.heights.shape
        return Budget((rows, columns), self.map_problem.rtol, tuple(self.trials))

    def solve(self) -> Contact:
        """Return the contact on the coarsest grid with the errors asked for, with its budget.

        Raises
        ------
        NotReachable
            If there is none.
        """
        load = (
            self.map_problem.force
            if self.map_problem.delta is None
            else self.map_problem.delta
        )
        if load is None or load <= 0:  # nothing touches, which is exact on any grid
            return solve_posed(self.map_problem).with_budget(self.budget)
        self._refuse_endless_waves()
        surface = Surface(self.map_problem)
        for nodes in grids(self.map_problem):
            if not self._may_suffice(nodes):
                continue
            problem, dropped = surface.on(nodes)
            # The waves that this grid drops would alone use up too much of the error.
            if OF_DROPPED * dropped > MOST_FOR_WAVES * min(self.asked_errors.values()):
                continue
            # No bar could hold. The given map has passed this test above.
            if nodes != self.map_problem.heights.shape and self._has_endless_waves(
                problem
            ):
                continue
            contact = self._try_grid(problem, dropped)
            if contact is not None and self.trials[-1].meets_errors:
                return contact.with_budget(self.budget)
        raise NotReachable(self._message(), self.budget, self.best_contact)

    def _may_suffice(self, nodes: tuple[int, int]) -> bool:
        """Return whether a grid may meet the errors, judging by the last trial.

        An error falls at most with the power `BEST_ORDER` of the spacing.
        """
        if not self.trials or nodes == self.map_problem.heights.shape:
            return True
        last = self.trials[-1]
        if last.error_ratio == math.inf:
            return True
        # ratio of the nodes a side to those of the last trial
        ratio = min(math.pow(last.error_ratio, 1 / BEST_ORDER), FURTHEST)
        return max(nodes) >= ratio * max(last.nodes)

    def _refuse_endless_waves(self) -> None:
        """Refuse a map whose roughness continues down to its grid, unless its bodies yield.

        Raises
        ------
        NotReachable
            If elastic bodies have no area in the continuum.
        """
        if not self._has_endless_waves(self.map_problem):
            return
        raise NotReachable(
            f"{self._in_words(self.asked_errors)} not reachable on any grid: waves go on down"
            " to the grid of the given map, so that no bar holds: give a map whose shortest wave"
            " has 8 nodes or more",
            self.budget,
        )

    def _has_endless_waves(self, problem: Problem) -> bool:
        """Return whether waves go on down to a grid, so that elastic bodies' area has no limit.

        It is always False for bodies that may yield.
        """
        if problem.hardness is not None:
            return False
        order = slope_order(problem.heights, problem.boundary, lines=LINES)
        return order < LEAST_ORDER

    def _try_grid(self, problem: Problem, dropped: float) -> Contact | None:
        """Solve on a grid, judge the contact and append the trial; return None if the solver fails.

        ArithmeticError of a linear solve for an answer passes through.

        Parameters
        ----------
        problem : Problem
            The problem on this grid.
        dropped : float
            Share of the given map's mean square slope that the grid lacks [1].
        """
        rows, columns = problem.heights.shape
        try:
            contact = solve_posed(problem)
        except ArithmeticError as failure:
            trial = Trial(
                nodes=(rows, columns),
                waves_dropped=dropped,
                errors={},
                reason=str(failure),
                convolutions=0.0,
                work=0.0,
            )
            self.trials.append(trial)
            return None
        # An earlier trial on half of the nodes a side, if there is one, is the coarser contact.
        coarse = self.contact_by_nodes.get(((rows + 1) // 2, (columns + 1) // 2))
        bars = contact.grid_error(coarse)
        self.contact_by_nodes[rows, columns] = contact
        errors = {
            name: self._parts(contact, bars, name, dropped=dropped)
            for name in self.asked_errors
        }
        convolutions = float(contact.convolutions)
        if coarse is None:  # otherwise the coarser ones are counted in the earlier trial
            for coarser in (bars.coarse, bars.coarsest):
                if coarser is not None:
                    share = work(coarser.pressure.shape) / work((rows, columns))
                    convolutions += coarser.convolutions * share
        trial = Trial(
            nodes=(rows, columns),
            waves_dropped=dropped,
            errors=errors,
            reason=bars.reason,
            convolutions=convolutions,
            work=convolutions
            * work((rows, columns))
            / work(self.map_problem.heights.shape),
        )
        smallest_ratio = min((one.error_ratio for one in self.trials), default=math.inf)
        if trial.error_ratio < smallest_ratio:
            self.best_contact = contact
        self.trials.append(trial)
        return contact

    def _parts(
        self, contact: Contact, bars: GridError, name: str, *, dropped: float
    ) -> ErrorParts:
        """Return the relative error of an answer by its causes.

        The area's error for dropped waves serves for every answer, and so does the tolerance, which
        is relative to Delta.
        """
        return ErrorParts(
            asked_error=self.asked_errors[name],
            grid=TO_95_PERCENT * _relative_bar(contact, bars, name),
            waves=OF_DROPPED * dropped,
            solver=contact.problem.rtol,
        )

    def _message(self) -> str:
        """Say that the errors are not reachable, what the best bars are, and why."""
        asked_text = self._in_words(self.asked_errors)
        unreachable = f"{asked_text} not reachable on the nodes of the given map"
        judged = [trial for trial in self.trials if trial.error_ratio < math.inf]
        if not judged:
            reason = self.trials[-1].reason if self.trials else "no grid could be tried"
            return f"{unreachable}, no bar holds: {reason}"
        best = min(judged, key=lambda trial: trial.error_ratio)
        reached_text = self._in_words(
            {name: parts.total for name, parts in best.errors.items()}
        )
        rows, columns = best.nodes
        return (
            f"{unreachable}: the best is {reached_text}, on {rows} x {columns} nodes, where"
            f" {best.reason}: ask for no less than that, or give a map with more nodes in a wave"
        )

    def _in_words(self, errors: Mapping[str, float]) -> str:
        """Return errors as text, for example "area to 1 %"."""
        return ", ".join(
            f"{name} to {100 * value:.2g} %" for name, value in errors.items()
        )


def _relative_bar(contact: Contact, error: GridError, name: str) -> float:
    """Return the half-width of an answer's 90 % bar over its value, infinite if it does not hold.

    Where yielding decides the area of a surface without a limit, it decides no other answer.
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
    """
    size = math.prod(nodes)
    return size * math.log2(max(size, 2))


# Grids of the same surface


def grids(problem: Problem) -> Iterator[tuple[int, int]]:
    """Yield the nodes of the grids of a map, from the coarsest one to the map itself.

    Each has about 1.4 times as many nodes a side as the one before. Their numbers suit fast
    transforms and the coarser grids of `bem.derived.grid_error`.

    Parameters
    ----------
    problem : Problem
        The problem on the given map.

    Yields
    ------
    tuple of int
        Nodes (mx, my).
    """
    rows, columns = problem.heights.shape
    steps = math.floor(math.log(max(min(rows, columns) / FEWEST_TRIED, 1), STEP))
    for step in range(steps, 0, -1):
        coarse = _fast_nodes(rows / STEP**step), _fast_nodes(columns / STEP**step)
        if coarse[0] < 0.85 * rows and coarse[1] < 0.85 * columns:
            yield coarse
    yield rows, columns


def _fast_nodes(nodes: float) -> int:
    """Return a number of nodes, at least the given one, that is four times a fast length."""
    from scipy.fft import next_fast_len  # here, because few contacts need it

    return 4 * int(next_fast_len(math.ceil(nodes / 4), real=True))


class Surface:
    """The surface of a map, which is read on fewer nodes whose cells cover the same patch.

    Parameters
    ----------
    problem : Problem
        The problem on the given map, with a datum.
    """

    def __init__(self, problem: Problem) -> None:
        self.problem = problem

    def on(self, nodes: tuple[int, int]) -> tuple[Problem, float]:
        """Return the problem on fewer nodes.

        Parameters
        ----------
        nodes : tuple of int
            Nodes (mx, my), at most those of the map.

        Returns
        -------
        problem : Problem
            The problem with the same datum and load.
        dropped : float
            Share of the map's mean square slope that is not on the coarser grid [1].
        """
        problem = self.problem
        shape = problem.heights.shape
        if nodes == shape:
            return problem, 0.0
        if problem.boundary == "free":
            fewer, dropped = _read_free(problem.heights, nodes, problem.aspect)
        else:
            fewer, dropped = self._waves.cut(nodes)
            fewer += float(problem.heights.mean())
        fewer.setflags(write=False)
        spacing = (
            problem.spacing[0] * shape[0] / nodes[0],
            problem.spacing[1] * shape[1] / nodes[1],
        )
        datum = problem.datum_height - float(fewer.max())
        return replace(problem, heights=fewer, spacing=spacing, datum=datum), dropped

    @computed_once
    def _waves(self) -> _Waves:
        """The waves of a patch without edges, by one transform."""
        heights = self.problem.heights - self.problem.heights.mean()
        if self.problem.boundary == "periodic":
            return _Waves.periodic(heights, self.problem.aspect)
        return _Waves.mirrored(heights, self.problem.aspect)


@dataclass(frozen=True, eq=False)
class _Waves:
    """The waves of a patch without edges.

    The mean square slope of a wave is the square of its amplitude times the sum of a function of
    its first number and one of its second number, so that sums over many waves are products of
    matrices.

    Attributes
    ----------
    amplitudes : ndarray, shape (nx, ny // 2 + 1) or (nx, ny)
        Amplitudes of Fourier's waves of a periodic patch, or of the cosines of a mirrored one [um].
    along, across : ndarray of int, shape (nx,) and (ny // 2 + 1,) or (ny,)
        Waves in the patch, or half waves in a mirrored one; negative ones of the first axis of a
        periodic patch run the other way.
    times_along, times_across : ndarray, shapes of along and across
        Number of waves for which an amplitude stands, by axis: 2 if it stands also for the wave the
        other way [1].
    aspect : float
        Second side of a cell over its first [1].
    is_periodic : bool
        Whether the patch is periodic.
    """

    amplitudes: NDArray[Any]  # complex or real
    along: Nodes
    across: Nodes
    times_along: Values
    times_across: Values
    aspect: float
    is_periodic: bool

    @classmethod
    def periodic(cls, heights: Field, aspect: float) -> _Waves:
        """Return the waves of a periodic patch of cells with an aspect, second side over first."""
        from scipy import fft  # here, because few contacts need it

        rows, columns = heights.shape
        across = np.arange(columns // 2 + 1)
        stand_for_one = (across == 0) | (2 * across == columns)
        return cls(
            amplitudes=fft.rfft2(heights, norm="forward"),
            along=np.rint(fft.fftfreq(rows, 1 / rows)).astype(np.intp),
            across=across,
            times_along=np.ones(rows),
            times_across=np.where(stand_for_one, 1.0, 2.0),
            aspect=aspect,
            is_periodic=True,
        )

    @classmethod
    def mirrored(cls, heights: Field, aspect: float) -> _Waves:
        """Return the cosines of a mirrored patch; its nodes are the centres of cells."""
        from scipy import fft  # here, because few contacts need it

        rows, columns = heights.shape
        along = np.arange(rows)
        across = np.arange(columns)
        return cls(
            amplitudes=fft.dctn(heights, norm="forward"),
            along=along,
            across=across,
            times_along=np.where(along == 0, 1.0, 2.0),
            times_across=np.where(across == 0, 1.0, 2.0),
            aspect=aspect,
            is_periodic=False,
        )

    def cut(self, nodes: tuple[int, int]) -> tuple[Field, float]:
        """Return the heights of those waves that fewer nodes have, and the share of the others.

        Parameters
        ----------
        nodes : tuple of int
            Nodes (mx, my) of the coarser grid.

        Returns
        -------
        heights : ndarray, shape (mx, my)
            Heights on the coarser grid, of zero mean [um].
        dropped : float
            Share of the mean square slope of the waves that are cut [1].
        """
        from scipy import fft  # here, because few contacts need it

        half_waves = 2 if self.is_periodic else 1
        rows = np.flatnonzero(half_waves * np.abs(self.along) < nodes[0])
        columns = np.flatnonzero(half_waves * self.across < nodes[1])
        kept = self.amplitudes[np.ix_(rows, columns)]
        share = 1.0
        if self._mean_square_slope > 0:
            share = self._slope_of(kept, rows, columns) / self._mean_square_slope
        spectrum = (nodes[0], nodes[1] // 2 + 1) if self.is_periodic else nodes
        amplitudes = np.zeros(spectrum, dtype=self.amplitudes.dtype)
        amplitudes[np.ix_(self.along[rows], self.across[columns])] = kept
        heights: Field
        if self.is_periodic:
            heights = fft.irfft2(amplitudes, s=nodes, norm="forward")
        else:
            heights = fft.idctn(amplitudes, norm="forward")
        return np.ascontiguousarray(heights), max(1.0 - share, 0.0)

    @computed_once
    def _mean_square_slope(self) -> float:
        """Mean square slope of all waves, in an arbitrary unit."""
        rows, columns = self.amplitudes.shape
        return self._slope_of(self.amplitudes, np.arange(rows), np.arange(columns))

    def _slope_of(self, amplitudes: NDArray[Any], rows: Nodes, columns: Nodes) -> float:
        """Return the mean square slope of waves in the unit of `_mean_square_slope`.

        `amplitudes` are those of the given rows and columns of all amplitudes [um].
        """
        squares = amplitudes.real**2
        if self.is_periodic:  # amplitudes are complex
            squares += amplitudes.imag**2
        nodes_across = self.times_across.size
        if self.is_periodic:
            nodes_across = 2 * (nodes_across - 1)
        slope_along = (self.along[rows] / self.along.size) ** 2
        slope_across = (self.across[columns] / nodes_across / self.aspect) ** 2
        times_along = self.times_along[rows]
        times_across = self.times_across[columns]
        weights = np.stack([times_across, times_across * slope_across], axis=1)
        sums = squares @ weights
        part_along = (times_along * slope_along) @ sums[:, 0]
        part_across = times_along @ sums[:, 1]
        return float(part_along + part_across)


def _read_free(
    heights: Field, nodes: tuple[int, int], aspect: float
) -> tuple[Field, float]:
    """Return a free surface at the centres of larger cells.

    What the coarser grid has not is the difference to the surface that is read back from it by
    cubic splines. It is measured on some lines of the map.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights [um].
    nodes : tuple of int
        Nodes (mx, my) of the coarser grid.
    aspect : float
        Second side of a cell over its first [1].

    Returns
    -------
    heights : ndarray, shape (mx, my)
        Heights on the coarser grid [um].
    dropped : float
        Share of the mean square slope of this difference, at least that of the waves that are lost
        [1].
    """
    places: list[Values] = []
    fewer = heights
    for axis in (0, 1):
        step = heights.shape[axis] / nodes[axis]
        places.append((np.arange(nodes[axis]) + 0.5) * step - 0.5)
        fewer = _interpolated(fewer, axis, places[axis])
    along = _squared_slopes_of_lines(heights, fewer, places)
    across = _squared_slopes_of_lines(heights.T, fewer.T, places[::-1])
    total = along.of_map + across.of_map / aspect**2
    lost = along.of_difference + across.of_difference / aspect**2
    return np.ascontiguousarray(fewer), lost / total if total > 0 else 0.0


def _interpolated(heights: Field, axis: int, places: Values) -> Field:
    """Return heights at places [spacing] along an axis, interpolated from the nodes around.

    Each is by Lagrange's polynomial through the `NODES_BESIDE` nodes around its place.

    Places at nodes give the heights of these nodes.
    """
    nodes = heights.shape[axis]
    beside = min(NODES_BESIDE, nodes)
    first = np.floor(places).astype(np.intp) - (beside // 2 - 1)
    first = np.clip(first, 0, nodes - beside)
    read_shape = list(heights.shape)
    read_shape[axis] = places.size
    read: Field = np.zeros(read_shape)
    from_first = places - first
    for number in range(beside):
        weight = np.ones_like(places)
        for other in range(beside):
            if other != number:
                weight *= (from_first - other) / (number - other)
        neighbours = heights.take(first + number, axis)
        read += neighbours * np.expand_dims(weight, 1 - axis)
    return read


@dataclass(frozen=True)
class _SquaredSlopes:
    """Mean squares of the slopes of lines along an axis [um2 / spacing2].

    Attributes
    ----------
    of_map : float
        Mean square slope of the map.
    of_difference : float
        Mean square slope of the map less the surface that is read back from fewer nodes.
    """

    of_map: float
    of_difference: float


def _squared_slopes_of_lines(
    heights: Field, fewer: Field, places: list[Values]
) -> _SquaredSlopes:
    """Return mean square slopes along the first axis, on some lines of a map.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights of the map [um].
    fewer : ndarray, shape (mx, my)
        Heights at the places [um].
    places : list of ndarray, shapes (mx,) and (my,)
        Places of the fewer nodes along both axes [spacing].
    """
    first, last = places[1][[0, -1]]
    within = np.arange(math.ceil(first), math.floor(last) + 1)
    lines = within[:: max(1, within.size // LINES)]
    first, last = places[0][[0, -1]]
    window = slice(math.ceil(first), math.floor(last) + 1)
    inner_nodes = np.arange(window.start, window.stop, dtype=np.float64)
    map_lines = heights[window, lines]
    read_back = _splined(fewer, 1, places[1], lines.astype(np.float64))
    read_back = _splined(read_back, 0, places[0], inner_nodes)
    slopes = np.diff(map_lines, axis=0)
    differences = np.diff(map_lines - read_back, axis=0)
    return _SquaredSlopes(float(np.mean(slopes**2)), float(np.mean(differences**2)))


def _splined(heights: Field, axis: int, nodes: Values, places: Values) -> Field:
    """Return heights at some places along an axis, by the cubic spline through those at nodes."""
    from scipy.interpolate import make_interp_spline  # here, because few contacts need it

    read: Field = make_interp_spline(nodes, heights, 3, axis=axis)(places)
    return read
