"""When a surrogate pays: the cost of solver and surrogate against the number of queries.

This is section 4.4 of the paper. Everything is timed in this one process, on surfaces of the paper
preset's distribution, but of another seed. All times are processor times of one core, so that other
work on the machine does not count.
"""

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import asdict, dataclass, replace
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
from bench.surrogates.fitting import (
    AREA_MAX,
    Fitted,
    Parts,
    fit,
    parted,
    read,
    request_for,
)
from gen.arrays import Heights, Values
from gen.generation.plan import parameters
from gen.generation.sample import compute_rows, solve_contact, surface_of
from gen.runtime.errors import InputError
from gen.scene import load
from learn.comparison import paper
from learn.comparison.folder import Folder
from learn.dataset import Request
from learn.features import OF_SURFACES, FeatureSet, SurfaceFeatures, chosen
from learn.metrics import scores
from learn.split import FOLDS

PAPER_SOLVE = 189.79
"""Mean time of a solve by the paper's solver (section 4.4) [s]."""

PAPER_ROWS = 15_878
"""Number of rows of the paper's database."""

PAPER_TESTS = 3_175
"""Number of rows of the paper's test set. The paper's prediction times are for all of them."""

FEWEST_ROWS = 200
"""Smallest number of rows of the database that is accepted."""

ENOUGH = 0.3
"""Total time of repeated calls after which their median is taken [s]."""

FEWEST_CALLS = 3
"""Smallest number of calls whose median is taken."""

MOST_CALLS = 300
"""Largest number of calls whose median is taken."""

BATCH = 2000
"""Number of rows that are predicted together, as in section 4.4."""

LOADS = 10
"""Number of displacements on one surface that are solved or predicted together."""

DELTAS = (5.0, 45.0)
"""Smallest and largest displacement of the paper [um]."""

LOOSE = 1e-2
"""Relative tolerance of loose solves, the solver's cheap alternative to a surrogate."""

SCENE = load("paper").model_copy(update={"seed": OTHER_SEED})
"""The paper preset with surfaces that no surrogate was trained on."""

SIDE = SCENE.sides[0]
"""Scan length [um]."""


@dataclass(frozen=True, eq=False)
class Query:
    """A contact whose area is to be computed."""

    heights: Heights  # (n, n) [um]
    delta: float  # far-field displacement [um]


@dataclass(frozen=True)
class SolverTimes:
    """Mean times of the solver, without any surrogate [s], and the error of loose solves."""

    row: float  # time of computing a row of a database
    surface: float  # time of generating the surface of a row
    solve: float  # time of solving a contact on a new surface
    ladder: float  # time of solving one of `LOADS` contacts on one surface
    loose: float  # time of solving a contact on a new surface, to the tolerance `LOOSE`
    loose_nmae: float  # error nMAE of the area of loose solves [%]


@dataclass(frozen=True)
class AnswerTimes:
    """Times of a surrogate's answers, for one contact each [s]."""

    surface: float  # time of the features of a contact on a new surface
    load: float  # time of the features of one of `LOADS` contacts on a known surface
    single: float  # time of predicting one row alone
    batched: float  # time of predicting one of `BATCH` rows


@dataclass(frozen=True)
class BuildTimes:
    """Times before the first answer of a surrogate [s]."""

    # t_d, time of computing the rows, and their surfaces again if the features need them.
    database: float
    tuning: float  # t_h, time of the choice among the settings that come with the program
    fit: float  # t_f, time of the fit

    @property
    def total(self) -> float:
        """The sum of all times [s]."""
        return self.database + self.tuning + self.fit


def break_even(build: float, solver: float, query: float) -> float:
    """Compute the number of queries at which a surrogate has saved the time that it took to build.

    Parameters
    ----------
    build : float
        Time before the first answer of the surrogate [s].
    solver : float
        Time of an answer by the solver [s].
    query : float
        Time of an answer by the surrogate [s].

    Returns
    -------
    float
        A whole number, rounded up; infinity if a query takes no less time than a solve.
    """
    if query >= solver:
        return math.inf
    return math.ceil(build / (solver - query))


def seconds_of(call: Callable[[], object]) -> float:
    """Measure the processor time of a call.

    Parameters
    ----------
    call : callable
        Called once, without arguments.

    Returns
    -------
    float
        Processor time of this process [s].
    """
    began = process_time()
    call()
    return process_time() - began


