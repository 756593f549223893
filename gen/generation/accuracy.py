"""The trial that finds the nodes and the tolerance of a scene that asks for an error.

It is made once, before the first row. The grid and the tolerance stand in the scene that the
database records, so that resumed runs, further parts and other machines take them from there.

The trial solves contacts at the ends of the drawn ranges (of parameters, loads and hardnesses, in
all combinations or a selection of them), and at some draws between. Each contact has a surface of
its own, and none is a row of the database: the random numbers come from a seed of the trial, so
that scenes that differ in their seed alone have the same nodes. A grid is taken if at most one in
twenty of these contacts is beyond an error that is asked for. Errors are judged by the bars of
`Contact.grid_error` at 95 %, which are several times the true error in the median. The grids are
tried from the coarsest one on, and a grid is left as soon as too many of its contacts are beyond.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

import bem
from bem.accuracy import (
    FURTHEST,
    MOST_FOR_WAVES,
    OF_DROPPED,
    error_parts,
    grids,
    tolerance_for,
)
from bem.bodies import HALF_SPACE
from bem.budget import ErrorParts
from bem.coarsening import sampled_lines
from bem.derived.grid_error import LEAST_ORDER, slope_order_of_lines
from gen.generation.plan import Plan, parameters
from gen.generation.sample import (
    UNSOLVED,
    absolute_load,
    made_surface_of,
    on_grid_of_contacts,
    settings_of,
)
from gen.runtime.errors import InputError, SourceError
from gen.runtime.farm import Overtime, time_limit
from gen.runtime.memory import too_little_for_solve
from gen.runtime.terminal import RunProgress
from gen.scene import Scene
from gen.scene.accuracy import ErrorRecord, FoundGrid, TriedGrid, answer_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gen.arrays import Values

SEED = 1
"""Seed of the surfaces and draws of a trial, in place of the seed of the scene."""

PLANNED_ROWS = 1000
"""Number of planned rows whose values show the ends of the drawn ranges."""

ENDS = (0.025, 0.975)
"""Ends of the drawn ranges, as probabilities: 95 % of all values are between them."""

MOST_ENDS = 5
"""Largest number of drawn quantities of which all combinations of ends are tried.

If more quantities are drawn, `COMBINATIONS` random combinations are tried.
"""

COMBINATIONS = 2**MOST_ENDS
"""Largest number of combinations of ends that are tried."""

DRAWS = 16
"""Number of contacts of a trial with drawn parameters and loads."""

MOST_BEYOND = 0.05
"""Largest share of the contacts of a trial that may be beyond an error that is asked for."""

BEST_ORDER = 3.0
"""Largest power of the spacing with which bars may fall.

