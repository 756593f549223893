"""Judge surfaces that are to be like a map by the contact: press the map and ten of them.

A spectrum and a distribution of heights do not hold everything of a map: of a map with steps or
pits, surfaces of both are pressed flat in other places. A contact costs little, so that the map
itself is pressed, and ten surfaces of its size, under three pressures.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from gen.arrays import Heights, Values
from gen.maps.read import Sides
from gen.material import Bodies
from gen.runtime.terminal import RunProgress, echo, print_columns
from gen.statistics import describe, rms_slope

MADE = 10
"""Number of surfaces that are pressed beside the map."""

MOST_NODES = 450_000
"""Most nodes of the map that are pressed, those in its middle: 670 x 670, or 775 x 580."""

LIMIT = 0.15
"""Largest relative difference of area and mean gap of a map that is of the kind of the surfaces."""

# Standard deviations of the surfaces beyond which a difference is none of their scatter.
BEYOND_SCATTER = 2.0
# scatter of an answer [1] beyond which an agreement tells nothing
WIDE = 0.3
# Shares of the patch in contact under the three pressures, about.
SHARES = (0.01, 0.05, 0.2)
# Under light loads the share in contact is KAPPA p / (E* rms slope), see `gen.draft.writing`.
KAPPA = 2.0
# Rows of a few thousand reach this number of standard deviations from the mean of a feature.
OF_RANGE = 3.5
PATCHES = (
    20  # number of patches whose features are compared with those of the map's windows
)

Verdict = Literal["of its kind", "undecided", "not of its kind"]

Maker = Callable[[tuple[int, int], np.random.Generator], Heights]
"""Function of the nodes (nx, ny) and a source of random numbers that makes heights [um]."""

ANSWERS: Mapping[str, Callable[[Any], float]] = {
    "area": lambda contact: float(contact.area_percent),
    "mean gap": lambda contact: float(contact.mean_gap),
    "stiffness": lambda contact: float(contact.stiffness),
    "number of spots": lambda contact: float(contact.spots.areas.size),
}
"""What is compared under each pressure, read off a `bem.Contact`."""

JUDGED = ("area", "mean gap")
"""Answers that decide the verdict."""


@dataclass(frozen=True)
class Ratio:
    """An answer of the surfaces over that of the map."""

    mean: float  # mean of the surfaces over the map [1]
    scatter: float  # standard deviation of the surfaces over their mean [1]

    @classmethod
    def of(cls, of_surfaces: Sequence[float], of_map: float) -> Ratio:
        """Compare the numbers of several surfaces with that of the map, in one unit."""
        values: Values = np.array(of_surfaces)
        mean = float(values.mean())
        if not math.isfinite(mean) or not math.isfinite(of_map) or of_map == 0:
            return cls(math.nan, math.nan)
        scatter = float(values.std(ddof=1) / abs(mean)) if mean else math.nan
        return cls(mean / of_map, scatter)

    @property
    def text(self) -> str:
        """The ratio with its scatter, as "1.02 +- 0.03"; "-" if there is none."""
        if math.isnan(self.mean):
            return "-"
        return f"{self.mean:.2f} +- {self.mean * self.scatter:.2f}"

    @property
    def is_off(self) -> bool:
        """Whether map and surfaces differ by more than `LIMIT`, or one of them has no number."""
        return not abs(self.mean - 1) <= LIMIT

    @property
    def is_beyond_scatter(self) -> bool:
        """Whether they differ by more than the surfaces do among themselves."""
        return not abs(self.mean - 1) <= BEYOND_SCATTER * self.mean * self.scatter


@dataclass(frozen=True)
class Judgement:
    """What the contact says of surfaces that are to be like a map."""

    nodes: tuple[int, int]  # nodes of the map that were pressed, along x and y
    pressures: tuple[float, ...]  # mean pressures [MPa]
    # ratios by the name of the answer, one under each pressure
    answers: Mapping[str, tuple[Ratio, ...]]
    geometry: Mapping[str, Ratio]  # ratios of numbers of the heights, by name
    outside: tuple[str, ...]  # statistics of the map beyond the range of the surfaces'

    @property
    def faults(self) -> list[str]:
        """What is off by more than the limit and the scatter, as "area 0.42 of the map's"."""
        return [
            f"{name} {ratio.mean:.2f} of the map's at {pressure:.3g} MPa"
            for name in JUDGED
            for pressure, ratio in zip(self.pressures, self.answers[name], strict=True)
            if ratio.is_off and ratio.is_beyond_scatter
        ]

    @property
    def verdict(self) -> Verdict:
        """The verdict on area and mean gap under all pressures.

        An answer beyond the limit is a fault, unless the surfaces scatter as much. Where they
        scatter much, an agreement decides nothing either.
        """
        if self.faults:
            return "not of its kind"
        ratios = [ratio for name in JUDGED for ratio in self.answers[name]]
        if any(ratio.is_off or ratio.scatter > WIDE for ratio in ratios):
            return "undecided"
        return "of its kind"

    @property
    def sentence(self) -> str:
        """The verdict, and why."""
        if self.verdict == "of its kind":
            return "of its kind: area and mean gap are those of the map"
        if self.verdict == "undecided":
            return f"undecided: within the scatter of the {MADE}, but that is wide"
        reason = "steps, pits and the like are no matter of a spectrum"
        return f"not of its kind: {', '.join(self.faults)}; {reason}"

    @property
    def of_ranges(self) -> str:
        """A sentence on the feature ranges of a surrogate of the surfaces."""
        if not self.outside:
            return "the features of a surrogate of these surfaces reach the map's"
        names = ", ".join(self.outside)
        return (
            f"a surrogate of these surfaces would flag the map: {names} beyond its range"
        )


def judge_surfaces(
    heights: Heights, spacing: Sides, make: Maker, bodies: Bodies, nodes: int
) -> Judgement:
    """Press a map and surfaces that are to be like it.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights of the prepared map [um].
    spacing : tuple of float
        Distance of its nodes along x and y [um].
    make : callable
        Function that makes a surface with the map's spacing.
    bodies : Bodies
        Material of the contact.
    nodes : int
        Nodes along each side of the patches of the scene, whose features are compared.

    Returns
    -------
    Judgement
        The comparison, and the verdict.
    """
    from bem.threads import cores, default_threads, on_threads

    middle = _middle(heights)
    shape = (middle.shape[0], middle.shape[1])
    surfaces = [make(shape, np.random.default_rng([MADE, seed])) for seed in range(MADE)]
    slope = rms_slope(middle, spacing)
    pressures = tuple(float(f"{p:.3g}") for p in _pressures(slope, bodies))
    press = _Press(spacing, bodies)
    solved: list[list[dict[str, float]]] = []  # of the map and the surfaces, by pressure
    total = (1 + MADE) * len(pressures)
    with on_threads(default_threads(cores())), RunProgress(total, noun="contacts") as bar:
        for surface in [middle, *surfaces]:
            answers = []
            for pressure in pressures:
                answers.append(press.answers(surface, pressure))
                bar.advance(rows=1)
            solved.append(answers)
    of_map, *of_surfaces = solved
    answers_by_name = {
        name: tuple(
            Ratio.of([one[at][name] for one in of_surfaces], of_map[at][name])
            for at in range(len(pressures))
        )
        for name in ANSWERS
    }
    statistics_of_map = describe(middle, spacing).values
    statistics = [describe(surface, spacing).values for surface in surfaces]
    slopes = [rms_slope(surface, spacing) for surface in surfaces]
    densities = [one["peak_density"] for one in statistics]
    return Judgement(
        nodes=shape,
        pressures=pressures,
        answers=answers_by_name,
        geometry={
            "rms height": Ratio.of([s.std() for s in surfaces], float(middle.std())),
            "rms slope": Ratio.of(slopes, slope),
            "summit density": Ratio.of(densities, statistics_of_map["peak_density"]),
        },
        outside=_outside(middle, spacing, make, nodes),
    )


def _middle(heights: Heights) -> Heights:
    """Return the nodes in the middle of a map, at most `MOST_NODES`, in the map's proportions."""
    share = min(1.0, math.sqrt(MOST_NODES / heights.size))
    nx, ny = (int(share * nodes) for nodes in heights.shape)
    x = (heights.shape[0] - nx) // 2
    y = (heights.shape[1] - ny) // 2
    middle = heights[x : x + nx, y : y + ny]
    return np.asarray(middle - middle.mean())


