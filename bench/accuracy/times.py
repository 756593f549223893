"""Time `bem.solve_within` and other solvers to an area within an error, on the same surfaces.

Other solvers count nodes in contact, and the count is too large along every border of contact. They
need the coarsest grid whose count is within the error, which may be finer than the map. Where that
grid is too large to be solved here, its nodes and its time are extrapolated, and the row says so.
Such surfaces are those that need the finest grids. Ratios of times are therefore given over all
surfaces, over the measured ones, and over the extrapolated ones.

Tables call a solver with all its settings a way; ours is `bem.solve_within`.
"""

import math
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from statistics import geometric_mean, median
from typing import Any

import numpy as np

import bem
from bench.accuracy.surfaces import places
from bench.files import Row
from bench.peers import PERIODIC_LADDER, PERIODIC_SOLVERS
from bench.report import remark
from bench.resolution import SLOPE, Surface, random_waves
from bench.solvers.others import installed, missing
from bench.solvers.solver import Case, Failure, Solver
from gen.arrays import Heights

OURS = "bem.solve_within"
"""Name of our way to an area within an error."""

ERRORS = (0.03, 0.01, 0.003)
"""Relative errors of the area that all ways have to reach [1]."""

ASKED = (0.1, *ERRORS)
"""Relative errors that our way is asked for; the first one is only for the picture [1]."""

PRESSURE = 0.05 * SLOPE
"""Mean pressure on all surfaces, a twentieth of E* times the rms slope [MPa]."""

HURST = (0.8, 0.4)
"""Hurst exponents, which take turns from surface to surface [1]."""

IN_WAVE = (
    2,
    3,
    4,
    5,
    6,
    7,
    8,
    10,
    12,
    14,
    16,
    20,
    24,
    28,
    32,
    36,
    40,
    48,
    56,
    64,
    80,
    96,
    128,
)
"""Nodes in the shortest wave of the grids of the other solvers."""

LEAST_MEASURED = 0.01
"""Relative error of the area within which the other solvers take no finer grid [1].

Smaller errors are extrapolated.
"""

MAP_IN_WAVE = 32
"""Nodes in the shortest wave of the map on which our way, and all defaults, are timed."""

TRUTH_IN_WAVE = 64
"""Nodes in the shortest wave of the grid whose area in the continuum is taken as the true one."""

COARSEST = 32
"""Fewest nodes a side of the grids of other solvers."""

SHARE = 0.1
"""Largest change of a count by the solver's tolerance, over the error of the count [1]."""

DEFAULTS: Mapping[str, float] = {
    "ContactMechanics primal": 1e-6,  # its `thermotol`
    "ContactMechanics dual": 1e-8,  # its `gtol`
    "Tamaas": 1e-8,  # it has no default, and gets the most usual one
    "ASPHER": 1e-8,
    "ASPHER nested, FFT": 1e-8,
}
"""Tolerances that the solvers have by default, by their names."""

FITTED = 4
"""Most grids by which the growth of a solver's time is fitted."""

NEEDED = ("measured", "extrapolated")
"""Values of column `row` for the coarsest grid of an error."""

TURN = 0.05
"""Least CPU time of all repetitions of a solve [s]."""

SEED = 7303
"""First number of the seeds of all surfaces, which keeps them apart from those of other studies."""

PATIENCE = 5.0
"""CPU time of a solve above which it is timed only once, and no finer grid is solved [s]."""


def timed(work: Callable[[], object], turn: float = TURN) -> float:
    """Repeat work, and return the median of its CPU times.

    Parameters
    ----------
    work : callable
        Function without arguments.
    turn : float
        Least CPU time of all repetitions [s].

    Returns
    -------
    float
        Median CPU time of one repetition [s].
    """
    seconds: list[float] = []
    while sum(seconds) < turn:
        began = time.process_time()
        work()
        # A clock may be too coarse for a short solve.
        seconds.append(max(time.process_time() - began, 1e-6))
    return median(seconds)


