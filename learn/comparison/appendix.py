"""Appendix A of the paper: with equal kernels, Gaussian process and kernel ridge predict alike.

Case 1 has a radial basis function of length 1, which is gamma = 1/2, and 1e-10 on the diagonal.
Case 2 has the linear kernel, `DotProduct(0, fixed)`; the paper gives it no noise, but a linear
kernel of 23 inputs is singular then, so both get 1, the default of kernel ridge.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gen.runtime.figure import new_figure
from learn import dataset, memory, split
from learn.arrays import Values
from learn.comparison.folder import Folder, conditions
from learn.comparison.pictures import save
from learn.executor import Executor
from learn.metrics import Scores, scores
from learn.models import MODELS, pipeline
from learn.request import Request, pressed_for

CASES: dict[str, dict[str, Any]] = {
    "radial basis function": {"kernel": "rbf", "gamma": 0.5, "alpha": 1e-10},
    "linear": {"kernel": "linear", "alpha": 1.0},
}
"""Kernel ridge's settings in both cases; lambda of the paper is alpha, as is sigma_n^2."""


@dataclass(frozen=True, eq=False)
class Agreement:
    """Both models in one case.

    Attributes
    ----------
    case : name of the kernel
    truth, process, ridge : (m,) solved values and the two predictions of the test rows
    largest : largest difference of the predictions, over the largest truth
    process_scores, ridge_scores : on the test rows
    """

    case: str
    truth: Values
    process: Values
    ridge: Values
    largest: float
    process_scores: Scores
    ridge_scores: Scores


def agreements(
    rows: dataset.Dataset, parts: split.Split, normalisation: str = "l2"
) -> list[Agreement]:
    """Fit both models in both cases.

    Parameters
    ----------
    rows, parts : the data
    normalisation : one of `learn.models.NORMALISATIONS`
    """
    found = []
    truth = rows.target[parts.test]
    for case, settings in CASES.items():
        process_settings = {"kernel": _kernel(case), "alpha": settings["alpha"]}
        predictions = []
        for name, own in (("gaussian-process", process_settings), ("kernel-ridge", settings)):
            fitted = pipeline(MODELS[name], own, normalisation=normalisation).fit(
                rows.inputs[parts.train], rows.target[parts.train]
            )
            predictions.append(np.asarray(fitted.predict(rows.inputs[parts.test]), dtype=float))
        process, ridge = predictions
        largest = float(np.abs(process - ridge).max() / np.abs(truth).max())
        scored = scores(truth, process), scores(truth, ridge)
        found.append(Agreement(case, truth, process, ridge, largest, *scored))
    return found


def _kernel(case: str) -> Any:
    from sklearn.gaussian_process.kernels import RBF, DotProduct

    return DotProduct(0.0, "fixed") if case == "linear" else RBF(1.0, "fixed")


def write_report(request: Request, say: Callable[[str], None]) -> list[Path]:
    """Compare, and write a table and a picture.

    Parameters
    ----------
    request : data and folder
    say : called with lines for the user

    Returns
    -------
    The files
    """
    pressed = pressed_for(request, Executor())
    rows = dataset.read(request.database, "area", request.area_max, request.features, pressed)
    parts = split.draw(rows, request.seed, request.train_rows)
    memory.check("gaussian-process", parts.train.size, baseline=True)
    folder = Folder(request.output / "area")
    agreed = conditions(rows, parts, request.normalisation, {"area_max": request.area_max})
    folder.begin(rows, parts, agreed)
    found = agreements(rows, parts, request.normalisation)
    for each in found:
        say(
            f"{each.case}: R2 {each.process_scores.r2:.4f} % (Gaussian process),"
            f" {each.ridge_scores.r2:.4f} % (kernel ridge), predictions differ by"
            f" {each.largest:.1e} of the largest area"
        )
    table = folder.write_table(
        "appendix.csv",
        ["case", "gp_r2", "ridge_r2", "gp_nmse", "ridge_nmse", "largest_difference"],
        [
            (
                each.case,
                each.process_scores.r2,
                each.ridge_scores.r2,
                each.process_scores.nmse,
                each.ridge_scores.nmse,
                each.largest,
            )
            for each in found
        ],
    )
    return [table, _draw(found, folder.path / "appendix.png")]


def _draw(found: list[Agreement], path: Path) -> Path:
    """Truth against both predictions, one against the other, and their difference."""
    figure = new_figure(13, 4.1 * len(found))
    for row, each in zip(figure.subplots(len(found), 3), found, strict=True):
        ends = [each.truth.min(), each.truth.max()]
        row[0].plot(each.truth, each.process, ".", ms=3, label="Gaussian process")
        row[0].plot(each.truth, each.ridge, "x", ms=2, label="kernel ridge")
        row[0].set(xlabel="solved area [%]", ylabel="predicted area [%]", title=each.case)
        row[0].legend()
        row[1].plot(each.process, each.ridge, ".", ms=3)
        row[1].set(xlabel="Gaussian process [%]", ylabel="kernel ridge [%]")
        for axis in row[:2]:
            axis.plot(ends, ends, "r-", lw=1)
        row[2].semilogy(each.truth, np.abs(each.process - each.ridge) + 1e-18, ".", ms=3)
        row[2].set(xlabel="solved area [%]", ylabel="difference of the predictions [%]")
    return save(figure, path)
