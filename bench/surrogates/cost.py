"""When a surrogate pays: solver and surrogate against the number of queries (section 4.4)."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from bench.surrogates import databases
from bench.surrogates.costs import (
    PAPER_SOLVE,
    BuildCosts,
    QueryCosts,
    SolverCosts,
    break_even,
    build_costs,
    measure_queries,
    measure_solver,
    of_the_paper,
)
from bench.surrogates.fitting import fit, parted, read, request_for
from bench.surrogates.learning import Point, Prices, curve
from gen.runtime.errors import InputError
from learn.comparison.folder import Folder
from learn.features import SETS, chosen

PAPER, OURS = "the paper's", "ours"
"""Solvers."""

NEW, LADDER, KNOWN = "new surfaces", "loads on one surface", "statistics at hand"
"""What is asked: a contact on a surface that nobody has seen, one more load on a surface, a contact
of which the features are known already."""


@dataclass(frozen=True)
class Question:
    """Solver against surrogate in one situation.

    Attributes
    ----------
    asked : what is asked
    solver : whose
    features : of the surrogate; "paper, as published" for the paper's own numbers
    rows : of its database
    database, tuning, fit : t_d, t_h, t_f [s]
    solve : a query by the solver [s]
    query : t_p of a query, with the features that it needs [s]
    break_even : queries from which on the surrogate is cheaper
    """

    asked: str
    solver: str
    features: str
    rows: int
    database: float
    tuning: float
    fit: float
    solve: float
    query: float
    break_even: float


@dataclass(frozen=True)
class Costs:
    """All that was measured.

    Attributes
    ----------
    solver : times without a surrogate
    queries : times of a surrogate's answers by feature set
    questions : break-even points
    points : learning curves
    """

    solver: SolverCosts
    queries: dict[str, QueryCosts]
    questions: list[Question]
    points: list[Point]


def cost(
    folder: Path,
    rows: int,
    *,
    given: Path | None = None,
    comparison: Path | None = None,
    area_max: float = 16.56,
    surfaces: int = 32,
    remark: Callable[[str], None] = lambda line: None,
) -> Costs:
    """Measure what a kernel ridge surrogate of the paper preset costs and saves.

    Parameters
    ----------
    folder : its `databases` holds what is generated
    rows : of the paper preset that are used
    given : database of the preset, None to generate one
    comparison : folder in which `learn tune` has searched kernel ridge's grid on the paper's
        features: its time is their t_h, which is 0 otherwise, for the paper's optimum
    area_max : largest area [%]
    surfaces : number of surfaces that are timed
    remark : told how far it is

    Raises
    ------
    InputError
        If a database or folder cannot be used, or there are too few rows.
    """
    if rows < 200:
        raise InputError(f"--rows {rows}: give 200 or more, the paper has 15878")
    searched = 0.0 if comparison is None else tuning_seconds(comparison)
    path = databases.of_the_paper(given, folder / "databases", rows, remark)
    remark(f"the solver on {surfaces} surfaces")
    solver = measure_solver(surfaces)
    questions = [_published()]
    points: list[Point] = []
    queries = {}
    for features in SETS:
        request = request_for(path, "kernel-ridge", features, area_max)
        parts = parted(read(request, rows))
        remark(f"{features} features: {parts.train.size} rows train")
        full = fit(request, parts.train, parts.calibration, parts.folds)
        queries[features] = query = measure_queries(full, chosen(features), surfaces)
        again = solver.surface + query.surface
        build = build_costs(rows, solver.row, full, chosen(features), again)
        build = BuildCosts(
            build.database, build.tuning + (searched if features == "paper" else 0), build.fit
        )
        questions += _questions(features, rows, solver, query, build)
        prices = Prices(solver.row, again, solver.solve, query.surface + query.batched)
        points += curve(request, parts, rows, prices, full)
    return Costs(solver, queries, questions, points)


def tuning_seconds(comparison: Path) -> float:
    """Time of all fits of the search in a folder of `learn tune` [s].

    Raises
    ------
    InputError
        If the folder has no search of kernel ridge for the area.
    """
    result = Folder(comparison / "area").result("tuned", "kernel-ridge")
    try:
        return float((result or {})["times"]["search"])
    except (KeyError, TypeError, ValueError):
        raise InputError(
            f"--comparison {comparison}: has no search of kernel ridge: python -m learn tune"
            " --model kernel-ridge"
        ) from None


def _published() -> Question:
    """The paper's own break-even, from its own times."""
    build, query = of_the_paper()
    rows = round(build.database / PAPER_SOLVE)
    return _question(KNOWN, PAPER, "paper, as published", rows, build, PAPER_SOLVE, query)


def _questions(
    features: str, rows: int, solver: SolverCosts, query: QueryCosts, build: BuildCosts
) -> list[Question]:
    """All situations of a feature set; a surface itself costs both sides the same."""
    theirs = BuildCosts(
        build.database + rows * (PAPER_SOLVE - solver.solve), build.tuning, build.fit
    )
    new, more = query.surface + query.batched, query.load + query.batched
    found = [
        _question(NEW, PAPER, features, rows, theirs, PAPER_SOLVE, new),
        _question(NEW, OURS, features, rows, build, solver.solve, new),
        _question(LADDER, OURS, features, rows, build, solver.ladder, more),
    ]
    if not chosen(features).needs_surface:
        found.append(_question(KNOWN, OURS, features, rows, build, solver.solve, query.batched))
    return found


def _question(
    asked: str,
    solver: str,
    features: str,
    rows: int,
    build: BuildCosts,
    solve: float,
    query: float,
) -> Question:
    return Question(
        asked=asked,
        solver=solver,
        features=features,
        rows=rows,
        database=build.database,
        tuning=build.tuning,
        fit=build.fit,
        solve=solve,
        query=query,
        break_even=break_even(build.total, solve, query),
    )
