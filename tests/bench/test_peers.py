"""The comparison with other solvers: fair, told as it is, and complete without any of them."""

from contextlib import redirect_stderr
from dataclasses import dataclass, field, replace
from io import StringIO

import numpy as np
import pytest

from bench import peers as periodic
from bench.commands import main
from bench.contents import tables_of
from bench.files import read_table
from bench.peers import Trial, compare, find_errors, sample
from bench.report import part_of
from bench.solvers.others import OTHERS
from bench.solvers.solver import (
    LADDER,
    Answer,
    Control,
    Failure,
    back_and_forth,
    find_exact,
)

SMALL = sample(33, 25.0)


def test_another_displacement_under_the_same_force_shows_in_the_displacement():
    exact = find_exact(SMALL)
    assert abs(find_errors(exact.pressure, "force", SMALL, exact).load_error) < 1e-12
    other = replace(SMALL, delta=SMALL.delta * 1.01)
    found = find_errors(exact.pressure, "force", other, exact)
    assert found.load_error == pytest.approx(0.01 / 1.01, rel=1e-9)


@dataclass
class Stub:
    """A solver that knows the reference, and errs by its tolerance."""

    name: str = "stub"
    control: Control = "displacement"
    ladder: tuple[float, ...] = LADDER
    largest_contact: float = np.inf
    version: str = "0"
    fails: bool = False
    asked: list[float] = field(default_factory=list)

    def solve(self, case, rtol):
        self.asked.append(rtol)
        if self.fails:
            raise Failure("stalled")
        return Answer(find_exact(case).pressure * (1 + rtol))


@dataclass
class Compared:
    """Three stubs that were compared on one contact, with their rows and what was printed."""

    good: Stub
    limited: Stub
    rows: list[dict[str, object]]
    printed: str


@pytest.fixture(scope="module")
def compared():
    good = Stub()
    failing = Stub(name="failing", fails=True)
    limited = Stub(name="limited", largest_contact=5)
    printed = StringIO()
    with redirect_stderr(printed):
        rows = compare([SMALL], [good, failing, limited], 2)
    return Compared(good, limited, rows, printed.getvalue())


def test_a_solver_is_timed_at_the_tolerance_that_it_needs(compared):
    row = compared.rows[0]
    assert row["tolerance"] == 10.0**-6
    assert row["load_error"] == pytest.approx(1e-6, rel=1e-6)
    assert compared.good.asked[-1] == row["tolerance"]


def test_the_first_solver_is_the_unit_of_times(compared):
    row = compared.rows[0]
    assert row["times_ours"] == 1
    assert row["seconds"] is not None


def test_a_row_has_the_nodes_in_contact_of_the_reference(compared):
    nodes = np.count_nonzero(find_exact(SMALL).pressure)
    assert {row["contact_nodes"] for row in compared.rows} == {nodes}


def test_a_solver_that_fails_has_a_remark_and_no_time(compared):
    row = compared.rows[1]
    assert (row["seconds"], row["remark"]) == (None, "tolerance 1e-01: stalled")


def test_a_solver_is_not_tried_above_its_largest_contact(compared):
    row = compared.rows[2]
    assert (row["seconds"], compared.limited.asked) == (None, [])
    assert row["remark"] == "not tried above 5 nodes in contact"


def test_the_progress_is_the_contact_in_words(compared):
    assert compared.printed == "33 nodes a side, H = 0.65, Delta = 25 um\n"


def test_times_over_ours_are_of_the_same_round(monkeypatch):
    """The median of 0.3 / 0.1, 0.2 / 0.2 and 0.6 / 0.3, not the ratio of the medians, 1.5."""
    speeds = iter(
        [0.1, 0.3, 0.2, 0.2, 0.3, 0.6]
    )  # ours and theirs forth, back, and forth
    answer = Answer(find_exact(SMALL).pressure)
    ours, theirs = Trial(Stub(), SMALL), Trial(Stub(name="theirs"), SMALL)
    monkeypatch.setattr(Trial, "_timed", lambda *_: (answer, next(speeds)))
    for trial in (ours, theirs):
        trial.tolerance = 1e-6
    for trial in back_and_forth([ours, theirs], 3):
        trial.take_turn()
    assert (ours.times(ours), theirs.times(ours)) == (1.0, pytest.approx(2.0))
    assert (ours.seconds, theirs.seconds) == (0.2, 0.3)


