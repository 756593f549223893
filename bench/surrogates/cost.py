"""When a surrogate pays: solver and surrogate against the number of queries (section 4.4)."""

from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from bench import databases
from bench.remarks import remark
from bench.surrogates.answer_times import (
    SolverTimes,
    SurrogateTimes,
    measure_solver,
    measure_surrogate,
    new_contacts,
)
from bench.surrogates.break_even import (
    PAPER_ROWS,
    PAPER_SOLVE,
    PAPER_TESTS,
    BuildTimes,
    break_even,
)
from bench.surrogates.fitting import Fitted, Parts, fit, parted, read, request_for
from gen.runtime.errors import InputError
from learn.comparison import paper
from learn.comparison.folder import Folder
from learn.features import SETS, chosen
from learn.request import Request

PAPER, OURS = "the paper's", "ours"
"""Solvers."""

NEW, LADDER, KNOWN = "new surfaces", "loads on one surface", "statistics at hand"
"""What is asked: a contact on a surface that nobody has seen, one more load on a surface, a contact
of which the features are known already."""

FEWEST = 100
"""Training rows of a learning curve's first point."""

DRAWS = 3
"""Fits of a point, each to other rows, as long as the rows suffice; the median error counts."""


@dataclass(frozen=True)
class Question:
    """Solver against surrogate in one situation."""

    asked: str
    solver: str  # whose
    features: str  # of the surrogate; "paper, as published" for the paper's own numbers
    rows: int  # of its database
    build: BuildTimes
    solve: float  # a query by the solver [s]
    query: float  # t_p of a query, with the features that it needs [s]

    @property
    def break_even(self) -> float:
        """Queries from which on the surrogate is cheaper."""
        return break_even(self.build.total, self.solve, self.query)


@dataclass(frozen=True)
class Costs:
    """Times of answers, by feature set those of surrogates; break-even points; learning curves."""

    solver: SolverTimes
    answers: dict[str, SurrogateTimes]
    questions: list[Question]
    points: list[dict[str, Any]]


def cost(
    folder: Path,
    rows: int,
    *,
    given: Path | None = None,
    comparison: Path | None = None,
    area_max: float = 16.56,
    surfaces: int = 32,
) -> Costs:
    """Measure what a kernel ridge surrogate of the paper preset costs and saves.

    The arguments are those of the command. A search in a comparison is one on the paper's features:
    its time is their t_h, which is 0 otherwise, for the paper's optimum.

    Raises
    ------
    InputError
        If a database or folder cannot be used, or there are too few rows.
    """
    if rows < 200:
        raise InputError(f"--rows {rows}: give 200 or more, the paper has 15878")
    searched = 0.0 if comparison is None else tuning_seconds(comparison)
    path = databases.of_the_paper(given, folder / "databases", rows)
    remark(f"the solver on {surfaces} surfaces")
    contacts = new_contacts(surfaces)
    costs = Costs(measure_solver(contacts), {}, [of_the_paper()], [])
    for features in SETS:
        request = request_for(path, "kernel-ridge", features, area_max)
        parts = parted(read(request, rows))
        remark(f"{features} features: {parts.train.size} rows train")
        full = fit(request, parts.train, parts.calibration, parts.folds)
        answer = measure_surrogate(full, features, contacts)
        build = build_times(rows, costs.solver, answer, full, features)
        if features == "paper":
            build = replace(build, tuning=build.tuning + searched)
        costs.answers[features] = answer
        costs.questions.extend(_questions(features, rows, costs.solver, answer, build))
        costs.points.extend(_curve(request, parts, rows, costs.solver, answer, full))
    return costs


def tuning_seconds(comparison: Path) -> float:
    """Return the time of all fits of the search in a folder of `learn tune` [s].

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


def of_the_paper() -> Question:
    """Return the paper's own break-even, from its own times."""
    fit, tests = paper.TIMES["tuned"]["kernel-ridge"]
    build = BuildTimes(PAPER_ROWS * PAPER_SOLVE, paper.TUNING_SECONDS["kernel-ridge"], fit)
    who = KNOWN, PAPER, "paper, as published"
    return Question(*who, PAPER_ROWS, build, PAPER_SOLVE, tests / PAPER_TESTS)


def build_times(
    rows: float, solver: SolverTimes, answer: SurrogateTimes, fitted: Fitted, features: str
) -> BuildTimes:
    """Add up a surrogate's time before its first answer; some features need surfaces again."""
    again = solver.surface + answer.surface if chosen(features).needs_surface else 0.0
    return BuildTimes(rows * (solver.row + again), fitted.choosing, fitted.fitting)


def _questions(
    features: str, rows: int, solver: SolverTimes, answer: SurrogateTimes, build: BuildTimes
) -> Iterator[Question]:
    """Yield all situations of a feature set; a surface itself costs both sides the same."""
    theirs = replace(build, database=build.database + rows * (PAPER_SOLVE - solver.solve))
    more = answer.load + answer.batched
    yield Question(NEW, PAPER, features, rows, theirs, PAPER_SOLVE, answer.new)
    yield Question(NEW, OURS, features, rows, build, solver.solve, answer.new)
    yield Question(LADDER, OURS, features, rows, build, solver.ladder, more)
    if not chosen(features).needs_surface:
        yield Question(KNOWN, OURS, features, rows, build, solver.solve, answer.batched)


def sizes(most: int) -> list[int]:
    """Return the training rows of a curve's points: doubled up to all of them."""
    doubled = [FEWEST * 2**power for power in range(30) if FEWEST * 2**power < 0.75 * most]
    return [*doubled, most]


def _curve(
    request: Request,
    parts: Parts,
    rows: int,
    solver: SolverTimes,
    answer: SurrogateTimes,
    full: Fitted,
) -> Iterator[dict[str, Any]]:
    """Yield a feature set's learning curve, judged on the same rows; its last point is `full`.

    The times of a point count the rows that had to be solved for it, with those left out.
    """
    most = parts.train.size
    for size in sizes(most):
        fits = [full] if size == most else _fits(request, parts, size)
        solved = size * rows / most
        judged = [asdict(each.scores(parts.test)) for each in fits]
        builds = [build_times(solved, solver, answer, each, request.features) for each in fits]
        build = float(np.median([each.total for each in builds]))
        yield {
            "features": request.features,
            "trained": size,
            "rows": round(solved),
            **{name: float(np.median([each[name] for each in judged])) for name in judged[0]},
            "build": build,
            "break_even": break_even(build, solver.solve, answer.new),
        }


def _fits(request: Request, parts: Parts, size: int) -> list[Fitted]:
    """Fit different rows, as often as there are rows for."""
    folds = (np.arange(size) % 5).astype(np.int8)
    draws = range(min(DRAWS, parts.train.size // size))
    drawn = (parts.train.at(np.arange(draw * size, (draw + 1) * size)) for draw in draws)
    return [fit(request, rows, parts.calibration, folds) for rows in drawn]
