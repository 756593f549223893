"""The share of further surfaces inside the band of a law of several surfaces.

A pool of surfaces of each of three populations is solved once, at pressures from light to heavy
contact. Then some surfaces of the pool are drawn again and again. `gen.law.bands` makes the band of
a law of the drawn surfaces. The other surfaces of the pool that are inside the band are counted, at
each load separately. Their share has to be the level that the law names. The table also has the
share between the quantiles of the drawn surfaces.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import bem
from bench.files import Row
from bench.made_maps import MadeMap, surface
from bench.report import remark
from gen.arrays import Heights, Values
from gen.generation.sample import surface_numbered
from gen.law.bands import Band, fewest_surfaces, further_surface
from gen.quantities import AREA, CLOSURE, DELTA, MEAN_GAP, STIFFNESS, UNLOADING, Quantity
from gen.runtime.errors import InputError
from gen.scene import Scene

LEVEL = 0.9
"""Share of further surfaces that have to be inside a band, 0 to 1."""

ALLOWED = 3.0
"""Largest difference between the mean share and the level that passes [percentage points]."""

NUMBERS = (5, 10, 20, 50)
"""Numbers of surfaces that are drawn for a law."""

LOADS = np.geomspace(0.003, 0.3, 5)
"""Mean pressures over E* and over the rms slope of the pool [1]."""

SEED = 68
"""Seed of the draws from each pool, and of the places of the windows of the map."""

SIDE = 1000.0
"""Scan length of the generated surfaces [um]."""

SCENES = {
    "spectral": 'generator = "spectral"\nhurst = 0.8\nroll_off = 500.0\ncut_off = 125.0\n'
    "rms_height = 3.0\n",
    "midpoint displacement": 'generator = "midpoint"\nhurst = 0.8\n',
}
"""Keys (TOML) of the scene's table `surface` for each generated population, by its name."""

MAP = MadeMap("sandblasted", 0, (1200, 1200), rms=3.0, length=30.0)
"""Map with a spacing of 1 um, from which the windows of the third population are cut."""

QUANTITIES: Mapping[str, Quantity] = {
    CLOSURE.name: DELTA,  # equal to Delta, because the patches have no edges
    "area": AREA,
    "mean gap": MEAN_GAP,
    UNLOADING.name: STIFFNESS,
}
"""Quantities of a law, by their names in the table of the report."""


@dataclass(frozen=True, eq=False)
class Population:
    """Surfaces of one kind."""

    name: str  # a key of `SCENES`, or "windows of a map"
    surfaces: list[Heights]  # heights of each surface, (nodes, nodes) [um]
    side: float  # scan length [um]


@dataclass(frozen=True, eq=False)
class Pool:
    """Solved surfaces of one population."""

    population: str  # name of the population
    # Values of each quantity, (surfaces, loads), by its name in `QUANTITIES`.
    values: dict[str, Values]


def bands(nodes: int, pool: int, draws: int) -> list[Row]:
    """Count the further surfaces inside bands of all populations.

    Progress is printed on standard error.

    Parameters
    ----------
    nodes : int
        Nodes a side of a surface.
    pool : int
        Number of surfaces of each population.
    draws : int
        Number of draws from each pool.

    Returns
    -------
    list of Row
        One row for each population, number of surfaces and quantity. Shares are in percent.
        `inside_percent` is the mean over loads and draws. `least_percent` and `most_percent` are
        the smallest and the largest mean over the draws at a load. `by_quantiles_percent` is the
        mean share between the quantiles of the drawn surfaces. A row passes if `inside_percent` is
        within `ALLOWED` of the level.

    Raises
    ------
    InputError
        If the pool is smaller than twice the largest of `NUMBERS`.
    """
    if pool < 2 * max(NUMBERS):
        raise InputError(
            f"--pool {pool}: give {2 * max(NUMBERS)} or more, half of which are drawn"
        )
    rows: list[Row] = []
    for population in populations(nodes, pool):
        solved = Pool(population=population.name, values=pressed(population))
        remark(f"{population.name}: {pool} surfaces solved")
        for number in NUMBERS:
            rows += judged(solved, number, draws)
    return rows