def median_seconds(call: Callable[[], object]) -> float:
    """Measure the median time of a call whose repetitions do equal work.

    Parameters
    ----------
    call : callable
        Called without arguments: once to warm up, then until the calls took `ENOUGH` seconds
        together, but at least `FEWEST_CALLS` and at most `MOST_CALLS` times.

    Returns
    -------
    float
        Median of the processor times [s].
    """
    seconds_of(call)  # warms up
    times: list[float] = []
    while len(times) < FEWEST_CALLS or (sum(times) < ENOUGH and len(times) < MOST_CALLS):
        times.append(seconds_of(call))
    return median(times)


def mean_seconds(calls: Iterable[Callable[[], object]]) -> float:
    """Measure the mean time of calls that differ from each other.

    Parameters
    ----------
    calls : iterable of callables
        One call or more. The first one is made twice, once to warm up.

    Returns
    -------
    float
        Mean of the processor times [s].
    """
    first, *following = calls
    seconds_of(first)  # warms up
    return fmean(map(seconds_of, (first, *following)))


def measure_solver(queries: list[Query]) -> SolverTimes:
    """Measure the times of the solver.

    Parameters
    ----------
    queries : list of Query
        Contacts on the first surfaces of `SCENE`, from `new_queries`. The rows and surfaces of the
        same numbers are computed, too.

    Returns
    -------
    SolverTimes
        Mean times [s], and the error of the loose solves [%].
    """
    rows = range(len(queries))
    plan = parameters(SCENE, 0, len(queries))
    deltas = np.linspace(*DELTAS, LOADS)
    exact = [
        partial(solve_contact, SCENE, query.heights, query.delta) for query in queries
    ]
    loose = [
        partial(bem.solve, query.heights, SIDE, query.delta, rtol=LOOSE)
        for query in queries
    ]

    def climb(heights: Heights) -> None:
        """Solve the contacts of one surface at all displacements, and drop them."""
        for _ in bem.ladder(heights, SIDE, deltas):
            pass

    def areas(solves: list[partial[bem.Contact]]) -> list[float]:
        """Solve contacts, and return their areas [%]."""
        return [solve().area_percent for solve in solves]

    return SolverTimes(
        row=mean_seconds(partial(compute_rows, SCENE, row, row + 1) for row in rows),
        surface=mean_seconds(partial(surface_of, SCENE, plan, row) for row in rows),
        solve=mean_seconds(exact),
        ladder=mean_seconds(partial(climb, query.heights) for query in queries) / LOADS,
        loose=mean_seconds(loose),
        loose_nmae=scores(areas(exact), areas(loose)).nmae,
    )


def feature_seconds(feature_set: FeatureSet, queries: Iterable[Query]) -> float:
    """Measure the time of the features of a contact on a new surface, from its heights alone.

    Parameters
    ----------
    feature_set : FeatureSet
        The features.
    queries : iterable of Query
        Contacts on different surfaces of `SCENE`.

    Returns
    -------
    float
        Mean processor time of a contact [s].
    """

    def features_of(query: Query) -> Values:
        """Return the features of a contact, (1, features)."""
        surface = _described(query.heights)
        return feature_set.of(surface.rows(feature_set, np.array([query.delta])))

    return mean_seconds(partial(features_of, query) for query in queries)


def _described(heights: Heights) -> SurfaceFeatures:
    """Return the features of a surface, of which none is computed yet."""
    step = SIDE / (len(heights) - 1)
    return SurfaceFeatures(heights, (SIDE, SIDE), (step, step))


def measure_surrogate(fitted: Fitted, features: str, queries: list[Query]) -> AnswerTimes:
    """Measure the times of a surrogate's answers.

    Parameters
    ----------
    fitted : Fitted
        The surrogate.
    features : str
        Name of its feature set.
    queries : list of Query
        Contacts on different surfaces of `SCENE`, on which the surrogate was not trained.

    Returns
    -------
    AnswerTimes
        Mean times of features, and median times of predictions [s].
    """
    feature_set = chosen(features, roots=True)

    def features_of(surface: SurfaceFeatures, deltas: Values) -> Values:
        """Return the features of a surface at k displacements [um], (k, features)."""
        return feature_set.of(surface.rows(feature_set, deltas))

    surfaces = [_described(query.heights) for query in queries]
    deltas = np.linspace(*DELTAS, LOADS)
    # This first use of a surface computes its features that do not depend on Delta. The surface
    # keeps them, so that the second use, which is timed, is that of a known surface.
    rows = np.concatenate([features_of(surface, deltas) for surface in surfaces])
    batch = np.resize(rows, (BATCH, rows.shape[1]))
    ladder_seconds = mean_seconds(
        partial(features_of, surface, deltas) for surface in surfaces
    )
    return AnswerTimes(
        surface=feature_seconds(feature_set, queries),
        load=ladder_seconds / LOADS,
        single=median_seconds(partial(fitted.learnt.raw, rows[:1])),
        batched=median_seconds(partial(fitted.learnt.raw, batch)) / BATCH,
    )


