"""The jobs: fit the models' baselines, and tune the models over their grids.

A job runs on the master. It reads as if there were one process: the executor (`learn.executor`)
does its fits on the workers.
"""

import math
import time
from collections.abc import Iterator

from gen.runtime.farm import Interruption
from gen.runtime.terminal import RunProgress
from learn import dataset, split
from learn.comparison import grid as grids
from learn.comparison import results
from learn.comparison.fits import Training, Trials
from learn.comparison.folder import Folder
from learn.comparison.results import TimedFit
from learn.comparison.search import GridSearch, halved, whole
from learn.dataset import Request, short_name
from learn.executor import Executor
from learn.features.scene import SCENE
from learn.models import Model, check_memory, models_named, scaling_of


def compare(request: Request, executor: Executor) -> int:
    """Fit, score and time the baselines of all models that are asked for; see `tune`."""
    models = models_named(list(request.models), request.features)
    tasks = [TimedFit(each.name, grids.baseline(each.name, request.features)) for each in models]
    tasks += [
        TimedFit(each.name, grids.LIBRARY[each.name], "library")
        for each in models
        if each.name in grids.LIBRARY
    ]
    with Interruption(listening=True) as interruption:
        for folder, training in _targets(request, models, executor, interruption, searched=False):
            with RunProgress(len(tasks), "models") as progress:
                for task in tasks:
                    if interruption.requested():
                        break
                    if request.again or folder.result(task.kind, task.model) is None:
                        limited = task.kind == "library"
                        own = training.first(grids.LIBRARY_ROWS) if limited else training
                        result = executor.call(results.fit_and_time, own, task)
                        results.write_fit(folder, task, own, result, progress.say)
                    progress.advance(1, 0)
    return interruption.signal


def tune(request: Request, executor: Executor) -> int:
    """Search the models' grids, then fit, score and time the winners, or the baselines that won.

    The number of the signal that stopped the job is returned, 0 if none did; InputError is raised
    for input that cannot be used.
    """
    models = models_named(list(request.models), request.features)
    with Interruption(listening=True) as interruption:
        targets = [*_targets(request, models, executor, interruption, searched=True)]
        searches = [(*target, model) for target in targets for model in models]
        for place, (folder, training, model) in enumerate(searches):
            if interruption.requested():
                break
            # What is left of the time is shared evenly among the searches that are left.
            share = max(request.until - time.time(), 0.0) / (len(searches) - place)
            agreed, until = folder.record()["conditions"], time.time() + share
            with Trials(folder.path / "trials" / f"{model.name}.jsonl", agreed) as trials:
                source, space = grids.space_of(model.name, agreed["features"])
                grid = grids.grid(model, space, training.columns)
                search = GridSearch(
                    *(model, grid, training, trials, executor, interruption.requested, source),
                    baseline=grids.baseline(model.name, agreed["features"]),
                    optimum=grid.number_of(grids.untuned(model.name, agreed["features"])[1]),
                )
                found = whole(search) if math.isinf(until) else halved(search, until)
                if not interruption.requested():
                    results.finish(folder, found, until, again=request.again)
    return interruption.signal


def _targets(
    request: Request,
    models: list[Model],
    executor: Executor,
    interruption: Interruption,
    *,
    searched: bool,
) -> Iterator[tuple[Folder, Training]]:
    """Read the database; split the rows of each target and open its folder, until a signal comes.

    InputError is raised if there are too few rows, or this machine lacks the memory for a model.
    """
    for rows in dataset.read(request, executor, interruption.requested):
        if interruption.requested():
            return
        parts = split.draw(rows, request.seed, request.train_rows)
        if searched:
            split.check_folds(rows, parts)
        for model in models:
            check_memory(model.name, parts.train.size, baseline=not searched)
        scaling = scaling_of(rows, parts.train, standard=rows.features.name == SCENE)
        folder = Folder(request.output / short_name(rows.target_name))
        folder.begin(rows, parts, request)
        with RunProgress(1) as progress:
            progress.say(
                f"{request.databases[0]}: {rows.target_name}, {parts.train.size} training rows,"
                f" {parts.test.size} test rows, {rows.features.name} features"
            )
            for line in dataset.remarks(rows, request.normalisation):
                progress.say(f"  {line}")
            if not parts.by_surface:
                progress.say("  all rows share one surface: they are split one by one")
        yield (
            folder,
            Training(
                inputs=rows.inputs[parts.train],
                target=scaling.scaled(rows.target[parts.train]),
                folds=parts.folds,
                test_inputs=rows.inputs[parts.test],
                test_target=rows.target[parts.test],
                normalisation=request.normalisation,
                seed=request.seed,
                scaling=scaling,
                groups=rows.groups[parts.train],
            ),
        )
