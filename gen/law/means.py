"""A law of the means over a scene's population, which have the errors that were asked for.

The tables of the law are those of one surface whose answers are the means. Their band is the error
of the means, not the scatter of the surfaces.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from bem.accuracy import work
from bem.budget import Budget, Trial
from gen.arrays import Values
from gen.law.contact_law import (
    Law,
    Making,
    Tables,
    bodies_of,
    law_of,
    table_of,
    with_contacts_between,
)
from gen.law.curves import APART, Curves, Points, risen
from gen.law.multilevel import PILOT, Level, Means, Planner, means_of
from gen.law.order import ARGUMENTS, Load, Order
from gen.law.population import (
    ANSWERS_IN_LAWS,
    Layout,
    MeanErrorParts,
    PopulationSearch,
    SampledGrid,
    Sampler,
    Stopping,
    refuse_unsuitable,
    tolerance_for,
    worst_errors,
)
from gen.law.solver import BETWEEN, NOT_SOLVED, SolvedLoads, ends_below
from gen.law.surfaces import read_law_surfaces, scene_as_input
from gen.maps.accuracy import RELATIVE_ERROR
from gen.quantities import DELTA, IN_LAWS, LOADS
from gen.runtime.documents import Row
from gen.runtime.errors import InputError
from gen.runtime.terminal import RunProgress

BAND = (
    "the error of the mean, kept 95 times in 100: for the number of surfaces, the grid, dropped"
    " waves and the solver"
)
"""Description of the band of a law of means."""


@dataclass(frozen=True, eq=False)
class MeansOfTable:
    """Means under the loads of a table, and the parts of their errors at 95 %.

    Attributes
    ----------
    at : ndarray, shape (k,)
        Ascending loads [um or MPa].
    by_quantity : mapping of str to Means
        Means and absolute errors, (k,), by the names of the quantities in laws and in their units.
    """

    at: Values
    by_quantity: Mapping[str, Means]

    def place(self, load: float) -> int | None:
        """Return the index of a load; None if the table was not sampled there.

        Parameters
        ----------
        load : float
            A load [um or MPa].

        Returns
        -------
        int or None
            The index.
        """
        places = np.flatnonzero(self.at == load)
        return int(places[0]) if places.size else None

    def errors(self, place: int, asked: Mapping[str, float]) -> dict[str, MeanErrorParts]:
        """Return the relative errors of the answers that were asked for, under a load.

        Parameters
        ----------
        place : int
            Index of the load.
        asked : mapping of str to float
            Errors that were asked for, by the names of the answers [1].

        Returns
        -------
        dict of str to MeanErrorParts
            The errors by the names of the answers.
        """
        return {
            name: MeanErrorParts.of(
                self.by_quantity[ANSWERS_IN_LAWS[name].in_laws], place, asked_error
            )
            for name, asked_error in asked.items()
        }


@dataclass(frozen=True, eq=False)
class SampledMeans:
    """How the means of a law were sampled, and their errors.

    Attributes
    ----------
    asked_errors : mapping of str to float
        Largest relative errors at 95 % that were asked for, by the names of the answers [1].
    tables : mapping of str to MeansOfTable
        Means of both tables with their errors, by the column of their loads.
    grids : sequence of SampledGrid
        Grids with their surfaces, from the coarsest one.
    nodes : tuple of int
        Nodes (nx, ny) of the grid of the scene.
    is_met : bool
        Whether all errors are met. They are not if the sampling had to stop.
    left : sequence of str
        The largest error of each answer over the loads, with its parts, one line each.
    """

    asked_errors: Mapping[str, float]
    tables: Mapping[str, MeansOfTable]
    grids: Sequence[SampledGrid]
    nodes: tuple[int, int]
    is_met: bool
    left: Sequence[str]

    @property
    def convolutions(self) -> float:
        """Convolutions of all contacts, in convolutions on the grid of the scene [1]."""
        return sum(grid.convolutions for grid in self.grids)

    def cells(self, table: Curves, place: int) -> Row:
        """Return the cells about the means at one argument of a table.

        Parameters
        ----------
        table : Curves
            Table of the law.
        place : int
            Index of the argument.

        Returns
        -------
        dict
            The part of each error that was asked for which is due to the number of surfaces [%],
            and the standard error of each quantity; "" where nothing was sampled.
        """
        means = self.tables[table.against]
        index = means.place(float(table.at[place]))
        row: Row = {}
        for name in self.asked_errors:
            row[f"{name}{RELATIVE_ERROR}from_surfaces_percent"] = ""
        for name in means.by_quantity:
            row[f"{name}_standard_error"] = ""
        if index is None:
            return row
        errors: dict[str, MeanErrorParts] = {}
        if table.at[place] > 0:
            errors = means.errors(index, self.asked_errors)
        for name, parts in errors.items():
            row[f"{name}{RELATIVE_ERROR}from_surfaces_percent"] = 100 * parts.surfaces
        for name, of_quantity in means.by_quantity.items():
            standard_error = float(of_quantity.standard_error[index])
            if math.isfinite(standard_error):
                row[f"{name}_standard_error"] = standard_error
        return row

    @property
    def in_json(self) -> dict[str, Any]:
        """The grids and the number of surfaces on each, for JSON."""
        return {
            "nodes": list(self.nodes),
            "errors_met": self.is_met,
            "convolutions": self.convolutions,
            "grids": [
                {
                    "nodes": list(grid.nodes),
                    "surfaces": len(grid.surfaces),
                    "in_the_means": grid.is_counted,
                    "convolutions": grid.convolutions,
                }
                for grid in self.grids
            ],
        }

    @property
    def grids_in_words(self) -> str:
        """The number of surfaces on each grid, and the work."""
        texts = []
        for grid in self.grids:
            text = f"{len(grid.surfaces)} on {grid.nodes[0]} x {grid.nodes[1]} nodes"
            if not grid.is_counted:
                text += " (not worth more, left out)"
            texts.append(text)
        return (
            f"surfaces: {', '.join(texts)}; work of {self.convolutions:.4g} convolutions on"
            f" {self.nodes[0]} x {self.nodes[1]} nodes"
        )


def by_means(
    order: Order, loads: Mapping[Load, Values], stopping: Stopping | None = None
) -> Law:
    """Make a law of the means over a scene's population.

    Parameters
    ----------
    order : Order
        The request, with the errors of the means in the tables that it requests.
    loads : mapping of str to ndarray
        Loads of the order by their kind, one or both [um or MPa].
    stopping : callable, optional
        Function that tells whether to stop before the errors are met.

    Returns
    -------
    Law
        The law, with `sampled`.

    Raises
    ------
    InputError
        If there are further inputs beside the scene; if the scene, a load or an error cannot be
        used; if the errors are not reachable; or if no load was solved on every surface.
    """
    errors = dict(order.errors or {})
    scene_text = _only_scene(order)
    order = replace(
        order,
        grid_error=order.grid_error or "area" in errors,
        stiffness=order.stiffness or "stiffness" in errors,
    )
    subjects = read_law_surfaces(replace(order, surfaces=PILOT, errors=None))
    scene = subjects.inputs[0].scene
    assert scene is not None  # `_only_scene` has refused other inputs
    bodies = bodies_of(order, subjects)
    order.refuse_impossible(bodies.hardness)
    sampler = Sampler(
        order=order,
        scene=scene,
        text=scene_text,
        bodies=bodies,
        layout=Layout(order.quantities, loads),
        tolerance=tolerance_for(errors),
    )
    refuse_unsuitable(sampler, subjects.surfaces)
    layout = _with_other_table(sampler)
    asked = layout.asked(errors, tuple(loads))
    search = PopulationSearch(
        sampler=replace(sampler, layout=layout),
        planner=Planner(asked, sampler.tolerance),
        stopping=stopping or (lambda: False),
    )
    search.run()
    means = search.means
    worst = worst_errors(layout, means, asked)
    sampled = SampledMeans(
        asked_errors=errors,
        tables={
            ARGUMENTS[load]: _means_of_table(
                layout, means, load, from_rest=load == "delta" or load not in loads
            )
            for load in layout.loads
        },
        grids=search.sampled_grids,
        nodes=sampler.shape,
        is_met=all(error.parts.is_met for error in worst),
        left=[error.text for error in worst],
    )
    number = search.next_surface
    about = scene_as_input(scene, scene_text, f"the means of its first {number} surfaces")
    tables = _tables(search, sampled, tuple(loads))
    making = Making(method="means by multilevel Monte Carlo", band=BAND)
    law = law_of(
        order=order,
        subjects=replace(subjects, surfaces=subjects.surfaces[:1], inputs=[about]),
        bodies=bodies,
        tables=replace(tables, remarks=[*_remarks(sampled), *tables.remarks]),
        making=making,
    )
    law = replace(law, sampled=sampled)
    if not order.between or search.stopped:
        return law
    return with_contacts_between(law, MeansSolver(order, search))


def _only_scene(order: Order) -> str:
    """Return the only input of an order, a scene. Raises InputError if there are several inputs."""
    if len(order.inputs) > 1:
        raise InputError(
            f"--error: {len(order.inputs)} inputs with a scene among them: give one scene, or"
            " surfaces from files"
        )
    return order.inputs[0]


def _with_other_table(sampler: Sampler) -> Layout:
    """Return a layout with the loads of the table for which the order gives none.

    These are the means of its argument under the loads of the other table, over the first surfaces
    on the coarsest grid. There are none if the order leaves this table out.
    """
    layout = sampler.layout
    missing = [load for load in ARGUMENTS if load not in layout.loads]
    if not missing:
        return layout
    [load] = missing
    [given] = layout.loads
    if not sampler.order.both_tables:
        return Layout(layout.quantities, {**layout.loads, load: np.empty(0)})
    coarsest = sampler.nested_grids()[0]
    level = Level(coarsest)
    for number in range(PILOT):
        level.samples.append(sampler.sample(number, coarsest, None))
    sampler.doubts.clear()  # the first surfaces are solved again, on all grids
    row = layout.quantities.index(IN_LAWS[ARGUMENTS[load]])
    mean = layout.by_quantity(level.values.mean(axis=0))[row, layout.places(given)]
    means = np.sort(mean[np.isfinite(mean)])
    means = means[risen(means)]
    if load == "pressure" and sampler.bodies.hardness is not None:
        means = means[means < (1 - APART) * sampler.bodies.hardness]
    return Layout(layout.quantities, {**layout.loads, load: means})


def _means_of_table(
    layout: Layout, means: Means, load: Load, *, from_rest: bool
) -> MeansOfTable:
    """Return the means under the loads of a table, with first touch before them if `from_rest`."""
    places = layout.places(load)
    columns = np.arange(places.start, places.stop)
    loads = layout.loads[load]
    if from_rest:
        columns = np.append(0, columns)
        loads = np.append(0.0, loads)

    def of_quantity(part: Values, row: int) -> Values:
        """Return the numbers of a quantity under these loads."""
        numbers: Values = layout.by_quantity(part)[row, columns]
        return numbers

    return MeansOfTable(
        loads,
        {
            quantity.in_laws: Means(
                mean=of_quantity(means.mean, row),
                standard_error=of_quantity(means.standard_error, row),
                surfaces=of_quantity(means.surfaces, row),
                grid=of_quantity(means.grid, row),
                waves=of_quantity(means.waves, row),
                solver=of_quantity(means.solver, row),
            )
            for row, quantity in enumerate(layout.quantities)
        },
    )


def _remarks(sampled: SampledMeans) -> list[str]:
    """Return lines about the errors and the numbers of surfaces."""
    lines = [*sampled.left, sampled.grids_in_words]
    if not sampled.is_met:
        lines.insert(
            0, "warning: stopped before the errors were met; what is left of them:"
        )
    return lines


def _tables(
    search: PopulationSearch, sampled: SampledMeans, requested: tuple[Load, ...]
) -> Tables:
    """Tabulate means against Delta and against pressure, and say which loads are left out.

    Raises InputError if a requested table has no load that was solved on every surface.
    """
    sampler = search.sampler
    remarks: list[str] = []
    if sampler.doubts:
        remarks.append(f"warning: {sampler.doubts[0]}")
    tables: dict[Load, Curves] = {}
    for load in ARGUMENTS:
        means = sampled.tables[ARGUMENTS[load]]
        solved = _solved_loads(sampler, means, load, _budgets(search, sampled, means))
        if load in requested and not (solved.loads > 0).any():
            reason = solved.remarks[0] if solved.remarks else "give larger ones"
            raise InputError(f"no load was solved on every surface; {reason}")
        remarks += solved.remarks
        at_rest = _at_rest(sampled, sampler.layout)
        tables[load] = table_of(load, solved, [at_rest], sampler.order, from_rest=False)
    return Tables(
        over_delta=tables["delta"], over_pressure=tables["pressure"], remarks=remarks
    )


def _at_rest(sampled: SampledMeans, layout: Layout) -> dict[str, float]:
    """Return the means at first touch by names in laws."""
    table = sampled.tables[DELTA.in_laws]  # it begins there
    return {
        quantity.in_laws: float(table.by_quantity[quantity.in_laws].mean[0])
        for quantity in layout.quantities
        if quantity.at_rest is not None
    }


def _budgets(
    search: PopulationSearch, sampled: SampledMeans, table: MeansOfTable
) -> tuple[Budget | None, ...]:
    """Return the budget of the errors under each load of a table, None at first touch."""
    finest = search.counted_levels[-1]
    dropped = float(np.mean([sample.waves_dropped for sample in finest.samples]))
    budgets: list[Budget | None] = []
    for place, load in enumerate(table.at.tolist()):
        if load == 0:
            budgets.append(None)
            continue
        trial = Trial(
            nodes=finest.nodes,
            waves_dropped=dropped,
            errors=table.errors(place, sampled.asked_errors),
            reason=sampled.grids_in_words,
            convolutions=sampled.convolutions * work(sampled.nodes) / work(finest.nodes),
            work=sampled.convolutions,
        )
        budgets.append(Budget(sampled.nodes, search.sampler.tolerance, (trial,)))
    return tuple(budgets)


def _solved_loads(
    sampler: Sampler,
    means: MeansOfTable,
    load: Load,
    budgets: tuple[Budget | None, ...] = (),
) -> SolvedLoads:
    """Return means as the contacts of one surface, under the loads solved on every surface."""
    loads = means.at
    values: dict[str, Values] = {}
    low: dict[str, Values] = {}
    high: dict[str, Values] = {}
    for name, of_quantity in means.by_quantity.items():
        mean = of_quantity.mean.copy()
        reach = np.where(np.isfinite(of_quantity.total), of_quantity.total, np.nan)
        reach[(loads == 0) & (mean == 0)] = 0.0
        values[name] = mean
        low[name] = np.clip(mean - reach, *IN_LAWS[name].bounds)
        high[name] = np.clip(mean + reach, *IN_LAWS[name].bounds)
    kept = np.isfinite(values[DELTA.in_laws])
    for name, mean in values.items():
        if IN_LAWS[name].diverges:  # infinite as soon as one surface is in full contact
            mean[kept & ~np.isfinite(mean)] = math.inf
        else:
            kept &= np.isfinite(mean)
    points = Points(
        values=values,
        low=low,
        high=high,
        reasons=("",) * loads.size,
        unresolved=("",) * loads.size,
        budgets=budgets,
    )
    return SolvedLoads(
        loads=loads[kept],
        points=[points.chosen(kept)],
        remarks=_left_out(sampler, load, loads[~kept]),
    )


def _left_out(sampler: Sampler, load: Load, left_out: Values) -> list[str]:
    """Say why loads are left out of a table, in a line for full contact and one for each fault."""
    lines: list[str] = []
    if load == "delta" and (left_out >= sampler.full_contact).any():
        lines.append(ends_below(sampler.full_contact))
    for value in left_out.tolist():
        fault = sampler.faults.get((load, value))
        if fault:
            text = f"{value:.4g} {LOADS[load].unit}"
            lines.append(f"{NOT_SOLVED} on a surface, left out: {text}: {fault}")
    return lines


@dataclass(frozen=True, eq=False)
class MeansSolver:
    """The solver of the same surfaces on the same grids under further loads.

    Attributes
    ----------
    order : Order
        The request, with the quantities of the contacts.
    search : PopulationSearch
        The sampling, which has ended.
    """

    order: Order
    search: PopulationSearch

    @property
    def has_one_surface(self) -> bool:
        """False: means at given pressures are no means at given Deltas."""
        return False

    def for_loads_between(self, order: Order) -> Self:
        """Return a solver of contacts between the loads of a law.

        Parameters
        ----------
        order : Order
            The request, with the quantities of these contacts.

        Returns
        -------
        MeansSolver
            The solver.
        """
        return replace(self, order=order)

    def solve_some(self, load: Load, loads: Values) -> SolvedLoads:
        """Solve all surfaces under loads, and return their means as contacts of one surface.

        Parameters
        ----------
        load : {"delta", "pressure"}
            Kind of the loads.
        loads : ndarray, shape (k,)
            Ascending loads [um or MPa].

        Returns
        -------
        SolvedLoads
            Means under the loads that were solved on every surface; under none if it has to stop.
        """
        search = self.search
        sampler = replace(
            search.sampler,
            order=self.order,
            layout=Layout(self.order.quantities, {load: loads}),
            full_contact=math.inf,
            faults={},
        )
        grids = [grid for grid in search.sampled_grids if grid.is_counted]
        levels: list[Level] = []
        total = sum(len(grid.surfaces) for grid in grids)
        with RunProgress(total, f"surfaces {BETWEEN[load]}") as progress:
            for number, grid in enumerate(grids):
                coarser = grids[number - 1].nodes if number else None
                level = Level(grid.nodes)
                for surface in grid.surfaces:
                    if search.must_stop():
                        return SolvedLoads(loads=np.empty(0), points=[])
                    level.samples.append(sampler.sample(surface, grid.nodes, coarser))
                    progress.advance(rows=1)
                levels.append(level)
        means = means_of(levels, sampler.tolerance)
        table = _means_of_table(sampler.layout, means, load, from_rest=False)
        return _solved_loads(sampler, table, load)
