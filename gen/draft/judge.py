"""Judge surfaces that are to be like a map by the contact: press the map and ten of them.

A spectrum and a distribution of heights do not describe a map completely. If a map has steps or
terraces, surfaces with its spectrum and its heights touch in other places. A contact costs little,
so the map itself and ten surfaces of its size are pressed, under three pressures. Six surfaces are
enough if the others would hardly change the verdict.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from gen.arrays import Heights, Values
from gen.draft.parts import PATCHES, Outside, compare_ranges, cut_parts
from gen.draft.press import (
    ANSWERS,
    Answers,
    Press,
    middle_of,
    pressures_for,
    step_of_nodes,
)
from gen.maps.read import Sides
from gen.material import Bodies
from gen.runtime.terminal import RunProgress, echo, print_columns
from gen.statistics import describe, rms_slope

PRESSED_SURFACES = 10
"""Largest number of surfaces that are pressed beside the map."""

FIRST_SURFACES = 6
"""Number of surfaces that are pressed first; the others are pressed if these do not decide."""

LIMIT = 0.15
"""Largest relative difference of area and mean gap between surfaces and a map of their kind."""

FAR = 2 * LIMIT
"""Relative difference above which an answer under one pressure decides by itself."""

# Probability with which the scatter of the surfaces explains the difference of a further surface of
# the population from their mean. With 95 %, one of several answers would often be beyond it.
EXPLAINED = 0.99
# Largest change of the mean of an answer by the surfaces after the first ones, in standard
# deviations of the surfaces, with a probability of 99 %: the quantile 0.995 of Student's
# distribution with 5 degrees of freedom times the root of 1/6 - 1/10.
CHANGE_BY_OTHERS = 1.04
# relative scatter of an answer above which an agreement decides nothing [1]
WIDE = 0.3
MOST_NAMES = 5  # largest number of statistics that the sentence on ranges names

Verdict = Literal["of its kind", "undecided", "not of its kind"]

Maker = Callable[[tuple[int, int], np.random.Generator], Heights]
"""Function of the nodes (nx, ny) and a source of random numbers that makes heights [um]."""

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
    def deviation(self) -> float:
        """Standard deviation of the surfaces over the map [1]."""
        return self.mean * self.scatter

    def is_off(self, limit: float = LIMIT) -> bool:
        """Tell whether map and surfaces differ by more than a limit, or one has no number.

        Parameters
        ----------
        limit : float
            Largest relative difference [1].

        Returns
        -------
        bool
            True if they do.
        """
        return not abs(self.mean - 1) <= limit

    def is_beyond_scatter(self, surfaces: int) -> bool:
        """Tell whether the scatter of surfaces does not explain their difference from the map.

        Parameters
        ----------
        surfaces : int
            Number of the surfaces, at least 2.

        Returns
        -------
        bool
            True if a further surface of the population differs less from the mean of the surfaces,
            with the probability `EXPLAINED`, or if one of map and surfaces has no number.
        """
        from scipy.special import stdtrit

        quantile = float(stdtrit(surfaces - 1, (1 + EXPLAINED) / 2))
        explained = quantile * math.sqrt(1 + 1 / surfaces) * self.deviation
        return not abs(self.mean - 1) <= explained

    def moved(self, deviations: float) -> Ratio:
        """Return the ratio with another mean of the surfaces.

        Parameters
        ----------
        deviations : float
            Distance by which the mean moves away from that of the map, in standard deviations of
            the surfaces. If it is below 0 the mean moves towards that of the map, at most up to it.

        Returns
        -------
        Ratio
            The moved ratio, with the same standard deviation.
        """
        if math.isnan(self.mean):
            return self
        difference = max(0.0, abs(self.mean - 1) + deviations * self.deviation)
        mean = 1 + math.copysign(difference, self.mean - 1)
        if not mean > 0:
            return self
        return Ratio(mean=mean, scatter=self.deviation / mean)


@dataclass(frozen=True)
class Judgement:
    """The comparison of a map with surfaces that are to be like it."""

    surfaces: int  # number of surfaces that were pressed
    nodes: tuple[int, int]  # nodes of the map that were pressed, along x and y
    pressures: tuple[float, ...]  # mean pressures [MPa]
    # ratios by the name of the answer, one under each pressure
    answers: Mapping[str, tuple[Ratio, ...]]
    geometry: Mapping[str, Ratio]  # ratios of numbers of the heights, by name

    @property
    def faults(self) -> list[str]:
        """Judged answers beyond limit and scatter, as "area 0.42 of the map's at 3 MPa"."""
        return [
            f"{name} {ratio.mean:.2f} of the map's at {pressure:.3g} MPa"
            for name in JUDGED
            for pressure, ratio in zip(self.pressures, self.answers[name], strict=True)
            if self._is_fault(ratio)
        ]

    def _is_fault(self, ratio: Ratio) -> bool:
        """Return whether a ratio is beyond the limit, and the scatter does not explain it."""
        return ratio.is_off() and ratio.is_beyond_scatter(self.surfaces)

    @property
    def stiffness_fault(self) -> str:
        """A sentence on the stiffness furthest beyond limit and scatter; "" if there is none."""
        faults = [
            (abs(math.log(ratio.mean)), ratio, pressure)
            for pressure, ratio in zip(
                self.pressures, self.answers["stiffness"], strict=True
            )
            if ratio.mean > 0 and self._is_fault(ratio)
        ]
        if not faults:
            return ""
        _, ratio, pressure = max(faults, key=lambda fault: fault[0])
        return (
            f"the verdict does not hold for the stiffness, which is {ratio.mean:.2f} of the map's"
            f" at {pressure:.3g} MPa"
        )

    @property
    def verdict(self) -> Verdict:
        """The verdict on area and mean gap under all pressures.

        A difference beyond the limit is a fault, unless the scatter of the surfaces explains it.
        The map is not of the kind of the surfaces if there are two faults, or one of more than
        `FAR`. Otherwise the verdict is undecided if a difference is beyond the limit, or if a
        scatter is above `WIDE`. A single smaller fault is undecided because chance can explain it:
        the population is fitted to a single map, and the scatter of its surfaces does not contain
        how much another map of the kind would change it.
        """
        ratios = [ratio for name in JUDGED for ratio in self.answers[name]]
        faults = [ratio for ratio in ratios if self._is_fault(ratio)]
        if len(faults) > 1 or any(fault.is_off(FAR) for fault in faults):
            return "not of its kind"
        if any(ratio.is_off() or ratio.scatter > WIDE for ratio in ratios):
            return "undecided"
        return "of its kind"

    @property
    def is_clear(self) -> bool:
        """Whether further surfaces would hardly change the verdict, which is not "undecided"."""
        nearer = self._moved(-CHANGE_BY_OTHERS).verdict
        further = self._moved(CHANGE_BY_OTHERS).verdict
        return nearer == further != "undecided"

    def _moved(self, deviations: float) -> Judgement:
        """Return the judgement with moved ratios, see `Ratio.moved`."""
        answers = {
            name: tuple(ratio.moved(deviations) for ratio in ratios)
            for name, ratios in self.answers.items()
        }
        return replace(self, answers=answers)

    @property
    def sentence(self) -> str:
        """The verdict and its reason."""
        if self.verdict == "of its kind":
            return "of its kind: area and mean gap are those of the map"
        faults = ", ".join(self.faults)
        if self.verdict == "not of its kind":
            reason = "steps, terraces and the like are no matter of a spectrum"
            return f"not of its kind: {faults}; {reason}"
        if faults:
            only = "the only difference of area and mean gap beyond the scatter"
            return f"undecided: {faults}, {only}"
        return f"undecided: within the scatter of the {self.surfaces}, but that is wide"


def judge_surfaces(
    heights: Heights, spacing: Sides, make: Maker, bodies: Bodies
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

    middle = middle_of(heights)
    surface = _pressed_surface(make, middle.shape, 0)
    press = Press(
        spacing=spacing,
        step=step_of_nodes((middle, surface), spacing),
        bodies=bodies,
        pressures=pressures_for(rms_slope(middle, spacing), bodies),
    )
    loads = len(press.pressures)
    with on_threads(default_threads(cores())):
        contacts = (1 + FIRST_SURFACES) * loads
        with RunProgress(contacts, noun="contacts") as progress:
            comparison = _Comparison(
                middle=middle,
                make=make,
                press=press,
                of_map=press.answers(middle, progress.advance),
            )
            comparison.press_surfaces(FIRST_SURFACES, progress)
        judgement = comparison.judgement
        if judgement.is_clear:
            return judgement
        contacts = (PRESSED_SURFACES - FIRST_SURFACES) * loads
        with RunProgress(contacts, noun="further contacts") as progress:
            comparison.press_surfaces(PRESSED_SURFACES, progress)
    return comparison.judgement


def _pressed_surface(make: Maker, shape: tuple[int, ...], seed: int) -> Heights:
    """Make one of the surfaces that are pressed beside the map [um].

    `shape` has its nodes along x and y, and `seed` counts the surfaces from 0.
    """
    nx, ny = shape
    return make((nx, ny), np.random.default_rng([PRESSED_SURFACES, seed]))


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


@dataclass(eq=False)
class _Comparison:
    """A map and the surfaces that have been pressed."""

    middle: Heights  # heights of the pressed part of the map [um]
    make: Maker
    press: Press
    of_map: Sequence[Answers]  # answers of the map under each pressure
    surfaces: list[Heights] = field(default_factory=list)  # heights [um]
    # answers of each surface under each pressure
    of_surfaces: list[Sequence[Answers]] = field(default_factory=list)

    def press_surfaces(self, number: int, progress: RunProgress) -> None:
        """Press further surfaces until `number` surfaces have been pressed."""
        for seed in range(len(self.surfaces), number):
            surface = _pressed_surface(self.make, self.middle.shape, seed)
            self.surfaces.append(surface)
            self.of_surfaces.append(self.press.answers(surface, progress.advance))

    @property
    def judgement(self) -> Judgement:
        """The judgement by the surfaces that have been pressed."""
        nx, ny = self.press.pressed_nodes(self.middle).shape
        return Judgement(
            surfaces=len(self.surfaces),
            nodes=(nx, ny),
            pressures=self.press.pressures,
            answers={
                name: _ratios(name, self.of_map, self.of_surfaces) for name in ANSWERS
            },
            geometry=_geometry(self.middle, self.surfaces, self.press.spacing),
        )


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


def compare_parts(heights: Heights, spacing: Sides, make: Maker, nodes: int) -> Outside:
    """Compare parts of a map with as many surfaces as give the ranges of a surrogate.

    Parameters
    ----------
    heights : ndarray, shape (nx, ny)
        Heights of the prepared map [um].
    spacing : tuple of float
        Distance of its nodes along x and y [um].
    make : Maker
        Function that makes a surface with the map's spacing.
    nodes : int
        Nodes along each side of the parts and of the surfaces, as those of a scene's patches.

    Returns
    -------
    Outside
        The parts whose statistics are beyond the ranges of the surfaces.
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
    surfaces = judgement.surfaces
    echo(f"{surfaces} {kind} over the map, {nx} x {ny} nodes, mean +- scatter:")
    titles = ["", *(f"{pressure:.3g} MPa" for pressure in judgement.pressures)]
    rows = [
        [name, *(ratio.text for ratio in ratios)]
        for name, ratios in judgement.answers.items()
    ]
    rows += [[name, ratio.text, "", ""] for name, ratio in judgement.geometry.items()]
    print_columns(rows, titles, right=titles[1:])
    echo(f"verdict: {judgement.sentence}")
    if judgement.verdict != "not of its kind" and judgement.stiffness_fault:
        echo(judgement.stiffness_fault)


def print_reach(outside: Outside) -> None:
    """Print whether the feature ranges of a surrogate of the surfaces hold the map.

    Parameters
    ----------
    outside : Outside
        The parts of the map whose statistics are beyond the ranges of the surfaces.
    """
    if outside.is_rare:
        echo("the features of a surrogate of these surfaces reach the map's")
        return
    names = ", ".join(outside.names[:MOST_NAMES])
    echo(
        f"a surrogate of these surfaces would flag {100 * outside.share:.0f} % of the patches of"
        f" the map: {names} beyond its range"
    )
