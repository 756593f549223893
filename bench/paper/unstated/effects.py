"""What a choice does to the numbers of the paper: areas, failures, Table 1's ranges, scores."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from bench.databases import generated
from bench.files import read_toml
from bench.paper.unstated.readings import range_distance
from bench.report import remark
from bench.surrogates import fitting
from gen.arrays import Values
from gen.database import Reader
from gen.schema import Status
from gen.statistics import NAMES
from learn.metrics import scores
from learn.models import MODELS, pipeline
from learn.request import Request

MODEL, FEATURES = "kernel-ridge", "paper"
SEEDS = range(5)  # of the decision trees, whose scores scatter
OURS = "ours"  # the paper preset as it is


class Variant(NamedTuple):
    """The paper preset with another choice: the scene says in TOML what differs.

    Areas above `area_max` are left out [%].
    """

    choice: str
    name: str
    ours: str = ""
    other: str = ""
    scene: str = ""
    area_max: float = 16.56


# One choice at a time, against the first.
VARIANTS = [Variant(**each) for each in read_toml("paper/choices")["variants"]]


def measure(folder: Path, rows: int) -> Iterator[dict[str, Any]]:
    """Generate databases of all variants in a folder, and compare each with the preset's.

    Yields
    ------
    dict
        Numbers of a variant by name, the preset's first: shares of rows, areas, scores and the
        distance from Table 1 [%]; mean area and force over the preset's, on rows that both have
        solved [1]. As many rows train the surrogate of each variant.
    """
    head = f"samples = {rows}\n"
    paths = {v.name: generated(folder, v.name, head + v.scene) for v in VARIANTS}
    requests = [
        fitting.request_for(paths[v.name], MODEL, FEATURES, min(v.area_max, 100)) for v in VARIANTS
    ]
    data = [fitting.parted(fitting.read(request)) for request in requests]
    trained = min(parts.train.target.size for parts in data)
    base = _columns(paths[OURS])
    for variant, request, parts in zip(VARIANTS, requests, data, strict=True):
        remark(f"{variant.choice}: {variant.other or OURS}")
        yield {
            "choice": variant.choice,
            "ours": variant.ours,
            "other": variant.other,
            **_solved(_columns(paths[variant.name]), base, variant.area_max),
            "trained": trained,
            **_scores(request, parts, trained),
            "spread": float(parts.test.target.var() / parts.test.target.mean()),
        }


def _columns(path: Path) -> dict[str, Values]:
    with Reader(path) as reader:
        return {name: reader.column(name) for name in ("status", "area_percent", "force", *NAMES)}


def _solved(
    columns: dict[str, Values], base: dict[str, Values], area_max: float
) -> dict[str, float]:
    """Compare the rows of a variant with the preset's: areas and forces where both are solved."""
    done = columns["status"] == Status.DONE
    both = done & (base["status"] == Status.DONE)
    area, force = (columns[name][both].mean() for name in ("area_percent", "force"))
    areas = columns["area_percent"][done]
    return {
        "rows": done.size,
        "done": 100 * float(done.mean()),
        "area_mean": float(area),
        "area_times": float(area / base["area_percent"][both].mean()),
        "force_times": float(force / base["force"][both].mean()),
        "area_largest": float(areas.max()),
        "kept": 100 * float((areas <= area_max).mean()),
        "table_1": float(np.median([range_distance(columns[name], name) for name in NAMES])),
    }


def _scores(request: Request, parts: fitting.Parts, trained: int) -> dict[str, float]:
    """Score kernel ridge and, in the mean over seeds, a decision tree with default settings [%]."""
    train, test = parts.train.at(np.arange(trained)), parts.test
    ridge = fitting.fit(request, train, parts.calibration, parts.folds[:trained])
    found = scores(test.target, ridge.predict(test))
    trees = []
    for seed in SEEDS:
        tree = pipeline(MODELS["decision-tree"], {}, normalisation="l2", seed=seed)
        tree.fit(train.inputs, train.target)
        trees.append(scores(test.target, tree.predict(test.inputs)).r2)
    shown = {name: getattr(found, name) for name in ("nmse", "nmae", "r2")}
    return shown | {"tree_r2": float(np.mean(trees))}
