"""Surrogates whose inputs are a scene's own numbers, judged by many surfaces of equal parameters.

The inputs are the parameters that the scene draws and the load, not statistics of a surface. Three
different scenes are studied: spectral surfaces of bodies that yield, under pressures; random
midpoint displacement, pressed by Delta; and windows of ground maps, whose rms height and length are
parameters. Surrogates are judged by contacts solved at fresh parameters on fresh surfaces. The
table also has a Gaussian process of scikit-learn, as a user would write it.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from time import process_time
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import norm
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from bench.databases import generated
from bench.files import Row, read_toml
from bench.report import Report, remark
from bench.surrogates.cost import median_seconds, seconds_of
from gen.arrays import Values
from gen.database import Reader
from gen.generation.plan import parameters
from gen.generation.sample import solve_contact, surface_numbered
from gen.quantities import AREA, DELTA, FORCE
from gen.runtime.user_code import TRUSTED
from gen.scene import Scene
from learn import dataset
from learn.database_rows import Dataset
from learn.dataset import Request
from learn.executor import Executor
from learn.features.scene import load_of
from learn.surrogate import Surrogate, fitting

SEED = 4242
"""Seed of the fresh parameters. The surfaces of the k-th set of parameters have SEED + 1 + k."""

FEW = 20
"""Number of surfaces that a user would solve for a mean."""

QUESTIONS = 10_000
"""Number of questions whose answers are timed together."""

LEVEL = 0.9
"""Level of the intervals, 0 to 1."""

SCORES_OF_MEANS = ("nmae", "floor", "mean_inside", "mean_width")
"""Columns of `_means` that are averaged over draws of the training rows."""

MODELS = ("population", "kernel-ridge", "gaussian-process")
"""Models of `learn fit` that are compared on a scene's own numbers."""

MODEL_ROWS = 3000
"""Number of rows that train each of `MODELS`. The fit times of kernel ridge and of the Gaussian
process grow with its cube."""

SIZES = (500, 1500, 5000)
"""Numbers of rows of smaller trainings. A size is left out if the database has no more rows."""

DRAWS = 5
"""Number of draws of the rows of a smaller training; scores are averaged over them. The errors of
one fit are correlated between points, so that one fit says little."""

PROCESS_ROWS = 1000
"""Number of rows that train the plain Gaussian process, whose fit time grows with its cube."""

SCENES: dict[str, str] = read_toml("surrogates/scenes")["own-numbers"]
"""The scenes (TOML) by their names, without their numbers of rows."""

RESULTS = (AREA.name, FORCE.name, DELTA.name)
"""Columns of the solved results by which surrogates are judged."""


class Solved(NamedTuple):
    """Results at p fresh sets of parameters, on s fresh surfaces for each of them."""

    # Values, (p,), of each parameter, of the load, and of the hardness if there is one, by names.
    numbers: dict[str, Values]
    # Values, (p, s), of each of `RESULTS`, by its name.
    results: dict[str, Values]


@dataclass(frozen=True, eq=False)
class Study:
    """A scene with its database, its surrogate, and the results that judge its surrogates."""

    name: str  # name of the scene
    request: Request  # request for the surrogate
    surrogate: Surrogate  # model "population", trained on all rows of the database
    fit_seconds: float  # processor time of the fit [s]
    rows: int  # number of rows of the database
    solved: Solved


