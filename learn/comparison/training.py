"""The data that all fits of one target share, and their preparation before any fit."""

from dataclasses import dataclass

from gen.runtime.terminal import RunProgress
from learn import dataset, memory, split
from learn.arrays import Folds, Values
from learn.columns import short_name
from learn.comparison.folder import Folder, conditions
from learn.dataset import Dataset
from learn.executor import Executor
from learn.models import UNSCALED, Model, Scaling, scaling_of
from learn.request import Request, hybrid_for
from learn.split import Split


@dataclass(frozen=True, eq=False)
class Training:
    """Training and test rows of one target, with the choices that all fits have in common.

    Attributes
    ----------
    inputs : ndarray, shape (n, d)
        Inputs of the training rows.
    target : ndarray, shape (n,)
        Target of the training rows as the models see it: divided by `scaling`.
    folds : ndarray, shape (n,)
        Fold of each training row.
    test_inputs : ndarray, shape (m, d)
        Inputs of the test rows, which no search sees.
    test_target : ndarray, shape (m,)
        Target of the test rows, not scaled.
    normalisation : str
        One of `learn.models.NORMALISATIONS`.
    seed : int
        Seed of the models' random draws.
    scaling : Scaling
        Scaling of the target.
    """

    inputs: Values
    target: Values
    folds: Folds
    test_inputs: Values
    test_target: Values
    normalisation: str = "l2"
    seed: int = 0
    scaling: Scaling = UNSCALED

    @property
    def rows(self) -> int:
        """Number of training rows."""
        return self.target.size

    @property
    def columns(self) -> int:
        """Number of inputs."""
        return int(self.inputs.shape[1])


def prepare(
    request: Request, rows: Dataset, models: list[Model], *, searched: bool
) -> tuple[Folder, Training]:
    """Split the rows of one target, check the memory and open the target's folder.

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
    scaling = scaling_of(rows, parts.train)
    with RunProgress(1) as progress:
        folder = open_folder(request, rows, parts)
        progress.say(
            f"{request.database}: {rows.target_name}, {parts.train.size} training rows,"
            f" {parts.test.size} test rows, {rows.features} features"
        )
        for line in dataset.remarks(rows, request.normalisation):
            progress.say(f"  {line}")
        if not parts.by_surface:
            progress.say("  all rows share one surface: they are split one by one")
    return folder, Training(
        inputs=rows.inputs[parts.train],
        target=scaling.scaled(rows.target[parts.train]),
        folds=parts.folds,
        test_inputs=rows.inputs[parts.test],
        test_target=rows.target[parts.test],
        normalisation=request.normalisation,
        seed=request.seed,
        scaling=scaling,
    )


def read_single(request: Request, target: str) -> tuple[Dataset, Split]:
    """Read and split the rows of a report on a target that is made on one process."""
    hybrid = hybrid_for(request, Executor())
    rows = dataset.read(request.database, target, request.area_max, request.features, hybrid)
    return rows, split.draw(rows, request.seed, request.train_rows)


def open_folder(request: Request, rows: Dataset, parts: Split) -> Folder:
    """Open the folder of a target.

    Raises
    ------
    InputError
        If the folder belongs to another comparison or cannot be written.
    """
    folder = Folder(request.output / short_name(rows.target_name))
    agreed = conditions(rows, parts, request.normalisation, {"area_max": request.area_max})
    folder.begin(rows, parts, agreed)
    return folder
