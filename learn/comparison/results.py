"""Write a job's results to its folder and report them."""

from collections.abc import Callable
from dataclasses import asdict, replace
from math import isnan
from typing import Any

import numpy as np

from gen.runtime.terminal import RunProgress
from learn import split
from learn.comparison.folder import Folder
from learn.comparison.search import pruning
from learn.comparison.search.grid_search import GridSearch, SearchResult
from learn.comparison.search.pruning import Grid
from learn.comparison.search.scores import GridScores
from learn.comparison.search.spaces import TABLE_2
from learn.comparison.search.whole_grid import Cost
from learn.comparison.search_tables import why_baseline
from learn.comparison.timing import FitResult, TimedFit
from learn.comparison.training_data import Training
from learn.models import MODELS, Model

Say = Callable[[str], None]
"""Prints a line for the user."""


def has_winner(folder: Folder, grid_search: GridSearch, search: SearchResult) -> bool:
    """Whether a folder has the result of this very search and winner.

    Parameters
    ----------
    folder : Folder
        The folder of the target.
    grid_search : GridSearch
        Model and grid.
    search : SearchResult
        The search, which has a winner.
    """
    result = folder.result("tuned", grid_search.model.name)
    return (
        result is not None
        and "settings" in result
        and result["settings_key"] == _key(winner_of(grid_search, search), grid_search.training)
        and result["search"].get("winner") == _kind_of_winner(grid_search, search)
        and result["search"]["how"] == search.how
        and result["search"].get("grid", TABLE_2) == grid_search.source
        and result["search"]["candidates_scored"] == search.scores.scored
    )


def winner_of(grid_search: GridSearch, search: SearchResult) -> TimedFit:
    """Return the winner of a search, to be fitted to all rows.

    Parameters
    ----------
    grid_search : GridSearch
        Model, grid and baseline.
    search : SearchResult
        The search, which has a winner: a candidate of the grid, or the baseline.
    """
    name, scores = grid_search.model.name, search.scores
    if scores.baseline_wins:
        return TimedFit(name, grid_search.baseline or {}, tuned=True, baseline=True)
    return TimedFit(name, grid_search.grid.differing[scores.winner], tuned=True)


def _kind_of_winner(grid_search: GridSearch, search: SearchResult) -> str:
    """Name the winner's place: the grid, its optimum by the paper, or the baseline."""
    if search.scores.baseline_wins:
        return "baseline"
    return "optimum" if search.scores.winner == grid_search.optimum else "grid"


def write_search(
    folder: Folder, grid_search: GridSearch, search: SearchResult, result: FitResult
) -> None:
    """Write and print the result of a search and of its winner.

    Parameters
    ----------
    folder : Folder
        The folder of the target.
    grid_search : GridSearch
        Model, grid and data.
    search : SearchResult
        The search, which has a winner.
    result : FitResult
        Scores and times of the winner.
    """
    model, grid, scores = grid_search.model, grid_search.grid, search.scores
    folder.write_table(f"tuned/{model.name}-grid.csv", *_candidates(grid, scores))
    task = winner_of(grid_search, search)
    if not task.baseline:
        task = replace(task, settings=grid.first(scores.winner))
    report = _report(grid_search, search)
    write_fit(folder, task, grid_search.training, result, report, search.seconds)
    for text, number in [*scores.failures.items(), *scores.remarks.items()]:
        _say(f"{model.title}: {number} of {scores.folds.size} scores: {text}")
    print_result(_say, task, result)
    if scores.baseline_wins:
        _say(f"{model.title}: {why_baseline(report)}")


def _report(grid_search: GridSearch, search: SearchResult) -> dict[str, Any]:
    """Describe a search in the result of its winner."""
    grid, scores = grid_search.grid, search.scores
    own = [] if np.isnan(scores.baseline).any() else scores.baseline.tolist()
    return {
        "how": search.how,
        "grid": grid_search.source,
        "rows": search.rows,
        "candidates": grid.nominal,
        "candidates_differing": len(grid.differing),
        "candidates_scored": scores.scored,
        "fits_nominal": split.FOLDS * grid.nominal,
        "fits": scores.fits,
        "baseline_fits": scores.baseline_fits,
        "winner": _kind_of_winner(grid_search, search),
        "r2_folds": _percent(own if scores.baseline_wins else scores.of(scores.winner)),
        "grid_r2_folds": _percent(scores.of(scores.winner)),
        "optimum_r2_folds": _percent(scores.of(grid_search.optimum)),
        "baseline_r2_folds": _percent(own),
        "failures": scores.failures,
        "remarks": scores.remarks,
    }


