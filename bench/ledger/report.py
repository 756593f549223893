"""Compare the ledger with new counts, or update it."""

from collections.abc import Callable

from bench.ledger.jobs import job_counts
from bench.ledger.solves import solve_counts
from bench.ledger.table import (
    LEDGER,
    faults,
    read,
    text_table,
    updated,
    write_entries,
)
from gen.runtime.output import Output, check_outputs


def report(say: Callable[[str], None], reason: str | None = None) -> list[str]:
    """Count everything, print it beside the ledger, and update the ledger if there is a reason.

    Parameters
    ----------
    say : callable
        Function that prints a text.
    reason : str, optional
        Why counts have changed; with it, the file of the ledger is written.

    Returns
    -------
    list of str
        One line for each count out of its bound; none after an update.
    """
    entries = read()
    if reason is not None:
        check_outputs([Output(LEDGER, "ledger")])
    counts = solve_counts() | job_counts()
    say(text_table(entries, counts))
    if reason is None:
        return list(faults(entries, counts))
    write_entries(updated(entries, counts, reason))
    say(f"wrote {LEDGER}")
    return []