def scene_surrogate(folder: Path, rows: int, points: int, surfaces: int) -> Report:
    """Fit a surrogate to each scene, and judge it at fresh parameters on fresh surfaces.

    Progress is printed on standard error. This marks Python functions of scenes as trusted for the
    rest of the process: the scene of windows has one, `bench.made_maps:window`.

    Parameters
    ----------
    folder : Path
        Folder of the report. Databases are generated in its folder `databases`, and kept.
    rows : int
        Number of rows of each database.
    points : int
        Number of fresh sets of parameters and loads.
    surfaces : int
        Number of fresh surfaces for each of these sets.

    Returns
    -------
    Report
        Table `scene-surrogate`, `scene-models` with the rows of `_other_models`, and `scene-means`
        with the rows of `_smaller_trainings`.
    """
    TRUSTED.set(True)
    table: list[Row] = []
    models: list[Row] = []
    means: list[Row] = []
    for name, scene_text in SCENES.items():
        file_name = name.replace(" ", "-")
        text = f"samples = {rows}\n{scene_text}"
        path = generated(folder / "databases", file_name, text)
        study = _study(name, path, rows, points, surfaces)
        table += _judged(study)
        models += _other_models(study)
        means += _smaller_trainings(study)
    return Report(
        {"scene-surrogate": table, "scene-models": models, "scene-means": means}
    )


def _study(name: str, path: Path, rows: int, points: int, surfaces: int) -> Study:
    """Fit the surrogate of a scene's database, and solve the contacts that judge it.

    `rows` is the number of rows of the database, and `points` and `surfaces` are the numbers of
    `solved`. The targets are the area, and the one of force and Delta that is not the load.
    """
    with Reader(path) as reader:
        scene = reader.scene
    load = load_of(scene)
    request = Request(
        databases=(path,),
        targets=("area", "force" if load == "delta" else "delta"),
        models=("population",),
        features="scene",
        normalisation="standard",
        load=load,
    )
    fit = _fitted(request)
    remark(f"{name}: {points} points of {surfaces} surfaces")
    return Study(
        name=name,
        request=request,
        surrogate=fit.surrogate,
        fit_seconds=fit.seconds,
        rows=rows,
        solved=solved(scene, fit.surrogate.features.names, points, surfaces),
    )


class _TimedFit(NamedTuple):
    """A surrogate, and the processor time of its fit [s]."""

    surrogate: Surrogate
    seconds: float


def _fitted(request: Request) -> _TimedFit:
    """Fit a surrogate as `learn fit` does; its progress is printed on standard error."""
    began = process_time()
    surrogate = fitting.fit(request, Executor(), remark)
    # The surrogate is None only after an interruption, which this executor never reports.
    assert surrogate is not None
    return _TimedFit(surrogate=surrogate, seconds=process_time() - began)


def solved(scene: Scene, names: tuple[str, ...], points: int, surfaces: int) -> Solved:
    """Solve contacts at fresh parameters of a scene, each on several fresh surfaces.

    Parameters
    ----------
    scene : Scene
        The scene.
    names : tuple of str
        Names of the parameters, of the load and of the hardness whose values are returned.
    points : int
        Number p of sets of parameters and loads.
    surfaces : int
        Number s of surfaces for each of these sets.

    Returns
    -------
    Solved
        The named numbers, in the units of the scene, and `RESULTS`, in the units of their columns.
    """
    load = load_of(scene)
    fresh = scene.model_copy(update={"seed": SEED, "samples_per_surface": 1})
    plan = parameters(fresh, 0, points)
    numbers: dict[str, list[float]] = {name: [] for name in names}
    results: dict[str, list[float]] = {column: [] for column in RESULTS}
    for point in range(points):
        drawn = plan.parameters_of(point)
        load_value = float(plan.load[point])
        of_point: dict[str, Any] = {**drawn, load: load_value}
        hardness = None
        if plan.hardness is not None:
            hardness = float(plan.hardness[point])
            of_point["hardness"] = hardness
        for name in names:
            numbers[name].append(of_point[name])
        at_point = scene.with_parameters(drawn, seed=SEED + 1 + point)
        loads: dict[str, Any] = {load: load_value}
        for number in range(surfaces):
            heights = surface_numbered(at_point, number)
            contact = solve_contact(at_point, heights, hardness=hardness, **loads)
            for column in RESULTS:
                results[column].append(getattr(contact, column))
    return Solved(
        numbers={name: np.array(values) for name, values in numbers.items()},
        results={
            column: np.reshape(values, (points, surfaces))
            for column, values in results.items()
        },
    )


