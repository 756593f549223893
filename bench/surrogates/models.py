"""Error of the nine models against the time that predictions, fits and searches take.

Read from a folder of `learn compare` and `learn tune`, whose fits were timed alone, on one thread.
"""

from collections.abc import Iterable
from pathlib import Path

from bench.files import Row, read_table
from gen.runtime.errors import InputError

TIMES = "predict_s", "fit_s", "search_s"
"""Kinds of run time; None where there is none."""


def models(comparison: Path, target: str = "area") -> list[Row]:
    """Read errors and times of all models that a comparison has results of, in Table 4's order.

    A row has a model with its result (`baseline` or `tuned`), and the kinds of time in which no
    other beats it in both error and time (`front`).

    Raises
    ------
    InputError
        If the folder has no scores and times.
    """
    try:
        scores, times, searches = (
            read_table(comparison / target / name)[1]
            for name in ("scores.csv", "times.csv", "tuning-times.csv")
        )
    except InputError as error:
        raise InputError(f"{error}; give a folder of learn compare or learn tune") from None
    timed = {(row["model"], row["result"]): row for row in times}
    searched = {(row["model"], "tuned"): float(row["fit_seconds"]) for row in searches}
    found: list[Row] = []
    for row in scores:
        key = row["model"], row["result"]
        if key in timed and not row["failure"]:
            errors = {name: float(row[name]) for name in ("nmae", "r2")}
            answer, fit = (float(timed[key][name]) for name in ("predict_row_s", "fit_s"))
            spent = {"predict_s": answer, "fit_s": fit, "search_s": searched.get(key)}
            found.append({"model": key[0], "result": key[1], **errors, **spent})
    if not found:
        raise InputError(f"{comparison}: has no scores and times of {target}; run learn compare")
    fronts = {time.removesuffix("_s"): front(found, time) for time in TIMES}
    for cost in found:
        cost["front"] = " ".join(name for name, best in fronts.items() if cost in best)
    return found


def front(costs: Iterable[Row], time: str) -> list[Row]:
    """Return those that no other beats in both error and a time, the fastest first."""
    kept: list[Row] = []
    known = (cost for cost in costs if cost[time] is not None)
    for cost in sorted(known, key=lambda cost: (cost[time], cost["nmae"])):
        if not kept or cost["nmae"] < kept[-1]["nmae"]:
            kept.append(cost)
    return kept
