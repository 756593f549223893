"""What a choice does to the numbers of the paper: areas, failures, Table 1's ranges, scores."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bench.surrogates import fitting
from bench.surrogates.databases import generated
from bench.unstated.choices import OURS, VARIANTS, Variant
from gen.database import Reader
from gen.runtime.errors import InputError
from gen.schema import COLUMNS, Status
from gen.statistics import NAMES
from learn.dataset import Dataset
from learn.metrics import scores
from learn.models import MODELS, pipeline

Values = NDArray[np.float64]
Remark = Callable[[str], None]

MODEL, FEATURES = "kernel-ridge", "paper"
SEEDS = range(5)
"""Of the decision trees, whose scores scatter."""

RANGES = {column.name: column.paper_range for column in COLUMNS if column.paper_range is not None}
"""Table 1's."""


@dataclass(frozen=True)
class Row:
    """The numbers of one variant.

    Attributes
    ----------
    choice, ours, other : what was varied
    rows : generated
    done : of them solved [%]
    area_mean : of the rows that both the variant and the preset have solved [%]
    area_times, force_times : mean area and force over the preset's, on those rows [1]
    area_largest : of all rows solved [%]
    kept : share of rows solved whose area is kept for the surrogate [%]
    table_1 : distance of the statistics' ranges from Table 1's, median over the 22; an end that is
        off by the width of the paper's range counts 100 [%]
    trained : rows that train the surrogate, as many for all variants
    nmse, nmae, r2 : scores of kernel ridge on the test rows [%]
    tree_r2 : of a decision tree with its library's settings, mean over seeds [%]
    spread : variance of the test areas over their mean, nMSE / (100 - R2) [%]
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
    folder : where the databases go; what is there already is used
    rows : of each
    remark : told how far it is

    Returns
    -------
    The preset first

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
            table_1=_distance({name: found[name] for name in NAMES}),
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


def _distance(statistics: dict[str, Values]) -> float:
    """Median over the statistics of how far the ends of their ranges are from Table 1's [%]."""
    return float(np.median([range_distance(values, name) for name, values in statistics.items()]))


def range_distance(values: Values, name: str) -> float:
    """How far the ends of a quantity's range are from Table 1's [% of that range's width].

    Raises
    ------
    InputError
        If Table 1 does not have it, or no value is finite.
    """
    if name not in RANGES:
        raise InputError(f"{name}: not in the paper's Table 1")
    if not np.isfinite(values).any():
        raise InputError(f"{name}: no finite value")
    low, high = RANGES[name]
    ends = np.array([np.nanmin(values), np.nanmax(values)])
    return float(100 * np.abs(ends - (low, high)).mean() / (high - low))


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
