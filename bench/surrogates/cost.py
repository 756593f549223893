"""When a surrogate pays: solver and surrogate against the number of queries (section 4.4)."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from bench import databases
from bench.surrogates.answer_times import (
    NewSurfaces,
    SolverTimes,
    SurrogateTimes,
    measure_solver,
    measure_surrogate,
    new_surfaces,
)
from bench.surrogates.break_even import (
    PAPER_SOLVE,
    BuildTimes,
    break_even,
    build_times,
    of_the_paper,
)
from bench.surrogates.fitting import fit, parted, read, request_for
from bench.surrogates.learning import Point, curve
from gen.runtime.errors import InputError
from learn.comparison.folder import Folder
from learn.features import SETS, chosen
from learn.request import Request

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
    build : time before the first answer [s]
    solve : a query by the solver [s]
    query : t_p of a query, with the features that it needs [s]
    """

    asked: str
    solver: str
    features: str
    rows: int
    build: BuildTimes
    solve: float
    query: float

    @property
    def break_even(self) -> float:
        """Queries from which on the surrogate is cheaper."""
        return break_even(self.build.total, self.solve, self.query)


@dataclass(frozen=True)
class Costs:
    """All that was measured.

    Attributes
    ----------
    solver : times without a surrogate
    answers : times of a surrogate's answers by feature set
    questions : break-even points
    points : learning curves
    """

    solver: SolverTimes
    answers: dict[str, SurrogateTimes]
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
    path = databases.of_the_paper(given, folder / "databases", rows)
    remark(f"the solver on {surfaces} surfaces")
    new = new_surfaces(surfaces)
    costs = Costs(measure_solver(new), {}, [_published()], [])
    for features in SETS:
        request = request_for(path, "kernel-ridge", features, area_max)
        _add(costs, request, rows, new, searched if features == "paper" else 0.0, remark)
    return costs


def _add(
    costs: Costs,
    request: Request,
    rows: int,
    new: NewSurfaces,
    searched: float,
    remark: Callable[[str], None],
) -> None:
    """Add one feature set to what was measured."""
    name, features = request.features, chosen(request.features)
    parts = parted(read(request, rows))
    remark(f"{name} features: {parts.train.size} rows train")
    full = fit(request, parts.train, parts.calibration, parts.folds)
    answer = measure_surrogate(full, features, new)
    build = build_times(rows, costs.solver, answer, full, features)
    build = replace(build, tuning=build.tuning + searched)
    costs.answers[name] = answer
    costs.questions.extend(_questions(name, rows, costs.solver, answer, build))
    costs.points.extend(curve(request, parts, rows, costs.solver, answer, full))


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


def _published() -> Question:
    """Return the paper's own break-even, from its own times."""
    build, query = of_the_paper()
    rows = round(build.database / PAPER_SOLVE)
    return Question(KNOWN, PAPER, "paper, as published", rows, build, PAPER_SOLVE, query)


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