Grids on which errors would still be too large at this power are skipped, unless they have
`FURTHEST` times the nodes a side of the grid before.
"""

ENDLESS = "waves go on down to this grid, so that no bar holds"
"""Reason why an elastic contact on a surface without a shortest wave has no error."""

THIN = "a cell of this grid is no smaller than the layer, so that no bar holds"
"""Reason why a contact on a layer has no error: the layer rules at the border of contact."""

CUT = "this grid drops too many of the waves"
"""Reason why a contact on a grid that lacks too many waves has no error."""


@dataclass(frozen=True)
class _JudgedContact:
    """A contact of a trial with the errors of its answers."""

    errors: dict[str, ErrorParts]  # by the keys of [accuracy]; empty without a bar
    reason: str  # why there are no errors, or the reason that the bars give for theirs
    row: int  # position of the contact in the plan of the trial

    @property
    def ratio(self) -> float:
        """Largest ratio of an error to the one asked for, infinite without a bar [1]."""
        ratios = [parts.total / parts.asked_error for parts in self.errors.values()]
        return max(ratios, default=math.inf)

    @property
    def in_words(self) -> str:
        """The errors in words."""
        words = []
        for key, parts in self.errors.items():
            reached = f"{key} to {parts.total:.2g}"
            if parts.total == math.inf:
                reached = f"no bar of {key}"
            words.append(reached)
        return ", ".join(words) or "no bar"

    @property
    def is_beyond(self) -> bool:
        """Whether an error is larger than the one asked for."""
        return self.ratio > 1


@dataclass(frozen=True)
class _JudgedGrid:
    """A grid of a trial, and the contacts that were tried on it and have a solution."""

    nodes: tuple[int, int]
    contacts: list[_JudgedContact]

    @property
    def beyond(self) -> list[_JudgedContact]:
        """The contacts that are beyond an error, by rising ratio."""
        beyond = [contact for contact in self.contacts if contact.is_beyond]
        return sorted(beyond, key=lambda contact: contact.ratio)

    @property
    def holds(self) -> bool:
        """Whether few enough contacts are beyond an error, and there is at least one."""
        most_beyond = MOST_BEYOND * len(self.contacts)
        return bool(self.contacts) and len(self.beyond) <= most_beyond

    @property
    def ratio(self) -> float:
        """Smallest factor by which errors must fall before a finer grid may hold [1].

        It is infinite if no contact is beyond an error.
        """
        return self.beyond[0].ratio if self.beyond else math.inf

    @property
    def record(self) -> TriedGrid:
        """The grid as the scene records it."""
        return TriedGrid(
            nodes=self.nodes, contacts=len(self.contacts), beyond=len(self.beyond)
        )

    def errors(self) -> dict[str, ErrorRecord]:
        """Return the largest error of each answer by its key, for a grid that holds.

        Contacts that are beyond an error are left out.
        """
        within = [contact.errors for contact in self.contacts if not contact.is_beyond]
        return {
            key: _record_of(max((errors[key] for errors in within), key=_total))
            for key in within[0]
        }


def _total(parts: ErrorParts) -> float:
    """Return the total of an error [1]."""
    return parts.total


def _record_of(parts: ErrorParts) -> ErrorRecord:
    """Return an error as the scene records it, with three digits."""
    return ErrorRecord(
        total=_rounded(parts.total),
        grid=_rounded(parts.grid),
        waves=_rounded(parts.waves),
        solver=_rounded(parts.solver),
    )


def _rounded(number: float) -> float:
    """Round a number to three significant digits."""
    return float(f"{number:.3g}")


def with_accuracy(
    scene: Scene, limit: float | None = None, *, watched: bool = False
) -> Scene:
    """Find the nodes and the tolerance with which rows have the errors that a scene asks for.

    No file is written. The result depends on the scene without its number of samples and its seed.
    With a `limit` it may depend on the speed of the machine too.

    Parameters
    ----------
    scene : Scene
        A scene with a table `[accuracy]` and the hashes of its sources; its surfaces are ready.
    limit : float, optional
        Largest time for each contact of the trial [s]; contacts that take longer are left out.
    watched : bool
        Whether progress and each tried grid are printed on standard error.

    Returns
    -------
    Scene
        The scene with the grid in `accuracy.found` and the tolerance in `contact.rtol`.

    Raises
    ------
    InputError
        If no grid up to the finest one gives the errors, no contact has a solution, or a contact
        does not fit into memory. The message says why.
    SourceError
        If a function of the user's fails. It is a kind of InputError.
    """
    trial = _Trial(scene, limit, watched=watched)
    try:
        solved = trial.solve()
    except MemoryError:
        raise too_little_for_solve(trial.nodes) from None
    return Scene.from_text(solved.text(), "the scene with its accuracy")


class _Trial:
    """The search for the coarsest grid of a scene that gives the errors it asks for.

    Parameters
    ----------
    scene : Scene
        The scene, without a grid in `accuracy.found`.
    limit : float or None
        Largest time for each contact [s]; None for no limit.
    watched : bool
        Whether progress is printed.
    """

    def __init__(self, scene: Scene, limit: float | None, *, watched: bool) -> None:
        assert scene.accuracy is not None  # the caller has checked it
        self.asked = scene.accuracy.asked
        tolerance = _rounded(tolerance_for(self.asked))
        contact = scene.contact.model_copy(update={"rtol": tolerance})
        self.scene = scene.model_copy(update={"contact": contact})  # of the database
        # Contacts of the trial are those of a scene with another seed.
        self.tried_scene = self.scene.model_copy(
            update={"seed": SEED, "samples_per_surface": 1}
        )
        self.limit = limit
        self.watched = watched
        self.plan = planned_contacts(self.tried_scene)
        self.judged: list[_JudgedGrid] = []
        self.nodes = self.scene.made_grid.shape  # of the grid that is being tried

    def solve(self) -> Scene:
        """Return the scene with the coarsest grid that holds; InputError if there is none."""
        for nodes in self._grids():
            self.nodes = nodes
            if not self._may_hold(nodes):
                continue
            candidate = _on_nodes(self.tried_scene, self._found_grid(nodes))
            if candidate.surface.fault_on(candidate.made_grid):
                continue  # it is too coarse for the shortest waves
            if candidate.fault_of_layer():
                continue  # it is too coarse for the thinnest layer
            grid = self._judge(candidate)
            self.judged.append(grid)
            if grid.holds:
                return _on_nodes(self.scene, self._found_grid(nodes, grid.errors()))
        raise InputError(self._message())

    def _grids(self) -> list[tuple[int, int]]:
        """Return the nodes of the grids to try, from the coarsest one on."""
        grid_made = self.scene.made_grid
        finest = grid_made.shape
        ladder = list(grids(finest))
        if not self.scene.surface.ON_ANY_GRID or self.scene.has_cells:
            return ladder
        # Bars compare the grid with every second of its nodes. These reach from border to border
        # if the number of nodes is odd.
        return [*((nx + 1, ny + 1) for nx, ny in ladder[:-1]), finest]

    def _may_hold(self, nodes: tuple[int, int]) -> bool:
        """Return whether a grid may hold, judging by the grid that was tried last.

        Bars fall at most with the power `BEST_ORDER` of the spacing. The finest grid is
        always tried.
        """
        if not self.judged or nodes == self.scene.made_grid.shape:
            return True
        last = self.judged[-1]
        if last.ratio == math.inf:
            return True
        factor = min(math.pow(last.ratio, 1 / BEST_ORDER), FURTHEST)
        return max(nodes) >= factor * max(last.nodes)

    def _judge(self, candidate: Scene) -> _JudgedGrid:
        """Solve and judge the contacts on a grid, until too many are beyond an error.

        The contacts that were furthest beyond on earlier grids come first.
        """
        nodes = candidate.grid.shape
        rows = self._rows_by_ratio()
        grid = _JudgedGrid(nodes=nodes, contacts=[])
        progress = RunProgress(
            len(rows), f"contacts of the trial on {nodes[0]} x {nodes[1]} nodes"
        )
        for row in rows:
            contact = self._judged_contact(candidate, row)
            if contact is not None:
                grid.contacts.append(contact)
            if self.watched:
                progress.advance(1)
            if len(grid.beyond) > MOST_BEYOND * len(rows):
                break
        if self.watched:
            progress.say(f"  {grid.record.in_words}")
        return grid

    def _rows_by_ratio(self) -> list[int]:
        """Return the positions of all contacts, those with the largest last ratios first."""
        ratios = dict.fromkeys(range(len(self.plan.load)), 0.0)
        for grid in self.judged:
            for contact in grid.contacts:
                ratios[contact.row] = contact.ratio
        return sorted(ratios, key=lambda row: -ratios[row])

    def _judged_contact(self, candidate: Scene, row: int) -> _JudgedContact | None:
        """Return a contact of the trial with its errors; None if it has no solution."""
        try:
            with time_limit(self.limit):
                return self._solve(candidate, row)
        except SourceError:
            raise  # the user's function or a map is wrong, not this contact
        except (Overtime, *UNSOLVED):
            return None

    def _solve(self, candidate: Scene, row: int) -> _JudgedContact:
        """Solve a contact of the trial and judge it.

        Raises errors of `UNSOLVED` if it has no solution, and a SourceError of a user's function.
        """
        load = float(self.plan.load[row])
        if load == 0.0:  # nothing touches, which is exact on any grid
            errors = {
                key: ErrorParts(asked_error=asked, grid=0, waves=0, solver=0)
                for key, asked in self.asked.items()
            }
            return _JudgedContact(errors, "nothing touches", row)
        hardness = self.plan.hardness_of(row)
        settings = settings_of(candidate, hardness, self.plan.layer_of(row))
        body = settings.get("body", HALF_SPACE)
        if not body.is_deeper_than_cells(candidate.grid.spacing):
            return _JudgedContact({}, THIN, row)
        full_surface = made_surface_of(candidate, self.plan, row)
        surface = on_grid_of_contacts(candidate, full_surface, body)
        # The waves that this grid drops use up too much of the error by themselves.
        if OF_DROPPED * surface.dropped > MOST_FOR_WAVES * min(self.asked.values()):
            return _JudgedContact({}, CUT, row)
        if hardness is None:
            boundary = candidate.contact.boundary
            lines = sampled_lines(surface.heights)
            if slope_order_of_lines(lines, boundary) < LEAST_ORDER:
                return _JudgedContact({}, ENDLESS, row)
        absolute = absolute_load(candidate, surface.heights, load)
        settings[absolute.kind] = absolute.value
        contact = bem.solve(surface.heights, candidate.grid.sides, **settings)
        bars = contact.grid_error()
        errors = {
            key: error_parts(
                contact,
                bars,
                answer_of(key),
                asked_error=asked,
                dropped=surface.dropped,
            )
            for key, asked in self.asked.items()
        }
        return _JudgedContact(errors, bars.reason, row)

    def _found_grid(
        self, nodes: tuple[int, int], errors: dict[str, ErrorRecord] | None = None
    ) -> FoundGrid:
        """Return a grid as the scene records it: its nodes, its errors and all tried grids."""
        tried = tuple(grid.record for grid in self.judged)
        return FoundGrid(nodes=nodes, errors=errors or {}, tried=tried)

    def _message(self) -> str:
        """Say that no grid gives the errors, how near the finest one comes, and why."""
        requests = ", ".join(f"{key} = {error:g}" for key, error in self.asked.items())
        nx, ny = self.scene.made_grid.shape
        place = f"on {nx} x {ny} nodes, the finest grid"
        if not self.judged or not self.judged[-1].contacts:
            return (
                f"accuracy: {requests}: {place}, no contact of its trial has a solution"
            )
        nearest = self.judged[-1].beyond[0]
        advice = "more nodes in the shortest wave"
        if self.scene.surface.ON_ANY_GRID:
            advice = "more nodes or longer waves"
        return (
            f"accuracy: {requests} is not reached {place}: {nearest.in_words} where"
            f" {self._place_of(nearest.row)} ({nearest.reason}); give {advice}, or ask for less"
        )

    def _place_of(self, row: int) -> str:
        """Return the load and the drawn parameters of a contact in words."""
        values: dict[str, float] = {self.scene.quantity: float(self.plan.load[row])}
        if self.scene.contact.draws_hardness:
            values["hardness"] = self.plan.hardness_of(row) or 0.0
        values |= self.plan.parameters_of(row) | self.plan.layer_of(row)
        return ", ".join(f"{name} {value:.3g}" for name, value in values.items())


def _on_nodes(scene: Scene, found: FoundGrid) -> Scene:
    """Return a copy of a scene with another grid in `accuracy.found`."""
    assert scene.accuracy is not None  # `_Trial` has checked it
    accuracy = scene.accuracy.model_copy(update={"found": found})
    return scene.model_copy(update={"accuracy": accuracy})


def planned_contacts(scene: Scene) -> Plan:
    """Plan the contacts of a trial: at the ends of the drawn ranges, and at some drawn values.

    Parameters
    ----------
    scene : Scene
        The scene of the trial, with one sample on each surface.

    Returns
    -------
    Plan
        The contacts, each with a surface of its own.
    """
    planned = parameters(scene, 0, PLANNED_ROWS)
    quantities = [planned.load, *planned.drawn.values(), *planned.layer.values()]
    if planned.hardness is not None:
        quantities.append(planned.hardness)
    load, *others = _ends_and_draws(quantities)
    hardness = None if planned.hardness is None else others.pop()
    parameters_of_surfaces = others[: len(planned.drawn)]
    numbers_of_layers = others[len(planned.drawn) :]
    return Plan(
        surface=np.arange(load.size, dtype=np.int64),
        drawn=dict(zip(planned.drawn, parameters_of_surfaces, strict=True)),
        load=load,
        hardness=hardness,
        layer=dict(zip(planned.layer, numbers_of_layers, strict=True)),
    )


def _ends_and_draws(quantities: Sequence[Values]) -> list[Values]:
    """Return the values of the contacts of a trial: combinations of ends, then `DRAWS` rows.

    `quantities` are the planned values of each quantity, (rows,). Each is replaced by an array of
    shape (contacts,).
    """
    ends = [np.quantile(values, ENDS, method="nearest") for values in quantities]
    varied = [place for place, (low, high) in enumerate(ends) if low < high]
    if len(varied) <= MOST_ENDS:
        choices = np.array(list(itertools.product((0, 1), repeat=len(varied))))
    else:
        random = np.random.default_rng(SEED)
        choices = random.integers(0, 2, (COMBINATIONS, len(varied)))
    # 0 for the lower end of a quantity and 1 for the upper one, (combinations, quantities)
    chosen_ends = np.zeros((len(choices), len(quantities)), dtype=np.intp)
    chosen_ends[:, varied] = choices
    return [
        np.concatenate([ends[place][chosen_ends[:, place]], values[:DRAWS]])
        for place, values in enumerate(quantities)
    ]
