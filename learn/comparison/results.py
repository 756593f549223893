"""What a job has found: written into the folder, and said."""

import math
from collections.abc import Callable
from dataclasses import asdict
from typing import Any

from gen.runtime.progress import RunProgress
from learn import split
from learn.comparison import budget, pruning, search, training_data
from learn.comparison.folder import Folder
from learn.comparison.spaces import TABLE_2
from learn.comparison.timing import Final, Outcome
from learn.comparison.whole_grid import Cost
from learn.models import Model


def is_there(
    folder: Folder | None,
    model: Model,
    final: Final | None,
    searched: budget.Searched | None,
    source: str,
) -> bool:
    """Whether the winner has been measured already."""
    result = None if folder is None else folder.result("tuned", model.name)
    return (
        result is not None
        and final is not None
        and searched is not None
        and result["settings_key"] == pruning.key(final.settings)
        and result["search"]["how"] == searched.how
        and result["search"].get("grid", TABLE_2) == source
        and result["search"]["candidates_scored"] == _scored(searched)
    )


def _scored(searched: budget.Searched) -> int:
    return sum(not math.isnan(mean) for mean in searched.found.means)


def keep_tuned(
    folder: Folder,
    model: Model,
    grid: pruning.Grid,
    source: str,
    searched: budget.Searched | None,
    outcome: Outcome | None,
) -> None:
    """Write what a search has found."""
    if searched is None or outcome is None:
        why = "no candidate was finished within the time"
        if searched is not None:
            why = "; ".join(searched.found.failures) or why
        folder.write_json(
            f"tuned/{model.name}.json", {"model": model.name, "failure": why, "remarks": []}
        )
        _say(f"warning: {model.title}: {why}")
        return
    found = searched.found
    report = {
        "how": searched.how,
        "grid": source,
        "rows": searched.rows,
        "candidates": grid.nominal,
        "candidates_differing": len(grid.differing),
        "candidates_scored": _scored(searched),
        "fits_nominal": split.FOLDS * grid.nominal,
        "fits": found.fits,
        "r2_folds": [100 * float(score) for score in found.scores[found.winner]],
        "failures": found.failures,
        "remarks": found.remarks,
    }
    folder.write_table(f"tuned/{model.name}-grid.csv", *_candidates(grid, found))
    keep(folder, "tuned", model, grid.first(found.winner), outcome, report, searched.seconds)
    for text, number in [*found.failures.items(), *found.remarks.items()]:
        _say(f"{model.title}: {number} of {found.scores.size} scores: {text}")
    tell(None, model, "tuned", outcome)


def _candidates(grid: pruning.Grid, found: search.Found) -> tuple[list[str], list[list[object]]]:
    """Table of all candidates as the paper counts them, in ParameterGrid's order."""
    names = list(grid.candidates[0])
    folds = [f"r2_fold_{fold}" for fold in range(found.scores.shape[1])]
    rows: list[list[object]] = []
    for candidate, number in zip(grid.candidates, grid.canonical, strict=True):
        scored = [float(found.means[number]), *map(float, found.scores[number])]
        rows.append([*(candidate[name] for name in names), number, *scored])
    return [*names, "differing_candidate", "r2_mean", *folds], rows


def keep(
    folder: Folder,
    kind: str,
    model: Model,
    settings: pruning.Settings,
    outcome: Outcome,
    report: dict[str, Any],
    search_seconds: float = 0.0,
) -> None:
    """Write a model's result; predictions first, so that a result is never without them."""
    test = training_data.held().test_target
    rows = enumerate(zip(test.tolist(), outcome.prediction.tolist(), strict=False))
    folder.write_table(
        f"{kind}/{model.name}.csv",
        ("test_row", "truth", "prediction"),
        ((number, *pair) for number, pair in rows),
    )
    canonical = pruning.canonical_settings(model, settings, training_data.held().inputs.shape[1])
    folder.write_json(
        f"{kind}/{model.name}.json",
        {
            "model": model.name,
            "settings": settings,
            "settings_key": pruning.key(canonical),
            "refit": dict(model.refit) if kind == "tuned" else {},
            "fitted": outcome.fitted,
            "test": None if outcome.test is None else asdict(outcome.test),
            "train": None if outcome.train is None else asdict(outcome.train),
            "failure": outcome.failure,
            "remarks": list(outcome.remarks),
            "search": report,
            "times": {**vars(outcome.times), "search": search_seconds},
        },
    )


def keep_cost(folder: Folder, model: Model, source: str, cost: Cost) -> None:
    """Write what a whole grid takes."""
    folder.write_json(f"whole-grid/{model.name}.json", {"grid": source, **asdict(cost)})


def tell(progress: RunProgress | None, model: Model, kind: str, outcome: Outcome) -> None:
    """Say a result, and what its fit warned of."""
    say: Callable[[str], None] = _say if progress is None else progress.say
    if outcome.test is None:
        say(f"warning: {model.title}, {kind}: {outcome.failure}")
        return
    times = outcome.times
    say(
        f"{model.title}, {kind}: R2 {outcome.test.r2:.2f} %, nMAE {outcome.test.nmae:.2f} %,"
        f" fit {times.fit:.3g} s, prediction {times.test:.3g} s"
    )
    for remark in outcome.remarks:
        say(f"  warning: {remark}")


def _say(line: str) -> None:
    with RunProgress(1) as progress:
        progress.say(line)
