"""When a surrogate pays: solver and surrogate against the number of queries (section 4.4).

Everything is timed in this one process, on the paper preset's distribution but on surfaces of
another seed. All are processor times of one core: others on the machine do not count.
"""

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import asdict
from functools import partial
from pathlib import Path
from statistics import fmean, median
from time import process_time

import numpy as np

import bem
from bench import databases
from bench.databases import OTHER_SEED
from bench.files import Row
from bench.report import Report, remark
from bench.surrogates.fitting import Fitted, Parts, fit, parted, read, request_for
from gen.arrays import Heights, Values
from gen.generation.plan import parameters
from gen.generation.sample import compute_rows, solve_contact, surface_of
from gen.runtime.errors import InputError
from gen.scene import load
from learn.comparison import paper
from learn.comparison.folder import Folder
from learn.dataset import Request
from learn.features import OF_SURFACES, SurfaceFeatures, chosen
from learn.metrics import scores

PAPER_SOLVE = 189.79  # mean time of the paper's solver for one contact (section 4.4) [s]
# Rows of the paper's database, and of its test set, which its prediction times are for.
PAPER_ROWS, PAPER_TESTS = 15_878, 3_175

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
Times = dict[str, float]  # [s]


def break_even(build: float, solver: float, query: float) -> float:
    """Return the number of queries from which on a surrogate is cheaper, infinity if it never is.

    Its rows, features and fit take `build`, an answer by the solver and by the surrogate `solver`
    and `query` [s].
    """
    return math.inf if query >= solver else math.ceil(build / (solver - query))


def seconds_of(call: Callable[[], object]) -> float:
    """Return the processor time of a call."""
    began = process_time()
    call()
    return process_time() - began


def median_seconds(call: Callable[[], object]) -> float:
    """Time a call that is the same each time; the first is a warm-up."""
    seconds_of(call)
    taken: list[float] = []
    while len(taken) < ROUNDS[0] or (sum(taken) < ENOUGH and len(taken) < ROUNDS[1]):
        taken.append(seconds_of(call))
    return median(taken)


def mean_seconds(calls: Iterable[Callable[[], object]]) -> float:
    """Time calls that differ: the mean is what many of them cost. The first is done twice."""
    first, *others = calls
    seconds_of(first)
    return fmean(map(seconds_of, (first, *others)))


def measure_solver(contacts: Contacts) -> Times:
    """Return mean times without any surrogate [s], and the error of loose solves [%].

    Of a `row` of a database, its `surface`, a `solve` of a contact on a new surface, of one among
    `LOADS` on one surface (`ladder`), and to a residual of `LOOSE`.
    """
    rows, deltas = range(len(contacts)), np.linspace(*DELTAS, LOADS)
    plan = parameters(SCENE, 0, len(contacts))
    loose = [
        partial(bem.solve, each, SIDE, delta, rtol=LOOSE) for each, delta in contacts
    ]
    exact = [partial(solve_contact, SCENE, *each) for each in contacts]
    climbs = [lambda z=z: list(bem.ladder(z, SIDE, deltas)) for z, _ in contacts]
    areas = ([solve().area_percent for solve in solves] for solves in (exact, loose))
    return {
        "row": mean_seconds(partial(compute_rows, SCENE, row, row + 1) for row in rows),
        "surface": mean_seconds(partial(surface_of, SCENE, plan, row) for row in rows),
        "solve": mean_seconds(exact),
        "ladder": mean_seconds(climbs) / LOADS,
        "loose": mean_seconds(loose),
        "loose_nmae": scores(*areas).nmae,
    }