def populations(nodes: int, pool: int) -> list[Population]:
    """Make the surfaces of all populations.

    Parameters
    ----------
    nodes : int
        Nodes a side of a surface.
    pool : int
        Number of surfaces of each population.

    Returns
    -------
    list of Population
        The two generated populations, then the windows of a map.
    """
    generated = []
    for name, keys in SCENES.items():
        scene = Scene.parse(
            f"samples = {pool}\nsamples_per_surface = 1\n"
            f"[surface]\n{keys}nodes = {nodes}\nside = {SIDE}\n"
            '[contact]\nboundary = "mirror"\n',
            name,
            Path(),
        )
        surfaces = [surface_numbered(scene, number) for number in range(pool)]
        generated.append(Population(name=name, surfaces=surfaces, side=SIDE))
    return [*generated, _windows(nodes, pool)]


def _windows(nodes: int, number: int) -> Population:
    """Return `number` windows of `MAP` at random places. They may overlap."""
    random = np.random.default_rng(SEED)
    heights = surface(MAP)
    corners = random.integers(0, np.subtract(heights.shape, nodes), (number, 2))
    windows = [heights[x : x + nodes, y : y + nodes] for x, y in corners]
    return Population(name="windows of a map", surfaces=windows, side=float(nodes))


def pressed(population: Population) -> dict[str, Values]:
    """Press each surface between its mirror images at `LOADS`, with E* = 1 MPa.

    Parameters
    ----------
    population : Population
        The surfaces.

    Returns
    -------
    dict
        Values of each quantity, (surfaces, loads), by its name in `QUANTITIES`.
    """
    pressures = _rms_slope(population) * LOADS  # [MPa], for E* = 1 MPa
    ladders = [
        list(bem.ladder(heights, population.side, pressures=pressures, boundary="mirror"))
        for heights in population.surfaces
    ]
    return {
        name: np.array(
            [[quantity.of(contact) for contact in ladder] for ladder in ladders]
        )
        for name, quantity in QUANTITIES.items()
    }


def _rms_slope(population: Population) -> float:
    """Return the root mean square of the modulus of the gradient, over all surfaces [1]."""
    squares = [
        np.mean(np.diff(heights, axis=axis) ** 2)
        for heights in population.surfaces
        for axis in (0, 1)
    ]
    # The square of a slope is the sum of the squares along x and y: twice their mean.
    rms_step = np.sqrt(2 * np.mean(squares))
    nodes = len(population.surfaces[0])
    return float(rms_step * nodes / population.side)


def judged(pool: Pool, number: int, draws: int) -> list[Row]:
    """Draw surfaces of a pool again and again, and count the other surfaces inside their band.

    Parameters
    ----------
    pool : Pool
        The solved surfaces.
    number : int
        Number of surfaces that are drawn for a law.
    draws : int
        Number of draws. Calls with equal arguments draw the same surfaces.

    Returns
    -------
    list of Row
        One row for each quantity; see `bands`.
    """
    random = np.random.default_rng(SEED)
    first_values = next(iter(pool.values.values()))
    size = len(first_values)  # number of surfaces of the pool
    # All quantities are judged by the same draws.
    orders = [random.permutation(size) for _ in range(draws)]
    tails = ((1 - LEVEL) / 2, (1 + LEVEL) / 2)
    rows: list[Row] = []
    for name, values in pool.values.items():
        inside = []
        by_quantiles = []
        for order in orders:
            drawn = values[order[:number]]
            rest_of_pool = values[order[number:]]
            band = further_surface(drawn, LEVEL, percent=name == "area")
            inside.append(_share_inside(rest_of_pool, band))
            quantiles = Band(*np.quantile(drawn, tails, axis=0))
            by_quantiles.append(_share_inside(rest_of_pool, quantiles))
        at_loads = np.mean(inside, axis=0)  # mean share at each load [%]
        mean = float(at_loads.mean())
        passed = abs(mean - 100 * LEVEL) <= ALLOWED
        rows.append(
            {
                "population": pool.population,
                "surfaces": number,
                "band": "ranks" if number >= fewest_surfaces(LEVEL) else "Student",
                "quantity": name,
                "inside_percent": mean,
                "least_percent": float(at_loads.min()),
                "most_percent": float(at_loads.max()),
                "by_quantiles_percent": float(np.mean(by_quantiles)),
                "verdict": "passed" if passed else "failed",
            }
        )
    return rows


def _share_inside(values: Values, band: Band) -> Values:
    """Return the share of surfaces inside a band at each load [%]; NaN at loads without a band.

    `values` has the shape (surfaces, loads).
    """
    shares = 100 * np.mean((band.low <= values) & (values <= band.high), axis=0)
    return np.where(np.isnan(band.low), np.nan, shares)
