"""Means over a population, their errors, and how they were sampled: the record beside a law."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from bem.budget import Budget
from gen.arrays import Values
from gen.law.accuracy import quantity_in_law
from gen.law.curves import Curves, Points
from gen.law.multilevel import Level, Means, means_of
from gen.law.order import Load, Order
from gen.law.population import (
    Layout,
    MeanErrorParts,
    PopulationSearch,
    SampledGrid,
    Sampler,
)
from gen.law.solver import BETWEEN, NOT_SOLVED, SolvedLoads, ends_below
from gen.maps.accuracy import RELATIVE_ERROR
from gen.quantities import DELTA, IN_LAWS, LOADS
from gen.runtime.documents import Row
from gen.runtime.terminal import RunProgress


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
        """Return the index of a load.

        Parameters
        ----------
        load : float
            A load [um or MPa].

        Returns
        -------
        int or None
            The index; None if the table was not sampled under this load.
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
                self.by_quantity[quantity_in_law(name).in_laws], place, asked_error
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
        Whether all errors are met; they may not be if the sampling had to stop.
    left : sequence of str
        For each answer, a line with its largest error over the loads and the parts of this error.
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
        """The number of surfaces on each grid, and the work, as a line for people."""
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


def means_of_table(
    layout: Layout, means: Means, load: Load, *, from_rest: bool
) -> MeansOfTable:
    """Return the means under the loads of a table.

    Parameters
    ----------
    layout : Layout
        Order of the answers.
    means : Means
        Means of all answers.
    load : {"delta", "pressure"}
        Kind of the loads of the table.
    from_rest : bool
        Whether to put first touch before the loads.

    Returns
    -------
    MeansOfTable
        The means of the table.
    """
    places = layout.places(load)
    columns = np.arange(places.start, places.stop)
    loads = layout.loads[load]
    if from_rest:
        columns = np.append(0, columns)
        loads = np.append(0.0, loads)
    indices = layout.by_quantity(np.arange(means.mean.size))
    return MeansOfTable(
        at=loads,
        by_quantity={
            quantity.in_laws: means.chosen(indices[row, columns])
            for row, quantity in enumerate(layout.quantities)
        },
    )


def solved_loads(
    sampler: Sampler,
    means: MeansOfTable,
    load: Load,
    budgets: tuple[Budget | None, ...] = (),
) -> SolvedLoads:
    """Return means as the contacts of one surface.

    Parameters
    ----------
    sampler : Sampler
        Solver of the surfaces, which knows why loads were not solved.
    means : MeansOfTable
        Means of a table.
    load : {"delta", "pressure"}
        Kind of the loads.
    budgets : tuple of Budget or None
        Budgets of the errors that were asked for under each load, None at first touch.

    Returns
    -------
    SolvedLoads
        The means under the loads that were solved on every surface, with their errors as intervals.
    """
    loads = means.at
    values: dict[str, Values] = {}
    low: dict[str, Values] = {}
    high: dict[str, Values] = {}
    for name, of_quantity in means.by_quantity.items():
        mean = of_quantity.mean.copy()
        # An unknown error gives no interval.
        reach = np.where(np.isfinite(of_quantity.total), of_quantity.total, np.nan)
        reach[(loads == 0) & (mean == 0)] = 0.0  # exact at first touch
        values[name] = mean
        low[name] = np.clip(mean - reach, *IN_LAWS[name].bounds)
        high[name] = np.clip(mean + reach, *IN_LAWS[name].bounds)
    kept = np.isfinite(values[DELTA.in_laws])
    for name, mean in values.items():
        # Infinite as soon as one surface is in full contact.
        if IN_LAWS[name].diverges:
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
    """Return lines why loads are left out: one for full contact, and one for each known fault."""
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
        table = means_of_table(sampler.layout, means, load, from_rest=False)
        return solved_loads(sampler, table, load)
