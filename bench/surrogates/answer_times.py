"""Times of an answer: a contact by the solver, and by a surrogate.

Everything is timed in this one process, on the paper preset's distribution but on surfaces of
another seed. All are processor times of one core: others on the machine do not count.
"""

from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

import bem
from bench.databases import OTHER_SEED
from bench.surrogates.clock import mean_seconds, median_seconds
from bench.surrogates.fitting import Fitted
from gen.arrays import Heights
from gen.generation.plan import Parameters, parameters
from gen.generation.sample import compute_rows, solve_contact, surface_of
from gen.scene import Scene, load
from learn.features import FeatureSet, SurfaceFeatures
from learn.metrics import scores

Values = NDArray[np.float64]

BATCH = 2000
"""Rows predicted together, as in section 4.4."""

LOADS = 10
"""Displacements of a ladder on one surface."""

DELTAS = 5.0, 45.0
"""The paper's range of displacements [um]."""

LOOSE = 1e-2
"""Residual of the loose solves that a surrogate competes with."""


@dataclass(frozen=True, eq=False)
class NewSurfaces:
    """Surfaces and loads of the paper preset's distribution that nothing was trained on.

    Attributes
    ----------
    scene, plan : of the preset with another seed, and its first rows
    heights : of each row [um]
    """

    scene: Scene
    plan: Parameters
    heights: list[Heights]

    @property
    def side(self) -> float:
        """Scan length [um]."""
        return self.scene.surface.side

    @property
    def contacts(self) -> list[tuple[Heights, float]]:
        """Each surface with its displacement [um]."""
        return list(zip(self.heights, self.plan.delta.tolist(), strict=True))


@dataclass(frozen=True)
class SolverTimes:
    """Mean times without any surrogate [s].

    Attributes
    ----------
    row : of a database's row: surface, statistics, solve
    surface : of generating a surface
    solve : of a contact on a new surface
    ladder : of a contact among `LOADS` on one surface
    loose : of a contact on a new surface, to a residual of `LOOSE`
    loose_nmae : error of its area [%]
    """

    row: float
    surface: float
    solve: float
    ladder: float
    loose: float
    loose_nmae: float


@dataclass(frozen=True)
class SurrogateTimes:
    """Times of a surrogate's answers [s].

    Attributes
    ----------
    surface : features of a new surface at one displacement
    load : features of one more displacement on it
    single : prediction of a single row
    batched : prediction of a row among `BATCH`
    """

    surface: float
    load: float
    single: float
    batched: float

    @property
    def new(self) -> float:
        """An answer on a new surface."""
        return self.surface + self.batched


def new_surfaces(count: int) -> NewSurfaces:
    """Generate surfaces that no surrogate here was trained on."""
    scene = load("paper").model_copy(update={"seed": OTHER_SEED})
    plan = parameters(scene, 0, count)
    return NewSurfaces(scene, plan, [surface_of(scene, plan, row) for row in range(count)])


def measure_solver(new: NewSurfaces) -> SolverTimes:
    """Time the solver on surfaces and loads of the paper preset's distribution."""
    scene, rows = new.scene, range(len(new.heights))
    loose = partial(bem.solve, side=new.side, rtol=LOOSE)
    exact_areas = [solve_contact(scene, *each).area_percent for each in new.contacts]
    loose_areas = [loose(heights, delta=delta).area_percent for heights, delta in new.contacts]
    return SolverTimes(
        row=mean_seconds(partial(compute_rows, scene, row, row + 1) for row in rows),
        surface=mean_seconds(partial(surface_of, scene, new.plan, row) for row in rows),
        solve=mean_seconds(partial(solve_contact, scene, *each) for each in new.contacts),
        ladder=ladder_seconds(new, LOADS),
        loose=mean_seconds(partial(loose, heights, delta=delta) for heights, delta in new.contacts),
        loose_nmae=scores(exact_areas, loose_areas).nmae,
    )


def ladder_seconds(new: NewSurfaces, loads: int) -> float:
    """Time a contact among several loads on one surface [s]."""
    deltas = np.linspace(*DELTAS, loads)

    def climb(heights: Heights) -> None:
        for _ in bem.ladder(heights, new.side, deltas):
            pass

    return mean_seconds(partial(climb, heights) for heights in new.heights) / loads


def measure_surrogate(fitted: Fitted, features: FeatureSet, new: NewSurfaces) -> SurrogateTimes:
    """Time a surrogate's answers.

    Parameters
    ----------
    fitted : the surrogate
    features : its feature set
    new : surfaces that it was not trained on
    """
    sides = new.side, new.side

    def unknown(heights: Heights, delta: float) -> Values:
        return SurfaceFeatures(heights, sides).features(features, np.array([delta]))

    surface = mean_seconds(partial(unknown, *each) for each in new.contacts)
    # What does not depend on Delta is computed once: these have it.
    known = [SurfaceFeatures(heights, sides) for heights in new.heights]
    deltas = np.linspace(*DELTAS, LOADS)
    rows = np.concatenate([each.features(features, deltas) for each in known])
    load = mean_seconds(partial(each.features, features, deltas) for each in known) / LOADS
    many = np.resize(rows, (BATCH, rows.shape[1]))
    return SurrogateTimes(
        surface=surface,
        load=load,
        single=median_seconds(partial(fitted.learnt.raw, rows[:1])),
        batched=median_seconds(partial(fitted.learnt.raw, many)) / BATCH,
    )
