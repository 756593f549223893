"""What is paid for an answer: t_d, t_h, t_f and t_p of the paper's section 4.4, measured here.

Everything is timed in this one process, on the paper preset's distribution but on surfaces of
another seed. All are processor times of one core: others on the machine do not count.
"""

import math
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

import bem
from bench.surrogates.clock import mean_seconds, median_seconds
from bench.surrogates.databases import OTHER_SEED
from bench.surrogates.fitting import Fitted
from gen.arrays import Heights
from gen.generation.plan import Parameters, parameters
from gen.generation.sample import compute_rows, solve_contact, surface_of
from gen.scene import Scene, load
from learn.comparison import paper
from learn.features import FeatureSet, SurfaceFeatures
from learn.metrics import scores

Values = NDArray[np.float64]

PAPER_SOLVE = 189.79
"""Mean time of the paper's solver for one contact (section 4.4) [s]."""

PAPER_ROWS, PAPER_TESTS = 15_878, 3_175
"""Rows of the paper's database, and of its test set, which its prediction times are for."""

PAPER_BREAK_EVEN = 15_893
"""Where the paper finds its break-even point (section 4.4)."""

BATCH = 2000
"""Rows predicted together, as in section 4.4."""

LOADS = 10
"""Displacements of a ladder on one surface."""

LOOSE = 1e-2
"""Residual of the loose solves that a surrogate competes with."""


@dataclass(frozen=True)
class SolverCosts:
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
class QueryCosts:
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


@dataclass(frozen=True)
class BuildCosts:
    """What has to be paid before the first answer [s].

    Attributes
    ----------
    database : t_d, solving all rows, and generating surfaces again where the features need them
    tuning : t_h, the search for settings
    fit : t_f
    """

    database: float
    tuning: float
    fit: float

    @property
    def total(self) -> float:
        """All of it."""
        return self.database + self.tuning + self.fit


def measure_solver(count: int) -> SolverCosts:
    """Time the solver on the paper preset's distribution.

    Parameters
    ----------
    count : number of surfaces
    """
    scene, plan = _scene(count)
    surfaces = [surface_of(scene, plan, row) for row in range(count)]
    pairs = list(zip(surfaces, plan.delta.tolist(), strict=True))
    side = scene.surface.side
    exact = [solve_contact(scene, *pair).area_percent for pair in pairs]
    loose = [_loose(side, *pair).area_percent for pair in pairs]
    return SolverCosts(
        row=mean_seconds(partial(compute_rows, scene, row, row + 1) for row in range(count)),
        surface=mean_seconds(partial(surface_of, scene, plan, row) for row in range(count)),
        solve=mean_seconds(partial(solve_contact, scene, *pair) for pair in pairs),
        ladder=mean_seconds(partial(_ladder, heights, side) for heights in surfaces) / LOADS,
        loose=mean_seconds(partial(_loose, side, *pair) for pair in pairs),
        loose_nmae=scores(exact, loose).nmae,
    )


def _loose(side: float, heights: Heights, delta: float) -> bem.Contact:
    return bem.solve(heights, side, delta, rtol=LOOSE)


def _scene(count: int) -> tuple[Scene, Parameters]:
    scene = load("paper").model_copy(update={"seed": OTHER_SEED})
    return scene, parameters(scene, 0, count)


def _ladder(heights: Heights, side: float) -> None:
    """The paper's range of displacements on one surface."""
    for _ in bem.ladder(heights, side, np.linspace(5.0, 45.0, LOADS)):
        pass


def measure_queries(fitted: Fitted, features: FeatureSet, count: int) -> QueryCosts:
    """Time a surrogate's answers.

    Parameters
    ----------
    fitted : the surrogate
    features : its feature set
    count : number of surfaces
    """
    scene, plan = _scene(count)
    side = scene.surface.side
    surfaces = [surface_of(scene, plan, row) for row in range(count)]
    new = mean_seconds(
        partial(_features, features, heights, side, np.array([delta]))
        for heights, delta in zip(surfaces, plan.delta.tolist(), strict=True)
    )
    # What does not depend on Delta is computed once: these have it.
    known = [SurfaceFeatures(heights, (side, side)) for heights in surfaces]
    deltas = np.linspace(5.0, 45.0, LOADS)
    rows = np.concatenate([each.features(features, deltas) for each in known])
    more = mean_seconds(partial(each.features, features, deltas) for each in known) / LOADS
    many = np.resize(rows, (BATCH, rows.shape[1]))
    return QueryCosts(
        surface=new,
        load=more,
        single=median_seconds(partial(fitted.learnt.raw, rows[:1])),
        batched=median_seconds(partial(fitted.learnt.raw, many)) / BATCH,
    )


def _features(features: FeatureSet, heights: Heights, side: float, deltas: Values) -> Values:
    """Features of a surface of which nothing is known yet."""
    return SurfaceFeatures(heights, (side, side)).features(features, deltas)


def build_costs(
    rows: float, solver: float, fitted: Fitted, features: FeatureSet, again: float
) -> BuildCosts:
    """Costs of a surrogate before its first answer.

    Parameters
    ----------
    rows : of its database
    solver : time of a row of the database [s]
    fitted : the surrogate
    features : its feature set
    again : time to generate a surface anew and to look at it [s]
    """
    anew = again if features.needs_surface else 0.0
    return BuildCosts(rows * (solver + anew), fitted.choosing, fitted.fitting)


def of_the_paper() -> tuple[BuildCosts, float]:
    """Kernel ridge's costs in the paper, and its time for a prediction [s]."""
    fit, tests = paper.TIMES["tuned"]["kernel-ridge"]
    tuning = paper.TUNING_SECONDS["kernel-ridge"]
    return BuildCosts(PAPER_ROWS * PAPER_SOLVE, tuning, fit), tests / PAPER_TESTS


def break_even(build: float, solver: float, query: float) -> float:
    """Queries from which on a surrogate has been cheaper, infinity if it never is.

    Parameters
    ----------
    build : costs before the first answer [s]
    solver, query : costs of an answer by the solver and by the surrogate [s]
    """
    return math.inf if query >= solver else math.ceil(build / (solver - query))
