"""Cases about the steps before and after the models: features, splits, scores, cleaning."""

from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from functools import partial
from typing import Any

import numpy as np

from bench.stability.case import EXACT_FACTORS, FACTORS, Answer, Case, Finding, Refusal
from bench.stability.models import samples
from bench.stability.models.samples import ordinary
from bench.stability.surfaces.exact import fractions
from gen.arrays import Values
from gen.runtime.errors import InputError
from gen.surface import generate
from learn import dataset
from learn.features import SurfaceFeatures, Undefined, chosen
from learn.metrics import scores
from learn.split import FOLDS, draw

SIDE = 1000.0
DELTA = 12.0
ROUNDING = 1e-13

SEEDS = 50  # draws of each split


def cases() -> Iterator[Case]:
    """Family after family."""
    yield from _features()
    yield from _features_refused()
    for name, groups in (
        ("90 surfaces", np.arange(90)),
        ("10 rows", np.arange(10)),
        ("one surface", np.zeros(90, np.int64)),
        ("two surfaces", np.arange(90) // 45),
        ("one surface with half of the rows", np.maximum(np.arange(90) - 44, 0)),
    ):
        asked = f"{groups.size} rows, {SEEDS} seeds"
        yield Case("splits", name, asked, partial(_split, groups))
    yield from _scores()
    yield from _scores_refused()
    yield from _remarks()


def _surface() -> Values:
    return generate("diamond-square", 65, 0.65, 12.0, np.random.default_rng(2))


def _features() -> Iterator[Case]:
    for name in ("dimensionless", "hybrid"):
        for what, factor in FACTORS.items():
            allowed = 0.0 if what in EXACT_FACTORS else 1e-9
            asked = f"65 x 65, Δ = {DELTA:g} um, beside the same in um"
            examine = partial(_other_unit, name, factor, allowed)
            yield Case("features: units", f"all lengths times {what}, {name}", asked, examine)
    case, counted = partial(Case, "features: hybrid"), "shares and means counted node by node"
    heights = _surface()
    for delta in (1e-12, 1e-3, 12.0, 1e3, 1e12):
        yield case(f"Δ = {delta:g} um", f"65 x 65, {counted}", partial(_bearing, heights, delta))
    asked = f"65 x 65, Δ = 12 um, {counted}"
    yield case("offset of 1e8 um", asked, partial(_bearing, heights + 1e8))
    for rows, columns in ((65, 17), (9, 64), (5, 5)):
        name, corner = f"{rows} x {columns}", heights[:rows, :columns]
        yield case(name, f"{name}, a corner of 65 x 65", partial(_bearing, corner))


def _other_unit(name: str, factor: float, allowed: float) -> Answer:
    """Features without units do not change with the unit of length."""
    heights, deltas, wanted = _surface(), np.array([DELTA]), chosen(name)
    first = SurfaceFeatures(heights, (SIDE, SIDE)).features(wanted, deltas)
    sides = (SIDE * factor, SIDE * factor)
    other = SurfaceFeatures(heights * factor, sides).features(wanted, deltas * factor)
    error = float((np.abs(other - first) / np.maximum(np.abs(first), 1)).max())
    out = f"{first.shape[1]} features, {first.min():.4g} to {first.max():.4g}"
    return Answer(out, [Finding("off the same in um", error, allowed)])


def _bearing(heights: Values, delta: float = DELTA) -> Answer:
    """Bearing share and interference, counted in fractions; all features finite and possible."""
    found = SurfaceFeatures(heights, (SIDE, SIDE)).hybrid(delta)
    above = fractions(heights) - (Fraction(float(heights.max())) - Fraction(delta))
    above = above[above > 0]
    mean = float(Fraction(above.sum()) / heights.size / Fraction(delta))
    # A displacement of less than the spacing of numbers at the highest node is rounded to it.
    lost = float(np.spacing(float(heights.max()))) / delta
    return Answer(
        f"share {found[0]:.4g}, interference {found[1]:.4g} Δ, coarse area {found[2]:.4g} %",
        [
            Finding("share off a count", abs(found[0] - above.size / heights.size), 0),
            Finding("interference off a sum", abs(found[1] - mean), ROUNDING + lost),
            Finding("not finite", int(np.count_nonzero(~np.isfinite(found))), 0),
            Finding("area beyond 100 %", max(found[2] - 100, 0.0), 0),
        ],
    )


def _features_refused() -> Iterator[Case]:
    rough = _surface()
    for name, heights, delta, error, words in (
        ("flat", np.zeros((9, 9)), DELTA, Undefined, "statistics undefined"),
        ("no asperity", np.outer(np.arange(9.0), np.ones(9)), DELTA, Undefined, "no asperity"),
        ("NaN among heights", np.where(rough > 30, np.nan, rough), DELTA, InputError, "finite"),
        ("lost in an offset", rough + 1e16, DELTA, Undefined, "lost in rounding"),
        ("Δ = 0", rough, 0.0, InputError, "above 0"),
        ("Δ = -1 um", rough, -1.0, InputError, "above 0"),
        ("Δ = NaN", rough, np.nan, InputError, "above 0"),
        ("Δ infinite", rough, np.inf, InputError, "above 0"),
    ):
        surface = SurfaceFeatures(heights, (SIDE, SIDE))
        call = partial(surface.features, chosen("hybrid"), np.array([delta]))
        yield Case("features: refused", name, "", call, Refusal(error, (words,)))


def _split(groups: Any) -> Answer:
    """Every row once, no surface on both sides, none in two folds."""
    rows = replace(ordinary().at(np.arange(groups.size)), groups=groups)
    lost = shared = torn = refusals = tested = 0
    for seed in range(SEEDS):
        try:
            split = draw(rows, seed)
        except InputError:  # one test row, where the next surface would be too many
            refusals += 1
            continue
        both = np.concatenate([split.train, split.test])
        lost += int(np.count_nonzero(np.sort(both) != np.arange(groups.size)))
        torn += int(split.folds.min() < 0 or split.folds.max() >= FOLDS)
        tested += split.test.size
        if np.ptp(groups) > 0:
            inside = groups[split.train].tolist()
            shared += np.intersect1d(inside, groups[split.test]).size
            torn += len(set(zip(inside, split.folds.tolist(), strict=True))) - len(set(inside))
    out = f"{tested / max(SEEDS - refusals, 1):.3g} of {groups.size} rows test"
    return Answer(
        out + f", {refusals} seeds refused" * bool(refusals),
        [
            Finding("rows lost or twice", lost, 0),
            Finding("surfaces on both sides", shared, 0),
            Finding("surfaces in two folds", torn, 0),
            Finding("share of seeds refused", refusals / SEEDS, 0.1),
        ],
    )


def _scores() -> Iterator[Case]:
    random = np.random.default_rng(4)
    truth = random.uniform(1, 16, 50)
    close = truth + random.normal(0, 0.1, 50)
    sizes = {"1e-12": 1e-12, "1e12": 1e12, "1e-150": 1e-150, "1e150": 1e150}
    for name, known, guessed in (
        ("ordinary", truth, close),
        *((f"times {name}", truth * size, close * size) for name, size in sizes.items()),
        ("offset of 1e8", truth + 1e8, close + 1e8),
        ("two rows", truth[:2], close[:2]),
        ("predictions right", truth, truth),
        ("predictions 1e12 off", truth, truth + 1e12),
    ):
        # An offset costs the truth's own rounding, over what it varies by.
        allowed, asked = 1e-6 if "offset" in name else ROUNDING, f"{known.size} rows"
        examine = partial(_score, known, guessed, allowed)
        yield Case("scores", name, f"{asked}, beside fractions", examine)


def _score(truth: Values, guessed: Values, allowed: float) -> Answer:
    found, known, number = scores(truth, guessed), fractions(truth), truth.size
    rest, mean = known - fractions(guessed), known.sum() / number
    expected: dict[str, Fraction] = {
        "nmse": (rest**2).sum() / number / mean,
        "nmae": abs(rest).sum() / number / mean,
        "nmaxe": abs(rest).max() / abs(known).max(),
        "r2": 1 - (rest**2).sum() / ((known - mean) ** 2).sum(),
    }
    errors = {
        name: float(abs(Fraction(getattr(found, name)) / 100 - value) / (abs(value) or 1))
        for name, value in expected.items()
    }
    worst = max(errors, key=lambda name: errors[name])
    out = f"R2 {found.r2:.6g} %, nMAE {found.nmae:.4g} %"
    return Answer(out, [Finding(f"off fractions: {worst}", errors[worst], allowed)])


def _scores_refused() -> Iterator[Case]:
    truth = np.arange(1.0, 6.0)
    for name, known, guessed, words in (
        ("constant truth", np.ones(5), truth, "must vary"),
        ("no row", truth[:0], truth[:0], "must vary"),
        ("one row", truth[:1], truth[:1], "must vary"),
        ("other lengths", truth, truth[:3], "one length"),
        ("NaN predicted", truth, truth * np.nan, "NaN"),
        ("infinite truth", truth * np.inf, truth, "infinity"),
    ):
        call = partial(scores, known, guessed)
        yield Case("scores: refused", name, "", call, Refusal(ValueError, (words,)))


def _remarks() -> Iterator[Case]:
    for name, change, words in (
        ("a constant input", samples.CONSTANT_COLUMN, "constant over all"),
        ("rows twice", lambda rows: rows.at(np.r_[:90, :45]), "repeat others exactly"),
        ("one input dominant", samples.DOMINANT_COLUMN, "say nothing"),
    ):
        yield Case("remarks", name, "90 rows", partial(_remarked, change, words))


def _remarked(change: samples.Change, words: str) -> Answer:
    """What is odd about inputs is said before a fit."""
    said = dataset.remarks(change(ordinary()), "l2")
    unsaid = not any(words in line for line in said)
    return Answer("; ".join(said), [Finding("unsaid", int(unsaid), 0)])
