"""The worth of each feature set: errors, small areas and intervals, on several seeds of the split.

Kernel ridge on the paper preset, fitted as `learn fit` does; its settings are chosen on the first
seed. The nMSE carries the target's unit: it
is (1 - R2) times the variance of the areas over their mean, so it compares with another one only
where this ratio is the same. Intervals of scores come from a bootstrap of the test rows.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from bench import databases
from bench.files import Row
from bench.picture import new_figure
from bench.report import Report, remark
from bench.surrogates import cost as times
from bench.surrogates.fitting import fit, parted, read, request_for
from gen.arrays import Values
from gen.runtime.errors import InputError
from learn.comparison.paper import SPREAD
from learn.dataset import Dataset
from learn.features import SETS, FeatureSet, SurfaceFeatures, chosen
from learn.features.sets import BLOCKS
from learn.metrics import bootstrap, scores
from learn.request import Request

LEVEL = 0.9  # of the intervals whose coverage is counted
SMALL = 0.5  # area below which relative errors are told [%]
QUARTERS = 4

MEANS = ("nmse", "nmae", "r2", "small_median", "small_p95", "covered", "solves")
MEAN_LINE = (
    "nMSE {nmse:.3f} %, nMAE {nmae:.2f} %, R2 {r2:.3f} %; areas below 0.5 %: {small_median:.1f} %"
    " off in the middle, 95 % of them within {small_p95:.1f} %; {covered:.1%} in 90 %; the features"
    " of an answer take {solves:.2f} solves"
)


@dataclass(frozen=True)
class Variant:
    """A feature set as surrogates see it."""

    name: str
    features: str
    blocks: int = BLOCKS

    @property
    def wanted(self) -> FeatureSet:
        """The columns."""
        return chosen(self.features, roots=True, blocks=self.blocks)

    def request(self, path: Path, area_max: float) -> Request:
        """Ask for the areas of a database with these features."""
        asked = request_for(path, "kernel-ridge", self.features, area_max)
        return replace(asked, blocks=self.blocks)


VARIANTS = (
    Variant("paper", "paper"),
    Variant("dimensionless", "dimensionless"),
    Variant("hybrid", "hybrid"),
    Variant("hybrid, 65 blocks", "hybrid", blocks=65),
)


@dataclass(frozen=True, eq=False)
class Judged:
    """Test rows of one variant and seed: areas, predictions, ends of intervals, each (n,) [%]."""

    variant: Variant
    seed: int
    trained: int
    calibrated: int
    truth: Values
    predicted: Values
    low: Values
    high: Values

    def relative(self, share: float) -> float:
        """Return a quantile of the relative errors of areas below `SMALL`; NaN without any [%]."""
        small = self.truth < SMALL
        truth = self.truth[small]
        errors = 100 * np.abs(self.predicted[small] - truth) / truth
        return float(np.quantile(errors, share)) if errors.size else np.nan

    @property
    def inside(self) -> Values:
        """1 for rows whose interval holds the truth, else 0, (n,)."""
        return np.asarray((self.low <= self.truth) & (self.truth <= self.high), dtype=np.float64)


def features(
    folder: Path,
    rows: int,
    database: Path | None,
    seeds: Sequence[int],
    features: Sequence[str],
    area_max: float,
    surfaces: int,
) -> Report:
    """Fit and judge every variant on every seed; the arguments are those of the command.

    Raises
    ------
    InputError
        If there are too few rows or no seeds, or a database is another one.
    """
    if rows < 100 or not seeds:
        raise InputError(f"--rows {rows}, --seeds {seeds}: give 100 rows and one seed or more")
    names = [chosen(name) and name for name in features] or list(SETS)
    path = databases.of_the_paper(database, folder / "databases", rows)
    judged: list[Judged] = []
    for variant in (each for each in VARIANTS if each.features in names):
        request = variant.request(path, area_max)
        judged += _judged(variant, request, read(request, rows), seeds)
    scores_, quarters = list(scored(judged, times_in_solves(surfaces))), list(covered(judged))
    return Report(
        {"features": scores_, "coverage": quarters},
        pictures={"features": picture(judged, quarters)},
        text="\n".join(_said(scores_)),
        text_name="features",
    )


def _judged(
    variant: Variant, request: Request, data: Dataset, seeds: Sequence[int]
) -> Iterator[Judged]:
    """Fit one variant to the parts of each seed, and predict the test rows."""
    settings = None
    for seed in seeds:
        parts = parted(data, seed)
        own = replace(request, seed=seed)
        fitted = fit(own, parts.train, parts.calibration, parts.folds, settings)
        settings, test = fitted.settings, parts.test
        error = fitted.scores(test)
        remark(f"{variant.name}, seed {seed}: nMSE {error.nmse:.3f} %, nMAE {error.nmae:.2f} %")
        trained, calibrated = parts.train.size, parts.calibration.size
        predicted, ends = fitted.predict(test), fitted.interval(test, LEVEL)
        yield Judged(variant, seed, trained, calibrated, test.target, predicted, *ends)


def times_in_solves(surfaces: int) -> dict[str, float]:
    """Return times of the features of new surfaces, over that of their contacts, by variant."""
    contacts = times.new_contacts(surfaces)
    solve = times.measure_solver(contacts).solve

    def ask(wanted: FeatureSet, heights: Values, delta: float) -> object:
        sides = times.SIDE, times.SIDE
        return SurfaceFeatures(heights, sides).features(wanted, np.array([delta]))

    return {
        variant.name: times.mean_seconds(partial(ask, variant.wanted, *each) for each in contacts)
        / solve
        for variant in VARIANTS
    }


def scored(judged: Sequence[Judged], solves: dict[str, float]) -> Iterator[Row]:
    """Yield a row of scores for each variant and seed [%]; `ratio` is nMSE over 1 - R2."""
    for each in judged:
        found = scores(each.truth, each.predicted)
        limits = bootstrap(each.truth, each.predicted, LEVEL)
        yield {
            "features": each.variant.name,
            "columns": len(each.variant.wanted.columns),
            "seed": each.seed,
            "trained": each.trained,
            "judged": each.truth.size,
            **vars(found),
            **{
                f"{name}_{end}": value
                for name, ends in limits.items()
                for end, value in zip(("low", "high"), ends, strict=True)
            },
            "ratio": float(each.truth.var() / each.truth.mean()),
            "small_median": each.relative(0.5),
            "small_p95": each.relative(0.95),
            "covered": float(each.inside.mean()),
            "width": float(np.mean(each.high - each.low)),
            "solves": solves[each.variant.name],
        }


def covered(judged: Sequence[Judged]) -> Iterator[Row]:
    """Yield the coverage in each quarter of the area, pooled over the seeds, for each variant.

    The slack is three standard errors of a share of `LEVEL`: of the rows judged, and of the rows
    that calibrated, both of this quarter.
    """
    for name in dict.fromkeys(each.variant.name for each in judged):
        mine = [each for each in judged if each.variant.name == name]
        truth, inside, width = (
            np.concatenate(parts)
            for parts in (
                [each.truth for each in mine],
                [each.inside for each in mine],
                [each.high - each.low for each in mine],
            )
        )
        calibrated = sum(each.calibrated for each in mine) / QUARTERS
        ends = np.quantile(truth, np.arange(QUARTERS + 1) / QUARTERS)
        number = np.clip(np.searchsorted(ends, truth, side="right") - 1, 0, QUARTERS - 1)
        for quarter in range(QUARTERS):
            rows = number == quarter
            share, judges = float(inside[rows].mean()), int(rows.sum())
            slack = 3 * float(np.sqrt(LEVEL * (1 - LEVEL) * (1 / judges + 1 / calibrated)))
            yield {
                "features": name,
                "from": float(ends[quarter]),
                "to": float(ends[quarter + 1]),
                "rows": judges,
                "covered": share,
                "slack": slack,
                "holds": abs(share - LEVEL) <= slack,
                "width": float(width[rows].mean()),
            }


def _said(rows: Sequence[Row]) -> Iterator[str]:
    """Say means over the seeds for each variant, and what the nMSE is."""
    for name in dict.fromkeys(row["features"] for row in rows):
        mine = [row for row in rows if row["features"] == name]
        means = {key: np.mean([row[key] for row in mine]) for key in MEANS}
        yield f"{name}: {MEAN_LINE.format(**means)}"
    ratio = float(np.mean([row["ratio"] for row in rows]))
    yield (
        "The nMSE is (1 - R2) times the variance of the areas over their mean,"
        f" {ratio:.2g} % here and {SPREAD:.2g} % in the paper: compare R2."
    )


def picture(judged: Sequence[Judged], quarters: Sequence[Row]) -> Any:
    """Draw relative errors over the area, and the coverage in the quarters."""
    figure = new_figure(11, 4.5)
    left, right = figure.subplots(1, 2)
    for number, variant in enumerate(VARIANTS):
        mine = [each for each in judged if each.variant.name == variant.name]
        if not mine:
            continue
        truth = np.concatenate([each.truth for each in mine])
        error = np.concatenate([each.predicted - each.truth for each in mine])
        ends = np.quantile(truth, np.arange(17) / 16)
        bins = np.clip(np.searchsorted(ends, truth, side="right") - 1, 0, 15)
        middle = [float(np.median(truth[bins == each])) for each in range(16)]
        typical = [
            100 * float(np.median(np.abs(error[bins == each]) / truth[bins == each]))
            for each in range(16)
        ]
        left.loglog(middle, typical, "o-", ms=3, color=f"C{number}", label=variant.name)
        own = [row for row in quarters if row["features"] == variant.name]
        places = np.arange(QUARTERS) + 0.1 * (number - 1.5)
        right.errorbar(
            places,
            [100 * row["covered"] for row in own],
            [100 * row["slack"] for row in own],
            fmt="o",
            ms=3,
            color=f"C{number}",
        )
    left.set(xlabel="area [%]", ylabel="median relative error [%]", title="(a) errors")
    left.legend(fontsize=8)
    right.axhline(100 * LEVEL, color="0.5", lw=1)
    right.set_xticks(range(QUARTERS), [f"{each + 1}." for each in range(QUARTERS)])
    right.set(xlabel="quarter of the area", ylabel="covered [%]", title="(b) 90 % intervals")
    return figure
