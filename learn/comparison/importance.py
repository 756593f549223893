"""Feature selection (the paper's section 3.1): the worth of each input, and fits without the weak.

The worth of an input is the loss of R2 when its values are shuffled over the test rows. Many of the
22 statistics are almost the same, and one of two twins can be shuffled without harm. Models are
therefore also fitted anew to fewer and fewer inputs.
"""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

import numpy as np

from gen.runtime.figure import new_figure
from learn import features, memory
from learn.comparison import timing
from learn.comparison.folder import Folder
from learn.comparison.grid import untuned
from learn.comparison.pictures import save
from learn.comparison.training import open_folder, read_single
from learn.dataset import Dataset
from learn.metrics import Scores, scores
from learn.models import Model, models_named, pipeline, remarks
from learn.request import Request
from learn.split import Split

SHUFFLES = 5
"""Times that an input is shuffled: enough for a mean and its scatter."""

SIZES = (30, 23, 20, 16, 12, 8, 6, 4, 3, 2, 1)
"""Numbers of inputs that are kept, the strongest first."""

Build = Callable[[], Any]
"""Returns an unfitted pipeline."""


class Worth(NamedTuple):
    """Mean and deviation of the loss of R2 over the shuffles of an input [%]."""

    name: str
    mean: float
    deviation: float


class Selection(NamedTuple):
    """A model fitted to some of the inputs.

    Attributes
    ----------
    inputs : int
        Number of inputs.
    dropped : tuple of str
        Inputs that the previous, larger selection still had.
    test : Scores
        Scores on the test rows.
    fit, predict : float
        Median times of the fit and of predicting the test rows [s].
    """

    inputs: int
    dropped: tuple[str, ...]
    test: Scores
    fit: float
    predict: float


def rank_inputs(rows: Dataset, parts: Split, build: Build) -> list[Worth]:
    """Rank the inputs of a model by permutation importance, the most important first."""
    from sklearn.inspection import permutation_importance

    fitted = build().fit(rows.inputs[parts.train], rows.target[parts.train])
    found = permutation_importance(
        fitted,
        rows.inputs[parts.test],
        rows.target[parts.test],
        scoring="r2",
        n_repeats=SHUFFLES,
        random_state=parts.seed,
    )
    means, deviations = found.importances_mean.tolist(), found.importances_std.tolist()
    each = zip(rows.names, means, deviations, strict=True)
    worths = [Worth(name, 100 * mean, 100 * deviation) for name, mean, deviation in each]
    return sorted(worths, key=lambda worth: -worth.mean)


def select(rows: Dataset, parts: Split, build: Build, ranked: list[str]) -> list[Selection]:
    """Fit a model to fewer and fewer of its inputs, which are given by their rank."""
    selections = []
    before = list(ranked)
    for size in SIZES:
        if size > len(ranked):
            continue
        kept = tuple(name for name in rows.names if name in ranked[:size])
        fewer = rows.keeping(kept)
        train, test = fewer.inputs[parts.train], fewer.inputs[parts.test]
        model = build()
        fit = timing.repeated(partial(model.fit, train, fewer.target[parts.train]), (3, 3))
        predict = timing.repeated(partial(model.predict, test), (3, 3))
        score = scores(fewer.target[parts.test], model.predict(test))
        dropped = tuple(name for name in before if name not in kept)
        selections.append(Selection(size, dropped, score, median(fit), median(predict)))
        before = list(kept)
    return selections


def write_report(request: Request, say: Callable[[str], None]) -> list[Path]:
    """Rank the inputs, fit the model to fewer of them, and write tables and a picture.

    Parameters
    ----------
    request : Request
        Data, folder and one model.
    say : callable
        Prints a line for the user.

    Returns
    -------
    list of Path
        The files.

    Raises
    ------
    InputError
        For input that cannot be used, or too little memory.
    """
    (model,) = models_named(list(request.models))
    rows, parts = read_single(request, request.targets[0])
    memory.check(model.name, parts.train.size)
    folder = open_folder(request, rows, parts)
    build = _builder(model, folder, request, say)
    with remarks() as said:
        worths = rank_inputs(rows, parts, build)
        selections = select(rows, parts, build, [worth.name for worth in worths])
    for worth in worths:
        say(f"  {worth.name:38} {worth.mean:9.4f} +- {worth.deviation:.4f} % of R2")
    for kept in selections:
        say(
            f"  {kept.inputs:2} inputs: R2 {kept.test.r2:.3f} %, nMAE {kept.test.nmae:.2f} %,"
            f" fit {kept.fit:.3g} s, prediction {kept.predict:.3g} s;"
            f" without {', '.join(kept.dropped) or '-'}"
        )
    for remark in said:
        say(f"  warning: {remark}")
    lines = [
        (
            *(model.name, kept.inputs, *vars(kept.test).values()),
            *(kept.fit, kept.predict, " ".join(kept.dropped)),
        )
        for kept in selections
    ]
    names = ["model", "inputs", *vars(selections[0].test)]
    return [
        folder.write_table("importance.csv", ["input", "r2_loss_percent", "deviation"], worths),
        folder.write_table("selection.csv", [*names, "fit_s", "predict_test_s", "dropped"], lines),
        _draw(worths, selections, model.title, folder.path / "importance.png"),
    ]


def _builder(model: Model, folder: Folder, request: Request, say: Callable[[str], None]) -> Build:
    """Return what builds the model, with tuned settings, or untuned ones where there are none.

    It is trained on the target as a search sees it.
    """
    from sklearn.compose import TransformedTargetRegressor
    from sklearn.preprocessing import StandardScaler

    result, tuned = folder.result("tuned", model.name), folder.winner(model.name)
    origin, settings = untuned(model.name, request.features)
    if tuned and tuned.of_grid and result and result["test"]:
        origin, settings = "tuned here", tuned.settings
    say(f"{model.title}, {origin}: {settings}")
    scaled = features.chosen(request.features).scaled

    def build() -> Any:
        bare = pipeline(
            model, settings, normalisation=request.normalisation, seed=request.seed, tuned=True
        )
        if not scaled:
            return bare
        return TransformedTargetRegressor(bare, transformer=StandardScaler())

    return build


def _draw(worths: list[Worth], selections: list[Selection], title: str, path: Path) -> Path:
    """Draw the worth of the inputs, and errors and times over the number of inputs."""
    figure = new_figure(12, 5.5)
    left, right = figure.subplots(1, 2)
    places = np.arange(len(worths))[::-1]
    left.barh(
        places,
        [max(worth.mean, 1e-6) for worth in worths],
        xerr=[worth.deviation for worth in worths],
        color="tab:blue",
    )
    left.set_yticks(places, [worth.name for worth in worths], fontsize=8)
    left.set(xscale="log", xlabel="loss of R2 when shuffled [%]", title=title)
    sizes = [kept.inputs for kept in selections]
    for style, label, values in (
        ("o-", "100 - R2 [%]", [100 - kept.test.r2 for kept in selections]),
        ("s-", "nMAE [%]", [kept.test.nmae for kept in selections]),
        ("k:", "fit [s]", [kept.fit for kept in selections]),
    ):
        right.plot(sizes, values, style, label=label)
    right.set(yscale="log", xlabel="inputs kept, the strongest first", title="fitted anew")
    right.legend()
    return save(figure, path)