PAPERS = "the paper's"
"""Name of the paper's solver in the tables."""

OURS = "ours"
"""Name of our solver in the tables."""

NEW = "new surfaces"
"""Name of the question in which each contact has a new surface."""

LADDER = "loads on one surface"
"""Name of the question in which many contacts have one surface."""

KNOWN = "statistics at hand"
"""Name of the question in which the features of each contact are known already."""

FEWEST = 100
"""Number of training rows of the first point of a learning curve."""

DRAWS = 3
"""Largest number of fits for a point of a learning curve, each to other rows. The point has the
medians of their values."""


@dataclass(frozen=True, eq=False)
class Studied:
    """A surrogate of one feature set, with all times that add up to its costs."""

    request: Request
    parts: Parts  # training and test rows
    rows: int  # number of solved rows of the database, unusable ones included
    fitted: Fitted  # fit to all training rows
    solver: SolverTimes
    answer: AnswerTimes

    @property
    def features(self) -> str:
        """Name of the feature set."""
        return self.request.features


def cost(
    folder: Path,
    rows: int,
    database: Path | None = None,
    comparison: Path | None = None,
    area_max: float = AREA_MAX,
    surfaces: int = 32,
) -> Report:
    """Measure costs and savings of kernel ridge surrogates of the paper preset.

    Break-even is computed with the settings that come with the program. For the paper's features it
    is computed a second time, with the time of the comparison's search for settings. Progress is
    printed on standard error.

    Parameters
    ----------
    folder : Path
        Folder of the report. A generated database is kept in its folder `databases`.
    rows : int
        Number of the preset's first rows that are used, `FEWEST_ROWS` or more.
    database : Path or None
        A database of the paper preset; None to generate one.
    comparison : Path or None
        Folder of `learn tune`; None to leave out the search.
    area_max : float
        Largest area of the rows that are used [%].
    surfaces : int
        Number of surfaces that are timed.

    Returns
    -------
    Report
        Table `cost` of the questions, `learning` of the learning curves, `times` of the solver and
        of all answers, and `totals` of the total costs over the number of queries. Times are in
        seconds.

    Raises
    ------
    InputError
        If a database or folder cannot be used, or there are too few rows.
    """
    if rows < FEWEST_ROWS:
        raise InputError(
            f"--rows {rows}: give {FEWEST_ROWS} or more, the paper has {PAPER_ROWS}"
        )
    search = math.nan  # time of the comparison's search [s]; NaN without one
    if comparison is not None:
        search = tuning_seconds(comparison)
    path = databases.of_the_paper(database, folder / "databases", rows)
    remark(f"the solver on {surfaces} surfaces")
    queries = new_queries(surfaces)
    solver = measure_solver(queries)
    questions = [of_the_paper()]
    points: list[Row] = []
    times = _rows_of_times("solver", asdict(solver))
    for features in OF_SURFACES:
        request = request_for(path, "kernel-ridge", features, area_max)
        parts = parted(read(request, rows))
        remark(f"{features} features: {parts.train.size} rows train")
        fitted = fit(request, parts.train, parts.folds)
        answer = measure_surrogate(fitted, features, queries)
        studied = Studied(
            request=request,
            parts=parts,
            rows=rows,
            fitted=fitted,
            solver=solver,
            answer=answer,
        )
        times += _rows_of_times(f"{features} features", asdict(answer))
        # The search of the comparison is for the paper's features alone.
        search_of_features = search if features == "paper" else math.nan
        questions += _questions(studied, search_of_features)
        points += _learning_curve(studied)
    totals = list(_totals(questions))
    return Report(
        {"cost": questions, "learning": points, "times": times, "totals": totals}
    )


def new_queries(surfaces: int) -> list[Query]:
    """Generate the first surfaces of `SCENE`, each with its displacement.

    Parameters
    ----------
    surfaces : int
        Number of surfaces.

    Returns
    -------
    list of Query
        A contact on each surface.
    """
    plan = parameters(SCENE, 0, surfaces)
    return [
        Query(heights=surface_of(SCENE, plan, row), delta=float(plan.load[row]))
        for row in range(surfaces)
    ]


