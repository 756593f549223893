"""Cases about what stands round the models: features, splits, scores, cleaning."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from fractions import Fraction
from functools import partial
from typing import Any

import numpy as np

from bench.stability.case import Answer, Case, Finding, Refusal
from bench.stability.models.samples import Values, ordinary
from gen.runtime.errors import InputError
from gen.surface import generate
from learn import dataset
from learn.features import SurfaceFeatures, chosen
from learn.metrics import scores
from learn.split import FOLDS, draw

SIDE = 1000.0
DELTA = 12.0
ROUNDING = 1e-13

SEEDS = 50
"""Draws of each split."""


def cases() -> Iterator[Case]:
    """Family after family."""
    yield from _features()
    yield from _features_refused()
    yield from _splits()
    yield from _scores()
    yield from _scores_refused()
    yield from _remarks()


def _surface() -> Values:
    return generate("diamond-square", 65, 0.65, 12.0, np.random.default_rng(2))


def _features() -> Iterator[Case]:
    for name in ("dimensionless", "hybrid"):
        for what, factor, allowed in (
            ("2^-40", 2.0**-40, 0.0),
            ("2^40", 2.0**40, 0.0),
            ("1e-12", 1e-12, 1e-9),
            ("1e12", 1e12, 1e-9),
        ):
            yield Case(
                "features: units",
                f"all lengths times {what}, {name}",
                f"65 x 65, Δ = {DELTA:g} um, beside the same in um",
                partial(_other_unit, name, factor, allowed),
            )
    for delta in (1e-12, 1e-3, 12.0, 1e3, 1e12):
        asked = "65 x 65, shares and means counted node by node"
        yield Case("features: hybrid", f"Δ = {delta:g} um", asked, partial(_bearing, delta, 0.0))
    asked = "65 x 65, Δ = 12 um, shares and means counted node by node"
    yield Case("features: hybrid", "offset of 1e8 um", asked, partial(_bearing, DELTA, 1e8))
    for shape in ((65, 17), (9, 64), (5, 5)):
        asked = f"{shape[0]} x {shape[1]}, a corner of 65 x 65"
        examine = partial(_bearing, DELTA, 0.0, shape)
        yield Case("features: hybrid", f"{shape[0]} x {shape[1]}", asked, examine)


def _other_unit(name: str, factor: float, allowed: float) -> Answer:
    """Features without units do not change with the unit of length."""
    heights, deltas, wanted = _surface(), np.array([DELTA]), chosen(name)
    first = SurfaceFeatures(heights, (SIDE, SIDE)).features(wanted, deltas)
    sides = (SIDE * factor, SIDE * factor)
    other = SurfaceFeatures(heights * factor, sides).features(wanted, deltas * factor)
    error = float((np.abs(other - first) / np.maximum(np.abs(first), 1)).max())
    out = f"{first.shape[1]} features, {first.min():.4g} to {first.max():.4g}"
    return Answer(out, [Finding("off the same in um", error, allowed)])


def _bearing(delta: float, offset: float, shape: tuple[int, int] = (65, 65)) -> Answer:
    """Bearing share and interference, counted in fractions; all features finite and possible."""
    heights = _surface()[: shape[0], : shape[1]] + offset
    found = SurfaceFeatures(heights, (SIDE, SIDE)).hybrid(delta)
    level = Fraction(float(heights.max())) - Fraction(delta)
    above = [over for z in heights.ravel().tolist() if (over := Fraction(z) - level) > 0]
    share, mean = (
        len(above) / heights.size,
        float(sum(above, Fraction(0)) / heights.size / Fraction(delta)),
    )
    # A displacement of less than the spacing of numbers at the highest node is rounded to it.
    lost = float(np.spacing(float(heights.max()))) / delta
    return Answer(
        f"share {found[0]:.4g}, interference {found[1]:.4g} Δ, coarse area {found[2]:.4g} %",
        [
            Finding("share off a count", abs(found[0] - share), 0),
            Finding("interference off a sum", abs(found[1] - mean), ROUNDING + lost),
            Finding("not finite", int(np.count_nonzero(~np.isfinite(found))), 0),
            Finding("area beyond 100 %", max(found[2] - 100, 0.0), 0),
        ],
    )


def _features_refused() -> Iterator[Case]:
    rough = _surface()
    for name, heights, delta, words in (
        ("flat", np.zeros((9, 9)), DELTA, "statistics undefined"),
        ("no asperity", np.outer(np.arange(9.0), np.ones(9)), DELTA, "no asperity"),
        ("NaN among heights", np.where(rough > 30, np.nan, rough), DELTA, "finite"),
        ("lost in an offset", rough + 1e16, DELTA, "lost in rounding"),
        ("Δ = 0", rough, 0.0, "above 0"),
        ("Δ = -1 um", rough, -1.0, "above 0"),
        ("Δ = NaN", rough, np.nan, "above 0"),
        ("Δ infinite", rough, np.inf, "above 0"),
    ):
        surface = SurfaceFeatures(heights, (SIDE, SIDE))
        call = partial(surface.features, chosen("hybrid"), np.array([delta]))
        yield Case("features: refused", name, "", call, Refusal(InputError, (words,)))


def _splits() -> Iterator[Case]:
    for name, groups in (
        ("90 surfaces", np.arange(90)),
        ("10 rows", np.arange(10)),
        ("one surface", np.zeros(90, np.int64)),
        ("two surfaces", np.arange(90) // 45),
        ("one surface with half of the rows", np.maximum(np.arange(90) - 44, 0)),
    ):
        asked = f"{groups.size} rows, {SEEDS} seeds"
        yield Case("splits", name, asked, partial(_split, groups))


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
    out += f", {refusals} seeds refused" * bool(refusals)
    return Answer(
        out,
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
    for name, known, guessed, allowed in (
        ("ordinary", truth, close, ROUNDING),
        ("times 1e-12", truth * 1e-12, close * 1e-12, ROUNDING),
        ("times 1e12", truth * 1e12, close * 1e12, ROUNDING),
        ("times 1e-150", truth * 1e-150, close * 1e-150, ROUNDING),
        ("times 1e150", truth * 1e150, close * 1e150, ROUNDING),
        # The truth's own rounding, over what it varies by.
        ("offset of 1e8", truth + 1e8, close + 1e8, 1e-6),
        ("two rows", truth[:2], close[:2], ROUNDING),
        ("predictions right", truth, truth, ROUNDING),
        ("predictions 1e12 off", truth, truth + 1e12, ROUNDING),
    ):
        asked = f"{known.size} rows, beside fractions"
        yield Case("scores", name, asked, partial(_score, known, guessed, allowed))


def _score(truth: Values, guessed: Values, allowed: float) -> Answer:
    found = scores(truth, guessed)
    known, said = ([Fraction(each) for each in values.tolist()] for values in (truth, guessed))
    rest = [a - b for a, b in zip(known, said, strict=True)]
    mean = sum(known, Fraction(0)) / len(known)
    squares = sum((each * each for each in rest), Fraction(0))
    expected = {
        "nmse": squares / len(rest) / mean,
        "nmae": sum(abs(each) for each in rest) / len(rest) / mean,
        "nmaxe": max(abs(each) for each in rest) / max(abs(each) for each in known),
        "r2": 1 - squares / sum((each - mean) ** 2 for each in known),
    }
    errors = {
        name: _relative(getattr(found, name), 100 * value) for name, value in expected.items()
    }
    worst = max(errors, key=lambda name: errors[name])
    out = f"R2 {found.r2:.6g} %, nMAE {found.nmae:.4g} %"
    return Answer(out, [Finding(f"off fractions: {worst}", errors[worst], allowed)])


def _relative(value: float, expected: Fraction | float) -> float:
    off = abs(Fraction(value) - Fraction(expected))
    return float(off / abs(Fraction(expected))) if expected else float(off)


def _scores_refused() -> Iterator[Case]:
    truth = np.arange(1.0, 6.0)
    for name, known, guessed, words in (
        ("constant truth", np.ones(5), truth, "must vary"),
        ("truth of mean zero", truth - 3, truth, "mean other than zero"),
        ("one row", truth[:1], truth[:1], "must vary"),
        ("other lengths", truth, truth[:3], "one length"),
        ("NaN predicted", truth, truth * np.nan, "NaN"),
        ("infinite truth", truth * np.inf, truth, "infinity"),
    ):
        call = partial(scores, known, guessed)
        yield Case("scores: refused", name, "", call, Refusal(ValueError, (words,)))


def _remarks() -> Iterator[Case]:
    rows = ordinary()
    for name, change, words in (
        ("a constant input", lambda x: np.where(np.arange(23) == 5, 0.25, x), "constant over all"),
        ("rows twice", lambda x: x, "repeat others exactly"),
        ("one input dominant", lambda x: np.where(np.arange(23) == 20, x * 1e12, x), "say nothing"),
    ):
        yield Case("remarks", name, f"{rows.size} rows", partial(_remarked, name, change, words))


def _remarked(name: str, change: Callable[[Values], Values], words: str) -> Answer:
    """What is odd about inputs is said before a fit."""
    rows = ordinary()
    if name == "rows twice":
        rows = rows.at(np.concatenate([np.arange(90), np.arange(45)]))
    said = dataset.remarks(replace(rows, inputs=change(rows.inputs)), "l2")
    return Answer(
        "; ".join(said), [Finding("unsaid", int(not any(words in line for line in said)), 0)]
    )
