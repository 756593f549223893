"""The last fits of a comparison: fitted to all training rows, scored, timed, written, reported.

The times of a search are taken while other fits run beside them. These are taken while the other
processes wait, on one thread, as medians.
"""

import json
import math
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from statistics import median
from time import perf_counter
from typing import Any

import numpy as np

from gen.arrays import Values
from gen.runtime.terminal import RunProgress
from learn.comparison.fits import Training, reason
from learn.comparison.folder import Folder
from learn.comparison.grid import Settings
from learn.comparison.search import Found
from learn.comparison.tables import WHY_BASELINE
from learn.metrics import scores
from learn.models import EVERY, STEP, pipeline, remarks
from learn.split import FOLDS

FITS = (3, 7)
"""Fewest and most fits that a median is over."""

ENOUGH = 5.0
"""Seconds after which the fewest repetitions are enough."""

TOO_LONG = 300.0
"""Seconds after which no further repetition is begun."""

UNFITTED = "the winner's fit to all rows was not finished within the time: give a larger --budget"
"""Why the winner of a search with a budget has no scores."""


@dataclass(frozen=True)
class TimedFit:
    """A model to fit to all training rows."""

    model: str
    settings: Settings = field(default_factory=dict)  # on top of the baseline's
    kind: str = "baseline"  # one of `learn.comparison.folder.KINDS`
    of_grid: bool = False  # whether it has the settings that all candidates of a grid share
    until: float = math.inf  # time of `time.time` at which the fit is stopped [s]


FitResult = tuple[Values, dict[str, Any]]
"""Predictions of the test rows, (m,), empty if the fit failed, and what a result says of it.

Times are medians on one thread: of a "fit", of predicting the "test" set, and one "row" [s].
"""


def fit_and_time(training: Training, task: TimedFit) -> FitResult:
    """Fit, score and time a model."""
    training = training.seen_by(task.model)
    model, how, restored = EVERY[task.model], training.normalisation, training.scaling.restored
    unfitted = pipeline(
        model, task.settings, normalisation=how, seed=training.seed, tuned=task.of_grid
    )
    prediction = np.empty(0)
    found: dict[str, Any] = {"fitted": {}, "test": None, "train": None, "failure": ""}
    found["times"] = {"fit": None, "fits": 0, "test": None, "row": None}
    beside = training.beside(slice(None))
    fit = partial(unfitted.fit, training.inputs, training.target, **beside)
    with remarks() as said:
        try:
            began = perf_counter()
            fitted = fit()
            alone = perf_counter() - began
            answer = partial(fitted.predict, training.test_inputs)
            for name, attribute in (("kernel", "kernel_"), ("iterations", "n_iter_")):
                chosen = getattr(fitted.named_steps[STEP], attribute, None)
                if chosen is not None and not isinstance(chosen, np.ndarray):
                    found["fitted"][name] = str(chosen)
            train = restored(fitted.predict(training.inputs))
            found["train"] = asdict(scores(restored(training.target), train))
            guess = restored(answer())
            found["test"] = asdict(scores(training.test_target, guess))
            of_test = median(repeated(answer, (3, 9)))
            of_row = median(repeated(partial(fitted.predict, training.test_inputs[:1]), (5, 99)))
            # The first of several fits is a warm-up; one that is too long counts itself.
            fits = repeated(fit, FITS, alone, task.until) or [alone]
            found["times"] |= {"fit": median(fits), "fits": len(fits)}
            found["times"] |= {"test": of_test, "row": of_row}
            prediction = guess
        except Exception as error:  # whatever a library raises: the model has no scores
            found |= {"failure": reason(error), "test": None, "train": None}
    return prediction, {**found, "remarks": said}


def repeated(
    action: Callable[[], Any], bounds: tuple[int, int], before: float = 0.0, until: float = math.inf
) -> list[float]:
    """Time an action repeatedly, between two numbers of times, and return the times [s].

    There are fewer, even none, if they take too long. An action that took a time `before` tells
    whether another one ends before `until` [s].
    """
    taken: list[float] = []
    while len(taken) < bounds[1] and before + sum(taken) < TOO_LONG:
        if len(taken) >= bounds[0] and sum(taken) > ENOUGH:
            break
        if time.time() + 2 * max([before, *taken]) >= until:
            break
        began = perf_counter()
        action()
        taken.append(perf_counter() - began)
    return taken