def measure_surrogate(fitted: Fitted, features: str, contacts: Contacts) -> Times:
    """Return times of a surrogate's answers [s], on surfaces that it has not seen.

    Of the features of a new `surface`, and of one more `load` on it; of the prediction of a
    `single` row, and of one among `BATCH` (`batched`).
    """
    wanted = chosen(features, roots=True)

    def surface_of(heights: Heights) -> SurfaceFeatures:
        step = SIDE / (len(heights) - 1)
        return SurfaceFeatures(heights, (SIDE, SIDE), (step, step))

    def features_of(surface: SurfaceFeatures, deltas: Values) -> Values:
        return wanted.of(surface.rows(wanted, deltas))

    def unknown(heights: Heights, delta: float) -> Values:
        return features_of(surface_of(heights), np.array([delta]))

    surface = mean_seconds(partial(unknown, *each) for each in contacts)
    # What does not depend on Delta is computed once: these have it.
    known = [surface_of(heights) for heights, _ in contacts]
    deltas = np.linspace(*DELTAS, LOADS)
    rows = np.concatenate([features_of(each, deltas) for each in known])
    many = np.resize(rows, (BATCH, rows.shape[1]))
    return {
        "surface": surface,
        "load": mean_seconds(partial(features_of, each, deltas) for each in known)
        / LOADS,
        "single": median_seconds(partial(fitted.learnt.raw, rows[:1])),
        "batched": median_seconds(partial(fitted.learnt.raw, many)) / BATCH,
    }


PAPERS, OURS = "the paper's", "ours"  # solvers

NEW, LADDER, KNOWN = "new surfaces", "loads on one surface", "statistics at hand"
"""The questions: a contact on a new surface, one more load on a surface, and a contact whose
features are known already."""

FEWEST = 100  # training rows of a learning curve's first point
# Fits of a point, each to other rows, as long as the rows suffice; the median error counts.
DRAWS = 3


def cost(
    folder: Path,
    rows: int,
    database: Path | None = None,
    comparison: Path | None = None,
    area_max: float = 16.56,
    surfaces: int = 32,
) -> Report:
    """Measure what a kernel ridge surrogate of the paper preset costs and saves.

    The arguments are those of the command. Break-even is counted twice: for those who take the
    settings that come with the program, and for those who search as in the comparison, which is
    on the paper's features.

    An InputError is raised if a database or folder cannot be used, or there are too few rows.
    """
    if rows < 200:
        raise InputError(f"--rows {rows}: give 200 or more, the paper has 15878")
    searched = math.nan if comparison is None else tuning_seconds(comparison)
    path = databases.of_the_paper(database, folder / "databases", rows)
    remark(f"the solver on {surfaces} surfaces")
    plan = parameters(SCENE, 0, surfaces)
    contacts = [
        (surface_of(SCENE, plan, row), float(plan.load[row])) for row in range(surfaces)
    ]
    solver, questions = measure_solver(contacts), [of_the_paper()]
    points: list[Row] = []
    spent = [
        {"of": "solver", "what": what, "value": value} for what, value in solver.items()
    ]
    for features in OF_SURFACES:
        request = request_for(path, "kernel-ridge", features, area_max)
        parts = parted(read(request, rows))
        remark(f"{features} features: {parts.train.size} rows train")
        full = fit(request, parts.train, parts.folds)
        answer = measure_surrogate(full, features, contacts)
        of = f"{features} features"
        spent += [
            {"of": of, "what": what, "value": value} for what, value in answer.items()
        ]
        build = build_times(rows, solver, answer, full, features)
        search = searched if features == "paper" else math.nan
        questions += _questions(features, rows, solver, answer, build, search)
        points += _curve(request, parts, rows, solver, answer, full)
    tables = {"cost": questions, "learning": points, "times": spent}
    return Report({**tables, "totals": [*_totals(questions)]})


def tuning_seconds(comparison: Path) -> float:
    """Return the time of all fits of the search in a folder of `learn tune` [s].

    NaN if the folder has no search of kernel ridge for the area.
    """
    result = Folder(comparison / "area").result("tuned", "kernel-ridge")
    if result is None or result.times is None:
        remark(f"{comparison} has no search of kernel ridge, which is left out")
        return math.nan
    return result.times.search


def question(
    who: tuple[str, str, str],
    rows: int,
    build: Times,
    solve: float,
    query: float,
    search: float,
) -> Row:
    """Return a row: surrogate against a solver in one situation, by the times of an answer [s].

    `query` is t_p, with the features that it needs. With the time of a `search` for settings, NaN
    if there was none, the row has break-even twice, and the contacts that pay for the search alone.
    """
    own, known = sum(build.values()), not math.isnan(search)
    return {
        **dict(zip(("asked", "solver", "features"), who, strict=True)),
        "rows": rows,
        **build,
        **dict(zip(("search", "solve", "query"), (search, solve, query), strict=True)),
        "break_even": break_even(own, solve, query),
        "break_even_searched": break_even(own + search, solve, query)
        if known
        else math.nan,
        "search_pays": break_even(search, solve, query) if known else math.nan,
    }