@dataclass(frozen=True)
class Solved:
    """The area that a way gives on a grid, by its error, and the time that it takes."""

    nodes: int  # nodes a side
    seconds: float  # CPU time [s]
    error: float  # relative error of the area, with its sign [1]
    tolerance: float | None = None  # of the solver, as it defines it; None for our way


@dataclass(frozen=True)
class Rough:
    """A self-affine periodic surface under `PRESSURE`, and its true area.

    Its side is 1 um, and E* is 1 MPa.
    """

    waves: int  # periods of the shortest wave on a side
    number: int  # number of the surface
    surface: Surface
    true_area: float  # [%]

    @classmethod
    def drawn(cls, waves: int, number: int) -> "Rough":
        """Draw the surface of a number, and solve it on the fine grid.

        Parameters
        ----------
        waves : int
            Periods of the shortest wave on a side.
        number : int
            Number of the surface.

        Returns
        -------
        Rough
            The surface.
        """
        random = np.random.default_rng((SEED, waves, number))
        surface = random_waves(1, waves, HURST[number % len(HURST)], random)
        fine = surface(places(TRUTH_IN_WAVE * waves, "periodic"))
        return cls(waves, number, surface, _pressed(fine).continuum_area_percent)

    def heights(self, in_wave: int) -> Heights:
        """Return the heights on a grid.

        Parameters
        ----------
        in_wave : int
            Nodes in the shortest wave.

        Returns
        -------
        ndarray, shape (n, n)
            Heights [um].
        """
        return self.surface(places(in_wave * self.waves, "periodic"))

    def error(self, area: float) -> float:
        """Return the relative error of an area in percent, with its sign [1].

        Parameters
        ----------
        area : float
            Share of the patch in contact [%].
        """
        return area / self.true_area - 1


def _pressed(heights: Heights) -> bem.Contact:
    """Press a periodic surface by `PRESSURE` on one thread."""
    return bem.solve(heights, 1.0, pressure=PRESSURE, boundary="periodic", threads=1)


def time_to_area(waves: Sequence[int], surfaces: int, largest: int) -> list[Row]:
    """Time all ways to an area within an error, on the same surfaces.

    Prints the progress, and the packages that are not installed, on standard error.

    Parameters
    ----------
    waves : sequence of int
        Periods of the shortest wave on a side; surfaces are drawn for each of them.
    surfaces : int
        Number of surfaces for each number of waves.
    largest : int
        Most nodes a side of a grid that is solved by other solvers.

    Returns
    -------
    list of Row
        Rows for each way and surface. Column `row` is "grid" for each grid that was solved. It is
        "default" for the map with default settings; other solvers have this row on the first
        surface of each number of waves. For each error of `ERRORS` and other solver it is
        "measured" or "extrapolated" for the coarsest grid within the error. Column `within_percent`
        has this error, for our way the error that was asked for, and None in all other rows.
    """
    peers = PERIODIC_SOLVERS[1:]
    for package, install in missing(peers).items():
        remark(f"{package} is not installed and left out: {install}")
    rows: list[Row] = []
    for number_of_waves, number in product(waves, range(surfaces)):
        rough = Rough.drawn(number_of_waves, number)
        rows += _rows_of_surface(rough, installed(peers), largest)
        remark(f"{number_of_waves} waves, surface {number}")
    return rows


def _rows_of_surface(rough: Rough, peers: Sequence[Solver], largest: int) -> list[Row]:
    """Return the rows of one surface.

    Our way takes a turn after each grid of the other solvers, so that slow seconds of the machine
    slow all of them.
    """
    ours = _Ours(rough)
    timed_peers = [_Peer(rough, solver) for solver in peers]
    ours.take_turn()
    for in_wave in IN_WAVE:
        if all(peer.is_done for peer in timed_peers):
            break
        if COARSEST <= in_wave * rough.waves <= largest:
            grid = _Grid.solved(rough, in_wave)
            for peer in timed_peers:
                peer.take_grid(grid)
            ours.take_turn()
    rows = ours.rows()
    for peer in timed_peers:
        rows += peer.rows(ours)
    if rough.number == 0:
        map_grid = _Grid.solved(rough, MAP_IN_WAVE)
        for peer in timed_peers:
            rows += peer.default_rows(map_grid, ours)
    return rows


