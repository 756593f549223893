"""The worth of each input (the paper's section 3.1), and fits without the weak.

The worth of an input is the loss of R2 when its values are shuffled over the test rows. Many of the
22 statistics are almost the same, and one of two twins can be shuffled without harm. Models are
therefore also fitted anew to fewer and fewer inputs, down to one; to two where rows are scaled to
unit length, after which a single input is the same number in all rows.
"""

from collections.abc import Callable, Iterator
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
from learn.comparison.grid import TABLE_2, space_of
from learn.comparison.jobs import repeated, targets
from learn.comparison.tables import DPI
from learn.dataset import Request
from learn.executor import Executor
from learn.metrics import scores
from learn.models import check_memory, models_named, remarks

SHUFFLES = 5  # times that an input is shuffled: enough for a mean and its scatter
UNIT_LENGTH = (
    "l2"  # normalisation of rows to unit length, after which a single input is constant
)
SIZES = (
    30,
    23,
    20,
    16,
    12,
    8,
    6,
    4,
    3,
    2,
    1,
)  # inputs that are kept, the strongest first


def write_report(request: Request, say: Callable[[str], None]) -> Iterator[Path]:
    """Rank the inputs, fit the model to fewer of them; yield the tables and the picture written.

    The settings are those of the folder's search, or untuned ones.
    InputError is raised for input that cannot be used, or too little memory.
    """
    (model,) = models_named(list(request.models), request.features)
    for folder, whole in targets(request, [model], Executor()):
        check_memory(model.name, whole.rows)
        training, names = (
            whole.seen_by(model.name),
            folder.record()["conditions"]["inputs"],
        )
        result, tuned = folder.result("tuned", model.name), folder.winner(model.name)
        if training.normalisation == UNIT_LENGTH and len(names) == 1:
            raise InputError(
                f"{names[0]} is the only input, and the same number in all rows of unit length:"
                " give --normalise standard"
            )
        source, _, settings = space_of(model.name, request.features)
        origin = "the paper's optimum" if source == TABLE_2 else "built in"
        if tuned and tuned.tuned and result and result.get("test"):
            origin, settings = "tuned here", tuned.values
        say(f"{model.title}, {origin}: {settings}")
        unfitted = training.unfitted(model.name, settings, tuned=True)
        with remarks() as said:
            losses = permutation_importance(
                unfitted.fit(training.inputs, training.target, **training.beside()),
                *(training.test_inputs, training.scaling.scaled(training.test_target)),
                scoring="r2",
                n_repeats=SHUFFLES,
                random_state=training.seed,
            )
            means, deviations = (
                100 * losses.importances_mean,
                100 * losses.importances_std,
            )
            ranked = np.argsort(-means, kind="stable")
            kept = _selections(unfitted, training, names, ranked)
        worths = [
            (names[each], float(means[each]), float(deviations[each])) for each in ranked
        ]
        for name, mean, deviation in worths:
            say(f"  {name:38} {mean:9.4f} +- {deviation:.4f} % of R2")
        for each in kept:
            say(
                f"  {each['inputs']:2} inputs: R2 {each['r2']:.3f} %, nMAE {each['nmae']:.2f} %,"
                f" fit {each['fit_s']:.3g} s, prediction {each['predict_test_s']:.3g} s; without"
                f" {', '.join(each['dropped'].split()) or '-'}"
            )
        if training.normalisation == UNIT_LENGTH:
            say(
                "   1 input: left out, because in rows of unit length a single input is the same in"
                " all rows; --normalise standard has it"
            )
        for remark in said:
            say(f"  warning: {remark}")
        header = ["input", "r2_loss_percent", "deviation"]
        yield folder.write_table("importance.csv", header, worths)
        lines = [[model.name, *each.values()] for each in kept]
        yield folder.write_table("selection.csv", ["model", *kept[0]], lines)
        yield _draw(worths, kept, model.title, inside(folder.path, "importance.png"))


def _selections(
    model: Any, training: Training, names: list[str], ranked: Indices
) -> list[dict[str, Any]]:
    """Fit a model to fewer and fewer of its inputs, by their rank; return rows of selection.csv.

    Two inputs are the fewest where rows are scaled to unit length.
    """
    fewest = 2 if training.normalisation == UNIT_LENGTH else 1
    selections, before, beside = [], [*ranked], training.beside()
    for size in (size for size in SIZES if fewest <= size <= len(ranked)):
        kept = sorted(ranked[:size])
        own = training.inputs[:, kept], training.target
        fit = repeated(partial(model.fit, *own, **beside), (3, 3))
        answer = partial(model.predict, training.test_inputs[:, kept])
        predict = repeated(answer, (3, 3))
        found = vars(scores(training.test_target, training.scaling.restored(answer())))
        times = {"fit_s": median(fit), "predict_test_s": median(predict)}
        dropped = " ".join(names[each] for each in before if each not in kept)
        selections.append({"inputs": size, **found, **times, "dropped": dropped})
        before = kept
    return selections


def _draw(worths: Any, kept: list[dict[str, Any]], title: str, path: Path) -> Path:
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
    right.set(
        yscale="log", xlabel="inputs kept, the strongest first", title="fitted anew"
    )
    right.legend()
    return save(figure, path, dpi=DPI)
