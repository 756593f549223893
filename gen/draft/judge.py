"""Judge surfaces that are to be like a map by the contact: press the map and ten of them.

A spectrum and a distribution of heights do not describe a map completely. If a map has steps or
terraces, surfaces with its spectrum and its heights touch in other places. A contact costs little,
so the map itself and ten surfaces of its size are pressed, under three pressures.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from gen.arrays import Heights, Values
from gen.draft.parts import PATCHES, Outside, compare_ranges, cut_parts
from gen.draft.writing import KAPPA
from gen.maps.read import Sides
from gen.material import Bodies
from gen.runtime.terminal import RunProgress, echo, print_columns
from gen.statistics import describe, rms_slope

PRESSED_SURFACES = 10
"""Number of surfaces that are pressed beside the map."""

MOST_NODES = 450_000
"""Largest number of nodes of the pressed map; of a larger map the middle is pressed."""

LIMIT = 0.15
"""Largest relative difference of area and mean gap between surfaces and a map of their kind."""

# Tolerance of the solver. On a measured map of 256 x 256 nodes and two surfaces like it, areas are
# within 0.08 % of those of the default tolerance, mean gaps within 0.01 %, in 0.7 of the time.
TOLERANCE = 1e-3

# Largest difference between map and mean of the surfaces that their scatter explains, in standard
# deviations of the surfaces. A further surface of the population is within it with a probability of
# 99 %: it is the quantile 0.995 of Student's distribution with 9 degrees of freedom, of ten
# surfaces, times the root of 1 + 1/10. With 95 %, one of several answers would often be beyond it.
BEYOND_SCATTER = 3.4
# relative scatter of an answer above which an agreement decides nothing [1]
WIDE = 0.3
# approximate shares of the patch in contact under the three pressures [1]
SHARES = (0.01, 0.05, 0.2)
MOST_NAMES = 5  # largest number of statistics that the sentence on ranges names

Verdict = Literal["of its kind", "undecided", "not of its kind"]

Maker = Callable[[tuple[int, int], np.random.Generator], Heights]
"""Function of the nodes (nx, ny) and a source of random numbers that makes heights [um]."""

ANSWERS: Mapping[str, Callable[[Any], float]] = {
    "area": lambda contact: float(contact.area_percent),
    "mean gap": lambda contact: float(contact.mean_gap),
    "stiffness": lambda contact: float(contact.stiffness),
    "number of spots": lambda contact: float(contact.spots.areas.size),
}
"""Functions that read the compared answers off a `bem.Contact`, by the names of the answers."""

Answers = Mapping[str, float]
"""The answers of `ANSWERS` of one contact, by name; NaN if it has not converged."""

JUDGED = ("area", "mean gap")
"""Answers that decide the verdict."""


@dataclass(frozen=True)
class Ratio:
    """An answer of the surfaces over that of the map."""

    mean: float  # mean of the surfaces over the map [1]
    scatter: float  # standard deviation of the surfaces over their mean [1]

    @classmethod
    def of(cls, of_surfaces: Sequence[float], of_map: float) -> Ratio:
        """Compare a number of several surfaces with that of the map, in one unit.

        Both fields are NaN if a number is not finite, or that of the map is 0.
        """
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
        """Whether map and surfaces differ by more than the scatter of the surfaces explains.

        It is true too if one of them has no number.
        """
        return not abs(self.mean - 1) <= BEYOND_SCATTER * self.mean * self.scatter


@dataclass(frozen=True)
class Judgement:
    """The comparison of a map with surfaces that are to be like it."""

    nodes: tuple[int, int]  # nodes of the map that were pressed, along x and y
    pressures: tuple[float, ...]  # mean pressures [MPa]
    # ratios by the name of the answer, one under each pressure
    answers: Mapping[str, tuple[Ratio, ...]]
    geometry: Mapping[str, Ratio]  # ratios of numbers of the heights, by name
    # parts of the map whose statistics are beyond the ranges of the surfaces
    outside: Outside

    @property
    def faults(self) -> list[str]:
        """Judged answers beyond limit and scatter, as "area 0.42 of the map's at 3 MPa"."""
        return [
            f"{name} {ratio.mean:.2f} of the map's at {pressure:.3g} MPa"
            for name in JUDGED
            for pressure, ratio in zip(self.pressures, self.answers[name], strict=True)
            if ratio.is_off and ratio.is_beyond_scatter
        ]

    @property
    def verdict(self) -> Verdict:
        """The verdict on area and mean gap under all pressures.

        A difference beyond the limit is a fault, unless the scatter of the surfaces explains it.
        Without a fault, the verdict is undecided if a difference is beyond the limit, or if a
        scatter is above `WIDE`.
        """
        if self.faults:
            return "not of its kind"
        ratios = [ratio for name in JUDGED for ratio in self.answers[name]]
        if any(ratio.is_off or ratio.scatter > WIDE for ratio in ratios):
            return "undecided"
        return "of its kind"

    @property
    def sentence(self) -> str:
        """The verdict and its reason."""
        if self.verdict == "of its kind":
            return "of its kind: area and mean gap are those of the map"
        if self.verdict == "undecided":
            return f"undecided: within the scatter of the {PRESSED_SURFACES}, but that is wide"
        reason = "steps, terraces and the like are no matter of a spectrum"
        return f"not of its kind: {', '.join(self.faults)}; {reason}"

    @property
    def sentence_on_ranges(self) -> str:
        """A sentence on the feature ranges of a surrogate of the surfaces."""
        if self.outside.is_rare:
            return "the features of a surrogate of these surfaces reach the map's"
        names = ", ".join(self.outside.names[:MOST_NAMES])
        return (
            f"a surrogate of these surfaces would flag {100 * self.outside.share:.0f} % of"
            f" the patches of the map: {names} beyond its range"
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
    make : Maker
        Function that makes a surface with the map's spacing.
    bodies : Bodies
        Material of the contact.
    nodes : int
        Nodes along each side of the patches of the scene, whose features are compared.

    Returns
    -------
    Judgement
        The comparison, and the verdict.

    Raises
    ------
    InputError
        If `make` cannot make a surface on the map's grid.
    """
    from bem.threads import cores, default_threads, on_threads

    middle = _middle(heights)
    shape = (middle.shape[0], middle.shape[1])
    surfaces = [
        make(shape, np.random.default_rng([PRESSED_SURFACES, seed]))
        for seed in range(PRESSED_SURFACES)
    ]
    slope = rms_slope(middle, spacing)
    pressures = tuple(float(f"{p:.3g}") for p in _pressures(slope, bodies))
    press = _Press(spacing=spacing, bodies=bodies, pressures=pressures)
    total = (1 + PRESSED_SURFACES) * len(pressures)
    with on_threads(default_threads(cores())), RunProgress(total, noun="contacts") as bar:
        of_map = press.answers(middle, bar)
        of_surfaces = [press.answers(surface, bar) for surface in surfaces]
    return Judgement(
        nodes=shape,
        pressures=pressures,
        answers={name: _ratios(name, of_map, of_surfaces) for name in ANSWERS},
        geometry=_geometry(middle, surfaces, spacing),
        outside=_outside(middle, spacing, make, nodes),
    )


