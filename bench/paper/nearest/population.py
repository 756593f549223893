"""Surfaces of unit sigma0 with their areas over the displacement: rows of many databases at once.

A surface that is c times as high, pressed c times as deep, touches at the same nodes: its area is
the same, heights and curvatures are c times as large, and its other statistics do not change. So a
surface solved once at sigma0 = 1 um stands for the same surface at every sigma0.
"""

import itertools
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator
from sklearn.isotonic import IsotonicRegression

import bem
from bem.influence import Kernel
from bench.files import kept_arrays
from bench.paper.facts import AREA_MAX
from bench.report import remark
from gen.arrays import Values
from gen.generation.plan import parameters, surface_random
from gen.populations import surface_heights
from gen.runtime.errors import InputError
from gen.runtime.output import make_folder, whole
from gen.scene import Scene
from gen.schema import statistics_columns
from gen.statistics import NAMES, describe

CHUNK = 50  # surfaces of one file
SIDE, NODES = 1000.0, 129  # of every surface: the paper's scan length [um] and grid
HURST = 0.5, 0.8  # range of the surfaces' Hurst exponents, that of Table 1
DENSER = 2.5  # Hurst exponents are 0.5 + 0.3 u^DENSER with even u: two thirds are below 0.6
RATIOS = np.geomspace(0.25, 7.5, 11)  # displacements over sigma0 at which surfaces are pressed
RTOL = 1e-3  # of the solves: counts of contact nodes within about half a per cent
APART = 0.01  # mean distance of Hurst exponents from those of a scene's plan, at most
GOLDEN = (np.sqrt(5) - 1) / 2  # multiples of it, without their whole parts, are even in [0, 1)


class TooFew(InputError):
    """A population has too few surfaces for the rows of a scene."""


@dataclass(frozen=True, eq=False)
class Population:
    """Surfaces with sigma0 = 1 um.

    Attributes
    ----------
    hurst : ndarray, shape (n,)
        Hurst exponents.
    statistics : ndarray, shape (n, 22)
        Statistics in the order of `gen.statistics.NAMES` [um, 1/um or 1].
    areas : ndarray, shape (n, 11)
        Contact areas at `RATIOS` [%]; NaN beyond the first one above the paper's largest.
    """

    hurst: Values
    statistics: Values
    areas: Values


@dataclass(frozen=True, eq=False)
class Rows:
    """Rows of a database.

    Attributes
    ----------
    columns : dict of str to ndarray, shape (n,)
        Hurst exponent, displacement, area and the 22 statistics, by the names of a database.
    surface : ndarray of int, shape (n,)
        Number of the surface of each row.
    """

    columns: dict[str, Values]
    surface: NDArray[np.int64]

    @property
    def inputs(self) -> Values:
        """What models learn from, (n, 23): the displacement and the statistics."""
        return np.column_stack([self.columns[name] for name in ("delta", *NAMES)])

    @property
    def target(self) -> Values:
        """Contact areas, (n,) [%]."""
        return self.columns["area_percent"]


def population(folder: Path, kernel: Kernel, surfaces: int) -> Population:
    """Make the surfaces, or read those that the folder holds already.

    Parameters
    ----------
    folder : Path
        Place of the files, one for `CHUNK` surfaces.
    kernel : str
        Influence coefficients, as scenes name them.
    surfaces : int
        Number of surfaces, a multiple of `CHUNK`.
    """
    make_folder(folder)
    parts: dict[str, list[Values]] = {"hurst": [], "statistics": [], "areas": []}
    for first in range(0, surfaces, CHUNK):
        path = folder / f"{kernel}-{first:05}.npz"
        if not path.is_file():
            remark(f"{kernel}: surfaces {first} to {first + CHUNK - 1} of {surfaces}")
            _write(path, kernel, range(first, first + CHUNK))
        kept = kept_arrays(path, *parts)
        for name, found in parts.items():
            found.append(kept[name])
    return Population(**{name: np.concatenate(found) for name, found in parts.items()})


def _write(path: Path, kernel: Kernel, numbers: range) -> None:
    """Make the surfaces of some numbers and keep them."""
    hurst, statistics, areas = zip(*(_surface(kernel, number) for number in numbers), strict=True)
    with whole(path, "arrays") as file:
        np.savez(file, hurst=hurst, statistics=statistics, areas=areas)


