"""Prepare a target before any fit: split its rows, refuse too large models, open the folder."""

from gen.runtime.progress import RunProgress
from learn import dataset, memory, split
from learn.comparison.folder import Folder, conditions
from learn.comparison.training_data import Training
from learn.dataset import Dataset
from learn.models import Model
from learn.request import Request
from learn.target import scaling_of


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
    training = Training(
        inputs=rows.inputs[parts.train],
        target=target_scaling.scaled(rows.target[parts.train]),
        folds=parts.folds,
        test_inputs=rows.inputs[parts.test],
        test_target=rows.target[parts.test],
        normalisation=request.normalisation,
        seed=request.seed,
        scaling=target_scaling,
    )
    return folder, training