def _pressures(slope: float, bodies: Bodies) -> list[float]:
    """Return the three pressures for a map with an rms slope [MPa]."""
    scale = bodies.e_star * slope / KAPPA
    if bodies.hardness is not None:
        scale = min(scale, bodies.hardness)
    return [share * scale for share in SHARES]


@dataclass(frozen=True)
class _Press:
    """The contact of a rigid plane with surfaces that are mirrored at their borders."""

    spacing: Sides  # distance of the nodes along x and y [um]
    bodies: Bodies

    def answers(self, heights: Heights, pressure: float) -> dict[str, float]:
        """Return the answers under a pressure [MPa], by name; NaN if the contact has none."""
        import bem

        nx, ny = heights.shape
        dx, dy = self.spacing
        try:
            contact = bem.solve(
                heights,
                (nx * dx, ny * dy),
                pressure=pressure,
                modulus=self.bodies.e_star,
                hardness=self.bodies.hardness,
                boundary="mirror",
            )
            return {name: read(contact) for name, read in ANSWERS.items()}
        except ArithmeticError:  # it has not converged
            return dict.fromkeys(ANSWERS, math.nan)


def _outside(
    heights: Heights, spacing: Sides, make: Maker, nodes: int
) -> tuple[str, ...]:
    """Return the names of statistics of a map's windows beyond those of many surfaces.

    The windows are of nodes x nodes, as the patches of a scene, and their mean counts.
    The range follows from the mean and the standard deviation of a few surfaces.
    """
    nx, ny = (min(nodes, side) for side in heights.shape)
    starts_x = range(0, heights.shape[0] - nx + 1, nx)
    starts_y = range(0, heights.shape[1] - ny + 1, ny)
    windows = [heights[x : x + nx, y : y + ny] for x in starts_x for y in starts_y]
    surfaces = [
        make((nx, ny), np.random.default_rng([PATCHES, seed])) for seed in range(PATCHES)
    ]
    of_map = [describe(window, spacing).values for window in windows]
    of_surfaces = [describe(surface, spacing).values for surface in surfaces]
    names = []
    for name in of_map[0]:
        value = float(np.mean([one[name] for one in of_map]))
        values = np.array([one[name] for one in of_surfaces])
        distance = abs(value - values.mean())
        reach = OF_RANGE * values.std(ddof=1)
        # Equal statistics of all surfaces differ by rounding.
        if distance > max(reach, 1e-6 * abs(value)):
            names.append(name)
    return tuple(names)


def print_judgement(judgement: Judgement, kind: str) -> None:
    """Print a table of the ratios with their scatter, and the verdict.

    Parameters
    ----------
    judgement : Judgement
        The comparison.
    kind : str
        What the surfaces are, as "surfaces of its self-affine law".
    """
    nx, ny = judgement.nodes
    echo(f"{MADE} {kind} over the map, {nx} x {ny} nodes, mean +- scatter:")
    titles = ["", *(f"{pressure:.3g} MPa" for pressure in judgement.pressures)]
    rows = [
        [name, *(ratio.text for ratio in ratios)]
        for name, ratios in judgement.answers.items()
    ]
    rows += [[name, ratio.text, "", ""] for name, ratio in judgement.geometry.items()]
    print_columns(rows, titles, right=titles[1:])
    echo(f"verdict: {judgement.sentence}")
    echo(judgement.of_ranges)
