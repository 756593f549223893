"""A law of the means over a scene's population, which have the errors that were asked for.

The tables of the law are those of one surface whose answers are the means. Their band is the error
of the means, not the scatter of the surfaces.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bem.accuracy import tolerance_for, work
from bem.budget import Budget, Trial
from gen.law.contact_law import (
    Law,
    Making,
    Tables,
    bodies_of,
    law_of,
    table_of,
    with_contacts_between,
)
from gen.law.curves import APART, Curves, risen
from gen.law.layer import check_layer
from gen.law.multilevel import PILOT, Level, Planner
from gen.law.order import ARGUMENTS, Load, Order
from gen.law.population import (
    Layout,
    PopulationSearch,
    Sampler,
    Stopping,
    refuse_unsuitable,
    worst_errors,
)
from gen.law.sampled import (
    MeansOfTable,
    MeansSolver,
    SampledMeans,
    means_of_table,
    solved_loads,
)
from gen.law.surfaces import read_law_surfaces, scene_as_input
from gen.quantities import DELTA, IN_LAWS
from gen.runtime.errors import InputError

BAND = (
    "the error of the mean, kept 95 times in 100: for the number of surfaces, the grid, dropped"
    " waves and the solver"
)
"""Description of the band of a law of means."""


def by_means(order: Order, stopping: Stopping | None = None) -> Law:
    """Make a law of the means over a scene's population.

    Parameters
    ----------
    order : Order
        The request, with the errors of the means in the tables whose loads it gives.
    stopping : callable, optional
        Function that tells whether to stop before the errors are met.

    Returns
    -------
    Law
        The law, whose attribute `sampled` has the errors of the means and the numbers of surfaces.

    Raises
    ------
    InputError
        If there are further inputs beside the scene; if the scene, a load or an error cannot be
        used; if the errors are not reachable; if the sampling had to stop before two surfaces were
        solved; or if no load was solved on every surface.
    """
    errors = dict(order.errors or {})
    loads = order.loads()
    if not errors:
        raise InputError("give --error, the errors of the means")
    if not loads:
        raise InputError("give --delta or --pressure, the loads of the law")
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
    check_layer(order, bodies)
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
    largest_errors = layout.largest_errors(errors, tuple(loads))
    search = PopulationSearch(
        sampler=replace(sampler, layout=layout),
        planner=Planner(largest_errors, sampler.tolerance),
        stopping=stopping or (lambda: False),
    )
    search.run()
    means = search.means
    worst = worst_errors(layout, means, largest_errors, errors)
    sampled = SampledMeans(
        asked_errors=errors,
        tables={
            ARGUMENTS[load]: means_of_table(
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
    [other] = layout.loads
    if not sampler.order.both_tables:
        return Layout(layout.quantities, {**layout.loads, load: np.empty(0)})
    coarsest = sampler.nested_grids()[0]
    level = Level(coarsest)
    for number in range(PILOT):
        level.samples.append(sampler.sample(number, coarsest, None))
    sampler.doubts.clear()  # the first surfaces are solved again, on all grids
    row = layout.quantities.index(IN_LAWS[ARGUMENTS[load]])
    answers = layout.by_quantity(level.values.mean(axis=0))[row, layout.places(other)]
    means = np.sort(answers[np.isfinite(answers)])
    means = means[risen(means)]
    if load == "pressure" and sampler.bodies.hardness is not None:
        means = means[means < (1 - APART) * sampler.bodies.hardness]
    return Layout(layout.quantities, {**layout.loads, load: means})


def _remarks(sampled: SampledMeans) -> list[str]:
    """Return lines about the errors and the numbers of surfaces, after a warning if it stopped."""
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
        solved = solved_loads(sampler, means, load, _budgets(search, sampled, means))
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
    table = sampled.tables[DELTA.in_laws]  # it begins at first touch
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
        budget = Budget(sampled.nodes, search.sampler.tolerance, trials=(trial,))
        budgets.append(budget)
    return tuple(budgets)