def _share_inside(low: Values, high: Values, truth: Values) -> float:
    """Return the share of results, 0 to 1, inside the interval of their point.

    `low` and `high` have the shape (p,), and `truth`, the results, has the shape (p, s).
    """
    return float(np.mean((low[:, None] <= truth) & (truth <= high[:, None])))


def _judged(study: Study) -> Iterator[Row]:
    """Yield the rows of the table `scene-surrogate`, one for each target of a study.

    A row has errors [%], coverage and times [s] of the surrogate and of a plain Gaussian process,
    and the columns of `_means`. `nmae_of_few` and `floor_of_few` are errors against means over
    `FEW` surfaces. `inside` is the share of results inside their interval, 0 to 1; `width` is the
    mean width of the intervals over the mean result [1].
    """
    surrogate = study.surrogate
    questions = surrogate.of_numbers(study.solved.numbers)
    answer = surrogate.predict_rows(questions, level=LEVEL)
    inputs = surrogate.features.of(questions)  # of the fresh points
    answer_seconds = _seconds_of_answers(study)
    training = dataset.read(study.request)  # one dataset for each target
    for mean, rows in zip(_means(surrogate, study.solved), training, strict=True):
        target = str(mean["target"])
        truth = study.solved.results[surrogate.learnt[target].column]
        few = _Errors(truth[:, :FEW])
        low = answer.low[target]
        high = answer.high[target]
        yield {
            "scene": study.name,
            "load": study.request.load,
            "rows": study.rows,
            "fit_seconds": study.fit_seconds,
            **mean,
            "nmae_of_few": few.of(answer.values[target]),
            "floor_of_few": few.floor,
            "inside": _share_inside(low, high, truth),
            "width": float((high - low).mean() / truth.mean()),
            "answer_seconds": answer_seconds,
            **_plain_process(rows, inputs, truth),
        }


def _seconds_of_answers(study: Study) -> float:
    """Return the median time of answering `QUESTIONS` questions together, with intervals [s]."""
    numbers = {
        name: np.resize(values, QUESTIONS)
        for name, values in study.solved.numbers.items()
    }
    surrogate = study.surrogate
    return median_seconds(
        lambda: surrogate.predict_rows(surrogate.of_numbers(numbers), level=LEVEL)
    )


def _plain_process(rows: Dataset, inputs: Values, truth: Values) -> Row:
    """Return error [%], coverage (0 to 1) and times [s] of a plain Gaussian process, as columns.

    Its kernel has a length for each input, and noise. It is fitted to the first `PROCESS_ROWS` of
    the training rows. It is judged at the inputs of p points, shape (p, d), by `truth`, the results
    at these points, shape (p, s).
    """
    kernel = ConstantKernel() * RBF(np.ones(inputs.shape[1])) + WhiteKernel()
    process = make_pipeline(
        StandardScaler(), GaussianProcessRegressor(kernel, normalize_y=True)
    )
    fit = partial(process.fit, rows.inputs[:PROCESS_ROWS], rows.target[:PROCESS_ROWS])
    fit_seconds = seconds_of(fit)
    middle, deviation = process.predict(inputs, return_std=True)
    half_width = norm.ppf((1 + LEVEL) / 2) * deviation
    inside = _share_inside(middle - half_width, middle + half_width, truth)
    questions = np.resize(inputs, (QUESTIONS, inputs.shape[1]))
    answer = partial(process.predict, questions, return_std=True)
    return {
        "process_nmae": _Errors(truth).of(middle),
        "process_inside": inside,
        "process_fit_seconds": fit_seconds,
        "process_answer_seconds": median_seconds(answer),
    }