def _row(
    rough: Rough,
    way: str,
    kind: str,
    solved: Solved,
    *,
    within: float | None = None,
    ours: "_Ours",
) -> Row:
    """Return a row of a way.

    `kind` is the value of column `row`. `within` is the error that this grid is needed for [1]; it
    is None for a grid that no error needs. Column `times_ours` is the time over that of our way to
    the same error.
    """
    times = None
    if within is not None and within in ours.solved:
        times = solved.seconds / ours.solved[within].seconds
    return {
        "waves": rough.waves,
        "surface": rough.number,
        "way": way,
        "row": kind,
        "within_percent": None if within is None else 100 * within,
        "nodes": solved.nodes,
        "nodes_in_wave": solved.nodes / rough.waves,
        "tolerance": solved.tolerance,
        "area_error_percent": 100 * solved.error,
        "seconds": solved.seconds,
        "times_ours": times,
    }


class _Ours:
    """Our way on the map of a surface with `MAP_IN_WAVE` nodes in the shortest wave.

    Errors that cannot be reached are left out. Times are medians over all turns.
    """

    def __init__(self, rough: Rough) -> None:
        self._rough = rough
        self._map = rough.heights(MAP_IN_WAVE)
        self._seconds: dict[float, list[float]] = {}
        self._contacts: dict[float, bem.Contact] = {}
        for error in ASKED:
            try:
                self._contacts[error] = self._contact(error)  # plans transforms, too
            except bem.NotReachable as refusal:
                remark(f"{rough.waves} waves, {100 * error:g} %: {refusal}")

    def _contact(self, error: float) -> bem.Contact:
        """Ask for the area within an error."""
        return bem.solve_within(
            self._map,
            1.0,
            error,
            pressure=PRESSURE,
            boundary="periodic",
            threads=1,
        )

    def take_turn(self) -> None:
        """Time all errors that can be reached."""
        for error in self._contacts:
            seconds = timed(partial(self._contact, error))
            self._seconds.setdefault(error, []).append(seconds)

    @property
    def solved(self) -> dict[float, Solved]:
        """The solved grids by the errors that were asked for [1]."""
        return {
            asked_error: Solved(
                nodes=contact.pressure.shape[0],
                seconds=median(self._seconds[asked_error]),
                error=self._rough.error(contact.continuum_area_percent),
            )
            for asked_error, contact in self._contacts.items()
        }

    def rows(self) -> list[Row]:
        """Return a row for each error that was asked for, and one of `bem.solve`."""
        rows = [
            _row(self._rough, OURS, "grid", solved, within=error, ours=self)
            for error, solved in self.solved.items()
        ]
        area_by_default = partial(_area_by_default, self._map)
        default = Solved(
            nodes=len(self._map),
            seconds=timed(area_by_default),
            error=self._rough.error(area_by_default()),
        )
        rows.append(_row(self._rough, OURS, "default", default, ours=self))
        return rows


def _area_by_default(heights: Heights) -> float:
    """Return the area in the continuum that `bem.solve` gives by default [%]."""
    return _pressed(heights).continuum_area_percent


@dataclass(frozen=True)
class _Grid:
    """A grid of a surface, and the exact count of its nodes in contact."""

    case: Case
    error: float  # relative error of the exact count, with its sign [1]
    touching: int  # exact number of nodes in contact

    @classmethod
    def solved(cls, rough: Rough, in_wave: int) -> "_Grid":
        """Solve the grid with `in_wave` nodes in the shortest wave of a surface, by `bem.solve`."""
        heights = rough.heights(in_wave)
        contact = _pressed(heights)
        case = Case(
            name=f"{rough.waves} waves",
            heights=heights,
            side=1.0,
            delta=contact.delta,
            load=PRESSURE,
        )
        return cls(case, rough.error(contact.area_percent), contact.contact_nodes)


