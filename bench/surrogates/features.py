"""Errors, also of small areas, and intervals of surrogates by feature set, and the features' times.

Kernel ridge is fitted to rows of the paper preset as `learn fit` does, for several splits into
training and test rows. Then surrogates of bodies that yield are judged in the same way.

The nMSE has the unit of the target: it is (1 - R2) times the variance of the areas over their mean.
So it can be compared with another nMSE only where this ratio is the same.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from bench import databases
from bench.files import Row
from bench.report import Report, remark
from bench.surrogates.cost import feature_seconds, measure_solver, new_queries
from bench.surrogates.fitting import AREA_MAX, fit, parted, request_for
from gen.arrays import Indices, Values
from gen.quantities import FORCE, YIELDED
from gen.runtime.errors import InputError
from learn import dataset
from learn.database_rows import Dataset
from learn.dataset import Request
from learn.features import FeatureSet, chosen
from learn.metrics import scores

LEVEL = 0.9
"""Level of the intervals, 0 to 1."""

SMALL = 0.5
"""Area below which relative errors are given [%]."""

QUARTERS = 4
"""Number of parts, of equally many rows, in which the coverage is counted."""

BINS = 16
"""Number of parts, of equally many rows, in which the errors of the picture are taken."""

FEWEST_ROWS = 100
"""Smallest number of rows that is accepted."""

MODEL = "kernel-ridge"
"""Name of the model."""

YIELDING = "paper-yielding"
"""Name of the preset of bodies that yield, each with a hardness of its own."""

TARGETS = ("area", FORCE.name, YIELDED.name)
"""Targets of the surrogates of bodies that yield."""


@dataclass(frozen=True)
class Variant:
    """A feature set, with the number of blocks of its coarse solve."""

    name: str  # name in the tables
    features: str  # name of the feature set
    blocks: int | None = None  # blocks a side of the coarse solve; None for the default

    @property
    def feature_set(self) -> FeatureSet:
        """The features that surrogates see."""
        return chosen(self.features, roots=True, blocks=self.blocks)

    def request(self, path: Path) -> Request:
        """Return the request for a surrogate of the areas of a database."""
        request = request_for(path, MODEL, self.features, AREA_MAX)
        return replace(request, blocks=self.blocks)


VARIANTS = (
    Variant("paper", "paper"),
    Variant("dimensionless", "dimensionless"),
    Variant("hybrid", "hybrid"),
    Variant("hybrid, 65 blocks", "hybrid", blocks=65),
)
"""The feature sets that are compared."""


@dataclass(frozen=True, eq=False)
class Judged:
    """Test rows of all splits, n in all, in the unit of the target."""

    trained: int  # number of training rows of each split
    truth: Values  # (n,) solved values
    predicted: Values  # (n,) predictions
    low: Values  # (n,) lower ends of the intervals
    high: Values  # (n,) upper ends of the intervals

    @property
    def inside(self) -> Values:
        """1 for rows whose interval holds the truth, 0 for the others, (n,)."""
        is_inside = (self.low <= self.truth) & (self.truth <= self.high)
        return is_inside.astype(np.float64)

    @property
    def relative_errors(self) -> Values:
        """Relative errors [%], (n,)."""
        return 100 * np.abs(self.predicted - self.truth) / self.truth

    def of_small_areas(self, share: float) -> float:
        """Return a quantile of the relative errors of areas below `SMALL` [%]; NaN without any."""
        errors = self.relative_errors[self.truth < SMALL]
        return float(np.quantile(errors, share)) if errors.size else float("nan")

    def in_parts(self, number: int) -> list[Indices]:
        """Return the positions of the rows in parts of equally many rows, smallest truths first."""
        return np.array_split(np.argsort(self.truth), number)


def features(folder: Path, rows: int, seeds: Sequence[int], surfaces: int) -> Report:
    """Fit and judge a surrogate of each feature set, and surrogates of bodies that yield.

    Progress is printed on standard error.

    Parameters
    ----------
    folder : Path
        Folder of the report. Databases are generated in its folder `databases`, and kept.
    rows : int
        Number of rows of the paper preset, `FEWEST_ROWS` or more; half as many have bodies that
        yield.
    seeds : sequence of int
        Seeds of the splits, one or more.
    surfaces : int
        Number of surfaces on which the features are timed.

    Returns
    -------
    Report
        Table `features`, with a row for each feature set; `quarters`, with its coverage by quarters
        of the area; `errors`, with relative errors over the area; `yielding`, with a row for each
        target of bodies that yield.

    Raises
    ------
    InputError
        If there are too few rows or no seeds.
    """
    if rows < FEWEST_ROWS or not seeds:
        raise InputError(
            f"--rows {rows}, --seeds {list(seeds)}: give {FEWEST_ROWS} rows and one seed or more"
        )
    path = databases.generated(
        folder / "databases", databases.PAPER, f"samples = {rows}\n"
    )
    judged: dict[Variant, Judged] = {}
    for variant in VARIANTS:
        (usable,) = dataset.read(variant.request(path))
        judged[variant] = _judged(variant.request(path), usable, seeds)
        remark(f"{variant.name} features: {usable.size} rows")
    solves = _times_in_solves(surfaces)
    return Report(
        {
            "features": [
                _row_of_scores(variant, of_variant, solves[variant])
                for variant, of_variant in judged.items()
            ],
            "quarters": list(_rows_of_quarters(judged)),
            "errors": list(_rows_of_errors(judged)),
            "yielding": _yielding(folder, rows, seeds),
        }
    )


def _judged(request: Request, usable: Dataset, seeds: Iterable[int]) -> Judged:
    """Fit a surrogate for each split of the usable rows, and predict its test rows.

    The settings of the model are chosen on the first split.
    """
    settings = None
    truth: list[Values] = []
    predicted: list[Values] = []
    low: list[Values] = []
    high: list[Values] = []
    for seed in seeds:
        parts = parted(usable, seed)
        fitted = fit(replace(request, seed=seed), parts.train, parts.folds, settings)
        settings = fitted.settings  # of the first split
        ends = fitted.interval(parts.test, LEVEL)
        truth.append(parts.test.target * parts.test.scale)
        predicted.append(fitted.predict(parts.test))
        low.append(ends.low)
        high.append(ends.high)
    return Judged(
        trained=parts.train.size,
        truth=np.concatenate(truth),
        predicted=np.concatenate(predicted),
        low=np.concatenate(low),
        high=np.concatenate(high),
    )


def _times_in_solves(surfaces: int) -> dict[Variant, float]:
    """Return the time of the features of a new surface over that of its contact, by variant."""
    queries = new_queries(surfaces)
    solve = measure_solver(queries).solve
    return {
        variant: feature_seconds(variant.feature_set, queries) / solve
        for variant in VARIANTS
    }


def _row_of_scores(variant: Variant, judged: Judged, solves: float) -> Row:
    """Return the row of a feature set; `solves` is its features' time over that of a solve."""
    truth = judged.truth
    return {
        "features": variant.name,
        "columns": len(variant.feature_set.columns),
        "trained": judged.trained,
        "judged": truth.size,
        **asdict(scores(truth, judged.predicted)),
        "variance_over_mean": float(truth.var() / truth.mean()),
        "small_median": judged.of_small_areas(0.5),
        "small_p95": judged.of_small_areas(0.95),
        "covered": float(judged.inside.mean()),
        "solves": solves,
    }


