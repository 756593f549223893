"""Times of an answer, by the solver and by a surrogate, and where a surrogate pays.

Everything is timed in this one process, on the paper preset's distribution but on surfaces of
another seed. All are processor times of one core: others on the machine do not count.
"""

from collections.abc import Callable, Iterable
from functools import partial
from statistics import fmean, median
from time import process_time
from typing import NamedTuple

import numpy as np

import bem
from bench.databases import OTHER_SEED
from bench.surrogates.fitting import Fitted
from gen.arrays import Heights
from gen.generation.plan import parameters
from gen.generation.sample import compute_rows, solve_contact, surface_of
from gen.scene import load
from learn.features import SurfaceFeatures, chosen
from learn.metrics import scores

PAPER_SOLVE = 189.79  # mean time of the paper's solver for one contact (section 4.4) [s]
# Rows of the paper's database, and of its test set, which its prediction times are for.
PAPER_ROWS, PAPER_TESTS = 15_878, 3_175
PAPER_BREAK_EVEN = 15_893  # contacts, where the paper finds its break-even point (section 4.4)
TAKEN = 1e-3  # s; settings that took less were taken from a table, not searched

ENOUGH = 0.3  # s of calls that a median is over
ROUNDS = (3, 300)  # calls that a median is over, at least and at most
BATCH = 2000  # rows predicted together, as in section 4.4
LOADS = 10  # displacements of a ladder on one surface
DELTAS = 5.0, 45.0  # the paper's range of displacements [um]
LOOSE = 1e-2  # residual of the loose solves that a surrogate competes with
# The paper preset with surfaces that nothing was trained on.
SCENE = load("paper").model_copy(update={"seed": OTHER_SEED})

SIDE = SCENE.sides[0]

Contacts = list[tuple[Heights, float]]  # surfaces, each with its displacement [um]


class SolverTimes(NamedTuple):
    """Mean times without any surrogate [s]."""

    row: float  # of a database: surface, statistics, solve
    surface: float  # of generating it
    solve: float  # of a contact on a new surface
    ladder: float  # of a contact among `LOADS` on one surface
    loose: float  # of a contact on a new surface, to a residual of `LOOSE`
    loose_nmae: float  # error of its area [%]


class SurrogateTimes(NamedTuple):
    """Times of a surrogate's answers [s]."""

    surface: float  # features of a new surface at one displacement
    load: float  # features of one more displacement on it
    single: float  # prediction of a single row
    batched: float  # prediction of a row among `BATCH`


def median_seconds(call: Callable[[], object]) -> float:
    """Time a call that is the same each time; the first is a warm-up."""
    call()
    taken: list[float] = []
    fewest, most = ROUNDS
    while len(taken) < fewest or (sum(taken) < ENOUGH and len(taken) < most):
        taken.append(_seconds(call))
    return median(taken)


def mean_seconds(calls: Iterable[Callable[[], object]]) -> float:
    """Time calls that differ: the mean is what many of them cost. The first is done twice."""
    first, *others = calls
    first()
    return fmean(map(_seconds, (first, *others)))


def _seconds(call: Callable[[], object]) -> float:
    began = process_time()
    call()
    return process_time() - began


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
    climbs = (lambda z=z: list(bem.ladder(z, SIDE, deltas)) for z, _ in contacts)
    return mean_seconds(climbs) / LOADS


def measure_surrogate(fitted: Fitted, features: str, contacts: Contacts) -> SurrogateTimes:
    """Time the answers of a surrogate with a feature set, on surfaces that it has not seen."""
    sides, wanted = (SIDE, SIDE), chosen(features, roots=True)

    def unknown(heights: Heights, delta: float) -> object:
        return SurfaceFeatures(heights, sides).features(wanted, np.array([delta]))

    surface = mean_seconds(partial(unknown, *each) for each in contacts)
    # What does not depend on Delta is computed once: these have it.
    known = [SurfaceFeatures(heights, sides) for heights, _ in contacts]
    deltas = np.linspace(*DELTAS, LOADS)
    rows = np.concatenate([each.features(wanted, deltas) for each in known])
    many = np.resize(rows, (BATCH, rows.shape[1]))
    return SurrogateTimes(
        surface=surface,
        load=mean_seconds(partial(each.features, wanted, deltas) for each in known) / LOADS,
        single=median_seconds(partial(fitted.learnt.raw, rows[:1])),
        batched=median_seconds(partial(fitted.learnt.raw, many)) / BATCH,
    )
