"""Questions about Asperity and the measured answers: the lines at the top of the page.

Each line is made of tables of one report, which names the command that made them.
"""

from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from typing import NamedTuple

from bench.files import is_there, named, read_table
from bench.record import Inputs
from bench.report import Part

Row = dict[str, str]

NOT_OTHERS = {"bem", "paper's NNLS"}
"""Solvers among the peers that are not another program."""


class Line(NamedTuple):
    """A line of the page: a question, the answer, and the part that it comes from."""

    question: str
    answer: str
    part: str


def lines(parts: Sequence[Part], inputs: Inputs) -> list[Line]:
    """Answer all questions whose tables are there and hold the answer."""
    known = {part.name: inputs.folder(part) for part in parts}
    found = []
    for question, part, tables, answer in ASKED:
        paths = named(known[part], tables) if part in known else []
        rows = [row for path in filter(is_there, paths) for row in read_table(path)[1]]
        with suppress(LookupError, ValueError):  # a short run has fewer rows
            if rows and (said := answer(rows)):
                found.append(Line(question, said, part))
    return found


def hertz(rows: list[Row]) -> str:
    """Error of the force on a sphere on the finest grid, at the largest displacement."""
    deepest = max(float(row["delta_um"]) for row in rows)
    last = [row for row in rows if float(row["delta_um"]) == deepest]
    (exact,) = (float(row["force_uN"]) for row in last if row["solution"] == "hertz")
    ours = {
        int(float(row["nodes"])): float(row["force_uN"])
        for row in last
        if row["solution"] == "uniform-pressure"
    }
    error = 100 * abs(ours[max(ours)] / exact - 1)
    return (
        f"The force on a sphere is within {error:.2g} % of Hertz's, {max(ours)} nodes a side,"
        f" pressed in by {deepest:g} um."
    )


def beside_others(case: str, rows: list[Row]) -> str:
    """Tell the time of the fastest other solver over ours, from the least of all cases on."""
    ratios: dict[tuple[str, ...], float] = {}
    for row in rows:
        if row["times_ours"] and row["solver"] not in NOT_OTHERS:
            key = tuple(row[name] for name in case.split())
            ratios[key] = min(ratios.get(key, float("inf")), float(row["times_ours"]))
    least, most = min(ratios.values()), max(ratios.values())
    return f"The fastest other solver takes {least:.2g} to {most:.2g} times our time."


def stability(rows: list[Row]) -> str:
    """Cases that pass, of all."""
    passed = sum(row["verdict"] == "passed" for row in rows)
    return f"{passed} of {len(rows)} stiff and extreme cases pass."


def growth(rows: list[Row]) -> str:
    """Growth of the convolutions from the smallest grid to the largest."""
    sizes = sorted({int(row["nodes"]) for row in rows})
    most = max(float(row["growth"]) for row in rows if int(row["nodes"]) == sizes[-1])
    return (
        f"From {sizes[0]} to {sizes[-1]:,} nodes a side the convolutions of a solve grow by a"
        f" factor of {most:.2g} at most."
    )


def comparison(rows: list[Row]) -> str:
    """Best of the nine models with the paper's features, beside the paper's best."""
    ours, theirs = (
        max(
            (row for row in rows if row[name]),
            key=lambda row: float(row[name]),
            default=None,
        )
        for name in ("r2", "paper_r2")
    )
    if ours is None:
        return ""
    best = (
        f"With a split by surfaces, the best of nine models ({ours['model']}) reaches R2"
        f" {float(ours['r2']):.2f} % of the area"
    )
    if theirs is None:  # other features or another database than the paper's
        return f"{best}."
    return f"{best}; the paper's best ({theirs['model']}) has {float(theirs['paper_r2']):.2f} %."


def exactness(rows: list[Row]) -> str:
    """Error of the area with hybrid features, learnt from all rows, on rows that judge."""
    best = max(
        (r for r in rows if r["features"] == "hybrid"), key=lambda r: int(r["trained"])
    )
    return (
        f"New surfaces of the same kind: nMAE {float(best['nmae']):.2f} % of the area, R2"
        f" {float(best['r2']):.2f} %, learnt from {int(best['trained']):,} rows."
    )


def coverage(rows: list[Row]) -> str:
    """Populations whose rows without a flag are covered as promised."""
    judged = [row for row in rows if "flagged" not in row["verdict"]]
    met = sum(row["verdict"].startswith("met") for row in judged)
    worst = min(judged, key=lambda row: float(row["covered_unflagged"]))
    share, rest = 100 * float(worst["covered_unflagged"]), len(rows) - len(judged)
    return (
        f"In {met} of {len(judged)} shifted populations and targets 90 % intervals hold at least"
        f" 86 % of the rows without a flag, to within the error. Least, {share:.0f} %:"
        f" {worst['target']} of '{worst['tested_on']}', learnt from '{worst['trained_on']}'. In"
        f" {rest} more nearly all rows are flagged."
    )


def scans(rows: list[Row]) -> str:
    """Errors on unseen tiles of maps, for each size of window."""
    whole = [
        row for row in rows if row["left_out"] == "unseen tiles" and row["map"] == "all"
    ]
    sizes = "; ".join(
        f"{row['nodes']} nodes a side: R2 {float(row['r2']):.2f} %, nMAE {float(row['nmae']):.2g} %"
        for row in sorted(whole, key=lambda row: int(row["nodes"]))
    )
    return f"Parts of maps that were not trained on: {sizes}." if sizes else ""


def grow(rows: list[Row]) -> str:
    """Promises of accuracy that hold on fresh surfaces."""
    kept = sum(float(row["fresh_nmae"]) <= float(row["asked"]) for row in rows)
    return (
        f"The accuracy asked for holds on fresh surfaces in {kept} of {len(rows)} cases."
    )


def cost(rows: list[Row]) -> str:
    """Contacts from which on a surrogate costs less than solving."""
    (row,) = (
        row
        for row in rows
        if (row["asked"], row["solver"], row["features"])
        == ("new surfaces", "ours", "hybrid")
    )
    return (
        f"From {int(row['break_even']):,} contacts of new surfaces on, with"
        f" {int(row['rows']):,} rows to train on; an answer takes"
        f" {float(row['query']) / float(row['solve']):.2g} of the time of a solve."
    )


FREE = partial(beside_others, "nodes hurst delta_um")
PERIODIC = partial(beside_others, "nodes hurst mean_pressure")
Answer = Callable[[list[Row]], str]
ASKED: tuple[tuple[str, str, str, Answer], ...] = (
    ("How exact is a contact?", "hertz", "hertz.csv", hertz),
    ("How fast, at equal accuracy?", "peers", "peers.csv", FREE),
    ("How fast on periodic patches?", "periodic", "periodic.csv", PERIODIC),
    ("Does it bear stiff and extreme cases?", "stability", "*.csv", stability),
    ("Do fine grids cost more steps?", "growth", "growth.csv", growth),
    (
        "How near do its models come to the paper's?",
        "comparison",
        "area/scores.csv",
        comparison,
    ),
    ("How exact is a surrogate?", "cost", "learning.csv", exactness),
    ("Does it know what it does not know?", "coverage", "coverage.csv", coverage),
    ("What of measured maps?", "scans", "scans.csv", scans),
    ("Is the accuracy asked for kept?", "grow", "grow.csv", grow),
    ("When does a surrogate pay?", "cost", "cost.csv", cost),
)
"""Questions in the order of the page, each with its part, the tables of that part (a * in a name
stands for several), and the function that puts their rows into words."""
