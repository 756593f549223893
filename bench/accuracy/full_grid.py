"""The time of a full map with its bar over that of `bem.solve_within`, on large maps."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from statistics import median
from typing import Any

import numpy as np

import bem
from bem.problem import Boundary
from bench.accuracy.surfaces import mirrored, places
from bench.accuracy.times import timed
from bench.files import Row
from bench.report import remark
from bench.resolution import SLOPE, random_waves
from gen.arrays import Heights

ERRORS = (0.03, 0.01)
"""Relative errors of the area that are asked for [1]."""

IN_WAVE = (16.0, 64.0)
"""Fewest and most nodes in the shortest wave of a map; their number is log-uniform."""

PRESSURES = (0.01, 0.4)
"""Lowest and highest mean pressure, log-uniform [E* times the rms slope]."""

BOUNDARIES: Sequence[Boundary] = ("periodic", "mirror", "free")
"""Boundaries, which take turns from map to map."""

SEED = 7304
"""First number of the seeds of all maps, which keeps them apart from those of other studies."""


@dataclass(frozen=True)
class _Map:
    """A map of self-affine waves under a mean pressure, with a side of 1 um and E* = 1 MPa."""

    heights: Heights  # (n, n) [um]
    in_wave: float  # nodes in the shortest wave
    pressure: float  # mean pressure [MPa]
    boundary: Boundary

    @property
    def load(self) -> dict[str, Any]:
        """Arguments of `bem.solve` and of `bem.solve_within`."""
        return {"pressure": self.pressure, "boundary": self.boundary, "threads": 1}

    def area_with_bar(self) -> float:
        """Solve the full map with its bar, and return the area in the continuum [%]."""
        contact = bem.solve(self.heights, 1.0, **self.load)
        contact.grid_error()
        return contact.continuum_area_percent

    def area_within(self, error: float) -> bem.Contact:
        """Return the contact whose area is within an error; may raise bem.NotReachable."""
        return bem.solve_within(self.heights, 1.0, error, **self.load)


def full_grid(nodes: Sequence[int], maps: Sequence[int]) -> list[Row]:
    """Time the solve of full maps with their bars, and `bem.solve_within` on the same maps.

    Prints the progress on standard error.

    Parameters
    ----------
    nodes : sequence of int
        Nodes a side of the maps.
    maps : sequence of int
        Number of maps of each size in `nodes`.

    Returns
    -------
    list of Row
        A row for each map and error, with CPU times [s]. Column `times` is the time of the full map
        over that of `solve_within`. Both are None where the error is not reached.
    """
    rows: list[Row] = []
    for size, number_of_maps in zip(nodes, maps, strict=True):
        for number in range(number_of_maps):
            rows += _rows_of_map(size, number)
            remark(f"full grid of {size} nodes a side, map {number}")
    return rows


def _rows_of_map(nodes: int, number: int) -> list[Row]:
    """Return the rows of the map of a size and a number.

    `solve_within` and the full map take turns, twice, so that slow seconds of the machine slow both
    of them. A first solve within each error, which may set up transforms, is not timed.
    """
    drawn = _drawn(nodes, number)
    seconds: dict[float, list[float]] = {}
    contacts: dict[float, bem.Contact] = {}
    for error in ERRORS:
        try:
            contacts[error] = drawn.area_within(error)
        except bem.NotReachable as refusal:
            remark(str(refusal))
    full_seconds: list[float] = []
    for _ in range(2):
        for error in contacts:
            seconds.setdefault(error, []).append(timed(partial(drawn.area_within, error)))
        full_seconds.append(timed(drawn.area_with_bar))
    rows = []
    for error in ERRORS:
        row: Row = {
            "nodes": nodes,
            "number": number,
            "boundary": drawn.boundary,
            "nodes_in_wave": drawn.in_wave,
            "pressure": drawn.pressure / SLOPE,
            "asked_percent": 100 * error,
            "grid": None,
            "full_seconds": median(full_seconds),
            "seconds": None,
            "times": None,
        }
        if error in contacts:
            row["grid"] = contacts[error].pressure.shape[0]
            row["seconds"] = median(seconds[error])
            row["times"] = row["full_seconds"] / row["seconds"]
        rows.append(row)
    return rows


def _drawn(nodes: int, number: int) -> _Map:
    """Draw the map of a size and a number."""
    random = np.random.default_rng((SEED, nodes, number))
    boundary = BOUNDARIES[number % len(BOUNDARIES)]
    in_wave = math.exp(random.uniform(*np.log(IN_WAVE)))
    waves = round(nodes / in_wave)
    hurst = random.uniform(0.2, 0.9)
    if boundary == "mirror":
        surface = mirrored(random_waves(2, 2 * waves, hurst, random))
    else:
        surface = random_waves(1, waves, hurst, random)
    # A free patch is a window of nine tenths of the period.
    width = 0.9 if boundary == "free" else 1.0
    heights = surface(width * places(nodes, boundary))
    pressure = math.exp(random.uniform(*np.log(PRESSURES)))
    return _Map(heights, nodes / (waves * width), pressure * SLOPE, boundary)


def medians(rows: Sequence[Row]) -> list[Row]:
    """Return the median ratio of times for each size and error.

    Parameters
    ----------
    rows : sequence of Row
        Rows of `full_grid`.

    Returns
    -------
    list of Row
        A row for each size and error, and one for all sizes of each error: the number of maps, the
        number on which the error is reached, and the medians of both times [s] and of their ratio.
    """
    groups: dict[tuple[float, Any], list[Row]] = {}
    for row in rows:
        for size in (row["nodes"], "all"):
            groups.setdefault((row["asked_percent"], size), []).append(row)
    return [
        {"asked_percent": asked_percent, "nodes": size, **_medians(group)}
        for (asked_percent, size), group in groups.items()
    ]


def _medians(rows: Sequence[Row]) -> Row:
    """Return the number of maps, the number of answered ones, and medians over these."""
    answered = [row for row in rows if row["times"] is not None]
    summary: Row = {"maps": len(rows), "answered": len(answered)}
    for column in ("full_seconds", "seconds", "times"):
        values = [row[column] for row in answered]
        summary[column] = median(values) if values else None
    return summary
