"""Peak memory of fits: measured in processes of their own, carried on in the number of trees."""

import csv

import numpy as np
import pytest

from bench import memory
from gen.runtime.errors import InputError


def test_a_kernel_matrix_shows_in_the_peak():
    held = np.ones(10**8)  # what the caller holds does not count
    rows = 2500
    (tree,) = memory.measure(["decision-tree"], rows)
    (ridge,) = memory.measure(["kernel-ridge"], rows)
    matrix = 8 * rows**2 / 2**30
    assert tree["measured"] + matrix < ridge["measured"] < tree["measured"] + 8 * matrix + 0.2
    assert ridge["measured"] < held.nbytes / 2**30
    assert ridge["peak"] == ridge["measured"]
    assert ridge["estimators"] == 1


def test_memory_of_trees_is_carried_on_in_a_line(monkeypatch):
    monkeypatch.setattr(
        memory, "_in_its_own_process", lambda name, rows, trees: 0.1 + 0.001 * trees
    )
    (peak,) = memory.measure(["random-forest"], 1000)
    assert peak["estimators"] == 2000
    assert peak["measured"] == pytest.approx(0.3)
    assert peak["peak"] == pytest.approx(2.1)


def test_the_report_is_a_table_and_a_file(tmp_path):
    columns = ("model", "rows", "estimators", "measured", "peak", "reckoned")
    peaks = [dict(zip(columns, ("svm", 12_703, 1, 0.25, 0.25, 0.5), strict=True))]
    assert "| svm | 12,703 | 0.25 | 0.50 |" in memory.report(peaks).text
    memory.report(peaks).write(tmp_path / "report")
    with (tmp_path / "report" / "memory.csv").open(encoding="utf-8") as file:
        (row,) = csv.DictReader(file)
    assert row["model"] == "svm"


def test_unknown_models_are_refused():
    with pytest.raises(InputError, match="'ridge': give some of decision-tree"):
        memory.measure(["ridge"], 100)
