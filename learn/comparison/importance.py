"""Feature selection (the paper's section 3.1): what each input is worth, and which can go.

The worth of an input is what shuffling it over the test rows takes from R2. Many of the 22
statistics say almost the same, so that one of two twins can be shuffled without harm: what
dropping inputs does to a model that is fitted anew is measured as well.
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
from learn.comparison.folder import Folder, conditions
from learn.comparison.pictures import save
from learn.comparison.search.spaces import untuned
from learn.comparison.winner import settings_of
from learn.executor import Executor
from learn.metrics import Scores, scores
from learn.models import chosen, pipeline
from learn.request import Request, pressed_for

SHUFFLES = 5
SIZES = (30, 23, 20, 16, 12, 8, 6, 4, 3, 2, 1)
"""Numbers of inputs that are kept, the strongest first."""


@dataclass(frozen=True)
class Worth:
    """What shuffling an input takes from R2 on the test rows, mean and deviation [%]."""

    name: str
    mean: float
    deviation: float


@dataclass(frozen=True)
class Selection:
    """A model fitted to some of the inputs.

    Attributes
    ----------
    inputs : how many
    dropped : those that the previous, larger selection still had
    test : scores on the test rows
    fit_seconds, predict_seconds : median times of the fit and of predicting the test rows [s]
    """

    inputs: int
    dropped: tuple[str, ...]
    test: Scores
    fit_seconds: float
    predict_seconds: float


def rank_inputs(rows: dataset.Dataset, parts: split.Split, build: Callable[[], Any]) -> list[Worth]:
    """Rank the inputs of a model by permutation importance.

    Parameters
    ----------
    rows, parts : the data
    build : makes the unfitted pipeline

    Returns
    -------
    The inputs, the most important first
    """
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
    worth = [
        Worth(name, 100 * float(mean), 100 * float(deviation))
        for name, mean, deviation in zip(
            rows.names, found.importances_mean, found.importances_std, strict=True
        )
    ]
    return sorted(worth, key=lambda each: -each.mean)


def select(
    rows: dataset.Dataset,
    parts: split.Split,
    build: Callable[[], Any],
    ranked: list[str],
    sizes: Iterable[int] = SIZES,
) -> list[Selection]:
    """Fit a model to ever fewer of its strongest inputs.

    Parameters
    ----------
    rows, parts : the data
    build : makes the unfitted pipeline
    ranked : names of the inputs, the most important first
    sizes : numbers of inputs to keep, falling
    """
    found = []
    before = list(ranked)
    for size in sizes:
        if size > len(ranked):
            continue
        kept = tuple(name for name in rows.names if name in ranked[:size])
        some = rows.keeping(kept)
        train, truth = some.inputs[parts.train], some.target[parts.train]
        test = some.inputs[parts.test]
        model = build()
        fit = _seconds(partial(model.fit, train, truth))
        predict = _seconds(partial(model.predict, test))
        score = scores(some.target[parts.test], model.predict(test))
        dropped = tuple(name for name in before if name not in kept)
        found.append(Selection(size, dropped, score, fit, predict))
        before = list(kept)
    return found


def _seconds(action: Callable[[], Any], times: int = 3) -> float:
    taken = []
    for _ in range(times):
        began = perf_counter()
        action()
        taken.append(perf_counter() - began)
    return median(taken)


def write_report(request: Request, say: Callable[[str], None]) -> list[Path]:
    """Rank, select, and write both with a picture.

    Parameters
    ----------
    request : data, folder and one model
    say : called with lines for the user

    Returns
    -------
    The files
    """
    target = request.targets[0]
    pressed = pressed_for(request, Executor())
    rows = dataset.read(request.database, target, request.area_max, request.features, pressed)
    parts = split.draw(rows, request.seed, request.train_rows)
    (model,) = chosen(list(request.models))
    memory.check(model.name, parts.train.size)
    folder = Folder(request.output / dataset.short_name(rows.target_name))
    agreed = conditions(rows, parts, request.normalisation, {"area_max": request.area_max})
    folder.begin(rows, parts, agreed)
    settings, origin = _settings(folder, model.name, request.features)
    say(f"{model.title}, {origin}: {settings}")

    def build() -> Any:
        bare = pipeline(
            model, settings, normalisation=request.normalisation, seed=request.seed, tuned=True
        )
        return _of_scaled_target(bare) if features.chosen(rows.features).scaled else bare

    worth = rank_inputs(rows, parts, build)
    selections = select(rows, parts, build, [each.name for each in worth])
    for each in worth:
        say(f"  {each.name:38} {each.mean:9.4f} +- {each.deviation:.4f} % of R2")
    for selection in selections:
        say(
            f"  {selection.inputs:2} inputs: R2 {selection.test.r2:.3f} %, nMAE"
            f" {selection.test.nmae:.2f} %, fit {selection.fit_seconds:.3g} s, prediction"
            f" {selection.predict_seconds:.3g} s; without {', '.join(selection.dropped) or '-'}"
        )
    score_names = list(asdict(selections[0].test))
    return [
        folder.write_table(
            "importance.csv",
            ["input", "r2_loss_percent", "deviation"],
            [(each.name, each.mean, each.deviation) for each in worth],
        ),
        folder.write_table(
            "selection.csv",
            ["model", "inputs", *score_names, "fit_s", "predict_test_s", "dropped"],
            [
                (
                    model.name,
                    each.inputs,
                    *asdict(each.test).values(),
                    each.fit_seconds,
                    each.predict_seconds,
                    " ".join(each.dropped),
                )
                for each in selections
            ],
        ),
        _draw(worth, selections, model.title, folder.path / "importance.png"),
    ]


def _of_scaled_target(model: Any) -> Any:
    """A model that is trained on the target's deviations from its mean, as in a search."""
    from sklearn.compose import TransformedTargetRegressor
    from sklearn.preprocessing import StandardScaler

    return TransformedTargetRegressor(model, transformer=StandardScaler())


def _settings(folder: Folder, model: str, features: str) -> tuple[dict[str, Any], str]:
    """Settings of the tuned model, or what serves in their place."""
    result = folder.result("tuned", model)
    found = settings_of(folder, model)
    if found and result and result["test"]:
        return found[0], "tuned here"
    origin, settings = untuned(model, features)
    settings.pop("criterion", None)  # the default, by another name
    return settings, origin


def _draw(worth: list[Worth], selections: list[Selection], title: str, path: Path) -> Path:
    figure = new_figure(12, 5.5)
    left, right = figure.subplots(1, 2)
    places = np.arange(len(worth))[::-1]
    left.barh(
        places,
        [max(each.mean, 1e-6) for each in worth],
        xerr=[each.deviation for each in worth],
        color="tab:blue",
    )
    left.set_yticks(places, [each.name for each in worth], fontsize=8)
    left.set(xscale="log", xlabel="loss of R2 when shuffled [%]", title=title)
    sizes = [each.inputs for each in selections]
    right.plot(sizes, [100 - each.test.r2 for each in selections], "o-", label="100 - R2 [%]")
    right.plot(sizes, [each.test.nmae for each in selections], "s-", label="nMAE [%]")
    right.plot(sizes, [each.fit_seconds for each in selections], "k:", label="fit [s]")
    right.set(yscale="log", xlabel="inputs kept, the strongest first", title="fitted anew")
    right.legend()
    return save(figure, path)
