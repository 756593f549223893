"""The counts of the ledger: no work may rise by more than 2 %, results stay what they are."""

import pytest

from bench.ledger.jobs import job_counts
from bench.ledger.solves import solve_counts
from bench.ledger.table import faults, read


def test_counts_are_those_of_the_ledger() -> None:
    counts = {**solve_counts(), **job_counts()}
    found = list(faults(read(), counts))
    if found:
        advice = "if wanted: python -m bench ledger --update 'the reason'"
        pytest.fail("\n".join([*found, advice]), pytrace=False)