def _geometry(
    middle: Heights, surfaces: Sequence[Heights], spacing: Sides
) -> dict[str, Ratio]:
    """Return the ratios of numbers of the heights [um] of surfaces to those of a map, by name."""
    numbers: dict[str, Callable[[Heights], float]] = {
        "rms height": lambda heights: float(heights.std()),
        "rms slope": lambda heights: rms_slope(heights, spacing),
        "summit density": lambda heights: describe(heights, spacing).values[
            "peak_density"
        ],
    }
    return {
        name: Ratio.of([number(surface) for surface in surfaces], number(middle))
        for name, number in numbers.items()
    }


def _middle(heights: Heights) -> Heights:
    """Return the middle of a map, less its mean [um].

    It has at most `MOST_NODES` nodes, and the proportions of the map.
    """
    share = min(1.0, math.sqrt(MOST_NODES / heights.size))
    nx, ny = (int(share * nodes) for nodes in heights.shape)
    x = (heights.shape[0] - nx) // 2
    y = (heights.shape[1] - ny) // 2
    middle = heights[x : x + nx, y : y + ny]
    return np.asarray(middle - middle.mean())


def _pressures(slope: float, bodies: Bodies) -> list[float]:
    """Return the three pressures for a map with an rms slope [MPa]."""
    # Light loads bring the share KAPPA p / (E* rms slope) into contact.
    scale = bodies.e_star * slope / KAPPA
    if bodies.hardness is not None:
        scale = min(scale, bodies.hardness)
    return [share * scale for share in SHARES]


