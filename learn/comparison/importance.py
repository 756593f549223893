"""The worth of each input (the paper's section 3.1), and fits without the weak inputs.

The worth of an input is the loss of R2 if its values are shuffled over the test rows. Many of the
22 statistics are almost equal to another one, and either of the two can be shuffled without a loss.
Models are therefore also fitted to fewer and fewer inputs, down to a single one; or down to two if
rows are scaled to unit length, because a single input is then 1 in all rows.

The command `learn importance` calls `write_report`. It uses the winner of a search, if the folder
has one, and writes into the folder of `compare` and `tune`.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from sklearn.inspection import permutation_importance

from gen.arrays import Indices
from gen.runtime.errors import InputError
from gen.runtime.figure import new_figure, save
from gen.runtime.files import inside
from learn.comparison.fits import Training
from learn.comparison.folder import Folder
from learn.comparison.grid import TABLE_2, SettingValues, space_of
from learn.comparison.jobs import Repetitions, open_targets, repeated
from learn.comparison.plots import DPI
from learn.dataset import Request
from learn.executor import Executor
from learn.metrics import Scores, scores
from learn.models import Model, check_memory, models_named, remarks

SHUFFLES = 5  # number of shuffles of each input, enough for a mean and its scatter
UNIT_LENGTH = "l2"  # normalisation that scales rows to unit length
# numbers of inputs that models are fitted to, if the feature set has as many
SIZES = (30, 23, 20, 16, 12, 8, 6, 4, 3, 2, 1)
SMALLEST_BAR = 1e-6  # smallest loss of R2 that is drawn [%]
# Repetitions of each fit, and of each prediction of the test set.
REPETITIONS = Repetitions(fewest=3, largest=3)


@dataclass(frozen=True)
class Worth:
    """The worth of an input: the loss of R2 on the test rows if the input is shuffled [%]."""

    name: str  # name of the input
    mean: float  # mean of the loss over the shuffles
    deviation: float  # standard deviation of the loss over the shuffles


@dataclass(frozen=True)
class Selection:
    """A fit to the strongest inputs."""

    inputs: int  # number of inputs
    scores: Scores  # scores on the test rows
    fit_seconds: float  # median time of the fit [s]
    predict_seconds: float  # median time of predicting the whole test set [s]
    dropped: list[str]  # inputs of the selection before that this one lacks


@dataclass(frozen=True)
class Ranking:
    """Worth of all inputs of a model, and fits to the strongest of them."""

    model: Model
    worths: list[Worth]  # from the largest worth to the smallest
    selections: list[Selection]  # from the largest number of inputs to the smallest
    remarks: list[str]  # warnings of the fits


@dataclass(frozen=True)
class Choice:
    """Settings with which the inputs of a model are ranked."""

    origin: str  # origin of the settings in words
    settings: SettingValues  # values by setting, on top of the settings of the baseline


def write_report(request: Request, say: Callable[[str], None]) -> Iterator[Path]:
    """Rank the inputs of a model for each target, write and print the ranking, and yield its files.

    This is a generator: each target is ranked when the first file of the target is asked for, and
    nothing is done or raised before the iteration begins.

    The settings of the model are those of the winner of the folder's search. Without a winner they
    are the paper's optimum, or the default point of another grid.

    Parameters
    ----------
    request : Request
        Database, output folder, one model and options.
    say : callable
        Called with lines for the user.

    Yields
    ------
    Path
        importance.csv, selection.csv and importance.png of each target, each once it is written.

    Raises
    ------
    InputError
        If the database cannot be used, the folder has results of other conditions or damaged ones,
        the only input is a constant, or this machine lacks the memory.
    """
    (model,) = models_named(list(request.models), request.features)
    for target in open_targets(request, [model], Executor()):
        check_memory(model.name, target.training.rows)
        training = target.training.seen_by(model.name)
        names = target.folder.record().conditions.inputs
        if training.normalisation == UNIT_LENGTH and len(names) == 1:
            raise InputError(
                f"{names[0]} is the only input, and the same number in all rows of unit length:"
                " give --normalise standard"
            )
        choice = _choice(target.folder, model, request.features)
        say(f"{model.title}, {choice.origin}: {choice.settings}")
        ranking = _rank(training, model, choice.settings, names)
        for line in _lines(ranking, training.normalisation):
            say(line)
        yield from _write(target.folder, ranking)


def _choice(folder: Folder, model: Model, features: str) -> Choice:
    """Return the settings of a folder's winner, if a candidate of the grid has won and has scores.

    Otherwise they are the default settings of the model's grid.
    """
    result = folder.result("tuned", model.name)
    winner = folder.winner(model.name)
    if result is not None and result.test and winner is not None and winner.tuned:
        return Choice(origin="tuned here", settings=winner.values)
    space = space_of(model.name, features)
    origin = "built in"
    if space.name == TABLE_2:
        origin = "the paper's optimum"
    return Choice(origin=origin, settings=space.default)


def _rank(
    training: Training, model: Model, settings: SettingValues, names: list[str]
) -> Ranking:
    """Rank the inputs of a model by shuffling each of them, and fit it to the strongest ones.

    `names` are the names of the inputs, in the order of the columns of `training.inputs`.
    """
    unfitted = training.unfitted(model.name, settings, tuned=True)
    with remarks() as warnings:
        fitted = unfitted.fit(
            training.inputs, training.target, **training.fit_arguments()
        )
        losses = permutation_importance(
            fitted,
            training.test_inputs,
            training.scaling.scaled(training.test_target),
            scoring="r2",
            n_repeats=SHUFFLES,
            random_state=training.seed,
        )
        means = 100 * losses.importances_mean
        deviations = 100 * losses.importances_std
        order = np.argsort(-means, kind="stable")  # the largest loss first
        selections = _selections(unfitted, training, names, order)
    worths = [
        Worth(
            name=names[place],
            mean=float(means[place]),
            deviation=float(deviations[place]),
        )
        for place in order
    ]
    return Ranking(model=model, worths=worths, selections=selections, remarks=warnings)


def _selections(
    unfitted: Any, training: Training, names: list[str], order: Indices
) -> list[Selection]:
    """Fit a pipeline to the strongest inputs, for each of the numbers of inputs in `SIZES`.

    `order` has the places of the inputs among the columns of `training.inputs`, (d,), from the
    strongest to the weakest.
    """
    fewest = 1
    if training.normalisation == UNIT_LENGTH:
        fewest = 2  # A single input would be 1 in all rows.
    selections = []
    # places of the inputs of the selection before; at first, of all inputs
    previous = [*order]
    for size in SIZES:
        if size < fewest or size > len(order):
            continue
        kept = sorted(order[:size])
        dropped = [names[place] for place in previous if place not in kept]
        selections.append(_fit_to(unfitted, training, kept, dropped))
        previous = kept
    return selections


def _fit_to(
    unfitted: Any, training: Training, kept: list[int], dropped: list[str]
) -> Selection:
    """Fit a pipeline to some inputs, score it on the test rows, and time it.

    `kept` are the places of these inputs among the columns of `training.inputs`. `dropped` are the
    names of the inputs that the selection before had in addition.
    """
    fit = partial(
        unfitted.fit,
        training.inputs[:, kept],
        training.target,
        **training.fit_arguments(),
    )
    predict = partial(unfitted.predict, training.test_inputs[:, kept])
    # The timed fits are done in place, so that the pipeline is fitted afterwards.
    fit_seconds = median(repeated(fit, REPETITIONS))
    predict_seconds = median(repeated(predict, REPETITIONS))
    prediction = training.scaling.restored(predict())
    return Selection(
        inputs=len(kept),
        scores=scores(training.test_target, prediction),
        fit_seconds=fit_seconds,
        predict_seconds=predict_seconds,
        dropped=dropped,
    )


def _lines(ranking: Ranking, normalisation: str) -> Iterator[str]:
    """Yield the lines for the user on the worth of all inputs, and on the fits to fewer inputs."""
    for worth in ranking.worths:
        yield f"  {worth.name:38} {worth.mean:7.2f} +- {worth.deviation:.2f} % of R2"
    for selection in ranking.selections:
        inputs = "input" if selection.inputs == 1 else "inputs"
        yield (
            f"  {selection.inputs:2} {inputs}: R2 {selection.scores.r2:.3f} %, nMAE"
            f" {selection.scores.nmae:.2f} %, fit {selection.fit_seconds:.3g} s, prediction"
            f" {selection.predict_seconds:.3g} s; without {', '.join(selection.dropped) or '-'}"
        )
    if normalisation == UNIT_LENGTH:
        yield (
            "   1 input: left out, because in rows of unit length a single input is the same in all"
            " rows; --normalise standard has it"
        )
    for remark in ranking.remarks:
        yield f"  warning: {remark}"


def _write(folder: Folder, ranking: Ranking) -> Iterator[Path]:
    """Write importance.csv, selection.csv and importance.png, and yield the path of each file."""
    worths = [(worth.name, worth.mean, worth.deviation) for worth in ranking.worths]
    header = ["input", "r2_loss_percent", "deviation"]
    yield folder.write_table("importance.csv", header, worths)
    header = [
        "model",
        "inputs",
        *vars(ranking.selections[0].scores),
        "fit_s",
        "predict_test_s",
        "dropped",
    ]
    lines = [
        (
            ranking.model.name,
            selection.inputs,
            *vars(selection.scores).values(),
            selection.fit_seconds,
            selection.predict_seconds,
            " ".join(selection.dropped),
        )
        for selection in ranking.selections
    ]
    yield folder.write_table("selection.csv", header, lines)
    yield _draw(ranking, inside(folder.path, "importance.png"))


def _draw(ranking: Ranking, path: Path) -> Path:
    """Draw the worth of the inputs and, over the number of inputs, errors and times of the fits.

    The picture is written to `path`, which is returned.
    """
    figure = new_figure(12, 5.5)
    worth_axis, size_axis = figure.subplots(1, 2)
    names = [worth.name for worth in ranking.worths]
    means = [worth.mean for worth in ranking.worths]
    deviations = [worth.deviation for worth in ranking.worths]
    places = np.arange(len(names))[::-1]  # the strongest input at the top
    # A loss that is 0 or negative has a small bar on the logarithmic axis.
    lengths = np.maximum(means, SMALLEST_BAR)
    worth_axis.barh(places, lengths, xerr=deviations, color="tab:blue")
    worth_axis.set_yticks(places, names, fontsize=8)
    title = ranking.model.title
    worth_axis.set(xscale="log", xlabel="loss of R2 when shuffled [%]", title=title)
    selections = ranking.selections
    sizes = [selection.inputs for selection in selections]
    unexplained = [100 - selection.scores.r2 for selection in selections]
    size_axis.plot(sizes, unexplained, "o-", label="100 - R2 [%]")
    errors = [selection.scores.nmae for selection in selections]
    size_axis.plot(sizes, errors, "s-", label="nMAE [%]")
    seconds = [selection.fit_seconds for selection in selections]
    size_axis.plot(sizes, seconds, "k:", label="fit [s]")
    size_axis.set(
        yscale="log", xlabel="inputs kept, the strongest first", title="fitted anew"
    )
    size_axis.legend()
    return save(figure, path, dpi=DPI)
