"""The error that a grid makes, by the number of nodes in the shortest wave.

`resolution` presses random surfaces without edges on finer and finer grids. It compares methods to
compute the area of contact: the area in the continuum, and counts of the nodes in contact. Counts
are taken as they are, less a share of the perimeter, or extrapolated from two grids.
"""

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

import bem
from bench.files import Row
from bench.report import remark
from gen.arrays import Heights, Values
from gen.quantities import DELTA, MEAN_GAP, UNLOADING

LONGEST = 1
"""Periods a side of the longest wave."""

SHORTEST = 8
"""Periods a side of the shortest wave."""

SLOPE = 0.1
"""Rms slope of the surfaces: the rms of the gradient's modulus [1]."""

HURST = (0.3, 0.8)
"""Hurst exponents [1]."""

PRESSURES = (0.01, 0.05, 0.2, 0.4)
"""Mean pressures [E* times the rms slope]."""

GRIDS = (2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64)
"""Nodes in the shortest wave of the grids."""

TRUTH = 128
"""Nodes in the shortest wave of the grid whose results count as exact."""

CONTINUUM = "area in the continuum"
"""Name of the area that a contact computes from pressures and gaps at the border."""

COUNT = "count of nodes"
"""Name of the area of the nodes in contact."""

TWO_GRIDS = "counts of two grids"
"""Name of the area that is extrapolated from the counts of two grids."""

PERIMETER = {
    # Yastrebov and others.
    "count less 0.118 of the perimeter": (math.pi - 1 + math.log(2)) / 24,
    # The mean offset of the border, from `bem.derived.border`.
    "count less 0.101 of the perimeter": 0.1014,
}
"""Areas that are subtracted from counts [perimeter times spacing], by the names of the methods."""

Surface = Callable[[Values], Heights]
"""A function that takes n places along both axes, and returns the heights, (n, n) [side]."""


def random_waves(
    longest: int,
    shortest: int,
    hurst: float,
    random: np.random.Generator,
    aspect: float = 1.0,
) -> Surface:
    """Draw a self-affine surface of period one and rms slope 0.1.

    Parameters
    ----------
    longest, shortest : int
        Number of periods of the longest and of the shortest wave on a side.
    hurst : float
        Hurst exponent [1].
    random : numpy.random.Generator
        Source of random numbers, whose state moves.
    aspect : float
        Length of a wave along the second axis over the length along the first of a wave with the
        same amplitude [1].

    Returns
    -------
    callable
        Function that takes n places along both axes, (n,), and returns the heights, (n, n), both in
        sides of the patch.
    """
    k = np.arange(-shortest, shortest + 1)  # periods a side of each wave along an axis
    size = np.hypot(k[:, None], aspect * k)
    inside = (size >= longest) & (size <= shortest)
    nonzero = np.where(size == 0, 1, size)
    amplitude = np.where(inside, nonzero ** -(hurst + 1.0), 0)
    phases = 2j * np.pi * random.random(size.shape)
    waves = amplitude * np.exp(phases)
    conjugates = np.conj(waves[::-1, ::-1])
    waves = (waves + conjugates) / 2  # which makes the heights real
    squared_wavenumbers = np.hypot(k[:, None], k) ** 2
    squares = squared_wavenumbers * np.abs(waves) ** 2
    # Rms slope before the heights are scaled.
    slope = 2 * np.pi * np.sqrt(np.sum(squares))

    def heights(places: Values) -> Heights:
        """Return the heights, (n, n), at n places along both axes."""
        exponents = 2j * np.pi * np.outer(places, k)
        basis = np.exp(exponents)
        surface: Heights = (basis @ waves @ basis.T).real * (SLOPE / slope)
        return surface

    return heights


Errors = dict[str, float]
"""Relative errors with their signs [1], by the quantity; key "seconds" is the wall time [s].

All methods have the quantity "area". Only the area in the continuum comes with displacement, mean
gap and stiffness.
"""


def resolution(surfaces: int, finest: int) -> list[Row]:
    """Measure errors and times of every method to compute an area, on grids of `GRIDS`.

    Prints the progress on standard error.

    Parameters
    ----------
    surfaces : int
        Number of surfaces of each Hurst exponent.
    finest : int
        Largest number of nodes in the shortest wave.

    Returns
    -------
    list of Row
        A row for each method, grid and pressure: root mean squares over all surfaces of the errors
        of area, displacement, mean gap and stiffness [%], and the median time [s]. Errors that a
        method does not have are "".
    """
    grids = [nodes for nodes in GRIDS if nodes <= finest]
    # Errors on all surfaces, by method, nodes in the shortest wave, and pressure.
    answers: dict[tuple[str, int, float], list[Errors]] = {}
    for hurst in HURST:
        for seed in range(surfaces):
            surface = random_waves(LONGEST, SHORTEST, hurst, np.random.default_rng(seed))
            for pressure in PRESSURES:
                for answer in _answers(surface, pressure, grids):
                    setting = (answer.method, answer.nodes, pressure)
                    answers.setdefault(setting, []).append(answer.errors)
            remark(f"H = {hurst:g}, surface {seed}")
    return [
        {
            "way": method,
            "nodes_a_wave": nodes,
            "pressure": pressure,
            **_summary(errors),
        }
        for (method, nodes, pressure), errors in answers.items()
    ]


