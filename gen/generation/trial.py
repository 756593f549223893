"""Doubts about the results of a scene, from a trial before a run or from its rows after it.

A doubt is a reason to distrust results, in one line for the user, see `gen.doubts`. It follows from
a tally: counts and extremes of rows, such as the number of rows in full contact.

A trial computes up to three of the first rows of the plan: those with the middle, the largest and
the smallest load. It writes nothing. It does not call the user's function for outputs. A user's
generator is called, which the user has trusted when the scene was completed.
"""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from gen.arrays import Columns, Values
from gen.doubts import SolvedRows, Tally, rows_doubts, unborne_loads
from gen.generation.plan import parameters
from gen.material import Bodies
from gen.quantities import CONTACT_NODES, DELTA, FORCE
from gen.runtime.errors import InputError
from gen.schema import Status
from gen.statistics import rms_slope_of

if TYPE_CHECKING:
    from gen.database import Reader
    from gen.generation.plan import Plan
    from gen.scene import Scene

PLANNED_ROWS = 1000
"""Number of first rows of the plan among which the rows of a trial are chosen by their loads."""

ALWAYS_NODES = 129**2
"""Largest number of nodes of a grid on which a trial is cheap, even before a short run."""

MOST_NODES = 513**2
"""Largest number of nodes of a grid on which rows are tried; on larger grids a contact takes too
long."""

SHARE = 20
"""A trial that is not cheap tries at most one row for every `SHARE` rows of the run."""

LONGEST = 5.0
"""Largest time for a surface of a trial, and for each of its contacts [s]."""

CHUNK_ROWS = 65_536
"""Number of rows of a database that are read together."""

USED = (
    DELTA.name,
    FORCE.name,
    CONTACT_NODES.name,
    "height_max",
    "height_rms",
    "peak_density",
    "bandwidth_x",
    "bandwidth_y",
)
"""Columns from which the doubts about rows follow: results, then statistics of the surface."""


def doubts_before(scene: Scene, rows: int) -> list[str]:
    """Return doubts about a scene before its rows are computed, from a trial of a few rows.

    Parameters
    ----------
    scene : Scene
        A completed scene.
    rows : int
        Number of rows that the run is going to compute. A short run has a shorter trial or none.

    Returns
    -------
    list of str
        One line for each doubt. Rows that take too long, have no solution or fail in the trial
        cause no doubt, except rows whose load is above what the hardness bears.
    """
    tally = Tally()
    if math.prod(scene.grid.shape) <= MOST_NODES:
        tally = _tally_of_trial(scene, _tried_rows(scene, rows))
    if scene.quantity in {"pressure", "force"}:
        # The plan has the loads of all rows, of which the trial had only a few.
        plan = parameters(scene, start=0, stop=min(scene.samples, PLANNED_ROWS))
        pressures = _nominal_pressures(scene, plan.load)
        tally = replace(tally, pressure=float(pressures.max()))
        doubts = _doubts(scene, tally, noun="tried rows")
        return doubts + _doubts_about_hardness(scene, plan, pressures)
    return _doubts(scene, tally, noun="tried rows")


def doubts_after(reader: Reader) -> list[str]:
    """Return doubts about a database from its done rows.

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
    return _doubts(reader.scene, tally, noun="rows")


def _doubts(scene: Scene, tally: Tally, noun: str) -> list[str]:
    """Return one line for each doubt about the material of a scene, or else about counted rows.

    The lines call the rows of the tally by the `noun`.
    """
    contact = scene.contact
    if contact.doubts:
        return contact.doubts  # a wrong material causes the doubts about rows too
    bodies = Bodies(e_star=contact.e_star, has_modulus=contact.has_modulus)
    return rows_doubts(tally, bodies, scene.quantity, max(scene.grid.spacing), noun)


def _tally_of_trial(scene: Scene, rows: list[int]) -> Tally:
    """Compute the rows with these numbers, and return a tally of the solved ones.

    Rows that fail, or take longer than `LONGEST`, are left out.
    """
    # Imported here because commands that only read a database need no solver.
    from gen.generation.sample import compute_rows
    from gen.scene import Store

    # Optional columns would cost time, and the user's function is not to be called.
    bare = scene.model_copy(update={"store": Store()})
    tally = Tally()
    for row in rows:
        with suppress(InputError):  # the run itself tells the user what is wrong
            columns = compute_rows(bare, row, row + 1, limit=LONGEST)
            tally += _tally(bare, columns)
    return tally


def _tally(scene: Scene, columns: Columns) -> Tally:
    """Return a tally of the done rows among some rows of a scene.

    `columns` has the column "status" and those in `USED`, each of shape (rows,).
    """
    done = columns["status"] == Status.DONE
    values = {name: columns[name][done] for name in USED}
    grid = scene.grid
    area = math.prod((*grid.shape, *grid.spacing))  # of the patch [um2]
    with np.errstate(over="ignore"):  # files may hold any numbers
        pressure = values["force"] / area  # nominal [MPa]
    solved = SolvedRows(
        delta=values["delta"],
        span=values["height_max"],
        slope=rms_slope_of(values, grid.spacing),
        contact_nodes=values["contact_nodes"],
        pressure=pressure,
    )
    return Tally.of(solved, math.prod(grid.shape))


def _nominal_pressures(scene: Scene, loads: Values) -> Values:
    """Return the nominal pressures of loads [MPa], which are pressures or forces."""
    if scene.quantity == "pressure":
        return loads
    area = math.prod((*scene.grid.shape, *scene.grid.spacing))  # of the patch [um2]
    return loads / area


def _doubts_about_hardness(scene: Scene, plan: Plan, pressures: Values) -> list[str]:
    """Return a line if the hardness does not bear loads of the first rows of the plan, else none.

    `pressures` are the nominal pressures of these rows [MPa]. The mean pressure on a patch of
    bodies that yield is below the hardness. If the scene has a wrong material, another line tells.
    """
    if plan.hardness is None or scene.contact.doubts:
        return []
    unborne = pressures >= plan.hardness
    if not unborne.any():
        return []
    planned = f"{unborne.size} rows"
    if unborne.size < scene.samples:
        planned = f"the first {planned}"
    largest = float(pressures[unborne].max())
    return [unborne_loads(int(unborne.sum()), planned, largest)]


def _tried_rows(scene: Scene, rows: int) -> list[int]:
    """Choose the rows of a trial among the first rows of the plan, and return their numbers.

    These are the rows with the middle, the largest and the smallest load, in this order. If a trial
    is not cheap, the list is cut to one row for each `SHARE` of the `rows` of the run.
    """
    planned_rows = min(scene.samples, PLANNED_ROWS)
    loads = parameters(scene, start=0, stop=planned_rows).load
    order = np.argsort(loads, kind="stable")  # numbers of the rows by rising load
    chosen = [int(order[order.size // 2]), int(order[-1]), int(order[0])]
    if math.prod(scene.grid.shape) > ALWAYS_NODES:
        chosen = chosen[: rows // SHARE]
    # In a plan of one or two rows, a row is chosen twice. Each row is kept once.
    return list(dict.fromkeys(chosen))
