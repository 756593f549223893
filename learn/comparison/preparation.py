"""Prepare a target before any fit: split its rows, check the memory, open its folder."""

from collections.abc import Iterator

from gen.runtime.terminal import RunProgress
from learn import dataset, memory, split
from learn.columns import short_name
from learn.comparison.folder import Folder, conditions
from learn.comparison.training_data import Training
from learn.dataset import Dataset
from learn.executor import Executor
from learn.models import Model, scaling_of
from learn.request import Request, hybrid_for
from learn.split import Split


def prepare(
    request: Request, rows: Dataset, models: list[Model], *, searched: bool
) -> tuple[Folder, Training]:
    """Split the rows of one target and open its folder.

    Parameters
    ----------
    request : Request
        Split, scaling and place of the comparison.
    rows : Dataset
        The usable rows of the target.
    models : list of Model
        The models to be fitted, for which the memory has to suffice.
    searched : bool
        Whether the models are tuned by cross-validation.

    Returns
    -------
    folder : Folder
        The target's folder.
    training : Training
        Its training and test rows.

    Raises
    ------
    InputError
        If there are too few rows or too little memory, or the folder belongs to another comparison.
    """
    parts = split.draw(rows, request.seed, request.train_rows)
    if searched:
        split.check_folds(rows, parts)
    for model in models:
        memory.check(model.name, parts.train.size, baseline=not searched)
    with RunProgress(1) as progress:
        folder = open_folder(request, rows, parts)
        for line in _described(request, rows, parts):
            progress.say(line)
    return folder, _training(request, rows, parts)


def _described(request: Request, rows: Dataset, parts: Split) -> Iterator[str]:
    """Yield the lines that describe the training rows to a user."""
    yield (
        f"{request.database}: {rows.target_name}, {parts.train.size} training rows,"
        f" {parts.test.size} test rows, {rows.features} features"
    )
    for line in dataset.remarks(rows, request.normalisation):
        yield f"  {line}"
    if not parts.by_surface:
        yield "  all rows share one surface: they are split one by one"


def read_single(request: Request, target: str) -> tuple[Dataset, Split]:
    """Read and split the rows of a report that is made on one process.

    Parameters
    ----------
    request : Request
        Database, features and split.
    target : str
        Name of the target.
    """
    hybrid = hybrid_for(request, Executor())
    rows = dataset.read(request.database, target, request.area_max, request.features, hybrid)
    return rows, split.draw(rows, request.seed, request.train_rows)


def open_folder(request: Request, rows: Dataset, parts: Split) -> Folder:
    """Open the folder of a target.

    Parameters
    ----------
    request : Request
        Place and choices of the comparison.
    rows, parts : Dataset, Split
        The rows of the target.

    Raises
    ------
    InputError
        If the folder belongs to another comparison or cannot be written.
    """
    folder = Folder(request.output / short_name(rows.target_name))
    agreed = conditions(rows, parts, request.normalisation, {"area_max": request.area_max})
    folder.begin(rows, parts, agreed)
    return folder


def _training(request: Request, rows: Dataset, parts: Split) -> Training:
    """Take the training and test rows out of a dataset."""
    target_scaling = scaling_of(rows, parts.train)
    return Training(
        inputs=rows.inputs[parts.train],
        target=target_scaling.scaled(rows.target[parts.train]),
        folds=parts.folds,
        test_inputs=rows.inputs[parts.test],
        test_target=rows.target[parts.test],
        normalisation=request.normalisation,
        seed=request.seed,
        scaling=target_scaling,
    )
