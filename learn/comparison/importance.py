"""Feature selection (the paper's section 3.1): the worth of each input, and fits without the weak.

The worth of an input is the loss of R2 when its values are shuffled over the test rows. Many of the
22 statistics are almost the same, and one of two twins can be shuffled without harm. Models are
therefore also fitted anew to fewer and fewer inputs.
"""

from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import Any

import numpy as np

from gen.runtime.figure import new_figure
from learn import dataset, features, memory, split
from learn.comparison.folder import Folder
from learn.comparison.grid import Settings
from learn.comparison.pictures import save
from learn.comparison.spaces import untuned
from learn.comparison.training import open_folder, read_single
from learn.metrics import Scores, scores
from learn.models import Model, models_named, pipeline, remarks
from learn.request import Request

SHUFFLES = 5
"""Times that an input is shuffled: enough for a mean and its scatter."""

SIZES = (30, 23, 20, 16, 12, 8, 6, 4, 3, 2, 1)
"""Numbers of inputs that are kept, the strongest first."""


@dataclass(frozen=True)
class Worth:
    """The loss of R2 on the test rows when an input is shuffled.

    Attributes
    ----------
    name : str
        Name of the input.
    mean, deviation : float
        Mean and standard deviation of the loss over the shuffles [%].
    """

    name: str
    mean: float
    deviation: float


@dataclass(frozen=True)
class Selection:
    """A model fitted to some of the inputs.

    Attributes
    ----------
    inputs : int
        Number of inputs.
    dropped : tuple of str
        Inputs that the previous, larger selection still had.
    test : Scores
        Scores on the test rows.
    fit_seconds, predict_seconds : float
        Median times of the fit and of predicting the test rows [s].
    """

    inputs: int
    dropped: tuple[str, ...]
    test: Scores
    fit_seconds: float
    predict_seconds: float

    def line(self) -> str:
        """Return the selection in words."""
        return (
            f"{self.inputs:2} inputs: R2 {self.test.r2:.3f} %, nMAE {self.test.nmae:.2f} %,"
            f" fit {self.fit_seconds:.3g} s, prediction {self.predict_seconds:.3g} s;"
            f" without {', '.join(self.dropped) or '-'}"
        )


def rank_inputs(rows: dataset.Dataset, parts: split.Split, build: Callable[[], Any]) -> list[Worth]:
    """Rank the inputs of a model by permutation importance.

    Parameters
    ----------
    rows, parts : Dataset, Split
        The data.
    build : callable
        Returns the unfitted pipeline.

    Returns
    -------
    list of Worth
        The inputs, the most important first.
    """
    from sklearn.inspection import permutation_importance

    fitted = build().fit(rows.inputs[parts.train], rows.target[parts.train])
    importance = permutation_importance(
        fitted,
        rows.inputs[parts.test],
        rows.target[parts.test],
        scoring="r2",
        n_repeats=SHUFFLES,
        random_state=parts.seed,
    )
    worths = [
        Worth(name, 100 * float(mean), 100 * float(deviation))
        for name, mean, deviation in zip(
            rows.names, importance.importances_mean, importance.importances_std, strict=True
        )
    ]
    return sorted(worths, key=lambda worth: -worth.mean)


def select(
    rows: dataset.Dataset,
    parts: split.Split,
    build: Callable[[], Any],
    ranked: list[str],
    sizes: Iterable[int] = SIZES,
) -> list[Selection]:
    """Fit a model to fewer and fewer of its strongest inputs.

    Parameters
    ----------
    rows, parts : Dataset, Split
        The data.
    build : callable
        Returns the unfitted pipeline.
    ranked : list of str
        Names of the inputs, the most important first.
    sizes : iterable of int
        Numbers of inputs to keep, falling.
    """
    selections = []
    before = list(ranked)
    for size in sizes:
        if size > len(ranked):
            continue
        kept = tuple(name for name in rows.names if name in ranked[:size])
        fewer = rows.keeping(kept)
        train, truth = fewer.inputs[parts.train], fewer.target[parts.train]
        test = fewer.inputs[parts.test]
        model = build()
        fit = _seconds(partial(model.fit, train, truth))
        predict = _seconds(partial(model.predict, test))
        score = scores(fewer.target[parts.test], model.predict(test))
        dropped = tuple(name for name in before if name not in kept)
        selections.append(Selection(size, dropped, score, fit, predict))
        before = list(kept)
    return selections


def _seconds(action: Callable[[], Any], times: int = 3) -> float:
    """Return the median time of an action [s]."""
    taken = []
    for _ in range(times):
        began = perf_counter()
        action()
        taken.append(perf_counter() - began)
    return median(taken)


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
    settings, origin = _settings(folder, model.name, request.features)
    say(f"{model.title}, {origin}: {settings}")

    build = partial(_built, model, settings, request)
    with remarks() as said:
        worths = rank_inputs(rows, parts, build)
        selections = select(rows, parts, build, [worth.name for worth in worths])
    for worth in worths:
        say(f"  {worth.name:38} {worth.mean:9.4f} +- {worth.deviation:.4f} % of R2")
    for selection in selections:
        say(f"  {selection.line()}")
    for remark in said:
        say(f"  warning: {remark}")
    return [
        *_write_tables(folder, model.name, worths, selections),
        _draw(worths, selections, model.title, folder.path / "importance.png"),
    ]


def _write_tables(
    folder: Folder, model: str, worths: list[Worth], selections: list[Selection]
) -> list[Path]:
    """Write importance.csv and selection.csv."""
    return [
        folder.write_table(
            "importance.csv",
            ["input", "r2_loss_percent", "deviation"],
            [(worth.name, worth.mean, worth.deviation) for worth in worths],
        ),
        folder.write_table(
            "selection.csv",
            [
                *("model", "inputs", *asdict(selections[0].test)),
                *("fit_s", "predict_test_s", "dropped"),
            ],
            [
                (
                    *(model, selection.inputs, *asdict(selection.test).values()),
                    *(selection.fit_seconds, selection.predict_seconds),
                    " ".join(selection.dropped),
                )
                for selection in selections
            ],
        ),
    ]


def _built(model: Model, settings: Settings, request: Request) -> Any:
    """Return an unfitted pipeline that is trained on the target as a search sees it."""
    from sklearn.compose import TransformedTargetRegressor
    from sklearn.preprocessing import StandardScaler

    bare = pipeline(
        model, settings, normalisation=request.normalisation, seed=request.seed, tuned=True
    )
    if not features.chosen(request.features).scaled:
        return bare
    return TransformedTargetRegressor(bare, transformer=StandardScaler())


def _settings(folder: Folder, model: str, features: str) -> tuple[Settings, str]:
    """Return the settings of the tuned model, or untuned ones, and their origin."""
    result = folder.result("tuned", model)
    tuned = folder.winner(model)
    if tuned and tuned.of_grid and result and result["test"]:
        return tuned.settings, "tuned here"
    origin, settings = untuned(model, features)
    return settings, origin


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
    sizes = [selection.inputs for selection in selections]
    for style, label, values in (
        ("o-", "100 - R2 [%]", [100 - selection.test.r2 for selection in selections]),
        ("s-", "nMAE [%]", [selection.test.nmae for selection in selections]),
        ("k:", "fit [s]", [selection.fit_seconds for selection in selections]),
    ):
        right.plot(sizes, values, style, label=label)
    right.set(yscale="log", xlabel="inputs kept, the strongest first", title="fitted anew")
    right.legend()
    return save(figure, path)