def _rows_of_quarters(judged: dict[Variant, Judged]) -> Iterator[Row]:
    """Yield the coverage of each feature set in each quarter of the area.

    `slack` is three standard errors of a share of `LEVEL`. It includes the scatter of the rows that
    judge and of those that calibrated: all training rows, a fourth of them for each quarter.
    """
    for variant, of_variant in judged.items():
        for rows in of_variant.in_parts(QUARTERS):
            share = float(of_variant.inside[rows].mean())
            sizes = 1 / rows.size + QUARTERS / of_variant.trained
            slack = 3 * float(np.sqrt(LEVEL * (1 - LEVEL) * sizes))
            width = of_variant.high[rows] - of_variant.low[rows]
            yield {
                "features": variant.name,
                "from": float(of_variant.truth[rows].min()),
                "to": float(of_variant.truth[rows].max()),
                "rows": rows.size,
                "covered": share,
                "slack": slack,
                "holds": abs(share - LEVEL) <= slack,
                "width": float(width.mean()),
            }


def _rows_of_errors(judged: dict[Variant, Judged]) -> Iterator[Row]:
    """Yield the median relative error of each feature set over the area, for the picture."""
    for variant, of_variant in judged.items():
        for rows in of_variant.in_parts(BINS):
            yield {
                "features": variant.name,
                "area": float(np.median(of_variant.truth[rows])),
                "relative_error": float(np.median(of_variant.relative_errors[rows])),
            }


def _yielding(folder: Path, rows: int, seeds: Sequence[int]) -> list[Row]:
    """Return the rows of the table `yielding`: surrogates with hybrid features, by target."""
    text = f"samples = {rows // 2}\n{databases.preset_text(YIELDING)}"
    path = databases.generated(folder / "databases", YIELDING, text)
    request = replace(request_for(path, MODEL, "hybrid", None), targets=TARGETS)
    table = []
    for target, usable in zip(TARGETS, dataset.read(request), strict=True):
        judged = _judged(request, usable, seeds)
        truth = judged.truth
        judged_scores = scores(truth, judged.predicted)
        table.append(
            {
                "target": target,
                "least": float(truth.min()),
                "most": float(truth.max()),
                "trained": judged.trained,
                "judged": truth.size,
                "nmae": judged_scores.nmae,
                "r2": judged_scores.r2,
                "covered": float(judged.inside.mean()),
            }
        )
        remark(f"bodies that yield, {target}: {usable.size} rows")
    return table
