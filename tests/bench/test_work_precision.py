"""Work against precision: what is measured is measured rightly, and written and drawn so."""

import sys
from dataclasses import dataclass, field
from itertools import pairwise

import pytest

from bench.commands import main
from bench.solvers.solver import Answer, Failure, find_exact
from bench.work_precision import DECADES, Row, compare, curves, paper_case, solver
from gen.runtime.installation import command_for


@pytest.fixture(scope="module")
def done():
    return list(solver(quick=True).tables["solver"])


@pytest.fixture(scope="module")
def small():
    return paper_case(0, 33)


def test_errors_fall_and_work_grows_with_the_tolerance(done):
    groups: dict[tuple[str, str], list[Row]] = {}
    for point in done:
        if point["study"] == "tolerance":
            groups.setdefault((point["kernel"], point["case"]), []).append(point)
    assert len(groups) == 4
    for group in groups.values():
        assert [point["rtol"] for point in group] == list(DECADES[::2])
        for loose, tight in pairwise(group):
            # dense algebra knows no tolerance: few nodes in contact are exact at any
            assert tight["pressure_error"] <= loose["pressure_error"]
            assert tight["convolutions"] >= loose["convolutions"]
        assert group[-1]["convolutions"] > group[0]["convolutions"]
        last = group[-1]
        assert last["force_error"] < 1e-9
        assert last["pressure_error"] < 1e-8
        assert last["area_error_nodes"] == last["area_error_percent"] == 0


@dataclass
class Stub:
    """A solver that knows the answer, or fails below a tolerance."""

    fails_below: float = 0.0
    name: str = "stub"
    control: str = "displacement"
    asked: list[tuple[str, float]] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)

    def solve(self, case, rtol):
        self.asked.append((self.name, rtol))
        if rtol < self.fails_below:
            raise Failure("stalled")
        return Answer(find_exact(case).pressure, seconds=self.seconds.pop(0))


def test_who_fails_at_one_tolerance_is_named_and_keeps_the_others(small, capsys):
    stub = Stub(fails_below=1e-3, seconds=[1.0] * 4, control="force")
    points = list(compare("peers", [stub], [small], [1e-1, 1e-2, 1e-4], 1))
    assert [point["rtol"] for point in points] == [1e-1, 1e-2]
    assert {point["force_error"] for point in points} == {None}, "which is given"
    said = "peers: left out stub: paper 0, 33 nodes a side, tolerance 1e-04: stalled\n"
    assert capsys.readouterr().err == said
    assert [rtol for _, rtol in stub.asked].count(1e-4) == 1


def test_tasks_run_back_and_forth_and_the_shortest_time_counts(small):
    asked: list[tuple[str, float]] = []
    a = Stub(name="A", asked=asked, seconds=[9.0, 3.0, 2.0, 4.0])
    b = Stub(name="B", asked=asked, seconds=[9.0, 5.0, 6.0, 7.0])
    points = list(compare("peers", [a, b], [small], [1e-2], 3))
    assert [name for name, _ in asked] == ["A", "B", "A", "B", "B", "A", "A", "B"]
    assert [(point["solver"], point["seconds"]) for point in points] == [
        ("A", 2.0),
        ("B", 5.0),
    ]
    assert points[0]["force_error"] == points[0]["pressure_error"] == 0
    assert points[0]["convolutions"] is None


def test_curves_are_means_over_the_cases(done):
    tolerance = [point for point in done if point["study"] == "tolerance"]
    uniform = [row for row in curves(tolerance) if row["curve"] == "uniform-pressure"]
    assert [row["setting"] for row in uniform] == list(DECADES[::2])
    first = [
        point for point in tolerance if (point["rtol"], point["kernel"][0]) == (0.1, "u")
    ]
    assert len(first) == 2
    mean = sum(point["force_error"] for point in first) / len(first)
    assert uniform[0]["force_error"] == pytest.approx(mean)
    others = curves([point for point in tolerance if point is not first[0]])
    assert [row["setting"] for row in others].count(0.1) == 1, "no mean of other cases"


def test_missing_matplotlib_is_said_before_anything_is_solved(
    tmp_path, monkeypatch, capsys
):
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    for command in ("solver", "peers"):
        assert main([command, "-o", str(tmp_path / "new")]) == 2
        said = capsys.readouterr().err
        assert f"matplotlib, which is not installed: {command_for('plot')}" in said
    assert not (tmp_path / "new").exists()
