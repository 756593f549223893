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

AMONG = 1000  # first rows of the plan, from which the tried ones are taken
ALWAYS_NODES = 129**2  # most nodes at which a trial is cheap whatever the run
MOST_NODES = 513**2  # most nodes of a trial: beyond, a contact takes too long to be tried
SHARE = 20  # rows of a run for each tried one, where a trial is not cheap
LONGEST = 5.0  # most time for a surface of a trial, and for a contact [s]
CHUNK_ROWS = 65_536  # rows of a database that are read together

RESULTS = (DELTA.name, FORCE.name, CONTACT_NODES.name)
STATISTICS = ("height_max", "height_rms", "peak_density", "bandwidth_x", "bandwidth_y")
USED = (*RESULTS, *STATISTICS)
"""Columns that tell of a row whether it is doubted."""


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
        One line for each doubt. Nothing is told of rows that cannot be tried, because they take too
        long, have no solution or fail.
    """
    if scene.grid.shape[0] * scene.grid.shape[1] > MOST_NODES:
        return _doubts(scene, _planned(scene, Tally()), "tried rows")
    from gen.generation.sample import compute_rows
    from gen.scene import Store

    # Without further columns: neither their cost, nor a function of the user's.
    bare = scene.model_copy(update={"store": Store()})
    tally = Tally()
    for row in _tried(scene, rows):
        with suppress(InputError):  # a run tells the user what is wrong with a row
            tally += _tally(bare, compute_rows(bare, row, row + 1, limit=LONGEST))
    return _doubts(scene, _planned(scene, tally), "tried rows")


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
        names = ("status", *USED)
        tally += _tally(
            reader.scene, {name: reader.column(name, start, stop) for name in names}
        )
    return _doubts(reader.scene, tally, "rows")


def _doubts(scene: Scene, tally: Tally, noun: str) -> list[str]:
    """Return the doubts about the material of a scene, or else those about rows."""
    contact = scene.contact
    bodies = Bodies(contact.e_star, has_modulus=contact.has_modulus)
    apart = max(scene.grid.spacing)
    # What an impossible material does to the rows is no second slip.
    return contact.doubts or rows_doubts(tally, bodies, scene.quantity, apart, noun)


def _tally(scene: Scene, columns: Columns) -> Tally:
    """Count the rows that are done."""
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


def _planned(scene: Scene, tally: Tally) -> Tally:
    """Complete a tally by the largest nominal pressure that is planned, if loads are forces."""
    if scene.quantity not in {"pressure", "force"}:
        return tally
    largest = float(parameters(scene, 0, min(scene.samples, AMONG)).load.max())
    if scene.quantity == "force":
        largest /= math.prod((*scene.grid.shape, *scene.grid.spacing))
    return replace(tally, pressure=largest)


def _tried(scene: Scene, rows: int) -> list[int]:
    """Choose rows with the smallest, the middle and the largest load, or fewer if they are dear."""
    order = np.argsort(
        parameters(scene, 0, min(scene.samples, AMONG)).load, kind="stable"
    )
    ends = [order[order.size // 2], order[-1], order[0]]
    cheap = math.prod(scene.grid.shape) <= ALWAYS_NODES
    number = len(ends) if cheap else rows // SHARE
    return list(dict.fromkeys(map(int, ends[:number])))
