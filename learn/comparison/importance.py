"""Feature selection (the paper's section 3.1): the worth of each input, and fits without the weak.

The worth of an input is the loss of R2 when its values are shuffled over the test rows. Many of the
22 statistics are almost the same, and one of two twins can be shuffled without harm. Models are
therefore also fitted anew to fewer and fewer inputs.
"""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from gen.runtime.figure import new_figure, save
from learn import features
from learn.comparison.folder import Folder
from learn.comparison.grid import untuned
from learn.comparison.jobs import open_folder, read_single
from learn.comparison.pictures import DPI
from learn.comparison.results import repeated
from learn.dataset import Dataset, Request
from learn.metrics import scores
from learn.models import MODELS, check_memory, models_named, pipeline, remarks
from learn.split import Split

SHUFFLES = 5
"""Times that an input is shuffled: enough for a mean and its scatter."""

SIZES = (30, 23, 20, 16, 12, 8, 6, 4, 3, 2, 1)
"""Numbers of inputs that are kept, the strongest first."""

SELECTION = (
    *("model", "inputs", "nmse", "nmae", "nmaxe", "r2"),
    *("fit_s", "predict_test_s", "dropped"),
)
"""Columns of selection.csv."""

Build = Callable[[], Any]
"""Returns an unfitted pipeline."""

Row = dict[str, Any]


def write_report(request: Request, say: Callable[[str], None]) -> list[Path]:
    """Rank the inputs, fit the model to fewer of them, and write tables and a picture.

    Lines for the user are said. InputError is raised for input that cannot be used, or too little
    memory.
    """
    (model,) = models_named(list(request.models))
    rows, parts = read_single(request, request.targets[0])
    check_memory(model.name, parts.train.size)
    folder = open_folder(request, rows, parts)
    build = _builder(model.name, folder, request, say)
    with remarks() as said:
        worths = _worths(rows, parts, build)
        kept = _selections(rows, parts, build, [name for name, _, _ in worths])
    for name, mean, deviation in worths:
        say(f"  {name:38} {mean:9.4f} +- {deviation:.4f} % of R2")
    for each in kept:
        say(
            f"  {each['inputs']:2} inputs: R2 {each['r2']:.3f} %, nMAE {each['nmae']:.2f} %, fit"
            f" {each['fit_s']:.3g} s, prediction {each['predict_test_s']:.3g} s; without"
            f" {', '.join(each['dropped'].split()) or '-'}"
        )
    for remark in said:
        say(f"  warning: {remark}")
    lines = [[model.name, *(each[name] for name in SELECTION[1:])] for each in kept]
    return [
        folder.write_table("importance.csv", ["input", "r2_loss_percent", "deviation"], worths),
        folder.write_table("selection.csv", SELECTION, lines),
        _draw_importance(worths, kept, model.title, folder.path / "importance.png"),
    ]


def _builder(model: str, folder: Folder, request: Request, say: Callable[[str], None]) -> Build:
    """Return what builds the model, with tuned settings, or untuned ones where there are none.

    It is trained on the target as a search sees it.
    """
    from sklearn.compose import TransformedTargetRegressor
    from sklearn.preprocessing import StandardScaler

    result, tuned = folder.result("tuned", model), folder.winner(model)
    origin, settings = untuned(model, request.features)
    if tuned and tuned.of_grid and result and result["test"]:
        origin, settings = "tuned here", tuned.settings
    say(f"{MODELS[model].title}, {origin}: {settings}")
    how: Row = {"normalisation": request.normalisation, "seed": request.seed, "tuned": True}

    def build() -> Any:
        bare = pipeline(MODELS[model], settings, **how)
        if not features.chosen(request.features).scaled:
            return bare
        return TransformedTargetRegressor(bare, transformer=StandardScaler())

    return build


def _worths(rows: Dataset, parts: Split, build: Build) -> list[tuple[str, float, float]]:
    """Return name, mean and deviation of the loss of R2 of each input, the largest first [%]."""
    from sklearn.inspection import permutation_importance

    found = permutation_importance(
        build().fit(rows.inputs[parts.train], rows.target[parts.train]),
        rows.inputs[parts.test],
        rows.target[parts.test],
        scoring="r2",
        n_repeats=SHUFFLES,
        random_state=parts.seed,
    )
    each = zip(rows.names, found.importances_mean, found.importances_std, strict=True)
    worths = [(name, 100 * float(mean), 100 * float(deviation)) for name, mean, deviation in each]
    return sorted(worths, key=lambda worth: -worth[1])


def _selections(rows: Dataset, parts: Split, build: Build, ranked: list[str]) -> list[Row]:
    """Fit a model to fewer and fewer of its inputs, which are given by their rank."""
    selections = []
    before = list(ranked)
    for size in (size for size in SIZES if size <= len(ranked)):
        kept = tuple(name for name in rows.names if name in ranked[:size])
        fewer = rows.keeping(kept)
        train, test = fewer.inputs[parts.train], fewer.inputs[parts.test]
        model = build()
        fit = repeated(partial(model.fit, train, fewer.target[parts.train]), (3, 3))
        predict = repeated(partial(model.predict, test), (3, 3))
        found = scores(fewer.target[parts.test], model.predict(test))
        dropped = " ".join(name for name in before if name not in kept)
        times = {"fit_s": median(fit), "predict_test_s": median(predict)}
        selections.append({"inputs": size, **vars(found), **times, "dropped": dropped})
        before = list(kept)
    return selections


def _draw_importance(
    worths: list[tuple[str, float, float]], kept: list[Row], title: str, path: Path
) -> Path:
    """Draw the worth of the inputs, and errors and times over the number of inputs."""
    figure = new_figure(12, 5.5)
    left, right = figure.subplots(1, 2)
    names, means, deviations = zip(*worths, strict=True)
    places = np.arange(len(worths))[::-1]
    left.barh(places, np.maximum(means, 1e-6), xerr=deviations, color="tab:blue")
    left.set_yticks(places, names, fontsize=8)
    left.set(xscale="log", xlabel="loss of R2 when shuffled [%]", title=title)
    sizes = [each["inputs"] for each in kept]
    right.plot(sizes, [100 - each["r2"] for each in kept], "o-", label="100 - R2 [%]")
    right.plot(sizes, [each["nmae"] for each in kept], "s-", label="nMAE [%]")
    right.plot(sizes, [each["fit_s"] for each in kept], "k:", label="fit [s]")
    right.set(yscale="log", xlabel="inputs kept, the strongest first", title="fitted anew")
    right.legend()
    return save(figure, path, dpi=DPI)
