"""What a choice does to the numbers of the paper: areas, failures, Table 1's ranges, scores."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bench.databases import generated
from bench.paper.unstated.choices import OURS, VARIANTS, Variant
from bench.paper.unstated.readings import range_distance
from bench.surrogates import fitting
from gen.database import Reader
from gen.schema import Status
from gen.statistics import NAMES
from learn.dataset import Dataset
from learn.metrics import scores
from learn.models import MODELS, pipeline

Values = NDArray[np.float64]
Remark = Callable[[str], None]

MODEL, FEATURES = "kernel-ridge", "paper"
SEEDS = range(5)
"""Of the decision trees, whose scores scatter."""


@dataclass(frozen=True)
class Row:
    """The numbers of one variant.

    Attributes
    ----------
    choice, ours, other : str
        The choice, what the preset takes, and what the variant takes.
    rows : int
        Rows that were generated.
    done : float
        Share of the rows that were solved [%].
    area_mean : float
        Mean area of the rows that both the variant and the preset have solved [%].
    area_times, force_times : float
        Mean area and force over the preset's, on those rows [1].
    area_largest : float
        Largest area of the solved rows [%].
    kept : float
        Share of the solved rows whose area is kept for the surrogate [%].
    table_1 : float
        Distance of the statistics' ranges from Table 1's, median over the 22; an end that is off by
        the width of the paper's range counts 100 [%].
    trained : int
        Rows that train the surrogate, as many for all variants.
    nmse, nmae, r2 : float
        Scores of kernel ridge on the test rows [%].
    tree_r2 : float
        R2 of a decision tree with its library's settings, mean over seeds [%].
    spread : float
        Variance of the test areas over their mean, nMSE / (100 - R2) [%].
    """

    choice: str
    ours: str
    other: str
    rows: int
    done: float
    area_mean: float
    area_times: float
    force_times: float
    area_largest: float
    kept: float
    table_1: float
    trained: int
    nmse: float
    nmae: float
    r2: float
    tree_r2: float
    spread: float


def measure(folder: Path, rows: int, remark: Remark) -> list[Row]:
    """Generate the databases of all variants, and compare each with the preset's.

    Parameters
    ----------
    folder : Path
        Folder of the databases; those that are there already are used.
    rows : int
        Rows of each database.
    remark : callable
        Told how far it is.

    Returns
    -------
    list of Row
        The preset first.

    Raises
    ------
    InputError
        If the folder cannot be written to, or so few rows are left that nothing can be learnt.
    KeyboardInterrupt
        After a signal: the same call goes on.
    """
    head = f"samples = {rows}\n"
    paths = {
        variant.name: generated(folder, variant.name, head + variant.scene, remark)
        for variant in VARIANTS
    }
    data = [_dataset(paths[variant.name], variant) for variant in VARIANTS]
    trained = min(parts.train.target.size for parts in data)
    return list(_rows(paths, data, trained, remark))


def _rows(
    paths: dict[str, Path], data: list[fitting.Parts], trained: int, remark: Remark
) -> Iterator[Row]:
    base = _columns(paths[OURS])
    for variant, parts in zip(VARIANTS, data, strict=True):
        remark(f"{variant.choice}: {variant.other or OURS}")
        found = _columns(paths[variant.name])
        done = found["status"] == Status.DONE
        both = done & (base["status"] == Status.DONE)
        kept = found["area_percent"][done] <= (variant.area_max or np.inf)
        yield Row(
            choice=variant.choice,
            ours=variant.ours,
            other=variant.other,
            rows=done.size,
            done=100 * float(done.mean()),
            area_mean=float(found["area_percent"][both].mean()),
            area_times=_times(found, base, both, "area_percent"),
            force_times=_times(found, base, both, "force"),
            area_largest=float(found["area_percent"][done].max()),
            kept=100 * float(kept.mean()),
            table_1=float(np.median([range_distance(found[name], name) for name in NAMES])),
            trained=trained,
            spread=float(parts.test.target.var() / parts.test.target.mean()),
            **_scores(paths[variant.name], variant, parts, trained),
        )


def _dataset(path: Path, variant: Variant) -> fitting.Parts:
    request = fitting.request_for(path, MODEL, FEATURES, variant.area_max or 100.0)
    return fitting.parted(fitting.read(request))


def _columns(path: Path) -> dict[str, Values]:
    with Reader(path) as reader:
        wanted = ("status", "area_percent", "force", *NAMES)
        return {name: reader.column(name) for name in wanted}


def _times(found: dict[str, Values], base: dict[str, Values], both: Values, name: str) -> float:
    return float(found[name][both].mean() / base[name][both].mean())


def _scores(path: Path, variant: Variant, parts: fitting.Parts, trained: int) -> dict[str, float]:
    """Scores of kernel ridge and decision trees, trained on as many rows as other variants have."""
    request = fitting.request_for(path, MODEL, FEATURES, variant.area_max or 100.0)
    train = parts.train.at(np.arange(trained))
    fitted = fitting.fit(request, train, parts.calibration, parts.folds[:trained])
    found = scores(parts.test.target, fitted.predict(parts.test))
    return {
        "nmse": found.nmse,
        "nmae": found.nmae,
        "r2": found.r2,
        "tree_r2": float(np.mean([_tree(train, parts.test, seed) for seed in SEEDS])),
    }


def _tree(train: Dataset, test: Dataset, seed: int) -> float:
    """R2 of a decision tree [%], with the paper's scaling of rows."""
    tree = pipeline(MODELS["decision-tree"], {}, normalisation="l2", seed=seed)
    tree.fit(train.inputs, train.target)
    return scores(test.target, tree.predict(test.inputs)).r2
