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
from gen.generation.plan import parameters
from gen.generation.sample import compute_rows, solve_contact, surface_of
from gen.scene import load
from learn.features import SurfaceFeatures, chosen
from learn.metrics import scores

BATCH = 2000
"""Rows predicted together, as in section 4.4."""

LOADS = 10
"""Displacements of a ladder on one surface."""

DELTAS = 5.0, 45.0
"""The paper's range of displacements [um]."""

LOOSE = 1e-2
"""Residual of the loose solves that a surrogate competes with."""


SCENE = load("paper").model_copy(update={"seed": OTHER_SEED})
"""The paper preset with surfaces that nothing was trained on."""

SIDE = SCENE.surface.side

Contacts = list[tuple[Heights, float]]
"""Surfaces, each with its displacement [um]."""


@dataclass(frozen=True)
class SolverTimes:
    """Mean times without any surrogate [s]."""

    row: float  # of a database: surface, statistics, solve
    surface: float  # of generating it
    solve: float  # of a contact on a new surface
    ladder: float  # of a contact among `LOADS` on one surface
    loose: float  # of a contact on a new surface, to a residual of `LOOSE`
    loose_nmae: float  # error of its area [%]


@dataclass(frozen=True)
class SurrogateTimes:
    """Times of a surrogate's answers [s]."""

    surface: float  # features of a new surface at one displacement
    load: float  # features of one more displacement on it
    single: float  # prediction of a single row
    batched: float  # prediction of a row among `BATCH`

    @property
    def new(self) -> float:
        """An answer on a new surface."""
        return self.surface + self.batched


def new_contacts(count: int) -> Contacts:
    """Generate surfaces and loads of the preset that no surrogate here was trained on."""
    plan = parameters(SCENE, 0, count)
    return [(surface_of(SCENE, plan, row), float(plan.delta[row])) for row in range(count)]


def measure_solver(contacts: Contacts) -> SolverTimes:
    """Time the solver on new contacts, and on the rows that they are of."""
    rows = range(len(contacts))
    plan = parameters(SCENE, 0, len(contacts))
    loose = [partial(bem.solve, each, SIDE, delta, rtol=LOOSE) for each, delta in contacts]
    exact = [partial(solve_contact, SCENE, *each) for each in contacts]
    areas = ([solve().area_percent for solve in solves] for solves in (exact, loose))
    return SolverTimes(
        row=mean_seconds(partial(compute_rows, SCENE, row, row + 1) for row in rows),
        surface=mean_seconds(partial(surface_of, SCENE, plan, row) for row in rows),
        solve=mean_seconds(exact),
        ladder=ladder_seconds(contacts),
        loose=mean_seconds(loose),
        loose_nmae=scores(*areas).nmae,
    )


def ladder_seconds(contacts: Contacts) -> float:
    """Time a contact among `LOADS` on one surface [s]."""
    deltas = np.linspace(*DELTAS, LOADS)

    def climb(heights: Heights) -> None:
        for _ in bem.ladder(heights, SIDE, deltas):
            pass

    return mean_seconds(partial(climb, heights) for heights, _ in contacts) / LOADS


def measure_surrogate(fitted: Fitted, features: str, contacts: Contacts) -> SurrogateTimes:
    """Time the answers of a surrogate with a feature set, on surfaces that it has not seen."""
    sides, wanted = (SIDE, SIDE), chosen(features)

    def unknown(heights: Heights, delta: float) -> NDArray[np.float64]:
        return SurfaceFeatures(heights, sides).features(wanted, np.array([delta]))

    surface = mean_seconds(partial(unknown, *each) for each in contacts)
    # What does not depend on Delta is computed once: these have it.
    known = [SurfaceFeatures(heights, sides) for heights, _ in contacts]
    deltas = np.linspace(*DELTAS, LOADS)
    rows = np.concatenate([each.features(wanted, deltas) for each in known])
    load = mean_seconds(partial(each.features, wanted, deltas) for each in known) / LOADS
    many = np.resize(rows, (BATCH, rows.shape[1]))
    return SurrogateTimes(
        surface=surface,
        load=load,
        single=median_seconds(partial(fitted.learnt.raw, rows[:1])),
        batched=median_seconds(partial(fitted.learnt.raw, many)) / BATCH,
    )