class _Peer:
    """Another solver on one surface: its time on each grid, at the loosest sufficient tolerance.

    A tolerance is sufficient if it changes the count by at most `SHARE` of the count's error. The
    search begins at the tolerance of the grid before.
    """

    def __init__(self, rough: Rough, solver: Solver) -> None:
        self._rough = rough
        self._solver = solver
        self._ladder = list(PERIODIC_LADDER)  # tolerances that are left to try
        self._solved: list[Solved] = []  # by rising nodes

    @property
    def is_done(self) -> bool:
        """Whether a solved grid is within `LEAST_MEASURED`, or took longer than `PATIENCE`."""
        return any(
            abs(solved.error) <= LEAST_MEASURED or solved.seconds > PATIENCE
            for solved in self._solved
        )

    def take_grid(self, grid: _Grid) -> None:
        """Find the tolerance on a grid, time the solver, and keep the time.

        Keep nothing if the solver fails, if no tolerance is sufficient, or if an earlier grid was
        the last one, see `is_done`.
        """
        if self.is_done:
            return
        while self._ladder:
            try:
                solved = self._solve(grid, self._ladder[0])
            except Failure as failure:
                remark(f"{self._solver.name}, {grid.case.nodes} nodes: {failure}")
                return
            if abs(solved.error - grid.error) <= SHARE * abs(grid.error):
                self._solved.append(self._timed_again(grid, solved))
                return
            self._ladder.pop(0)

    def _solve(self, grid: _Grid, tolerance: float) -> Solved:
        """Solve a grid with a tolerance; raise Failure if the solver fails.

        The time may include the setup that the first solve on a grid needs.
        """
        began = time.process_time()
        answer = self._solver.solve(grid.case, tolerance)
        seconds = time.process_time() - began
        touching = int(np.count_nonzero(answer.pressure > 0))
        area = 100 * touching / answer.pressure.size
        return Solved(
            nodes=grid.case.nodes,
            seconds=seconds,
            error=self._rough.error(area),
            tolerance=tolerance,
        )

    def _timed_again(self, grid: _Grid, solved: Solved) -> Solved:
        """Return a solution with the time of further solves, unless it took over `PATIENCE`."""
        if solved.seconds > PATIENCE or solved.tolerance is None:
            return solved
        solve = partial(self._solver.solve, grid.case, solved.tolerance)
        return replace(solved, seconds=timed(solve))

    def rows(self, ours: _Ours) -> list[Row]:
        """Return a row for each solved grid, and one for the coarsest grid within each error.

        The latter is extrapolated if no solved grid is within the error. It is left out if fewer
        than two grids were solved.
        """
        name = self._solver.name
        rows = [
            _row(self._rough, name, "grid", solved, ours=ours) for solved in self._solved
        ]
        for within in ERRORS:
            sufficient = [
                solved for solved in self._solved if abs(solved.error) <= within
            ]
            if sufficient:
                kind = "measured"
                coarsest = sufficient[0]
            elif len(self._solved) > 1:
                kind = "extrapolated"
                coarsest = extrapolated(self._solved, within)
            else:
                continue
            rows.append(_row(self._rough, name, kind, coarsest, within=within, ours=ours))
        return rows

    def default_rows(self, grid: _Grid, ours: _Ours) -> list[Row]:
        """Return the row of the solver's default tolerance on the map; none if it fails."""
        name = self._solver.name
        try:
            solved = self._timed_again(grid, self._solve(grid, DEFAULTS[name]))
        except Failure as failure:
            remark(f"{name} by default: {failure}")
            return []
        return [_row(self._rough, name, "default", solved, ours=ours)]


