"""Disturbances by samples: some raise, some give NaN, some never end, one has a bug."""

import time

import numpy as np

from gen.schema import Reason
from tests.faults.rows import Columns, difference, finished, row_fault
from tests.faults.runs import await_lock
from tests.faults.stage import Found, Stage, code_fault

LIMIT = 2.0
"""Wall-clock limit of a sample that never ends [s]; ordinary ones take milliseconds."""

AILING = 3
"""Samples that ail in one run, at most: each that never ends takes `LIMIT`."""


def sample_raises(stage: Stage) -> Found:
    """Raise an arithmetic error in samples."""
    return _failing(stage, "raises", Reason.ARITHMETIC)


def sample_returns_nan(stage: Stage) -> Found:
    """Return NaN from samples."""
    return _failing(stage, "returns_nan", Reason.NOT_FINITE)


def sample_does_not_converge(stage: Stage) -> Found:
    """Run samples into the bound on iterations."""
    return _failing(stage, "does_not_converge", Reason.NOT_CONVERGED)


def sample_never_ends(stage: Stage) -> Found:
    """Run samples into the wall-clock limit: they stay pending, the others are done."""
    rows = _rows(stage)
    began = time.monotonic()
    with stage.run(
        stage.ranks(), "--sample-limit", f"{LIMIT:g}", ailments=dict.fromkeys(rows, "never_ends")
    ) as run:
        ended = run.wait()
    seconds = time.monotonic() - began
    now = stage.columns()
    if ended.code or "took longer than --sample-limit" not in ended.text:
        fault = f"exit code {ended.code} without the warning of --sample-limit"
    elif now is None or finished(now)[rows].any():
        fault = "a sample beyond the limit was finished"
    else:
        fault = ""
    return Found(f"rows {_listed(rows)}", fault, seconds=seconds)


def sample_has_a_bug(stage: Stage) -> Found:
    """Raise a bug in a sample: the run ends at once and says where; nothing else is lost."""
    row = _rows(stage)[0]
    began = time.monotonic()
    with stage.run(stage.ranks(), ailments={row: "has_a_bug"}) as run:
        ended = run.wait()
        await_lock(stage.path)
    seconds = time.monotonic() - began
    fault = code_fault(ended, stage.columns())
    if ended.code in {0, 2} or "TypeError: injected" not in ended.text:
        fault = f"exit code {ended.code} without the bug's traceback"
    return Found(f"row {row}", fault, seconds=seconds)


def _failing(stage: Stage, ailment: str, reason: Reason) -> Found:
    """Let samples fail, see that they say why, and have them computed again."""
    rows = _rows(stage)
    before = stage.columns()
    began = time.monotonic()
    with stage.run(stage.ranks(), ailments=dict.fromkeys(rows, ailment)) as run:
        ended = run.wait()
    seconds = time.monotonic() - began
    failed = stage.columns()
    fault = _failed_fault(stage, ended.code, before, failed, dict.fromkeys(rows, int(reason)))
    with stage.run(stage.ranks(), "--retry-failed") as run:
        again = run.wait()
    if not fault and again.code:
        fault = f"exit code {again.code} of --retry-failed"
    fault = fault or difference(stage.columns(), stage.reference)
    return Found(f"rows {_listed(rows)}", fault, seconds=seconds)


def _failed_fault(
    stage: Stage, code: int, before: Columns | None, now: Columns | None, failed: dict[int, int]
) -> str:
    """What is wrong with a run some of whose samples have failed."""
    if code:
        return f"exit code {code} because of failed samples"
    if now is None or not finished(now).all():
        return "rows are pending beside the failed ones"
    return row_fault(before, now, stage.reference, failed)


def _rows(stage: Stage) -> list[int]:
    """Some of the pending rows, at random."""
    pending = stage.pending()
    number = min(int(stage.random.integers(1, AILING, endpoint=True)), len(pending))
    chosen = np.sort(stage.random.choice(pending, number, replace=False))
    return [int(row) for row in chosen]


def _listed(rows: list[int]) -> str:
    return ", ".join(str(row) for row in rows)
