"""Appendix A of the paper: with equal kernels, Gaussian process and kernel ridge predict alike.

Case 1 has a radial basis function of length 1, which is gamma = 1/2, and 1e-10 on the diagonal.
Case 2 has the linear kernel, `DotProduct(0, fixed)`; the paper gives it no noise, but a linear
kernel of 23 inputs is singular then, so both get 1, the default of kernel ridge.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from gen.runtime.figure import draw_parity, new_figure, parity_axes
from learn import memory
from learn.arrays import Values
from learn.comparison.pictures import save
from learn.comparison.training import open_folder, read_single
from learn.dataset import Dataset
from learn.metrics import Scores, scores
from learn.models import MODELS, pipeline, remarks
from learn.request import Request
from learn.split import Split

CASES: dict[str, dict[str, Any]] = {
    "radial basis function": {"kernel": "rbf", "gamma": 0.5, "alpha": 1e-10},
    "linear": {"kernel": "linear", "alpha": 1.0},
}
"""Kernel ridge's settings in both cases; the paper's lambda and sigma_n^2 are both alpha."""


class Agreement(NamedTuple):
    """The predictions of both models in one case.

    Attributes
    ----------
    case : str
        Name of the kernel.
    truth, process, ridge : ndarray, shape (m,)
        Solved areas of the test rows, and the predictions of both models [%].
    largest : float
        Largest difference of the predictions over the largest truth.
    process_scores, ridge_scores : Scores
        Scores of both models on the test rows.
    """

    case: str
    truth: Values
    process: Values
    ridge: Values
    largest: float
    process_scores: Scores
    ridge_scores: Scores


def agreements(rows: Dataset, parts: Split, normalisation: str = "l2") -> list[Agreement]:
    """Fit both models in both cases, with one of `learn.models.NORMALISATIONS`."""
    from sklearn.gaussian_process.kernels import RBF, DotProduct

    cases = []
    truth = rows.target[parts.test]
    for case, settings in CASES.items():
        kernel = DotProduct(0.0, "fixed") if case == "linear" else RBF(1.0, "fixed")
        process_settings = {"kernel": kernel, "alpha": settings["alpha"]}
        predictions = []
        for name, own in (("gaussian-process", process_settings), ("kernel-ridge", settings)):
            fitted = pipeline(MODELS[name], own, normalisation=normalisation).fit(
                rows.inputs[parts.train], rows.target[parts.train]
            )
            predictions.append(np.asarray(fitted.predict(rows.inputs[parts.test]), dtype=float))
        process, ridge = predictions
        largest = float(np.abs(process - ridge).max() / np.abs(truth).max())
        scored = scores(truth, process), scores(truth, ridge)
        cases.append(Agreement(case, truth, process, ridge, largest, *scored))
    return cases


def write_report(request: Request, say: Callable[[str], None]) -> list[Path]:
    """Compare both models in both cases, and write a table and a picture.

    Parameters
    ----------
    request : Request
        Data and folder.
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
    rows, parts = read_single(request, "area")
    memory.check("gaussian-process", parts.train.size, baseline=True)
    folder = open_folder(request, rows, parts)
    with remarks() as said:
        cases = agreements(rows, parts, request.normalisation)
    for remark in said:
        say(f"warning: {remark}")
    lines = []
    for case in cases:
        process, ridge = case.process_scores, case.ridge_scores
        say(
            f"{case.case}: R2 {process.r2:.4f} % (Gaussian process), {ridge.r2:.4f} % (kernel"
            f" ridge), predictions differ by {case.largest:.1e} of the largest area"
        )
        lines.append((case.case, process.r2, ridge.r2, process.nmse, ridge.nmse, case.largest))
    header = ["case", "gp_r2", "ridge_r2", "gp_nmse", "ridge_nmse", "largest_difference"]
    return [
        folder.write_table("appendix.csv", header, lines),
        _draw(cases, folder.path / "appendix.png"),
    ]


def _draw(cases: list[Agreement], path: Path) -> Path:
    """Draw both predictions over the truth and over each other, and their difference."""
    figure = new_figure(13, 4.1 * len(cases))
    for row, case in zip(figure.subplots(len(cases), 3), cases, strict=True):
        for axis in row[:2]:
            parity_axes(axis, case.truth)
        circles: dict[str, Any] = {"marker": "o", "ms": 4, "mew": 0.5, "mfc": "none", "ls": "none"}
        dots: dict[str, Any] = {"marker": ".", "ms": 2, "ls": "none"}
        draw_parity(row[0], case.truth, case.process, label="Gaussian process", **circles)
        draw_parity(row[0], case.truth, case.ridge, label="kernel ridge", **dots)
        row[0].set(xlabel="solved area [%]", ylabel="predicted area [%]", title=case.case)
        row[0].legend()
        draw_parity(row[1], case.process, case.ridge, **dots)
        row[1].set(xlabel="Gaussian process [%]", ylabel="kernel ridge [%]")
        row[2].semilogy(case.truth, np.abs(case.process - case.ridge) + 1e-18, ".", ms=3)
        row[2].set(xlabel="solved area [%]", ylabel="difference of the predictions [%]")
    return save(figure, path)