def extrapolated(solved: Sequence[Solved], within: float) -> Solved:
    """Extrapolate the nodes and the time that a count needs to be within an error.

    The error of a count is proportional to the spacing, by a factor that is the median over the
    last `FITTED` grids. The time grows with a power of the nodes a side, which is fitted to these
    grids and kept between 2 (time proportional to the number of all nodes) and 3.

    Parameters
    ----------
    solved : sequence of Solved
        Grids by rising nodes, two or more.
    within : float
        The relative error [1].

    Returns
    -------
    Solved
        The nodes a side and the time of the grid whose error, with its sign, has the size `within`.
    """
    last = solved[-1]
    of_fit = solved[-FITTED:]
    power, _ = np.polyfit(
        np.log([grid.nodes for grid in of_fit]),
        np.log([grid.seconds for grid in of_fit]),
        deg=1,
    )
    power = min(max(float(power), 2.0), 3.0)
    error_by_nodes = median(grid.nodes * abs(grid.error) for grid in of_fit)
    nodes = max(math.ceil(error_by_nodes / within), last.nodes)
    seconds = last.seconds * (nodes / last.nodes) ** power
    return Solved(nodes, seconds, math.copysign(within, last.error), last.tolerance)


def ratios(rows: Sequence[Row]) -> list[Row]:
    """Return the times of the other solvers over ours, as geometric means over surfaces.

    Parameters
    ----------
    rows : sequence of Row
        Rows of `time_to_area`.

    Returns
    -------
    list of Row
        A row for each error and solver. It has the number of surfaces on which the grid of the
        error is known, and the geometric means of the nodes a side and of the times over ours on
        these; then the same for the surfaces on which that grid was measured, and for those on
        which it was extrapolated. A mean over no surface is None.
    """
    groups: dict[tuple[float, str], list[Row]] = {}
    for row in rows:
        if row["row"] in NEEDED and row["times_ours"]:
            key = (row["within_percent"], row["way"])
            groups.setdefault(key, []).append(row)
    return [
        {"within_percent": within, "way": way, **_ratio(group)}
        for (within, way), group in sorted(groups.items())
    ]


def _ratio(rows: Sequence[Row]) -> Row:
    """Return the means over all surfaces, over measured grids, and over extrapolated ones."""
    groups = {"all": rows}
    for kind in NEEDED:
        groups[kind] = [row for row in rows if row["row"] == kind]
    ratio: Row = {}
    for name, group in groups.items():
        ratio[f"{name}_surfaces"] = len(group)
        ratio[f"{name}_nodes"] = _mean(row["nodes"] for row in group)
        ratio[f"{name}_times_ours"] = _mean(row["times_ours"] for row in group)
    return ratio


def _mean(values: Iterable[float]) -> float | None:
    """Return the geometric mean of positive numbers; None if there are none."""
    numbers = list(values)
    return geometric_mean(numbers) if numbers else None


def curves(rows: Sequence[Row]) -> list[Row]:
    """Return error and time of each way, as means over surfaces.

    Parameters
    ----------
    rows : sequence of Row
        Rows of `time_to_area`.

    Returns
    -------
    list of Row
        A row for each number of waves, way and grid (of our way: each error asked for). It has the
        geometric means of the time [s] and of the size of the error [%], and those with default
        settings: of our way over all surfaces, of other solvers on the first surface alone. Grids
        that not all surfaces have are left out.
    """
    groups: dict[tuple[Any, ...], list[Row]] = {}
    for row in rows:
        if row["row"] in {"grid", "default"}:
            setting = row["within_percent"] or row["nodes_in_wave"]
            if row["row"] == "default":
                setting = "default"
            key = (row["waves"], row["way"], setting)
            groups.setdefault(key, []).append(row)
    surfaces = 1 + max((row["surface"] for row in rows), default=0)
    points = []
    for (waves, way, setting), group in groups.items():
        defaults = groups.get((waves, way, "default"))
        if setting == "default" or defaults is None or len(group) < surfaces:
            continue
        points.append(
            {
                "waves": waves,
                "way": way,
                **_means(group),
                **{f"default_{name}": value for name, value in _means(defaults).items()},
            }
        )
    return points


def _means(rows: Sequence[Row]) -> Row:
    """Return the geometric means of time and error; an error is at least 0.001 %."""
    errors = [max(abs(row["area_error_percent"]), 1e-3) for row in rows]
    return {
        "seconds": geometric_mean([row["seconds"] for row in rows]),
        "area_error_percent": geometric_mean(errors),
    }
