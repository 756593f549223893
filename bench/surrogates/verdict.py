"""What the numbers of a case amount to, in a line: does it hold, does it say so, what mends it."""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from bench.surrogates.cases import HOME
from bench.surrogates.generalisation import LEVEL

Row = Mapping[str, Any]
"""A case as `bench.surrogates.generalisation.judge` describes it."""

HOLDS = 1.5
"""Times the reference's error up to which a surrogate is as good as where it was trained."""

USABLE, USABLE_R2 = 4.0, 95.0
"""Times the reference's error, and R2 [%], within which it is worse but not useless."""

WARNED = 0.5
"""Share of flagged rows above which a user would notice."""

MENDS = 0.7
"""Times the error that is left, at most, by what is called a cure."""


def verdict(row: Row, rows: Sequence[Row]) -> str:
    """Judge a row among all rows of a table."""
    state, flagged = state_of(row), row["flagged"]
    parts = [f"{state}: {row['nmae'] / row['reference']:.3g} x the error at home"]
    if row["tested_on"] == HOME:
        parts = ["the measure for the others"]
    narrow = f"intervals too narrow ({row['covered']:.0%} inside)"
    parts.append("intervals hold" if covers(row) else narrow)
    if state != "holds" and flagged > WARNED:
        parts.append(f"says so ({flagged:.0%} of rows flagged)")
    elif state != "holds":
        parts.append(f"does not say so (only {flagged:.0%} of rows flagged)")
    if row["grid_nmae"] > row["reference"]:
        parts.append(f"the solved area itself changes by {row['grid_nmae']:.3g} % with the grid")
    if state != "holds" or not covers(row):
        parts.extend(_cures(row, rows))
    return "; ".join(parts)


def state_of(row: Row) -> str:
    """Say whether it "holds", is "worse" but of use, or "fails"."""
    ratio = row["nmae"] / row["reference"]
    if ratio <= HOLDS:
        return "holds"
    return "worse" if ratio <= USABLE and row["r2"] >= USABLE_R2 else "fails"


def covers(row: Row) -> bool:
    """Say whether as many truths lie in the intervals as should, or more."""
    return bool(row["covered"] >= LEVEL - row["slack"])


def _cures(row: Row, rows: Sequence[Row]) -> Iterator[str]:
    """Yield what was seen to mend it, or to help at least, by the errors it leaves."""
    better = {words: error for error, words in _tried(row, rows) if error <= MENDS * row["nmae"]}
    mended = [words for words, error in better.items() if error <= USABLE * row["reference"]]
    helped = [words for words in better if words not in mended]
    if not better:
        yield "nothing tried here mends its error"
    if mended:
        yield f"mended by {', or '.join(mended)}"
    if helped:
        yield f"helped by {', or '.join(helped)}"
    inside = row["mended_covered"]
    if not covers(row) and row["mending"] and inside >= LEVEL - row["slack"]:
        yield f"intervals calibrated on such rows hold ({inside:.0%} inside)"


def _tried(row: Row, rows: Sequence[Row]) -> Iterator[tuple[float, str]]:
    """Yield what was tried: the error that it leaves [%], in words."""
    same, nmae = ("tested_on", "model"), row["nmae"]
    alike = [each for each in rows if all(each[name] == row[name] for name in same)]
    others = [each for each in alike if each["features"] != row["features"]]
    if others:
        best = min(others, key=lambda other: other["nmae"])
        instead = f"(nMAE {best['nmae']:.3g} instead of {nmae:.3g} %)"
        yield best["nmae"], f"{best['features']} features {instead}"
    if row["mending"]:
        yield row["mended_nmae"], f"{row['mending']} rows of it (nMAE {row['mended_nmae']:.3g} %)"
    resampled = row["resampled_nmae"]
    if not math.isnan(resampled):
        yield resampled, f"features of every second node (nMAE {resampled:.3g} %)"