def test_times_that_are_too_long_to_be_repeated_are_compared_as_they_are():
    ours, theirs = Trial(Stub(), SMALL), Trial(Stub(), SMALL)
    ours._seconds, theirs._seconds = [6.0], [9.0]
    assert theirs.times(ours) == 1.5


def test_command_writes_table_and_picture(tmp_path, capsys):
    folder = tmp_path / "new" / "reports"
    arguments = ["--nodes", "17", "--deltas", "5,25", "--rounds", "1"]
    assert main(["peers", "-o", str(folder), *arguments]) == 0
    done = capsys.readouterr()
    assert done.out.split()[-2:] == [
        str(folder / f"peers.{end}") for end in ("csv", "png")
    ]
    for peer in OTHERS:
        assert (f"{peer.package} is not installed" in done.err) is not bool(peer.version)
    _, rows = read_table(folder / "peers.csv")
    assert [row["solver"] for row in rows[:2]] == ["bem", "paper's NNLS"]
    assert {row["delta_um"] for row in rows} == {"5.0", "25.0"}
    for row in rows:
        assert float(row["load_error"]) <= 1e-6
        assert float(row["seconds"]) > 0


@pytest.mark.parametrize(
    "solver", periodic.PERIODIC_SOLVERS, ids=lambda solver: solver.name
)
@pytest.mark.parametrize("load", periodic.LOADS[::2])
def test_periodic_patches_are_the_same_problem_for_all(solver, load):
    """Our own waves, spacing, units and zero mean displacement, up to nearly full contact."""
    if not solver.version:
        pytest.skip(f"{solver.package} is not installed: {solver.install}")
    case = periodic.periodic_sample(32, 0.8, load)
    pressure = solver.solve(case, 1e-11).pressure
    errors = find_errors(pressure, solver.control, case, find_exact(case))
    assert errors.load_error < 1e-8
    assert errors.misplaced_nodes == 0
    assert errors.pressure_error < 1e-8


def test_command_compares_periodic_patches(tmp_path):
    arguments = ["--nodes", "32", "--rounds", "1"]
    assert main(["periodic", "-o", str(tmp_path), *arguments]) == 0
    _, rows = read_table(tmp_path / "periodic.csv")
    ours = [row for row in rows if row["solver"] == "bem"]
    assert [row["times_ours"] for row in ours] == ["1.0"] * 5
    assert float(ours[0]["area_percent"]) < 5
    assert float(ours[4]["area_percent"]) > 95
    assert [len(tables_of(each)) for each in part_of("periodic").show(tmp_path)] == [1, 1]


def test_command_compares_bodies_that_yield(tmp_path):
    arguments = ["--nodes", "17", "--deltas", "25", "--rounds", "1", "--hardness", "0.02"]
    assert main(["hardness", "-o", str(tmp_path), *arguments]) == 0
    found = read_table(tmp_path / "hardness.csv")[
        1
    ]  # of other solvers too, where there are any
    elastic, yielding = (row for row in found if row["solver"] == "bem")
    assert (elastic["hardness"], elastic["yielded_nodes"]) == ("", "0")
    assert int(yielding["yielded_nodes"]) > 0
    assert float(yielding["load_error"]) <= 1e-6
    assert [len(tables_of(each)) for each in part_of("hardness").show(tmp_path)] == [1, 1]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--nodes", "128"], "nodes 128: give 2^k + 1"),
        (["--deltas", "0"], "0: give displacements and hardnesses above 0"),
        (["--deltas", "5,"], "deltas '5,': give numbers with commas between them"),
    ],
)
def test_bad_input_is_refused_in_one_line(arguments, message, tmp_path, capsys):
    assert main(["peers", "-o", str(tmp_path / "new"), *arguments]) == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "new").exists()
