"""Rows of the report on growth: what they hold, and that they can show a miss."""

import csv
from dataclasses import replace
from pathlib import Path

import pytest

from bench.growth import growth, in_words, report
from gen.runtime.errors import InputError


def test_rows_reach_their_contact_and_say_what_it_took(tmp_path: Path) -> None:
    rows = growth((65, 129), surfaces=1, percents=(5.0,))
    assert [row.nodes for row in rows] == [65, 129]
    for row in rows:
        assert row.area_percent == pytest.approx(5, rel=0.2)
        assert row.convolutions >= 3
        assert row.seconds > 0
        assert 0 < row.padded_arrays < 12
    assert rows[0].growth == 1
    assert rows[1].growth == pytest.approx(rows[1].convolutions / rows[0].convolutions)
    table, picture = report(rows).write(tmp_path / "new")
    assert picture.read_bytes().startswith(b"\x89PNG")
    with table.open(newline="") as file:
        written = list(csv.DictReader(file))
    assert [float(row["convolutions"]) for row in written] == [row.convolutions for row in rows]
    missed = [rows[0], replace(rows[1], growth=1.77, padded_arrays=13.0)]
    assert "at most 1.77 (mark 1.3); memory: at most 13.0" in in_words(missed)


@pytest.mark.parametrize("nodes", [100, 33, 3, 0])
def test_grids_that_cannot_be_nested_are_refused(nodes: int) -> None:
    with pytest.raises(InputError, match=f"nodes {nodes}: give 2"):
        growth((nodes,))