def _surface(kernel: Kernel, number: int) -> tuple[float, list[float], Values]:
    """Make one surface: its Hurst exponent, statistics and areas."""
    low, high = HURST
    hurst = low + (high - low) * (number * GOLDEN % 1.0) ** DENSER
    text = f"samples = 1\n[surface]\nnodes = {NODES}\nside = {SIDE}\nhurst = {hurst}\nsigma0 = 1.0"
    scene = Scene.parse(text, "a surface")
    drawn = {"hurst": hurst, "sigma0": 1.0}
    heights = surface_heights(scene, number, drawn, surface_random(scene, number))
    values = describe(heights, scene.spacing).values
    return hurst, [values[name] for name in NAMES], _areas(heights, kernel)


def _areas(heights: Values, kernel: Kernel) -> Values:
    """Press a surface deeper and deeper, until its area is above the paper's largest [%]."""
    areas, near = np.full(RATIOS.size, np.nan), None
    for place, delta in enumerate(RATIOS):
        contact = bem.solve(
            heights, SIDE, float(delta), kernel=kernel, rtol=RTOL, near=near, threads=1
        )
        areas[place], near = contact.area_percent, contact.pressure
        if areas[place] > AREA_MAX:
            break
    return areas


def rows_of(scene: Scene, surfaces: Population) -> Rows:
    """Draw the rows of a scene from a population, with areas up to the paper's largest.

    Surfaces and loads are those of the scene's plan, but each of its surfaces is the one of the
    population whose Hurst exponent is about the same, none of them twice. Areas between those that
    were solved are interpolated.

    Raises
    ------
    TooFew
        If the population has not enough surfaces with the Hurst exponents of the scene's.
    InputError
        If the scene has loads that the population was not pressed to.
    """
    plan = parameters(scene, 0, scene.samples)
    _, first, number = np.unique(plan.surface, return_index=True, return_inverse=True)
    wanted = plan.drawn["hurst"][first]
    if first.size > surfaces.hurst.size:
        raise TooFew(f"{first.size} surfaces: the population has {surfaces.hurst.size}")
    places = nearest_places(wanted, surfaces.hurst)
    if np.abs(surfaces.hurst[places] - wanted).mean() > APART:
        raise TooFew(f"{first.size} surfaces: the population has too few with their H")
    taken, sigma0, delta = places[number], plan.drawn["sigma0"], plan.delta
    area = _interpolated(surfaces.areas[places], number, delta / sigma0)
    lengths = np.array([column.unit != "1" for column in statistics_columns()])
    statistics = surfaces.statistics[taken] * np.where(lengths, sigma0[:, np.newaxis], 1.0)
    columns = dict(zip(NAMES, statistics.T, strict=True))
    columns |= {"hurst": surfaces.hurst[taken], "delta": delta, "area_percent": area}
    kept = area <= AREA_MAX  # not of NaN, which is above it
    return Rows({name: values[kept] for name, values in columns.items()}, plan.surface[kept])


def nearest_places(wanted: Values, available: Values) -> NDArray[np.int64]:
    """Give each wanted number an available one, none twice, in the order of both.

    Parameters
    ----------
    wanted : ndarray, shape (m,)
        Numbers in any order.
    available : ndarray, shape (n,)
        Numbers in any order, at least as many.

    Returns
    -------
    ndarray of int, shape (m,)
        Places in `available`. Where many are wanted the excess goes to both sides alike.
    """
    order, ranks = np.argsort(wanted, kind="stable"), np.argsort(available, kind="stable")
    ideal = np.searchsorted(available[ranks], wanted[order]).astype(float)
    own = np.arange(wanted.size)
    moved = IsotonicRegression().fit_transform(own, ideal - own)  # gaps of one place at least
    places = np.clip(np.rint(moved), 0, available.size - wanted.size).astype(np.int64) + own
    found = np.empty(wanted.size, dtype=np.int64)
    found[order] = ranks[places]
    return found


def _interpolated(areas: Values, number: NDArray[np.int64], ratio: Values) -> Values:
    """Interpolate areas at displacements over sigma0; NaN beyond what was solved.

    The surfaces have the areas (m, 11), each of the rows is of one of them (`number`, ascending)
    and has one displacement (`ratio`), both (n,).
    """
    if ratio.min() < RATIOS[0]:
        raise InputError(f"a displacement is {ratio.min():.3g} sigma0: {RATIOS[0]} at least")
    found, steps = np.full(ratio.size, np.nan), np.log(RATIOS)
    edges = np.searchsorted(number, np.arange(len(areas) + 1))
    for own, (first, last) in zip(areas, itertools.pairwise(edges.tolist()), strict=True):
        solved = own[np.isfinite(own)]
        curve = PchipInterpolator(steps[: solved.size], solved, extrapolate=False)
        found[first:last] = curve(np.log(ratio[first:last]))
    return found