def _other_models(study: Study) -> Iterator[Row]:
    """Yield rows of the table `scene-models`: one for each of `MODELS` and each target.

    `nmae` is the error of the predictions against the means over surfaces [%]. `inside` is the
    share of results inside the interval of their point, 0 to 1.
    """
    for model in MODELS:
        request = replace(study.request, models=(model,), train_rows=MODEL_ROWS)
        surrogate, seconds = _fitted(request)
        questions = surrogate.of_numbers(study.solved.numbers)
        answer = surrogate.predict_rows(questions, level=LEVEL)
        for target, learnt in surrogate.learnt.items():
            truth = study.solved.results[learnt.column]
            yield {
                "scene": study.name,
                "target": target,
                "model": model,
                "fit_seconds": seconds,
                "nmae": _Errors(truth).of(answer.values[target]),
                "inside": _share_inside(answer.low[target], answer.high[target], truth),
            }


def _smaller_trainings(study: Study) -> Iterator[Row]:
    """Yield rows of the table `scene-means`: one for each of `SIZES` and each target.

    A row has the scores of `_means` for surrogates that were trained on `size` rows, averaged over
    `DRAWS` draws of these rows.
    """
    for size in SIZES:
        if size >= study.rows:
            continue
        draws = []
        for draw in range(DRAWS):
            request = replace(study.request, train_rows=size, seed=draw)
            surrogate = _fitted(request).surrogate
            draws.append(list(_means(surrogate, study.solved)))
        # Each draw has one row for each target, in equal order.
        for rows_of_target in zip(*draws, strict=True):
            row: Row = {
                "scene": study.name,
                "target": rows_of_target[0]["target"],
                "rows": size,
            }
            for name in SCORES_OF_MEANS:
                row[name] = float(np.mean([of_draw[name] for of_draw in rows_of_target]))
            yield row


def _means(surrogate: Surrogate, truth: Solved) -> Iterator[Row]:
    """Yield a row for each target with the scores of a surrogate's means over surfaces.

    `nmae` and `floor` are the errors of `_Errors` [%]. `mean_inside` is the share of means of
    solved results inside the interval of their point, 0 to 1. The interval is widened by the error
    of the mean of solved results, because it is over a limited number of surfaces. `mean_width` is
    the mean width of the intervals, without this widening, over the mean result [1].
    """
    questions = surrogate.of_numbers(truth.numbers)
    answer = surrogate.predict_rows(questions, level=LEVEL, mean=True)
    for target, learnt in surrogate.learnt.items():
        results = truth.results[learnt.column]
        errors = _Errors(results)
        half_width = (answer.high[target] - answer.low[target]) / 2
        widened = np.hypot(half_width, errors.half_width)
        distance = np.abs(answer.values[target] - results.mean(axis=1))
        yield {
            "target": target,
            "nmae": errors.of(answer.values[target]),
            "floor": errors.floor,
            "mean_inside": float(np.mean(distance <= widened)),
            "mean_width": float(2 * half_width.mean() / results.mean()),
        }


class _Errors:
    """Errors of predicted means over surfaces, judged by `results` of p points, shape (p, s)."""

    def __init__(self, results: Values) -> None:
        self._mean = results.mean(axis=1)
        # Standard error of the mean over s surfaces.
        self._error = results.std(axis=1, ddof=1) / np.sqrt(results.shape[1])

    @property
    def half_width(self) -> Values:
        """Half the width of the interval of each mean over s surfaces, shape (p,)."""
        return np.asarray(norm.ppf((1 + LEVEL) / 2) * self._error)

    @property
    def floor(self) -> float:
        """The error `of` an exact prediction, because the means are of only s surfaces [%]."""
        # The mean absolute value of a normal number is sqrt(2 / pi) of its standard deviation.
        return float(100 * np.sqrt(2 / np.pi) * self._error.mean() / self._mean.mean())

    def of(self, predicted: Values) -> float:
        """Return the mean absolute error of predicted means, (p,), over the mean result [%]."""
        return float(100 * np.abs(predicted - self._mean).mean() / self._mean.mean())
