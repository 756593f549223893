"""Tables for other programs hold no formulas of strangers."""

import csv

import pytest

from gen.runtime.documents import cell, write_csv


@pytest.mark.parametrize("text", ["=1+1", "+1", "-1", "@SUM(A1)", "\t=1", "\r=1", "\n=1"])
def test_a_cell_of_text_is_no_formula(tmp_path, text):
    assert cell(text) == f"'{text}"
    write_csv(tmp_path / "a.csv", [{"name": text, "value": -1.5, "count": -3, "plain": "a=b"}])
    with (tmp_path / "a.csv").open(newline="", encoding="utf-8") as file:
        (row,) = csv.DictReader(file)
    assert row == {"name": f"'{text}", "value": "-1.5", "count": "-3", "plain": "a=b"}
