"""How many further surfaces lie inside the band of a law of several surfaces.

Of three populations a pool of surfaces is solved once, at pressures from light to heavy contact.
Again and again some of the pool are drawn, `gen.law.bands` makes the band of a law of these, and
those of the rest that lie inside are counted, at each load by itself. The share has to be the level
that the law says. Beside it stands what the quantiles of the drawn surfaces themselves would hold.
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
ALLOWED = 3.0  # distance of the share inside from the level [%]
NUMBERS = (5, 10, 20, 50)  # surfaces of a law
LOADS = np.geomspace(
    0.003, 0.3, 5
)  # mean pressures over E* and the rms slope of the pool
SEED = 68

SIDE = 1000.0  # um
SCENES = {
    "spectral": 'generator = "spectral"\nhurst = 0.8\nroll_off = 500.0\ncut_off = 125.0\n'
    "rms_height = 3.0\n",
    "midpoint displacement": 'generator = "midpoint"\nhurst = 0.8\n',
}
"""Surfaces of the populations that a scene makes."""

MAP = MadeMap("sandblasted", 0, (1200, 1200), rms=3.0, length=30.0)
"""Map with a node every um that the windows of the third population are cut out of."""

QUANTITIES: Mapping[str, Quantity] = {
    CLOSURE.name: DELTA,  # patches have no edges
    "area": AREA,
    "mean gap": MEAN_GAP,
    UNLOADING.name: STIFFNESS,
}
"""Quantities of a law by their names; the area is a share in percent."""


@dataclass(frozen=True, eq=False)
class Pool:
    """Surfaces of one population that have been solved."""

    population: str
    values: dict[str, Values]  # of all quantities: (surfaces, loads)


def bands(nodes: int, pool: int, draws: int) -> list[Row]:
    """Count further surfaces inside bands, for each population, number of surfaces and quantity.

    Shares are in percent: the mean over loads and draws, and at the loads with the least and the
    most. A row passes if the mean is within `ALLOWED` of the level. InputError is raised if the
    pool is too small.
    """
    if pool < 2 * max(NUMBERS):
        raise InputError(
            f"--pool {pool}: give {2 * max(NUMBERS)} or more, half of which are drawn"
        )
    rows: list[Row] = []
    for name, surfaces, side in populations(nodes, pool):
        solved = Pool(name, pressed(surfaces, side))
        remark(f"{name}: {pool} surfaces solved")
        rows += [row for number in NUMBERS for row in judged(solved, number, draws)]
    return rows


def populations(nodes: int, pool: int) -> list[tuple[str, list[Heights], float]]:
    """Return name, surfaces [um] and scan length [um] of each population."""
    made = []
    for name, keys in SCENES.items():
        table = f"[surface]\n{keys}nodes = {nodes}\nside = {SIDE}\n"
        text = f'samples = {pool}\nsamples_per_surface = 1\n{table}[contact]\nboundary = "mirror"\n'
        scene = Scene.parse(text, name, Path())
        made.append(
            (name, [surface_numbered(scene, number) for number in range(pool)], SIDE)
        )
    random, whole = np.random.default_rng(SEED), surface(MAP)
    corners = random.integers(0, np.subtract(whole.shape, nodes), (pool, 2))
    windows = [whole[x : x + nodes, y : y + nodes] for x, y in corners]
    return [*made, ("windows of a map", windows, float(nodes))]


def pressed(surfaces: list[Heights], side: float) -> dict[str, Values]:
    """Press all surfaces between their mirror images at the same pressures, with E* = 1 MPa."""
    steps = [np.diff(heights, axis=axis) for heights in surfaces for axis in (0, 1)]
    slope = (
        np.sqrt(2 * np.mean([np.mean(step**2) for step in steps]))
        * len(surfaces[0])
        / side
    )
    contacts = [
        list(bem.ladder(heights, side, pressures=slope * LOADS, boundary="mirror"))
        for heights in surfaces
    ]
    return {
        name: np.array(
            [[quantity.of(contact) for contact in ladder] for ladder in contacts]
        )
        for name, quantity in QUANTITIES.items()
    }


def judged(pool: Pool, number: int, draws: int) -> list[Row]:
    """Draw some of a pool's surfaces again and again; count how many others their bands hold."""
    random = np.random.default_rng(SEED)
    size = len(next(iter(pool.values.values())))
    orders = [random.permutation(size) for _ in range(draws)]
    shares = (1 - LEVEL) / 2, (1 + LEVEL) / 2
    rows: list[Row] = []
    for name, values in pool.values.items():
        inside, by_quantiles = [], []
        for order in orders:
            drawn, others = values[order[:number]], values[order[number:]]
            band = further_surface(drawn, LEVEL, percent=name == "area")
            inside.append(_held(others, band))
            by_quantiles.append(_held(others, Band(*np.quantile(drawn, shares, axis=0))))
        at_loads = np.mean(inside, axis=0)
        mean = float(at_loads.mean())
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
                "verdict": "passed" if abs(mean - 100 * LEVEL) <= ALLOWED else "failed",
            }
        )
    return rows


def _held(others: Values, band: Band) -> Values:
    """Return the share of surfaces inside a band at each load, NaN where there is none [%]."""
    shares = 100 * np.mean((band.low <= others) & (others <= band.high), axis=0)
    return np.where(np.isnan(band.low), np.nan, shares)