def _rows_of_times(subject: str, values: dict[str, float]) -> list[Row]:
    """Return rows of the table `times`: one for each field of `SolverTimes` or `AnswerTimes`.

    `subject` is "solver" or names a feature set. `values` has the fields by their names.
    """
    return [{"of": subject, "what": name, "value": values[name]} for name in values]


def tuning_seconds(comparison: Path) -> float:
    """Read the time of the comparison's search for settings of kernel ridge, for the area.

    Parameters
    ----------
    comparison : Path
        Folder of `learn tune`.

    Returns
    -------
    float
        Time of all fits of the search [s]. If the folder has no search of kernel ridge, it is NaN,
        and a remark is printed on standard error.
    """
    result = Folder(comparison / "area").result("tuned", "kernel-ridge")
    if result is None or result.times is None:
        remark(f"{comparison} has no search of kernel ridge, which is left out")
        return math.nan
    return result.times.search


@dataclass(frozen=True)
class Situation:
    """The names of a question, and of the solver and the features that are compared in it."""

    question: str  # `NEW`, `LADDER` or `KNOWN`
    solver: str  # `PAPERS` or `OURS`
    features: str  # name of the surrogate's feature set


def question(
    situation: Situation,
    rows: int,
    build: BuildTimes,
    solve: float,
    query: float,
    search: float,
) -> Row:
    """Compare a surrogate with a solver in one situation.

    Parameters
    ----------
    situation : Situation
        The question, the solver and the features.
    rows : int
        Number of rows of the surrogate's database.
    build : BuildTimes
        Times before the first answer [s].
    solve : float
        Time of an answer by the solver [s].
    query : float
        Time t_p of an answer by the surrogate, with the features that it needs [s].
    search : float
        Time of a search for settings [s]; NaN if there was none.

    Returns
    -------
    Row
        A row of the table `cost`: all times [s]; break-even without the search (`break_even`) and
        with it (`break_even_searched`); and the number of queries that pay for the search alone
        (`search_pays`). The last two are NaN without a search.
    """
    row = {
        "asked": situation.question,
        "solver": situation.solver,
        "features": situation.features,
        "rows": rows,
        **asdict(build),
        "search": search,
        "solve": solve,
        "query": query,
        "break_even": break_even(build.total, solve, query),
        "break_even_searched": math.nan,
        "search_pays": math.nan,
    }
    if not math.isnan(search):
        row["break_even_searched"] = break_even(build.total + search, solve, query)
        row["search_pays"] = break_even(search, solve, query)
    return row


def of_the_paper() -> Row:
    """Compute the break-even of the paper from the times that the paper gives.

    Returns
    -------
    Row
        A row of the table `cost`.
    """
    fit_seconds, test_seconds = paper.TIMES["tuned"]["kernel-ridge"]
    build = BuildTimes(database=PAPER_ROWS * PAPER_SOLVE, tuning=0.0, fit=fit_seconds)
    # The paper's times do not contain the computation of features.
    return question(
        Situation(question=KNOWN, solver=PAPERS, features="paper, as published"),
        rows=PAPER_ROWS,
        build=build,
        solve=PAPER_SOLVE,
        query=test_seconds / PAPER_TESTS,
        search=paper.TUNING_SECONDS["kernel-ridge"],
    )


def build_times(studied: Studied, fitted: Fitted, rows: float) -> BuildTimes:
    """Compute the times before the first answer of a surrogate.

    Parameters
    ----------
    studied : Studied
        The feature set, and the times of solver and features.
    fitted : Fitted
        The fit, to all training rows or to some of them.
    rows : float
        Number of rows that had to be solved for the fit.

    Returns
    -------
    BuildTimes
        Times [s]. If the features need the surfaces, their generation is added a second time, and
        the computation of the features: a database has no surfaces.
    """
    row_seconds = studied.solver.row
    if chosen(studied.features).needs_surface:
        row_seconds += studied.solver.surface + studied.answer.surface
    return BuildTimes(
        database=rows * row_seconds, tuning=fitted.choosing, fit=fitted.fitting
    )


