"""A surrogate of a scene's own numbers, judged by many surfaces of the same parameters.

Three scenes that share nothing but this: spectral surfaces of bodies that yield, by pressure;
random midpoint displacement, by Delta; and windows of ground maps, whose height and length are
parameters. The truth is solved at fresh parameters on fresh surfaces. Beside ours stands a Gaussian
process of scikit-learn as a user would write it.
"""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from time import process_time
from typing import Any

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
from learn.dataset import Request
from learn.executor import Executor
from learn.features.scene import load_of
from learn.surrogate import Surrogate, fitting

SEED = 4242  # of parameters and surfaces that judge
FEW = 20  # surfaces that a user would solve for a mean
QUESTIONS = 10_000
LEVEL = 0.9
MEANS = ("nmae", "floor", "mean_inside", "mean_width")
MODELS = (
    "population",
    "kernel-ridge",
    "gaussian-process",
)  # whose fits `learn fit` makes
MODEL_ROWS = 3000  # that train each of them: the fits of the last two take the cube of their number
SIZES = (500, 1500, 5000)  # rows that train means too
DRAWS = 5  # of these rows, since means of one fit err alike at neighbouring points
PROCESS_ROWS = (
    1000  # of the plain Gaussian process, whose fit takes the cube of their number
)

SCENES: dict[str, str] = read_toml("surrogates/scenes")["own-numbers"]


def scene_surrogate(folder: Path, rows: int, points: int, surfaces: int) -> Report:
    """Fit to each scene, and judge by `surfaces` surfaces at each of `points` fresh parameters.

    The arguments are those of the command.
    """
    TRUSTED.set(True)  # the windows come from a function of `bench`
    found: list[Row] = []
    models: list[Row] = []
    means: list[Row] = []
    for name, text in SCENES.items():
        path = generated(
            folder / "databases", name.replace(" ", "-"), f"samples = {rows}\n{text}"
        )
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
        surrogate, seconds = _fitted(request)
        remark(f"{name}: {points} points of {surfaces} surfaces")
        asked, truth = solved(scene, surrogate.features.names, points, surfaces)
        said = {"scene": name, "load": load, "rows": rows, "fit_seconds": seconds}
        found += [said | row for row in _judged(surrogate, request, asked, truth)]
        for model in MODELS:
            own, seconds = _fitted(
                replace(request, models=(model,), train_rows=MODEL_ROWS)
            )
            new = own.predict_rows(own.of_numbers(asked), level=LEVEL)
            for target, learnt in own.learnt.items():
                true = truth[learnt.column]
                row = {
                    "scene": name,
                    "target": target,
                    "model": model,
                    "fit_seconds": seconds,
                }
                row["nmae"] = _Errors(true).of(new.values[target])
                models.append(
                    {**row, "inside": _inside(new.low[target], new.high[target], true)}
                )
        for size in (each for each in SIZES if each < rows):
            draws = [
                replace(request, train_rows=size, seed=draw) for draw in range(DRAWS)
            ]
            fits = [list(_means(_fitted(each)[0], asked, truth)) for each in draws]
            for same in zip(*fits, strict=True):
                mean = {
                    name: float(np.mean([each[name] for each in same])) for name in MEANS
                }
                means.append(
                    {"scene": name, "target": same[0]["target"], "rows": size, **mean}
                )
    return Report(
        {"scene-surrogate": found, "scene-models": models, "scene-means": means}
    )


def _fitted(request: Request) -> tuple[Surrogate, float]:
    """Fit a surrogate as `learn fit` does; return it with the processor time [s]."""
    began = process_time()
    surrogate = fitting.fit(request, Executor(), remark)
    assert surrogate is not None  # which a stop would make it
    return surrogate, process_time() - began


def _inside(low: Values, high: Values, true: Values) -> float:
    """Return the share of results, (p, s), inside the intervals of their points, (p,)."""
    return float(np.mean((low[:, None] <= true) & (true <= high[:, None])))


