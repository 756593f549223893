"""What the numbers of a case amount to, in a line: does it hold, does it say so, what mends it."""

import math
from collections.abc import Iterator, Sequence

from bench.surrogates.cases import HOME
from bench.surrogates.generalisation import LEVEL, Row

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
    state = state_of(row)
    parts = [f"{state}: {row.ratio:.3g} x the error at home"]
    if row.tested_on == HOME:
        parts = ["the measure for the others"]
    parts.append(_intervals(row))
    if state != "holds":
        parts.append(_warning(row))
    if row.grid_nmae > row.reference:
        parts.append(f"the solved area itself changes by {row.grid_nmae:.3g} % with the grid")
    if state != "holds" or not covers(row):
        parts.append(_cure(row, rows))
    return "; ".join(parts)


def state_of(row: Row) -> str:
    """Whether it "holds", is "worse" but of use, or "fails"."""
    if row.ratio <= HOLDS:
        return "holds"
    return "worse" if row.ratio <= USABLE and row.r2 >= USABLE_R2 else "fails"


def covers(row: Row) -> bool:
    """Whether as many truths lie in the intervals as should, or more."""
    return row.covered >= LEVEL - row.slack


def _intervals(row: Row) -> str:
    if covers(row):
        return "intervals hold"
    return f"intervals too narrow ({row.covered:.0%} inside)"


def _warning(row: Row) -> str:
    if row.flagged > WARNED:
        return f"says so ({row.flagged:.0%} of rows flagged)"
    return f"does not say so (only {row.flagged:.0%} of rows flagged)"


def _cure(row: Row, rows: Sequence[Row]) -> str:
    """What was seen to mend it, or to help at least, by the errors it leaves."""
    tried = list(_tried(row, rows))
    better = [(error, words) for error, words in tried if error <= MENDS * row.nmae]
    mended = [words for error, words in better if error <= USABLE * row.reference]
    helped = [words for _, words in better if words not in mended]
    found = [f"mended by {', or '.join(mended)}"] if mended else []
    if helped:
        found.append(f"helped by {', or '.join(helped)}")
    if not covers(row) and row.mending and row.mended_covered >= LEVEL - row.slack:
        found.append(f"intervals calibrated on such rows hold ({row.mended_covered:.0%} inside)")
    if not better:
        found.insert(0, "nothing tried here mends its error")
    return "; ".join(found)


def _tried(row: Row, rows: Sequence[Row]) -> Iterator[tuple[float, str]]:
    """What was tried: the error that it leaves [%], in words."""
    others = [
        other
        for other in rows
        if (other.tested_on, other.model) == (row.tested_on, row.model)
        and other.features != row.features
    ]
    if others:
        best = min(others, key=lambda other: other.nmae)
        instead = f"(nMAE {best.nmae:.3g} instead of {row.nmae:.3g} %)"
        yield best.nmae, f"{best.features} features {instead}"
    if row.mending:
        yield row.mended_nmae, f"{row.mending} rows of it (nMAE {row.mended_nmae:.3g} %)"
    if not math.isnan(row.resampled_nmae):
        yield row.resampled_nmae, f"features of every second node (nMAE {row.resampled_nmae:.3g} %)"
