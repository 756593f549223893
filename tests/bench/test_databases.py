"""What optional outputs of a database cost."""

import pytest

from bench.databases import outputs
from gen.scene import flags


def test_every_optional_output_has_its_cost(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("bench.databases.SAMPLES", 2)
    rows = outputs("quick", 1)
    assert [row["column"] for row in rows] == list(flags())
    assert all(row["ratio"] > 0 and row["bytes"] > 0 for row in rows)
