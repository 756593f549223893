"""A campaign as lines and a table for people."""

import io
from collections.abc import Sequence
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table

from tests.faults.campaign import KINDS, Round
from tests.faults.runs import BOUND


def line(number: int, done: Round) -> str:
    """One round in one line."""
    verdict = done.fault or ("ok" if done.hit or not done.kind else "came too late")
    return (
        f"{number:3} {done.kind or 'nothing':24} {done.detail:32} {done.before:5} ->"
        f" {done.after:5} rows, end after {done.seconds:4.1f} s: {verdict}"
    )


def by_kind(rounds: Sequence[Round]) -> list[dict[str, Any]]:
    """Rows of a table: faults of each kind, and what came of them."""
    most = max((done.after for done in rounds), default=0)
    rows = []
    for kind in KINDS:
        mine = [done for done in rounds if done.kind == kind]
        hits = [done for done in mine if done.hit]
        if mine:
            rows.append(
                {
                    "kind": kind,
                    "injected": len(hits),
                    "partly_done": sum(0 < e.before < most or 0 < e.after < most for e in hits),
                    "longest_end_s": max(done.seconds for done in mine),
                    "wrong": _faults(mine),
                    "verdict": "failed" if _faults(mine) else "passed",
                }
            )
    return rows


def summary(rounds: Sequence[Round]) -> str:
    """A table by kind, and the verdict in words."""
    table = Table(box=box.SIMPLE_HEAD, title_justify="left")
    for title in ("kind", "injected", "file partly done", "longest end [s]", "faults"):
        table.add_column(title, justify="left" if title == "kind" else "right")
    for row in by_kind(rounds):
        kind, injected, partly, longest, wrong, _ = row.values()
        table.add_row(kind, str(injected), str(partly), f"{longest:.1f}", str(wrong))
    text = io.StringIO()
    Console(file=text, width=120).print(table)
    injected = sum(done.hit for done in rounds)
    kinds = len({done.kind for done in rounds if done.hit})
    text.write(
        f"{injected} faults of {kinds} kinds injected; {_faults(rounds)} times a row was lost, done"
        f" twice or wrong, an answer was wrong, or a run took more than {BOUND:g} s to end\n"
    )
    return text.getvalue()


def _faults(rounds: Sequence[Round]) -> int:
    return sum(bool(done.fault) for done in rounds)