def _questions(studied: Studied, search: float) -> Iterator[Row]:
    """Yield a row for each question and solver that a feature set is compared in.

    `search` is the time of a search for settings [s], NaN without one. The time of generating the
    surface of a query is left out, because solver and surrogate both need it.
    """
    features = studied.features
    rows = studied.rows
    solver = studied.solver
    answer = studied.answer
    build = build_times(studied, studied.fitted, rows)
    # The paper's solver would have computed the same rows more slowly.
    slower = rows * (PAPER_SOLVE - solver.solve)
    build_by_papers = replace(build, database=build.database + slower)
    on_new_surface = answer.surface + answer.batched
    on_same_surface = answer.load + answer.batched
    yield question(
        Situation(question=NEW, solver=PAPERS, features=features),
        rows=rows,
        build=build_by_papers,
        solve=PAPER_SOLVE,
        query=on_new_surface,
        search=search,
    )
    yield question(
        Situation(question=NEW, solver=OURS, features=features),
        rows=rows,
        build=build,
        solve=solver.solve,
        query=on_new_surface,
        search=search,
    )
    yield question(
        Situation(question=LADDER, solver=OURS, features=features),
        rows=rows,
        build=build,
        solve=solver.ladder,
        query=on_same_surface,
        search=search,
    )
    # Features that need the surface cannot be known without it.
    if not chosen(features).needs_surface:
        yield question(
            Situation(question=KNOWN, solver=OURS, features=features),
            rows=rows,
            build=build,
            solve=solver.solve,
            query=answer.batched,
            search=search,
        )


def sizes(rows: int) -> list[int]:
    """Choose the numbers of training rows of a learning curve's points.

    Parameters
    ----------
    rows : int
        Number of all training rows.

    Returns
    -------
    list of int
        `FEWEST` and its doublings that are below three quarters of all rows; then all rows.
    """
    chosen_sizes = []
    size = FEWEST
    while size < 0.75 * rows:
        chosen_sizes.append(size)
        size *= 2
    return [*chosen_sizes, rows]


def _learning_curve(studied: Studied) -> Iterator[Row]:
    """Yield the points of a feature set's learning curve, as rows of the table `learning`.

    All points are judged by the same test rows. The build time of a point contains test rows and
    unusable rows, too, in proportion to its training rows. Scores and build time are medians over
    the fits of `_fits_of_size`.
    """
    all_training_rows = studied.parts.train.size
    on_new_surface = studied.answer.surface + studied.answer.batched
    for size in sizes(all_training_rows):
        fits = _fits_of_size(studied, size)
        solved = size * studied.rows / all_training_rows
        judged = [asdict(fitted.scores(studied.parts.test)) for fitted in fits]
        builds = [build_times(studied, fitted, solved).total for fitted in fits]
        build = float(np.median(builds))
        row: Row = {
            "features": studied.features,
            "trained": size,
            "rows": round(solved),
        }
        for name in judged[0]:
            row[name] = float(np.median([of_fit[name] for of_fit in judged]))
        row["build"] = build
        row["break_even"] = break_even(build, studied.solver.solve, on_new_surface)
        yield row


def _fits_of_size(studied: Studied, size: int) -> list[Fitted]:
    """Fit the surrogate to each of at most `DRAWS` disjoint blocks of `size` training rows.

    If a block has all training rows, no fit is made, and the list has `studied.fitted` alone. The
    rows are in random order, and each has another surface, so that any folds will do.
    """
    train = studied.parts.train
    if size == train.size:
        return [studied.fitted]
    folds = (np.arange(size) % FOLDS).astype(np.int8)
    blocks = min(DRAWS, train.size // size)
    fits = []
    for block in range(blocks):
        rows = np.arange(block * size, (block + 1) * size)
        fits.append(fit(studied.request, train.at(rows), folds))
    return fits


def _totals(questions: list[Row]) -> Iterator[Row]:
    """Yield rows of the table `totals`: costs [s] over the number of queries on new surfaces.

    For each solver there is its own curve and one for each feature set. A curve has 40 points, up
    to thirty times the largest finite break-even of these feature sets.
    """
    for solver in (PAPERS, OURS):
        rows = [
            row for row in questions if row["asked"] == NEW and row["solver"] == solver
        ]
        finite = [row["break_even"] for row in rows if math.isfinite(row["break_even"])]
        largest = max(finite, default=1e5)  # some number, if no surrogate ever pays
        curves = {"the solver": _CostLine(build=0.0, query=rows[0]["solve"])}
        for row in rows:
            build = row["database"] + row["tuning"] + row["fit"]
            name = f"{row['features']} features"
            curves[name] = _CostLine(build=build, query=row["query"])
        for name, line in curves.items():
            for number in np.geomspace(1, 30 * largest, 40).tolist():
                yield {
                    "solver": solver,
                    "of": name,
                    "queries": number,
                    "seconds": line.build + number * line.query,
                }


@dataclass(frozen=True)
class _CostLine:
    """The cost of a solver or surrogate as a linear function of the number of queries [s]."""

    build: float  # time before the first answer
    query: float  # time of each answer
