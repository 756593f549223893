"""What a solver is asked for, and what becomes of its faults."""

from dataclasses import replace

import pytest

from bench.peers import sample
from bench.solvers.case import Case
from bench.solvers.others import installed, missing
from bench.solvers.solver import BEM, Answer, Failure, Press, Solver


@pytest.fixture(scope="module")
def case() -> Case:
    return sample(33, 25.0)


def broken(nodes: int, spacing: float) -> Press:
    """A peer that raises what nobody expects."""

    def press(case: Case, force: float, tolerance: float) -> Answer:
        raise RuntimeError("nan encountered")

    return press


ABSENT = Solver("Absent", broken, "no_such_package", "pip install no-such-package")


def test_faults_of_peers_are_failures(case: Case) -> None:
    with pytest.raises(Failure, match="RuntimeError: nan encountered"):
        ABSENT.solve(case, 1e-3)
    with pytest.raises(Failure, match="no kernel 'concentrated-force'"):
        ABSENT.solve(replace(case, kernel="concentrated-force"), 1e-3)
    with pytest.raises(RuntimeError, match="nan encountered"):
        replace(ABSENT, install="").solve(case, 1e-3)


def test_absent_peers_are_left_out_with_how_to_get_them() -> None:
    assert installed([ABSENT, BEM]) == [BEM]
    assert missing([ABSENT, BEM, replace(ABSENT, name="again")]) == {
        "no_such_package": "pip install no-such-package"
    }
