"""Write a job's results to its folder and report them."""

from collections.abc import Callable
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from gen.runtime.terminal import RunProgress
from learn.comparison import grid as grids
from learn.comparison.estimate import Cost
from learn.comparison.folder import Folder
from learn.comparison.search import GridScores, GridSearch, SearchResult
from learn.comparison.search_tables import why_baseline
from learn.comparison.timing import FitResult, TimedFit
from learn.comparison.training import Training
from learn.models import MODELS, Model
from learn.split import FOLDS

Say = Callable[[str], None]
"""Prints a line for the user."""

UNFINISHED = f"neither baseline nor candidate was finished on {FOLDS} folds within the time"
"""Why a search with a budget has no winner."""

UNFITTED = "the winner's fit to all rows was not finished within the time: give a larger --budget"
"""Why the winner of a search with a budget has no scores."""


def winner_of(search: GridSearch, found: SearchResult) -> TimedFit:
    """Return the winner of a search, a candidate of the grid or the baseline, to be fitted."""
    name, scores = search.model.name, found.scores
    if scores.baseline_wins:
        return TimedFit(name, search.baseline or {}, tuned=True, baseline=True)
    return TimedFit(name, search.grid.differing[scores.winner], tuned=True)


def _place_of_winner(search: GridSearch, found: SearchResult) -> str:
    """Name the winner's place: the grid, its optimum by the paper, or the baseline."""
    if found.scores.baseline_wins:
        return "baseline"
    return "optimum" if found.scores.winner == search.optimum else "grid"


def has_winner(folder: Folder, search: GridSearch, found: SearchResult) -> bool:
    """Whether a folder has the result of this very search and winner."""
    result = folder.result("tuned", search.model.name)
    return (
        result is not None
        and "settings" in result
        and result["settings_key"] == _key(winner_of(search, found), search.training)
        and result["search"].get("winner") == _place_of_winner(search, found)
        and result["search"]["how"] == found.how
        and result["search"].get("grid") == search.source
        and result["search"]["candidates_scored"] == found.scores.scored
    )


def write_search(
    folder: Folder, search: GridSearch, found: SearchResult, result: FitResult
) -> None:
    """Write and print the result of a search and of its winner.

    Parameters
    ----------
    folder : Folder
        The folder of the target.
    search : GridSearch
        Model, grid and data.
    found : SearchResult
        The result of the search, which has a winner.
    result : FitResult
        Scores and times of the winner.
    """
    model, scores = search.model, found.scores
    folder.write_table(f"tuned/{model.name}-grid.csv", *_candidates(search, scores))
    task = winner_of(search, found)
    if not task.baseline:
        task = replace(task, settings=search.grid.first(scores.winner))
    report = _report(search, found)
    write_fit(folder, task, search.training, result, report, found.seconds)
    with RunProgress(1) as progress:
        for text, number in [*scores.failures.items(), *scores.remarks.items()]:
            progress.say(f"{model.title}: {number} of {scores.folds.size} scores: {text}")
        print_result(progress.say, task, result)
        if scores.baseline_wins:
            progress.say(f"{model.title}: {why_baseline(report)}")


def _report(search: GridSearch, found: SearchResult) -> dict[str, Any]:
    """Describe a search in the result of its winner."""
    grid, scores = search.grid, found.scores
    own = [] if np.isnan(scores.baseline).any() else scores.baseline.tolist()
    of_folds = {
        "r2_folds": own if scores.baseline_wins else scores.of(scores.winner),
        "grid_r2_folds": scores.of(scores.winner),
        "optimum_r2_folds": scores.of(search.optimum),
        "baseline_r2_folds": own,
    }
    return {
        "how": found.how,
        "grid": search.source,
        "rows": search.training.rows,
        "candidates": grid.nominal,
        "candidates_differing": len(grid.differing),
        "candidates_scored": scores.scored,
        "fits_nominal": FOLDS * grid.nominal,
        "fits": scores.fits,
        "baseline_fits": int(np.count_nonzero(~np.isnan(scores.baseline))),
        "winner": _place_of_winner(search, found),
        **{name: [100 * score for score in folds] for name, folds in of_folds.items()},
        "failures": scores.failures,
        "remarks": scores.remarks,
    }


def _candidates(search: GridSearch, scores: GridScores) -> tuple[list[str], list[list[object]]]:
    """Return the table of all candidates as the paper counts them, in ParameterGrid's order."""
    names = list(search.grid.candidates[0])
    folds = [f"r2_fold_{fold}" for fold in range(FOLDS)]
    rows: list[list[object]] = []
    means = scores.means
    for candidate, number in zip(search.grid.candidates, search.grid.canonical, strict=True):
        r2 = [float(means[number]), *map(float, scores.folds[number])]
        rows.append([*(candidate[name] for name in names), number, *r2])
    return [*names, "differing_candidate", "r2_mean", *folds], rows


def write_failure(folder: Folder, model: Model, reason: str) -> None:
    """Write and print the reason why a search has no winner."""
    content = {"model": model.name, "failure": reason, "remarks": []}
    folder.write_json(f"tuned/{model.name}.json", content)
    with RunProgress(1) as progress:
        progress.say(f"warning: {model.title}: {reason}")


def write_fit(
    folder: Folder,
    task: TimedFit,
    training: Training,
    result: FitResult,
    report: dict[str, Any] | None = None,
    search_seconds: float = 0.0,
) -> None:
    """Write scores, predictions and times of a model.

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
    content = {
        "model": task.model,
        "settings": task.settings,
        "settings_key": _key(task, training),
        "fitted": result.fitted,
        "test": None if result.test is None else asdict(result.test),
        "train": None if result.train is None else asdict(result.train),
        "failure": result.failure,
        "remarks": list(result.remarks),
        "search": report or {},
        "times": {**result.times, "search": search_seconds},
    }
    folder.write_json(f"{task.kind}/{task.model}.json", content)


def _key(task: TimedFit, training: Training) -> str:
    """Return the line of text that identifies the settings of a fit."""
    if not task.of_grid:
        return grids.baseline_key(task.settings)
    return grids.key(grids.canonical_settings(MODELS[task.model], task.settings, training.columns))


def write_cost(folder: Folder, search: GridSearch, cost: Cost) -> None:
    """Write the time that a model's whole grid takes."""
    content = {"grid": search.source, **asdict(cost)}
    folder.write_json(f"whole-grid/{search.model.name}.json", content)


def print_result(say: Say, task: TimedFit, result: FitResult) -> None:
    """Print a model's scores and times, and the warnings of its fit."""
    title = f"{MODELS[task.model].title}, {task.kind}"
    title += ", which is the baseline" if task.tuned and task.baseline else ""
    if result.test is None:
        say(f"warning: {title}: {result.failure}")
        return
    say(
        f"{title}: R2 {result.test.r2:.2f} %, nMAE {result.test.nmae:.2f} %,"
        f" fit {result.times['fit']:.3g} s, prediction {result.times['test']:.3g} s"
    )
    for remark in result.remarks:
        say(f"  warning: {remark}")