def finish(folder: Folder, found: Found, until: float, *, again: bool) -> None:
    """Fit the winner of a search until a time [s], and write and print what came of both.

    The winner is a candidate of the grid or the baseline. Nothing is done, except `again`, where
    the folder has the result of this very search and winner.
    """
    search, scores, name = found.search, found.scores, found.search.model.name
    why = found.fault
    if not why:
        task, report = TimedFit(name, search.baseline or {}, "tuned", until=until), _report(found)
        if not scores.baseline_wins:
            task = replace(task, settings=search.grid.first(scores.winner), of_grid=True)
        there = folder.result("tuned", name) or {}
        there = {"settings": there.get("settings"), **(there.get("search") or {})}
        same = {each: report[each] for each in ("winner", "how", "grid", "candidates_scored")}
        same["settings"] = task.settings
        stored = json.dumps({each: there.get(each) for each in same})
        if not again and stored == json.dumps(same):
            return
        result = search.executor.call(fit_and_time, search.training, task, until)
        why = "" if result else UNFITTED
    with RunProgress(1) as progress:
        if why:
            content = {"model": name, "failure": why, "remarks": []}
            folder.write_json(f"tuned/{name}.json", content)
            progress.say(f"warning: {search.model.title}: {why}")
            return
        _write_grid(folder, found)
        for text, number in [*scores.failures.items(), *scores.remarks.items()]:
            progress.say(f"{search.model.title}: {number} of {scores.folds.size} scores: {text}")
        write_fit(folder, task, search.training, result, progress.say, report, found.seconds)
        if scores.baseline_wins:
            progress.say(f"{search.model.title}: {WHY_BASELINE}")


def _write_grid(folder: Folder, found: Found) -> None:
    """Write the candidates of a search with their scores."""
    scores, grid, means = found.scores, found.search.grid, found.scores.means
    names, folds = list(grid.candidates[0]), [f"r2_fold_{fold}" for fold in range(FOLDS)]
    folder.write_table(
        f"tuned/{found.search.model.name}-grid.csv",
        [*names, "differing_candidate", "r2_mean", *folds],
        (
            [*candidate.values(), number, float(means[number]), *scores.folds[number]]
            for candidate, number in zip(grid.candidates, grid.canonical, strict=True)
        ),
    )


def _report(found: Found) -> dict[str, Any]:
    """Describe a search in the result of its winner."""
    search, scores, grid, means = found.search, found.scores, found.search.grid, found.scores.means
    own = [] if np.isnan(scores.baseline).any() else scores.baseline.tolist()
    of_folds = {
        "r2_folds": own if scores.baseline_wins else scores.of(scores.winner),
        "grid_r2_folds": scores.of(scores.winner),
        "optimum_r2_folds": scores.of(search.optimum),
        "baseline_r2_folds": own,
    }
    place = "optimum" if scores.winner == search.optimum else "grid"
    best = grid.first(max(scores.winner, 0))
    return {
        "how": found.how,
        "grid": search.source,
        "rows": search.training.rows,
        "candidates": len(grid.candidates),
        "candidates_differing": len(grid.differing),
        "candidates_scored": int(np.isfinite(means).sum()),
        "fits_nominal": FOLDS * len(grid.candidates),
        "fits": scores.fits,
        "baseline_fits": int(np.count_nonzero(~np.isnan(scores.baseline))),
        "winner": "baseline" if scores.baseline_wins else place,
        "ends": [*grid.beyond(best)],
        **{name: [100 * score for score in folds] for name, folds in of_folds.items()},
        "failures": scores.failures,
        "remarks": scores.remarks,
    }


def write_fit(
    folder: Folder,
    task: TimedFit,
    training: Training,
    result: FitResult,
    say: Callable[[str], None],
    search: dict[str, Any] | None = None,
    seconds: float = 0.0,
) -> None:
    """Write and print scores and times of a model, with the report and the time of its search."""
    prediction, found = result
    pairs = zip(training.test_target.tolist(), prediction.tolist(), strict=False)
    folder.write_table(
        f"{task.kind}/{task.model}.csv",
        ("test_row", "truth", "prediction"),
        ((number, *pair) for number, pair in enumerate(pairs)),
    )
    times = {**found["times"], "search": seconds}
    content = {"model": task.model, "settings": task.settings, **found}
    folder.write_json(
        f"{task.kind}/{task.model}.json", {**content, "search": search or {}, "times": times}
    )
    title = f"{EVERY[task.model].title}, {task.kind}"
    title += ", which is the baseline" if task.kind == "tuned" and not task.of_grid else ""
    if found["test"] is None:
        say(f"warning: {title}: {found['failure']}")
        return
    say(
        f"{title}: R2 {found['test']['r2']:.2f} %, nMAE {found['test']['nmae']:.2f} %,"
        f" fit {times['fit']:.3g} s, prediction {times['test']:.3g} s"
    )
    for remark in found["remarks"]:
        say(f"  warning: {remark}")