def solved(
    scene: Scene, names: tuple[str, ...], points: int, surfaces: int
) -> tuple[dict[str, Values], dict[str, Values]]:
    """Return fresh parameters and loads by their names, (p,), and results by column, (p, s)."""
    fresh = scene.model_copy(update={"seed": SEED, "samples_per_surface": 1})
    plan, asked, truth = parameters(fresh, 0, points), dict[str, Any](), dict[str, Any]()
    for point in range(points):
        drawn, hardness = plan.parameters_of(point), None
        numbers = {**drawn, load_of(scene): float(plan.load[point])}
        if plan.hardness is not None:
            numbers["hardness"] = hardness = float(plan.hardness[point])
        given = {load_of(scene): numbers[load_of(scene)]}
        one = scene.with_parameters(drawn, seed=SEED + 1 + point)
        for number in range(surfaces):
            heights = surface_numbered(one, number)
            contact = solve_contact(one, heights, hardness=hardness, **given)
            for column in (AREA.name, FORCE.name, DELTA.name):
                truth.setdefault(column, []).append(getattr(contact, column))
        for name in names:
            asked.setdefault(name, []).append(numbers[name])
    results = {name: np.reshape(each, (points, surfaces)) for name, each in truth.items()}
    return {name: np.array(values) for name, values in asked.items()}, results


def _means(
    surrogate: Surrogate, asked: dict[str, Values], truth: dict[str, Values]
) -> Iterator[Row]:
    """Yield a row for each target: errors of means over surfaces, and what their intervals hold."""
    answer = surrogate.predict_rows(surrogate.of_numbers(asked), level=LEVEL, mean=True)
    for target, learnt in surrogate.learnt.items():
        true, error = truth[learnt.column], _Errors(truth[learnt.column])
        half = (answer.high[target] - answer.low[target]) / 2
        wrong = np.abs(answer.values[target] - true.mean(axis=1))
        yield {
            "target": target,
            "nmae": error.of(answer.values[target]),
            "floor": error.floor,
            "mean_inside": float(np.mean(wrong <= np.hypot(half, error.half))),
            "mean_width": float(2 * half.mean() / true.mean()),
        }


def _judged(
    surrogate: Surrogate,
    request: Request,
    asked: dict[str, Values],
    truth: dict[str, Values],
) -> Iterator[Row]:
    """Yield a row for each target: errors of the mean, coverage, times; and the plain process's."""
    questions = surrogate.of_numbers(asked)
    new, means = (
        surrogate.predict_rows(questions, level=LEVEL),
        _means(surrogate, asked, truth),
    )
    many = {name: np.resize(values, QUESTIONS) for name, values in asked.items()}
    seconds = median_seconds(
        lambda: surrogate.predict_rows(surrogate.of_numbers(many), level=LEVEL)
    )
    inputs = surrogate.features.of(questions)
    every = np.resize(inputs, (QUESTIONS, inputs.shape[1]))
    for mean, rows in zip(means, dataset.read(request), strict=True):
        target = str(mean["target"])
        true = truth[surrogate.learnt[target].column]
        low, high, error = new.low[target], new.high[target], _Errors(true)
        process = make_pipeline(
            StandardScaler(),
            GaussianProcessRegressor(
                ConstantKernel() * RBF(np.ones(inputs.shape[1])) + WhiteKernel(),
                normalize_y=True,
            ),
        )
        few = rows.inputs[:PROCESS_ROWS], rows.target[:PROCESS_ROWS]
        fit_seconds = seconds_of(partial(process.fit, *few))
        middle, deviation = process.predict(inputs, return_std=True)
        deviation *= norm.ppf((1 + LEVEL) / 2)
        yield {
            **mean,
            "nmae_of_few": _Errors(true[:, :FEW]).of(new.values[target]),
            "floor_of_few": _Errors(true[:, :FEW]).floor,
            "inside": _inside(low, high, true),
            "width": float((high - low).mean() / true.mean()),
            "answer_seconds": seconds,
            "process_nmae": error.of(middle),
            "process_inside": _inside(middle - deviation, middle + deviation, true),
            "process_fit_seconds": fit_seconds,
            "process_answer_seconds": median_seconds(
                partial(process.predict, every, return_std=True)
            ),
        }


class _Errors:
    """Errors of means over all surfaces, by results of some of them, (p, s)."""

    def __init__(self, true: Values) -> None:
        self._mean = true.mean(axis=1)
        self._error = true.std(axis=1, ddof=1) / np.sqrt(true.shape[1])

    @property
    def half(self) -> Values:
        """Half the width of the intervals of the true means, (p,)."""
        return np.asarray(norm.ppf((1 + LEVEL) / 2) * self._error)

    @property
    def floor(self) -> float:
        """Error that the true means would have, by the scatter of so few surfaces [%]."""
        return float(100 * np.sqrt(2 / np.pi) * self._error.mean() / self._mean.mean())

    def of(self, predicted: Values) -> float:
        """Return the mean absolute error over the mean [%]."""
        return float(100 * np.abs(predicted - self._mean).mean() / self._mean.mean())
