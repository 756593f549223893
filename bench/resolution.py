"""The error that a grid makes: the area of contact by the nodes in the shortest wave.

`resolution` presses the same random surfaces without edges on ever finer grids, and compares the
area in the continuum with counts of nodes: as they are, less a share of the perimeter, extrapolated
from two grids.
"""

import math
import time
from collections.abc import Callable, Iterator

import numpy as np

import bem
from bench.files import Row
from bench.report import remark
from gen.arrays import Heights, Values
from gen.quantities import DELTA, MEAN_GAP, UNLOADING

LONGEST, SHORTEST = 1, 8  # periods a side of the longest and the shortest wave
SLOPE = 0.1  # rms of the gradient's modulus
HURST = (0.3, 0.8)
PRESSURES = (0.01, 0.05, 0.2, 0.4)  # E* times the rms slope
TRUTH = 128  # nodes in the shortest wave of the grid that counts as exact
PERIMETER = {
    "count less 0.118 of the perimeter": (math.pi - 1 + math.log(2))
    / 24,  # Yastrebov and others
    "count less 0.101 of the perimeter": 0.1014,  # the mean offset, `bem.derived.border`
}
CONTINUUM, COUNT, TWO_GRIDS = (
    "area in the continuum",
    "count of nodes",
    "counts of two grids",
)

Surface = Callable[[Values], Heights]


def random_waves(
    longest: int,
    shortest: int,
    hurst: float,
    random: np.random.Generator,
    aspect: float = 1.0,
) -> Surface:
    """Return heights of a self-affine surface of rms slope 0.1 and period one, at any places.

    `longest` and `shortest` are the periods a side of its longest and shortest waves; `aspect` says
    how much longer waves are along the second axis.
    """
    k = np.arange(-shortest, shortest + 1)
    size = np.hypot(k[:, None], aspect * k)
    inside = (size >= longest) & (size <= shortest)
    amplitude = np.where(inside, np.where(size == 0, 1, size) ** -(hurst + 1.0), 0)
    waves = amplitude * np.exp(2j * np.pi * random.random(size.shape))
    waves = (waves + np.conj(waves[::-1, ::-1])) / 2
    slope = 2 * np.pi * np.sqrt(np.sum(np.hypot(k[:, None], k) ** 2 * np.abs(waves) ** 2))

    def heights(places: Values) -> Heights:
        phases = np.exp(2j * np.pi * np.outer(places, k))
        surface: Heights = (phases @ waves @ phases.T).real * (SLOPE / slope)
        return surface

    return heights


def resolution(surfaces: int, finest: int) -> list[Row]:
    """Measure errors [%] and times [s] of every way to give an area, by the nodes in a wave.

    Errors of area, displacement, mean gap and stiffness are root mean squares over the surfaces.
    """
    grids = [
        nodes for nodes in (2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64) if nodes <= finest
    ]
    found: dict[tuple[str, int, float], list[dict[str, float]]] = {}
    for hurst in HURST:
        for seed in range(surfaces):
            surface = random_waves(LONGEST, SHORTEST, hurst, np.random.default_rng(seed))
            for pressure in PRESSURES:
                exact = _pressed(surface(_grid(TRUTH)), pressure)
                counted: dict[int, float] = {}
                for nodes in grids:
                    heights = surface(_grid(nodes))
                    for way, answer in _answers(heights, pressure, exact, nodes, counted):
                        found.setdefault((way, nodes, pressure), []).append(answer)
            remark(f"H = {hurst:g}, surface {seed}")
    return [
        {"way": way, "nodes_a_wave": nodes, "pressure": pressure, **_summary(answers)}
        for (way, nodes, pressure), answers in found.items()
    ]


def _grid(nodes_a_wave: int) -> Values:
    """Return the places of the nodes along one side, (n,)."""
    return np.arange(nodes_a_wave * SHORTEST) / (nodes_a_wave * SHORTEST)


def _pressed(heights: Heights, pressure: float) -> bem.Contact:
    return bem.solve(
        heights, 1.0, pressure=pressure * SLOPE, boundary="periodic", threads=1
    )


def _answers(
    heights: Heights,
    pressure: float,
    exact: bem.Contact,
    nodes: int,
    counted: dict[int, float],
) -> Iterator[tuple[str, dict[str, float]]]:
    """Yield every way's relative errors and time on one grid; counts of grids are kept."""
    truth = exact.continuum_area_percent
    _pressed(heights, pressure)  # the first contact of a grid plans its transforms
    began = time.perf_counter()
    contact = _pressed(heights, pressure)
    counting = time.perf_counter() - began
    area = contact.continuum_area_percent
    seconds = time.perf_counter() - began
    yield (
        CONTINUUM,
        {
            "area": area / truth - 1,
            DELTA.name: contact.delta / exact.delta - 1,
            MEAN_GAP.name: contact.mean_gap / exact.mean_gap - 1,
            UNLOADING.name: contact.stiffness / exact.stiffness - 1,
            "seconds": seconds,
        },
    )
    counted[nodes] = contact.area_percent
    yield COUNT, {"area": contact.area_percent / truth - 1, "seconds": counting}
    perimeter = 100 * contact.perimeter / len(heights)
    for way, share in PERIMETER.items():
        less = contact.area_percent - share * perimeter
        yield way, {"area": less / truth - 1, "seconds": counting}
    if nodes % 2 == 0 and nodes // 2 in counted:
        both = 2 * contact.area_percent - counted[nodes // 2]
        yield TWO_GRIDS, {"area": both / truth - 1, "seconds": 1.25 * counting}


def _summary(answers: list[dict[str, float]]) -> Row:
    """Return the root mean squares of relative errors [%], and the median time [s]."""
    row: Row = {}
    for name in ("area", DELTA.name, MEAN_GAP.name, UNLOADING.name):
        errors = [each[name] for each in answers if name in each]
        row[f"{name}_error_percent"] = (
            100 * float(np.sqrt(np.mean(np.square(errors)))) if errors else ""
        )
    return row | {"seconds": float(np.median([each["seconds"] for each in answers]))}
