"""Doubts about a scene: from a trial of few rows before a run, from its rows afterwards.

A trial solves the rows with the smallest, the middle and the largest load among the first ones of
the plan. It writes nothing. Of the user's functions it calls the one that makes surfaces, and only
in a completed scene, which needs trust.
"""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from gen.arrays import Columns
from gen.doubts import SolvedRows, Tally, rows_doubts
from gen.generation.plan import parameters
from gen.material import Bodies
from gen.quantities import CONTACT_NODES, DELTA, FORCE
from gen.runtime.errors import InputError
from gen.schema import Status
from gen.statistics import rms_slope_of

if TYPE_CHECKING:
    from gen.database import Reader
    from gen.scene import Scene

PLANNED_ROWS = 1000  # first rows of the plan, whose loads are looked at
ALWAYS_NODES = 129**2  # most nodes at which a trial is cheap, however short the run is
MOST_NODES = (
    513**2
)  # most nodes of a trial: with more, a contact takes too long to be tried
SHARE = 20  # rows of a run for each row of its trial, where a trial is not cheap
LONGEST = 5.0  # largest time for a surface of a trial, and for a contact [s]
CHUNK_ROWS = 65_536  # rows of a database that are read together

RESULTS = (DELTA.name, FORCE.name, CONTACT_NODES.name)
STATISTICS = ("height_max", "height_rms", "peak_density", "bandwidth_x", "bandwidth_y")
USED = (*RESULTS, *STATISTICS)
"""Columns by which a row is doubted."""


def doubts_before(scene: Scene, rows: int) -> list[str]:
    """Doubt a scene before rows of it are computed, by a trial.

    Parameters
    ----------
    scene : Scene
        A completed scene.
    rows : int
        Number of rows that the run is to compute; a trial costs a small share of it.

    Returns
    -------
    list of str
        One line for each doubt. Rows that cannot be tried, because they take too long, have no
        solution or fail, cause none.
    """
    tally = Tally()
    if math.prod(scene.grid.shape) <= MOST_NODES:
        tally = _tally_of_trial(scene, _tried_rows(scene, rows))
    if scene.quantity in {"pressure", "force"}:
        # Loads of all rows are known, also where none was tried.
        tally = replace(tally, pressure=_largest_planned_pressure(scene))
    return _doubts(scene, tally, "tried rows")


def doubts_after(reader: Reader) -> list[str]:
    """Doubt a database by the rows that are done.

    Parameters
    ----------
    reader : Reader
        An open database.

    Returns
    -------
    list of str
        One line for each doubt.
    """
    tally = Tally()
    for start in reader.rows[::CHUNK_ROWS]:
        stop = min(start + CHUNK_ROWS, reader.rows.stop)
        columns = {name: reader.column(name, start, stop) for name in ("status", *USED)}
        tally += _tally(reader.scene, columns)
    return _doubts(reader.scene, tally, "rows")


def _doubts(scene: Scene, tally: Tally, noun: str) -> list[str]:
    """Return the doubts about the material of a scene, or else those about rows, called `noun`."""
    contact = scene.contact
    if contact.doubts:
        return contact.doubts  # the rows would repeat what the material does to them
    bodies = Bodies(contact.e_star, has_modulus=contact.has_modulus)
    return rows_doubts(tally, bodies, scene.quantity, max(scene.grid.spacing), noun)


def _tally_of_trial(scene: Scene, rows: list[int]) -> Tally:
    """Compute rows of a scene, by their numbers, and count those that have a solution in time."""
    # Here, as commands that read a database do without the solver.
    from gen.generation.sample import compute_rows
    from gen.scene import Store

    # Without further columns: neither their cost, nor a function of the user's.
    bare = scene.model_copy(update={"store": Store()})
    tally = Tally()
    for row in rows:
        with suppress(InputError):  # a run tells the user what is wrong with a row
            columns = compute_rows(bare, row, row + 1, limit=LONGEST)
            tally += _tally(bare, columns)
    return tally


def _tally(scene: Scene, columns: Columns) -> Tally:
    """Count the rows that are done, from their columns status and `USED`."""
    done = columns["status"] == Status.DONE
    values = {name: columns[name][done] for name in USED}
    grid = scene.grid
    with np.errstate(over="ignore"):  # files may hold any numbers
        pressure = values["force"] / math.prod((*grid.shape, *grid.spacing))
    solved = SolvedRows(
        delta=values["delta"],
        span=values["height_max"],
        slope=rms_slope_of(values, grid.spacing),
        contact_nodes=values["contact_nodes"],
        pressure=pressure,
    )
    return Tally.of(solved, math.prod(grid.shape))


def _largest_planned_pressure(scene: Scene) -> float:
    """Return the largest nominal pressure [MPa] of the first rows, by their pressures or forces."""
    loads = parameters(scene, 0, min(scene.samples, PLANNED_ROWS)).load
    largest = float(loads.max())
    if scene.quantity == "force":
        largest /= math.prod((*scene.grid.shape, *scene.grid.spacing))
    return largest


def _tried_rows(scene: Scene, rows: int) -> list[int]:
    """Choose rows with the middle, the largest and the smallest load, fewer if they are expensive.

    `rows` is the number of rows of the run.
    """
    loads = parameters(scene, 0, min(scene.samples, PLANNED_ROWS)).load
    order = np.argsort(loads, kind="stable")
    chosen = [int(order[order.size // 2]), int(order[-1]), int(order[0])]
    if math.prod(scene.grid.shape) > ALWAYS_NODES:
        chosen = chosen[: rows // SHARE]
    return list(dict.fromkeys(chosen))  # a short plan has one row in two places