@dataclass(frozen=True)
class _Press:
    """The contact of a rigid plane with surfaces that are mirrored at their borders."""

    spacing: Sides  # distance of the nodes along x and y [um]
    bodies: Bodies
    pressures: tuple[float, ...]  # rising mean pressures [MPa]

    def answers(self, heights: Heights, progress: RunProgress) -> list[Answers]:
        """Return the answers of a surface [um] under each pressure.

        `progress` advances by one for each contact. The solver starts each contact from earlier
        ones of the surface.
        """
        import bem

        nx, ny = heights.shape
        dx, dy = self.spacing
        contacts = bem.ladder(
            heights,
            (nx * dx, ny * dy),
            pressures=self.pressures,
            modulus=self.bodies.e_star,
            hardness=self.bodies.hardness,
            boundary="mirror",
            rtol=TOLERANCE,
        )
        by_pressure: list[Answers] = []
        for _ in self.pressures:
            try:
                contact = next(contacts)
                answers = {name: read(contact) for name, read in ANSWERS.items()}
            except ArithmeticError:  # it has not converged
                answers = dict.fromkeys(ANSWERS, math.nan)
            by_pressure.append(answers)
            progress.advance(rows=1)
        return by_pressure


def _ratios(
    name: str, of_map: Sequence[Answers], of_surfaces: Sequence[Sequence[Answers]]
) -> tuple[Ratio, ...]:
    """Return the ratios of one answer of the surfaces to that of the map, by pressure.

    `of_map` has the answers of the map under each pressure, and `of_surfaces` those of each
    surface.
    """
    return tuple(
        Ratio.of([of_surface[step][name] for of_surface in of_surfaces], answers[name])
        for step, answers in enumerate(of_map)
    )


def _outside(heights: Heights, spacing: Sides, make: Maker, nodes: int) -> Outside:
    """Compare parts of a map with as many patches as give the ranges of a surrogate.

    Parts and patches have `nodes` nodes along each side, as the patches of a scene.
    """
    parts = cut_parts(heights, nodes)
    patches = [
        make(parts[0].shape, np.random.default_rng([PATCHES, seed]))
        for seed in range(PATCHES)
    ]
    return compare_ranges(parts, patches, spacing)


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
    echo(f"{PRESSED_SURFACES} {kind} over the map, {nx} x {ny} nodes, mean +- scatter:")
    titles = ["", *(f"{pressure:.3g} MPa" for pressure in judgement.pressures)]
    rows = [
        [name, *(ratio.text for ratio in ratios)]
        for name, ratios in judgement.answers.items()
    ]
    rows += [[name, ratio.text, "", ""] for name, ratio in judgement.geometry.items()]
    print_columns(rows, titles, right=titles[1:])
    echo(f"verdict: {judgement.sentence}")
    echo(judgement.sentence_on_ranges)
