"""Kernel ridge on a finer grid than it was trained with: section 4.3 and Table 5."""

from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from bench.contents import Content
from bench.files import write_table
from bench.paper.facts import AREA_MAX, FINE, FINE_ROWS
from bench.paper.texts import DIGITS, picture, ratio, table, why
from bench.picture import COLOURS, new_figure
from bench.surrogates.fitting import fit, parted, read, request_for
from bench.surrogates.times import median_seconds
from gen.arrays import Values
from gen.database import Reader
from gen.runtime.errors import InputError
from gen.runtime.figure import draw_parity, parity_axes
from gen.scene import Scene, differences, load
from learn.dataset import Dataset
from learn.features import SETS
from learn.metrics import Scores, scores

MODEL = "kernel-ridge"
CURVATURE = "peak_curvature_mean"
SCENE = "[surface]\nnodes = 257\n"  # the finer grid, where no database of it is given

PRESET = load("paper")


class Judged(NamedTuple):
    """A surrogate of the coarse grid on rows of the fine one: predicted areas [%] and times [s].

    A single prediction takes `seconds`, one among all of them `batched`; both without the features.
    """

    rows: Dataset
    prediction: Values
    scores: Scores
    seconds: float
    batched: float


def fine_grid(folder: Path, database: Path, fine: Path) -> list[Content]:
    """Train with each feature set on the preset's grid, test on the finer one."""
    same = check(fine).seed == PRESET.seed
    found = {name: _judge(database, fine, name) for name in SETS}
    first = found["paper"].rows
    curvature = _curvature(database, first)
    data = _table(folder, found, curvature)
    predictions = write_table(
        folder / "fine-grid.csv",
        ("row", "solved_percent", *found),
        zip(first.rows, first.target, *(e.prediction for e in found.values()), strict=True),
        digits=5,
    )
    seen = " (surfaces of the training's seed: not unseen)" if same else ""
    said: dict[str, Any] = {"rows": first.size, "seen": seen, "papers": FINE_ROWS}
    said |= {"theirs": FINE.r2, "ours": ", ".join(f"{e.scores.r2:.2f}" for e in found.values())}
    drawn = _picture(found, fine)
    return [
        picture(folder, "fine-grid", drawn, data, predictions, **said),
        table(data, why=curvature),
    ]


def tests_of(rows: int) -> int:
    """Return the rows of the finer grid that test a database; the paper has 800 for 15,878."""
    return min(FINE_ROWS, max(40, rows // 5))


def check(fine: Path) -> Scene:
    """Return a database's scene; refuse all but the paper preset's on a finer grid."""
    with Reader(fine) as reader:
        scene = reader.scene
    nodes, coarse = scene.shape[0], PRESET.shape[0]
    if nodes <= coarse:
        raise InputError(
            f"--fine {fine}: has {nodes} nodes a side, give one with more than {coarse}:"
            " python -m gen run fine -o fine.h5"
        )
    alike = {"surface": scene.surface.model_copy(update={"nodes": coarse}), "store": PRESET.store}
    different = differences(scene.model_copy(update=alike), PRESET)
    if any(not line.startswith("seed") for line in different):
        raise InputError(
            f"--fine {fine}: give one of the paper preset with another grid ({different[0]})"
        )
    return scene


def _judge(database: Path, fine: Path, features: str) -> Judged:
    """Fit as `learn fit` does on the coarse grid, and test on the fine one."""
    request = request_for(database, MODEL, features, AREA_MAX)
    parts = parted(read(request))
    fitted = fit(request, parts.train, parts.calibration, parts.folds)
    rows = read(request_for(fine, MODEL, features, AREA_MAX))
    found = fitted.predict(rows)
    alone = median_seconds(partial(fitted.predict, rows.at(np.array([0]))))
    together = median_seconds(partial(fitted.predict, rows)) / rows.size
    return Judged(rows, found, scores(rows.target, found), alone, together)


def _curvature(database: Path, fine: Dataset) -> str:
    """Say why the statistics do not carry over: how the mean curvature of peaks changes."""
    with Reader(database) as reader, Reader(Path(fine.source["database"])) as other:
        coarse, own = reader.column(CURVATURE), other.column(CURVATURE)[fine.rows]
    growth = float(np.median(own) / np.nanmedian(coarse))
    return why("fine", growth=growth, beyond=100 * float((own > np.nanmax(coarse)).mean()))


def _table(folder: Path, found: dict[str, Judged], curvature: str) -> Path:
    """Write Table 5, a column for each feature set."""
    rows: list[tuple[object, ...]] = []
    for name, theirs in asdict(FINE).items():
        ours = {features: getattr(each.scores, name) for features, each in found.items()}
        mine = ours["paper"]
        apart = f"{mine - theirs:+.2f}" if name == "r2" else ratio(mine, theirs)
        rows.append((name, *ours.values(), theirs, apart, curvature))
    header = ("score_percent", *(f"ours_{name}" for name in found))
    names = (*header, "paper", "deviation", "explanation")
    return write_table(folder / "table-5.csv", names, rows, DIGITS)


def _picture(found: dict[str, Judged], fine: Path) -> Any:
    """Draw predictions over truth with each feature set, then times."""
    figure = new_figure(10, 8)
    *axes, last = figure.subplots(2, 2).ravel()
    for axis, (name, each) in zip(axes, found.items(), strict=False):
        parity_axes(axis, each.rows.target)
        look: dict[str, Any] = {"marker": ".", "ms": 3, "ls": "none", "color": COLOURS[0]}
        draw_parity(axis, each.rows.target, each.prediction, **look)
        beside = f" (the paper's {FINE.r2:.2f} %)" if name == "paper" else ""
        axis.set_title(f"{name} features: R² {each.scores.r2:.2f} %{beside}", fontsize=10)
        axis.set(xlabel="solved area [%]", ylabel="predicted area [%]")
    first = found["paper"]
    with Reader(fine) as reader:
        seconds = reader.column("solve_seconds")[first.rows.rows]
    last.plot(first.rows.target, seconds, ".", ms=3, color=COLOURS[0], label="a solve")
    among = f"a prediction among {first.rows.size:,}"
    last.axhline(first.seconds, color=COLOURS[1], ls="--", lw=2, label="a prediction alone")
    last.axhline(first.batched, color=COLOURS[1], ls=":", lw=2, label=among)
    last.set(yscale="log", xlabel="solved area [%]", ylabel="time [s]")
    last.set_title("time of an answer from known features", fontsize=10)
    last.legend(fontsize=9)
    return figure