def of_the_paper() -> Row:
    """Return the paper's own break-even, from its own times."""
    fit, tests = paper.TIMES["tuned"]["kernel-ridge"]
    searched = paper.TUNING_SECONDS["kernel-ridge"]
    build = {"database": PAPER_ROWS * PAPER_SOLVE, "tuning": 0.0, "fit": fit}
    who = KNOWN, PAPERS, "paper, as published"
    return question(who, PAPER_ROWS, build, PAPER_SOLVE, tests / PAPER_TESTS, searched)


def build_times(
    rows: float, solver: Times, answer: Times, fitted: Fitted, features: str
) -> Times:
    """Return times before the first answer [s]: t_d, `database`, t_h, `tuning`, and t_f, `fit`.

    Where features need surfaces, these are generated again; `tuning` chooses among the settings
    that come with the program.
    """
    again = (
        solver["surface"] + answer["surface"] if chosen(features).needs_surface else 0.0
    )
    database = rows * (solver["row"] + again)
    return {"database": database, "tuning": fitted.choosing, "fit": fitted.fitting}


def _questions(
    features: str, rows: int, solver: Times, answer: Times, build: Times, search: float
) -> Iterator[Row]:
    """Yield all situations of a feature set; a surface itself costs both sides the same."""
    theirs = {
        **build,
        "database": build["database"] + rows * (PAPER_SOLVE - solver["solve"]),
    }
    new, more = (answer[name] + answer["batched"] for name in ("surface", "load"))
    yield question((NEW, PAPERS, features), rows, theirs, PAPER_SOLVE, new, search)
    yield question((NEW, OURS, features), rows, build, solver["solve"], new, search)
    yield question((LADDER, OURS, features), rows, build, solver["ladder"], more, search)
    if not chosen(features).needs_surface:
        known = KNOWN, OURS, features
        yield question(known, rows, build, solver["solve"], answer["batched"], search)


def sizes(most: int) -> list[int]:
    """Return the training rows of a curve's points: doubled up to all of them."""
    doubled = [
        FEWEST * 2**power for power in range(30) if FEWEST * 2**power < 0.75 * most
    ]
    return [*doubled, most]


def _curve(
    request: Request, parts: Parts, rows: int, solver: Times, answer: Times, full: Fitted
) -> Iterator[Row]:
    """Yield a feature set's learning curve, judged on the same rows; its last point is `full`.

    A point fits different rows, as often as there are rows for; its times count the rows that had
    to be solved for it, with those left out.
    """
    most = parts.train.size
    for size in sizes(most):
        folds = (np.arange(size) % 5).astype(np.int8)
        draws = [
            np.arange(n * size, (n + 1) * size) for n in range(min(DRAWS, most // size))
        ]
        fits = (
            [full]
            if size == most
            else [fit(request, parts.train.at(n), folds) for n in draws]
        )
        solved = size * rows / most
        judged = [asdict(each.scores(parts.test)) for each in fits]
        builds = [
            build_times(solved, solver, answer, each, request.features) for each in fits
        ]
        build = float(np.median([sum(each.values()) for each in builds]))
        query = answer["surface"] + answer["batched"]
        yield {
            "features": request.features,
            "trained": size,
            "rows": round(solved),
            **{
                name: float(np.median([each[name] for each in judged]))
                for name in judged[0]
            },
            "build": build,
            "break_even": break_even(build, solver["solve"], query),
        }


def _totals(questions: list[Row]) -> Iterator[Row]:
    """Yield the total cost [s] of a solver, and of each surrogate beside it, over the queries."""
    for solver in (PAPERS, OURS):
        own = [row for row in questions if (row["asked"], row["solver"]) == (NEW, solver)]
        most = max(
            (q["break_even"] for q in own if math.isfinite(q["break_even"])), default=1e5
        )
        curves = {"the solver": (0.0, own[0]["solve"])}
        for each in own:
            build = each["database"] + each["tuning"] + each["fit"]
            curves[f"{each['features']} features"] = build, each["query"]
        for name, (build, each) in curves.items():
            for n in np.geomspace(1, 30 * most, 40).tolist():
                yield {
                    "solver": solver,
                    "of": name,
                    "queries": n,
                    "seconds": build + n * each,
                }