def _percent(scores: list[float]) -> list[float]:
    return [100 * score for score in scores]


def write_failure(folder: Folder, model: Model, search: SearchResult | None) -> None:
    """Write and print the reason why a search has no winner.

    Parameters
    ----------
    folder : Folder
        The folder of the target.
    model : Model
        The model.
    search : SearchResult or None
        The search, None if it finished no candidate.
    """
    reason = f"neither baseline nor candidate was finished on {split.FOLDS} folds within the time"
    if search is not None:
        reason = "; ".join(search.scores.failures) or reason
    folder.write_json(
        f"tuned/{model.name}.json", {"model": model.name, "failure": reason, "remarks": []}
    )
    _say(f"warning: {model.title}: {reason}")


def _candidates(grid: Grid, scores: GridScores) -> tuple[list[str], list[list[object]]]:
    """Return the table of all candidates as the paper counts them, in ParameterGrid's order."""
    names = list(grid.candidates[0])
    folds = [f"r2_fold_{fold}" for fold in range(scores.folds.shape[1])]
    rows: list[list[object]] = []
    for candidate, number in zip(grid.candidates, grid.canonical, strict=True):
        r2 = [float(scores.means[number]), *map(float, scores.folds[number])]
        rows.append([*(candidate[name] for name in names), number, *r2])
    return [*names, "differing_candidate", "r2_mean", *folds], rows


def write_fit(
    folder: Folder,
    task: TimedFit,
    training: Training,
    result: FitResult,
    report: dict[str, Any] | None = None,
    search_seconds: float = 0.0,
) -> None:
    """Write a model's result; predictions first, so that no result is without them.

    Parameters
    ----------
    folder : Folder
        The folder of the target.
    task : TimedFit
        The model and its settings.
    training : Training
        The data that it was fitted to.
    result : FitResult
        Scores, predictions and times.
    report : dict, optional
        Description of the search for the settings; a baseline has none.
    search_seconds : float
        Sum of the times of the search's fits [s].
    """
    pairs = zip(training.test_target.tolist(), result.prediction.tolist(), strict=False)
    folder.write_table(
        f"{task.kind}/{task.model}.csv",
        ("test_row", "truth", "prediction"),
        ((number, *pair) for number, pair in enumerate(pairs)),
    )
    content = _content(task, training, result)
    times = {name: None if isnan(each) else each for name, each in vars(result.times).items()}
    content |= {"search": report or {}, "times": {**times, "search": search_seconds}}
    folder.write_json(f"{task.kind}/{task.model}.json", content)


def _content(task: TimedFit, training: Training, result: FitResult) -> dict[str, Any]:
    """Return the settings and scores of a result as its file holds them."""
    return {
        "model": task.model,
        "settings": task.settings,
        "settings_key": _key(task, training),
        "fitted": result.fitted,
        "test": None if result.test is None else asdict(result.test),
        "train": None if result.train is None else asdict(result.train),
        "failure": result.failure,
        "remarks": list(result.remarks),
    }


def _key(task: TimedFit, training: Training) -> str:
    """Return the line of text that identifies the settings of a fit."""
    if not task.of_grid:
        return pruning.baseline_key(task.settings)
    canonical = pruning.canonical_settings(MODELS[task.model], task.settings, training.columns)
    return pruning.key(canonical)


def write_cost(folder: Folder, grid_search: GridSearch, cost: Cost) -> None:
    """Write the time that a model's whole grid takes.

    Parameters
    ----------
    folder : Folder
        The folder of the target.
    grid_search : GridSearch
        Model and grid.
    cost : Cost
        The estimate.
    """
    content = {"grid": grid_search.source, **asdict(cost)}
    folder.write_json(f"whole-grid/{grid_search.model.name}.json", content)


def print_result(say: Say, task: TimedFit, result: FitResult) -> None:
    """Print a model's scores and times, and the warnings of its fit.

    Parameters
    ----------
    say : callable
        Prints a line.
    task : TimedFit
        The model.
    result : FitResult
        Scores and times.
    """
    title = f"{MODELS[task.model].title}, {task.kind}"
    title += ", which is the baseline" if task.tuned and task.baseline else ""
    if result.test is None:
        say(f"warning: {title}: {result.failure}")
        return
    times = result.times
    say(
        f"{title}: R2 {result.test.r2:.2f} %, nMAE {result.test.nmae:.2f} %,"
        f" fit {times.fit:.3g} s, prediction {times.test:.3g} s"
    )
    for remark in result.remarks:
        say(f"  warning: {remark}")


def _say(line: str) -> None:
    with RunProgress(1) as progress:
        progress.say(line)
