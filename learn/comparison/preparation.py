"""Before any fit: read the rows, split them, refuse what is too large, open the folder."""

from collections.abc import Iterator
from contextlib import contextmanager

from gen.runtime import farm
from gen.runtime.progress import RunProgress
from learn import dataset, memory, split
from learn.arrays import Values
from learn.comparison import training_data
from learn.comparison.folder import Folder, conditions
from learn.models import Model
from learn.request import Request
from learn.target import scaling_of


@contextmanager
def prepared(
    request: Request,
    target: str,
    models: list[Model],
    world: farm.World,
    pressed: Values | None,
    *,
    searched: bool,
) -> Iterator[Folder | None]:
    """Read the data on the master and give it to all; the folder on the master, None elsewhere."""
    folder: Folder | None = None
    training: training_data.Training | None = None
    if world.is_master:
        training, folder = _read(request, target, models, pressed, searched=searched)
    training_data.hold(training, world)
    yield folder


def _read(
    request: Request,
    target: str,
    models: list[Model],
    pressed: Values | None,
    *,
    searched: bool,
) -> tuple[training_data.Training, Folder]:
    """Read the rows, split them, refuse what is too large, and open the folder."""
    rows = dataset.read(request.database, target, request.area_max, request.features, pressed)
    parts = split.draw(rows, request.seed, request.train_rows)
    if searched:
        split.check_folds(parts)
    for model in models:
        memory.check(model.name, parts.train.size, baseline=not searched)
    folder = Folder(request.output / dataset.short_name(rows.target_name))
    agreed = conditions(rows, parts, request.normalisation, {"area_max": request.area_max})
    with RunProgress(1) as progress:
        folder.begin(rows, parts, agreed)
        progress.say(
            f"{request.database}: {rows.target_name}, {parts.train.size} training rows,"
            f" {parts.test.size} test rows, {rows.features} features"
        )
        for line in dataset.remarks(rows, request.normalisation):
            progress.say(f"  {line}")
        if not parts.by_surface:
            progress.say("  all rows share one surface: they are split one by one")
    target_scaling = scaling_of(rows, parts.train)
    training = training_data.Training(
        inputs=rows.inputs[parts.train],
        target=target_scaling.scaled(rows.target[parts.train]),
        folds=parts.folds,
        test_inputs=rows.inputs[parts.test],
        test_target=rows.target[parts.test],
        normalisation=request.normalisation,
        seed=request.seed,
        scaling=target_scaling,
    )
    return training, folder
