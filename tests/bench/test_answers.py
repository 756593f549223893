"""The lines at the top of the page: answers are computed from the tables, or are not there."""

from pathlib import Path

from bench.answers import lines, peers
from bench.record import Inputs
from bench.report import PARTS

RESULTS = Path(__file__).resolve().parents[2] / "bench" / "results"


def test_all_questions_are_answered_by_what_is_published():
    inputs = Inputs(RESULTS, None, None, full=True)
    found = lines(PARTS, inputs)
    assert len(found) == 11
    assert all(line.answer.endswith(".") and len(line.answer) < 280 for line in found)


def test_what_is_not_there_is_not_listed(tmp_path):
    (tmp_path / "grow").mkdir()
    (tmp_path / "grow" / "grow.csv").write_text("asked,seed\n3,1\n")  # lacks what is asked
    assert lines(PARTS, Inputs(tmp_path, None, None, full=False)) == []


def test_the_fastest_other_solver_is_chosen_case_by_case():
    times = {("1", "bem"): 1, ("1", "A"): 5, ("1", "B"): 9, ("2", "A"): 8, ("2", "B"): 7}
    times |= {("2", "paper's NNLS"): 2, ("2", "C"): ""}  # another algorithm, one that failed
    rows = [
        {"nodes": "9", "hurst": "1", "delta_um": delta, "solver": solver, "times_ours": str(each)}
        for (delta, solver), each in times.items()
    ]
    assert "takes 5 to 7 times" in peers(rows)
