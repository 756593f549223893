"""When a surrogate pays: its cost before the first answer, and the time that each answer saves."""

import math
import time

from gen.arrays import Indices, Values
from gen.generation.plan import parameters
from gen.generation.sample import surface_of
from gen.runtime.errors import InputError
from gen.scene import Scene
from learn.surrogate.model import Surrogate

SURFACES = 8
"""Surfaces whose answers are timed, at most."""


def break_even(build: float, solver: float, query: float) -> float:
    """Return the number of queries from which on a surrogate is cheaper, infinity if it never is.

    Its rows, features and fit take `build`, an answer by the solver and by the surrogate `solver`
    and `query` [s].
    """
    return math.inf if query >= solver else math.ceil(build / (solver - query))


def time_of(seconds: float) -> str:
    """Write a time in a unit that suits it."""
    units = {1e-3: ("us", 1e6), 1.0: ("ms", 1e3), 600.0: ("s", 1.0), 1e6: ("h", 1 / 3600)}
    unit, number = next((u for most, u in units.items() if seconds < most), ("d", 1 / 86400))
    return f"{number * seconds:.3g} {unit}"


def in_words(build: float, solver: float, query: float) -> str:
    """Say from how many contacts on a surrogate pays; times are those of `break_even`."""
    even = break_even(build, solver, query)
    who = (
        f"an answer on a new surface takes {time_of(query)}, a solve {time_of(solver)}; database"
        f" and fit took {time_of(build)}"
    )
    if math.isinf(even):
        return f"{who}: on new surfaces the surrogate never pays"
    return f"{who}: it pays from {even:,.0f} new contacts on"


def answer_seconds(surrogate: Surrogate, scene: Scene, rows: Indices, deltas: Values) -> float:
    """Measure the mean wall-clock time of an answer on surfaces of a scene [s].

    Statistics and features are included. `SURFACES` rows, (n,), at most are timed, at their Delta
    [um]; none of them has trained. NaN if no surface can be asked.
    """
    taken = []
    for row, delta in zip(rows[: SURFACES + 1].tolist(), deltas.tolist(), strict=False):
        plan = parameters(scene, row, row + 1)
        try:
            heights = surface_of(scene, plan, 0)
            began = time.perf_counter()
            surrogate.for_surface(heights, scene.sides).predict(delta, hardness=plan.hardness_of(0))
            taken.append(time.perf_counter() - began)
        except InputError:  # statistics that the surface does not define
            continue
    warm = taken[1:] or taken
    return sum(warm) / len(warm) if warm else math.nan
