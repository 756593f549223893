"""The population of a scene, sampled on nested grids until the means of a law are within errors.

Each surface is made on the grid of the scene and read on coarser grids of the same patch, with the
waves that these can carry. Its datum is the highest node on the grid of the scene, on all grids
(`bem.coarsening`). `gen.law.multilevel` chooses and judges the samples. Surfaces are numbered as in
a database of the scene, and each number is used once. The choice of the surfaces follows from their
answers and from counts of convolutions, never from times: the same command takes the same surfaces
on all machines.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bem import NotConverged
from bem.accuracy import on_coarser_map, work
from bem.budget import ErrorParts
from bem.coarsening import Coarsening
from bem.derived.grid_error import LEAST_ORDER, slope_order
from bem.problem import NoSolution, Problem, under_load
from bem.solving import solve_posed
from gen.arrays import Values
from gen.doubts import Pressed, contact_doubts
from gen.law.accuracy import quantity_in_law
from gen.law.layer import compliance_in_law, in_series, resolves_layer
from gen.law.multilevel import (
    LARGEST_BIAS,
    PILOT,
    PILOT_OF_FINER,
    Completion,
    Level,
    Means,
    Planner,
    Refinement,
    Sample,
    Sampling,
    Unreachable,
    means_of,
)
from gen.law.order import Load, Order
from gen.law.surfaces import LawSurface, surfaces_of_scene
from gen.maps.accuracy import parts_in_words, percent, quantity_of
from gen.material import Bodies
from gen.quantities import LOADS, PRESSURE, Quantity
from gen.runtime.errors import InputError
from gen.runtime.terminal import RunProgress

if TYPE_CHECKING:
    from gen.scene import Scene

FEWEST_NODES = 16
"""Fewest nodes along an axis of a grid that is sampled."""

FIRST_LEVELS = 3
"""Number of grids that are sampled before a finer one is taken only if it is needed."""

FEWEST_OF_MANY = 32
"""Fewest nodes along an axis of grids beyond the `FIRST_LEVELS` finest ones: contacts on smaller
grids take hardly less time."""

OF_SURFACE = 2.0
"""Cost of making a surface and reading it on coarser grids, in convolutions on the grid of the
scene [1]. A rough estimate, with which grids are weighed against each other."""

OF_CONTACT = work((256, 256))
"""Cost of a contact on any grid besides its convolutions, in the unit of `bem.accuracy.work`. A
rough estimate: contacts on very few nodes take about as long as one convolution on this grid."""

Stopping = Callable[[], bool]
"""Function that returns whether to stop before the errors are met."""


@dataclass(frozen=True, eq=False)
class Layout:
    """The order of the answers of a sample: quantities at first touch, then under each load.

    Attributes
    ----------
    quantities : tuple of Quantity
        Quantities that are read off each contact.
    loads : mapping of str to ndarray
        Ascending loads of each table, (k,), by their kind [um or MPa].
    """

    quantities: tuple[Quantity, ...]
    loads: Mapping[Load, Values]

    @property
    def columns(self) -> int:
        """Number of first touch and all loads together."""
        return 1 + sum(loads.size for loads in self.loads.values())

    def places(self, load: Load) -> slice:
        """Return the columns of the loads of a table.

        Parameters
        ----------
        load : {"delta", "pressure"}
            Kind of the loads.

        Returns
        -------
        slice
            Columns of an array of shape (quantities, columns).
        """
        first = 1
        for kind, loads in self.loads.items():
            if kind == load:
                return slice(first, first + loads.size)
            first += loads.size
        raise KeyError(load)

    @property
    def loads_in_order(self) -> list[tuple[Load, float]]:
        """Kind and value of each load, in the order of the columns after first touch."""
        return [
            (kind, load) for kind, loads in self.loads.items() for load in loads.tolist()
        ]

    def by_quantity(self, answers: NDArray[Any]) -> NDArray[Any]:
        """Return answers (m,) as an array of shape (quantities, columns).

        Parameters
        ----------
        answers : ndarray, shape (m,)
            Numbers in the order of this layout.

        Returns
        -------
        ndarray, shape (quantities, columns)
            The same numbers.
        """
        return answers.reshape(len(self.quantities), self.columns)

    def largest_errors(
        self, errors: Mapping[str, float], requested: tuple[Load, ...]
    ) -> Values:
        """Return the largest relative error of each answer.

        Parameters
        ----------
        errors : mapping of str to float
            Errors by the names of the answers in `bem.answers.ANSWERS` [1].
        requested : tuple of str
            Kinds of the loads whose tables have these errors.

        Returns
        -------
        ndarray, shape (m,)
            The errors, infinite for answers that may have any. A load of 0 is exact.
        """
        largest_errors = np.full((len(self.quantities), self.columns), math.inf)
        for name, error in errors.items():
            row = self.quantities.index(quantity_in_law(name))
            for load in requested:
                largest_errors[row, self.places(load)] = np.where(
                    self.loads[load] > 0, error, math.inf
                )
        return largest_errors.ravel()


@dataclass(frozen=True, eq=False)
class _GridAnswers:
    """Answers of a surface on one grid.

    Attributes
    ----------
    values : ndarray, shape (m,)
        Answers, NaN under a load that has no solution or whose contact was not solved.
    convolutions : float
        Convolutions of all contacts, in convolutions on the grid of the scene [1].
    pressed : list of Pressed
        What doubts are judged by, of each solved contact.
    """

    values: Values
    convolutions: float
    pressed: list[Pressed]


@dataclass(eq=False)
class Sampler:
    """The solver of the surfaces of a scene on nested grids.

    It collects the last three attributes while it solves.

    Attributes
    ----------
    order : Order
        The request for the law.
    scene : Scene
        The scene, with the boundary of the law.
    text : str
        Input that names the scene.
    bodies : Bodies
        Material of the bodies.
    layout : Layout
        Loads and quantities.
    tolerance : float
        Tolerance of the solver [Delta].
    full_contact : float
        Smallest displacement of full contact of the surfaces that were solved beyond it [um].
    faults : dict
        The first reason why a contact was not solved, by the kind and the value of its load.
    doubts : list of str
        The first doubt about the contacts of each of the first surfaces.
    """

    order: Order
    scene: Scene
    text: str
    bodies: Bodies
    layout: Layout
    tolerance: float
    full_contact: float = math.inf
    faults: dict[tuple[Load, float], str] = field(default_factory=dict)
    doubts: list[str] = field(default_factory=list)

    @property
    def shape(self) -> tuple[int, int]:
        """Nodes (nx, ny) of the grid of the scene."""
        return self.scene.grid.shape

    def nested_grids(self) -> list[tuple[int, int]]:
        """Return the grids, from the coarsest one to that of the scene.

        Grids whose cells are no smaller than a layer are left out, but for that of the scene.

        Returns
        -------
        list of tuple of int
            Nodes (mx, my); each grid has half of the nodes a side of the next one.
        """
        nodes = self.shape
        grids = [nodes]
        while min(nodes) >= 2 * FEWEST_NODES - 1:
            nodes = (nodes[0] + 1) // 2, (nodes[1] + 1) // 2
            if len(grids) >= FIRST_LEVELS and min(nodes) < FEWEST_OF_MANY:
                break
            if not self.resolves_layer(nodes):
                break
            grids.append(nodes)
        return grids[::-1]

    def surface(self, number: int) -> LawSurface:
        """Make a surface of the scene.

        Parameters
        ----------
        number : int
            Index of the surface, as in a database of the scene.

        Returns
        -------
        LawSurface
            The surface.
        """
        [surface] = surfaces_of_scene(self.scene, self.text, range(number, number + 1))
        return surface

    def posed(self, surface: LawSurface) -> Problem:
        """Pose the contact of a surface at first touch, with the bodies and the tolerance.

        Parameters
        ----------
        surface : LawSurface
            The surface.

        Returns
        -------
        Problem
            The problem with a datum, so that the cells of all grids cover the same patch.
        """
        return replace(
            surface.posed(self.bodies),
            hardness=self.bodies.hardness,
            rtol=self.tolerance,
            max_iterations=self.scene.contact.max_iterations,
            datum=0.0,
        )

    def sample(
        self, number: int, nodes: tuple[int, int], coarser: tuple[int, int] | None
    ) -> Sample:
        """Solve a surface under all loads on a grid, and on the next coarser one.

        Faults, full contacts and doubts are added to the attributes.

        Parameters
        ----------
        number : int
            Index of the surface.
        nodes : tuple of int
            Nodes (mx, my) of the grid.
        coarser : tuple of int or None
            Nodes of the coarser grid; None to leave it out.

        Returns
        -------
        Sample
            The answers on both grids.

        Raises
        ------
        InputError
            If the surface has no value of a quantity at first touch.
        """
        surface = self.surface(number)
        problem = self.posed(surface)
        coarsening = Coarsening(
            problem.heights, problem.boundary, problem.aspect, problem.reduced_body
        )
        at_rest = self._at_rest(problem)
        first_touch = coarsening.on(nodes)
        on_grid = on_coarser_map(problem, first_touch)
        answers = self._answers(on_grid, at_rest)
        convolutions = answers.convolutions
        cost = OF_SURFACE + convolutions + self.cost_of_contacts
        coarser_values: Values | None = None
        coarser_cost = 0.0
        if coarser is not None:
            on_coarser = on_coarser_map(problem, coarsening.on(coarser))
            of_coarser = self._answers(on_coarser, at_rest)
            coarser_values = of_coarser.values
            convolutions += of_coarser.convolutions
            coarser_cost = of_coarser.convolutions + self.cost_of_contacts
        if number < PILOT and answers.pressed:
            load = self.order.requested[0]
            self.doubts += contact_doubts(
                surface.heights, self.bodies, load, answers.pressed
            )[:1]
        return Sample(
            values=answers.values,
            coarser_values=coarser_values,
            waves_dropped=first_touch.dropped,
            slope_order=slope_order(on_grid.heights, problem.boundary),
            cost=cost,
            coarser_cost=coarser_cost,
            convolutions=convolutions,
        )

    @property
    def cost_of_contacts(self) -> float:
        """Cost of the contacts under all loads besides their convolutions, in the same unit."""
        return (self.layout.columns - 1) * OF_CONTACT / work(self.shape)

    def _at_rest(self, problem: Problem) -> Values:
        """Return all quantities at first touch, (quantities,)."""
        try:
            return np.array(
                [
                    quantity.resting(problem, self.order.media)
                    for quantity in self.layout.quantities
                ]
            )
        except (ValueError, ArithmeticError) as error:
            raise InputError(f"{self.text}: {error}") from None

    def _answers(self, problem: Problem, at_rest: Values) -> _GridAnswers:
        """Solve a problem under all loads.

        `at_rest` has its answers at first touch, (quantities,).
        """
        layout = self.layout
        values = np.full((len(layout.quantities), layout.columns), np.nan)
        values[:, 0] = at_rest
        convolutions = 0.0
        pressed: list[Pressed] = []
        for column, (kind, load) in enumerate(layout.loads_in_order, 1):
            try:
                contact = solve_posed(_under(problem, kind, load))
                convolutions += contact.convolutions
                values[:, column] = [
                    quantity.in_law(contact, self.order.media)
                    for quantity in layout.quantities
                ]
            except NoSolution:
                full = problem.datum_height - float(problem.heights.mean())
                self.full_contact = min(self.full_contact, full)
                continue
            except ArithmeticError as error:
                if isinstance(error, NotConverged):
                    convolutions += error.contact.convolutions
                self.faults.setdefault((kind, load), str(error))
                continue
            pressed.append(
                Pressed(
                    delta=contact.delta,
                    largest_pressure=contact.largest_pressure,
                    is_full=contact.contact_nodes == contact.pressure.size,
                )
            )
        values = self._with_layer(values)
        share = work(problem.heights.shape) / work(self.shape)
        return _GridAnswers(
            values=values.ravel(), convolutions=convolutions * share, pressed=pressed
        )

    def _with_layer(self, values: Values) -> Values:
        """Return values, (quantities, columns), whose closures have a layer if the law has it."""
        compliance = compliance_in_law(self.order, self.bodies)
        if compliance == 0:
            return values
        names = [quantity.in_laws for quantity in self.layout.quantities]
        curves = dict(zip(names, values, strict=True))
        together = in_series(curves, curves[PRESSURE.in_laws], compliance)
        return np.array([together[name] for name in names])

    def resolves_layer(self, nodes: tuple[int, int]) -> bool:
        """Return whether the cells of a grid are smaller than a layer; True for half-spaces."""
        contact = self.scene.contact
        return resolves_layer(self.bodies, nodes, self.scene.grid.sides, contact.boundary)


def _under(problem: Problem, kind: Load, value: float) -> Problem:
    """Return a problem under a load [um or MPa]."""
    if kind == "delta":
        return under_load(problem, value)
    return under_load(problem, None, pressure=value)


@dataclass(frozen=True)
class SampledGrid:
    """A grid of a law of means, and its surfaces.

    Attributes
    ----------
    nodes : tuple of int
        Nodes (mx, my).
    surfaces : tuple of int
        Indices of the surfaces that were solved on it.
    is_counted : bool
        False if the grid was found not to be worth its samples, and is not in the means.
    convolutions : float
        Convolutions of its contacts, in convolutions on the grid of the scene [1].
    """

    nodes: tuple[int, int]
    surfaces: tuple[int, ...]
    is_counted: bool
    convolutions: float


class PopulationSearch:
    """The sampling of a population until means have the errors that are asked for.

    Parameters
    ----------
    sampler : Sampler
        Solver of the surfaces.
    planner : Planner
        Choice of grids and numbers of surfaces.
    stopping : callable
        Function that tells whether to stop.
    """

    def __init__(self, sampler: Sampler, planner: Planner, stopping: Stopping) -> None:
        self.sampler = sampler
        self.planner = planner
        self.stopping = stopping
        self.grids = sampler.nested_grids()
        self.levels: list[Level] = []
        self.surfaces: list[list[int]] = []  # indices of the surfaces of each level
        self.coarsest = 0  # index of the coarsest level that is in the means
        self.stopped = False

    @property
    def next_surface(self) -> int:
        """Index of the first surface that is not used yet."""
        return sum(map(len, self.surfaces))

    @property
    def means(self) -> Means:
        """The means from all samples that there are."""
        return means_of(self.counted_levels, self.planner.tolerance)

    @property
    def counted_levels(self) -> list[Level]:
        """The levels that are in the means. A last one with too few surfaces is left out."""
        levels = self.levels[self.coarsest :]
        while len(levels) > 1 and levels[-1].surface_count < 2:
            levels.pop()
        return levels

    @property
    def sampled_grids(self) -> list[SampledGrid]:
        """All grids with their surfaces."""
        counted = self.counted_levels
        return [
            SampledGrid(
                nodes=level.nodes,
                surfaces=tuple(surfaces),
                is_counted=level in counted,
                convolutions=level.convolutions,
            )
            for level, surfaces in zip(self.levels, self.surfaces, strict=True)
            if level.samples
        ]

    def run(self) -> None:
        """Sample the population until the errors are met, or until it has to stop.

        Raises
        ------
        InputError
            If the errors are not reachable on the grid of the scene; if the sampling had to stop
            before two surfaces were solved; or if a surface has no value of a quantity at first
            touch.
        """
        with RunProgress(PILOT, "surfaces") as progress:
            for _ in range(min(FIRST_LEVELS, len(self.grids))):
                self._refine(PILOT, progress)
            while not self.must_stop():
                step = self.planner.next_step(
                    self.levels[self.coarsest :], self._cost_of_finer()
                )
                match step:
                    case Completion():
                        break
                    case Refinement():
                        self._refine(PILOT_OF_FINER, progress)
                    case Sampling():
                        self.coarsest += step.coarsest
                        self._sample_more(step, progress)
                    case Unreachable():
                        raise InputError(self._unreachable())
        if self.levels[0].surface_count < 2:
            raise InputError(
                "stopped before two surfaces were solved: there are no means"
            )

    def must_stop(self) -> bool:
        """Return whether to stop: once it is true, it stays so.

        Returns
        -------
        bool
            True if the sampling has to stop, or had to before.
        """
        self.stopped = self.stopped or self.stopping()
        return self.stopped

    def _refine(self, surfaces: int, progress: RunProgress) -> None:
        """Take the next finer grid, and solve some surfaces on it."""
        self.levels.append(Level(self.grids[len(self.levels)]))
        self.surfaces.append([])
        number = len(self.levels) - 1
        progress.expect(self.next_surface + surfaces)
        self._sample(number, surfaces, progress)

    def _sample_more(self, step: Sampling, progress: RunProgress) -> None:
        """Solve more surfaces on all grids, as a step says, beginning with the coarsest."""
        counts = dict(enumerate(step.numbers, self.coarsest))
        more = {
            level: max(count - self.levels[level].surface_count, 0)
            for level, count in counts.items()
        }
        progress.expect(self.next_surface + sum(more.values()))
        for level, number in more.items():
            self._sample(level, number, progress)

    def _sample(self, number: int, surfaces: int, progress: RunProgress) -> None:
        """Solve further surfaces on the level with an index, until the sampling has to stop."""
        level = self.levels[number]
        coarser = self.grids[number - 1] if number > self.coarsest else None
        for _ in range(surfaces):
            if self.must_stop():
                return
            index = self.next_surface
            level.samples.append(self.sampler.sample(index, level.nodes, coarser))
            self.surfaces[number].append(index)
            progress.advance(rows=1)

    def _cost_of_finer(self) -> float | None:
        """Return the expected cost of a sample on the next finer grid; None if there is none.

        The sample is solved on the finest grid that there is, too, and is expected to take as many
        convolutions on the finer one.
        """
        if len(self.levels) == len(self.grids):
            return None
        finest = self.levels[-1]
        fixed = OF_SURFACE + self.sampler.cost_of_contacts  # the same on all grids
        ratio = work(self.grids[len(self.levels)]) / work(finest.nodes)
        return finest.cost + fixed + ratio * max(finest.cost - fixed, 0.0)

    def _unreachable(self) -> str:
        """Say which errors are not reachable, what the best ones are, and what helps."""
        nx, ny = self.sampler.shape
        errors = self.sampler.order.errors or {}
        worst = worst_errors(
            self.sampler.layout, self.means, self.planner.relative_errors, errors
        )
        unmet = [
            error.text
            for error in worst
            if error.parts.bias > LARGEST_BIAS * error.parts.asked_error
        ]
        return (
            f"{self.sampler.text}: not reachable on the {nx} x {ny} nodes of the scene,"
            f" however many surfaces: {'; '.join(unmet)}: ask for no less, or give the scene more"
            " nodes"
        )


@dataclass(frozen=True)
class MeanErrorParts(ErrorParts):
    """Relative error of a mean, kept with a probability of 95 %, by its causes.

    Attributes
    ----------
    surfaces : float
        Error for the finite number of surfaces [1]. The attributes of `ErrorParts` have the others.
    """

    surfaces: float = 0.0

    @property
    def bias(self) -> float:
        """Error that more surfaces do not reduce [1]."""
        return super().total

    @property
    def total(self) -> float:
        """Root of the sum of the squares of all parts [1]."""
        return math.hypot(self.bias, self.surfaces)

    @classmethod
    def of(cls, means: Means, place: int, asked_error: float) -> MeanErrorParts:
        """Return the relative error of one of several means.

        Parameters
        ----------
        means : Means
            Means and their absolute errors.
        place : int
            Index of the mean.
        asked_error : float
            The error that was asked for [1].

        Returns
        -------
        MeanErrorParts
            The error, infinite for a mean of 0.
        """
        value = abs(float(means.mean[place]))

        def relative(errors: Values) -> float:
            """Return the relative error of this mean from the absolute errors of all means."""
            return float(errors[place]) / value if value > 0 else math.inf

        return cls(
            asked_error=asked_error,
            grid=relative(means.grid),
            waves=relative(means.waves),
            solver=relative(means.solver),
            surfaces=relative(means.surfaces),
        )


@dataclass(frozen=True)
class WorstError:
    """The error of an answer at the load where it is largest, over the error that was asked for.

    Attributes
    ----------
    name : str
        Name of the answer.
    load : str
        The load with its unit.
    parts : MeanErrorParts
        The error.
    """

    name: str
    load: str
    parts: MeanErrorParts

    @property
    def text(self) -> str:
        """The error with its parts, in words."""
        return (
            f"{quantity_of(self.name).noun} within {percent(self.parts.total)} at 95 %,"
            f" {parts_in_words(self.parts)}, surfaces {percent(self.parts.surfaces)} (at"
            f" {self.load})"
        )


def worst_errors(
    layout: Layout, means: Means, largest_errors: Values, names: Iterable[str]
) -> list[WorstError]:
    """Return the error of each answer at its worst load.

    Parameters
    ----------
    layout : Layout
        Order of the answers.
    means : Means
        Means and their errors.
    largest_errors : ndarray, shape (m,)
        Largest relative errors, see `Layout.largest_errors` [1].
    names : iterable of str
        Names of the answers of which errors were asked for.

    Returns
    -------
    list of WorstError
        One for each answer. An answer is left out if it has no finite mean under a load
        with a finite largest error.
    """
    places = layout.by_quantity(np.arange(largest_errors.size))
    worst: list[WorstError] = []
    for name in names:
        row = layout.quantities.index(quantity_in_law(name))
        candidates = [
            WorstError(
                name=name,
                load=_load_at(layout, column),
                parts=MeanErrorParts.of(means, int(place), float(largest_errors[place])),
            )
            for column, place in enumerate(places[row])
            if math.isfinite(largest_errors[place]) and math.isfinite(means.mean[place])
        ]
        if candidates:
            worst.append(
                max(
                    candidates,
                    key=lambda error: error.parts.total / error.parts.asked_error,
                )
            )
    return worst


def _load_at(layout: Layout, column: int) -> str:
    """Write the load of a column of a layout, which is not first touch, with its unit."""
    kind, load = layout.loads_in_order[column - 1]
    return f"{load:.4g} {LOADS[kind].unit}"


def refuse_unsuitable(sampler: Sampler, surfaces: Sequence[LawSurface]) -> None:
    """Refuse a scene for whose means no error can be promised, before anything is solved.

    Parameters
    ----------
    sampler : Sampler
        Solver of the surfaces.
    surfaces : sequence of LawSurface
        The first surfaces of the scene.

    Raises
    ------
    InputError
        If the scene has another kernel or far field than the default, a load is not allowed, the
        surfaces have too few nodes or a layer too thin for these, or their waves go on down to the
        grid.
    """
    contact = sampler.scene.contact
    for key, allowed in (("kernel", "uniform-pressure"), ("far_field", "rigid")):
        value = getattr(contact, key)
        if value != allowed:
            raise InputError(
                f"{sampler.text}: contact.{key} = {value!r}: with --error use {allowed!r},"
                " because answers of the other one belong to their grid"
            )
    nx, ny = sampler.shape
    coarser = (nx + 1) // 2, (ny + 1) // 2
    if not sampler.resolves_layer(coarser):
        raise InputError(
            f"{sampler.text}: {nx} x {ny} nodes: on half of the nodes a cell is no smaller than the"
            " layer, so that no error can be told: give the scene more nodes"
        )
    if len(sampler.nested_grids()) < 2:
        raise InputError(
            f"{sampler.text}: {nx} x {ny} nodes: --error needs {2 * FEWEST_NODES - 1}"
            " nodes a side or more, because coarser grids tell the error"
        )
    problems = [sampler.posed(surface) for surface in surfaces]
    _refuse_loads(sampler, problems[0])
    orders = [slope_order(problem.heights, problem.boundary) for problem in problems]
    if float(np.median(orders)) < LEAST_ORDER:
        raise InputError(
            f"{sampler.text}: waves go on down to the grid, so that the area of contact has no"
            " limit and no error can be promised: give a scene whose shortest wave has 8 nodes or"
            " more, as generator = 'spectral' with a cut_off"
        )


def _refuse_loads(sampler: Sampler, problem: Problem) -> None:
    """Refuse loads that are not allowed; displacements of full contact are allowed."""
    for kind, load in sampler.layout.loads_in_order:
        try:
            _under(problem, kind, load)
        except ValueError as error:
            if kind == "delta" and isinstance(error, NoSolution):
                continue
            raise InputError(f"{sampler.text}: {error}") from None