@dataclass(frozen=True)
class _GridAnswer:
    """The errors of one method on one grid."""

    method: str  # name of the method to compute the area
    nodes: int  # nodes in the shortest wave
    errors: Errors


def _answers(
    surface: Surface, pressure: float, grids: Sequence[int]
) -> list[_GridAnswer]:
    """Press a surface by a mean pressure [E* slope] on all grids; return the errors of all methods.

    `grids` are the numbers of nodes in the shortest wave, in rising order.
    """
    exact = _pressed(surface(_grid(TRUTH)), pressure)
    true_area = exact.continuum_area_percent
    answers: list[_GridAnswer] = []
    counts: dict[int, float] = {}  # share of nodes in contact of each grid [%]
    for nodes in grids:
        contact = _TimedContact(surface(_grid(nodes)), pressure)
        counts[nodes] = contact.count
        by_method = {CONTINUUM: contact.errors(exact, true_area)}
        areas = contact.corrected_counts()
        for method, area in areas.items():
            by_method[method] = contact.errors_of_area(area, true_area)
        half = nodes // 2
        if nodes % 2 == 0 and half in counts:
            # The error of a count is proportional to the spacing, and cancels in this.
            area = 2 * contact.count - counts[half]
            errors = contact.errors_of_area(area, true_area)
            # The coarser grid has a quarter of the nodes, and is taken to need a quarter as long.
            errors["seconds"] *= 1.25
            by_method[TWO_GRIDS] = errors
        answers += [
            _GridAnswer(method, nodes, errors) for method, errors in by_method.items()
        ]
    return answers


def _grid(nodes_a_wave: int) -> Values:
    """Return the places of the nodes along an axis, (n,) [side of the patch]."""
    nodes = nodes_a_wave * SHORTEST
    return np.arange(nodes) / nodes


def _pressed(heights: Heights, pressure: float) -> bem.Contact:
    """Press a periodic surface by a mean pressure [E* times rms slope] on one thread."""
    return bem.solve(
        heights, 1.0, pressure=pressure * SLOPE, boundary="periodic", threads=1
    )


class _TimedContact:
    """A contact on one grid, which is solved and timed when the object is made.

    Attributes
    ----------
    contact : bem.Contact
        The contact of a periodic surface.
    solve_seconds : float
        Wall time of the solve [s].
    area : float
        Area in the continuum [%].
    seconds : float
        Wall time of the solve and of the area in the continuum [s].
    perimeter : float
        Perimeter times spacing [% of the patch].
    """

    def __init__(self, heights: Heights, pressure: float) -> None:
        """Solve the contact for heights [side] and a mean pressure [E* times rms slope]."""
        _pressed(heights, pressure)  # the first contact of a grid plans its transforms
        began = time.perf_counter()
        self.contact = _pressed(heights, pressure)
        self.solve_seconds = time.perf_counter() - began
        self.area = self.contact.continuum_area_percent
        self.seconds = time.perf_counter() - began
        self.perimeter = 100 * self.contact.perimeter / len(heights)

    @property
    def count(self) -> float:
        """Share of nodes in contact [%]."""
        return self.contact.area_percent

    def corrected_counts(self) -> dict[str, float]:
        """Return areas by method [%]: the count of nodes, and counts less part of the perimeter."""
        areas = {COUNT: self.count}
        for method, share in PERIMETER.items():
            areas[method] = self.count - share * self.perimeter
        return areas

    def errors_of_area(self, area: float, true_area: float) -> Errors:
        """Return the error of an area of this contact, with the time of the solve alone.

        `area` and `true_area` are in percent.
        """
        return {"area": area / true_area - 1, "seconds": self.solve_seconds}

    def errors(self, exact: bem.Contact, true_area: float) -> Errors:
        """Return the errors of the area in the continuum, displacement, mean gap and stiffness.

        `exact` is the contact on the exact grid, `true_area` its area in the continuum [%].
        """
        contact = self.contact
        return {
            "area": self.area / true_area - 1,
            DELTA.name: contact.delta / exact.delta - 1,
            MEAN_GAP.name: contact.mean_gap / exact.mean_gap - 1,
            UNLOADING.name: contact.stiffness / exact.stiffness - 1,
            "seconds": self.seconds,
        }


def _summary(answers: list[Errors]) -> Row:
    """Return the columns of a row about the answers of one method.

    They are the root mean square of the relative errors of each quantity [%], and the median time
    [s]. The column of a quantity is "" if the method does not compute it.
    """
    row: Row = {}
    for name in ("area", DELTA.name, MEAN_GAP.name, UNLOADING.name):
        errors = [answer[name] for answer in answers if name in answer]
        row[f"{name}_error_percent"] = ""
        if errors:
            rms = float(np.sqrt(np.mean(np.square(errors))))
            row[f"{name}_error_percent"] = 100 * rms
    row["seconds"] = float(np.median([answer["seconds"] for answer in answers]))
    return row
