"""Solvers by other people: the same problem as ours, where they are installed; exact solutions."""

from dataclasses import replace

import numpy as np
import pytest

from bench.peers import find_errors, sample
from bench.references.dense import press
from bench.solvers.others import OTHERS, installed, missing
from bench.solvers.solver import (
    BEM,
    EXACT_RTOL,
    PAPERS,
    Case,
    Failure,
    Solver,
    find_exact,
)
from bench.work_precision import paper_case


@pytest.mark.parametrize("peer", OTHERS, ids=lambda peer: peer.name)
@pytest.mark.parametrize("delta", [5.0, 25.0])
def test_peers_solve_the_same_problem(peer, delta):
    """To eight digits: the same coefficients, spacing, units and free boundaries."""
    if not peer.version:
        pytest.skip(f"{peer.package} is not installed: {peer.install}")
    case = sample(33, delta)
    exact = find_exact(case)
    errors = find_errors(peer.solve(case, 1e-10).pressure, peer.control, case, exact)
    assert errors.load_error < 1e-8
    assert errors.misplaced_nodes == 0
    assert errors.pressure_error < 1e-7


@pytest.mark.parametrize(
    ("delta", "hardness", "yielded"),
    [
        (5.0, 0.3, 0),
        (5.0, 0.05, 3),
        (5.0, 0.005, 8),
        (25.0, 0.05, 103),
        (25.0, 0.005, 264),
    ],
)
def test_solvers_that_know_a_hardness_agree(delta, hardness, yielded):
    """With one another and with the dense reference, on nodes in contact and on yielded ones."""
    case = sample(33, delta, hardness)
    exact = find_exact(case)
    assert exact.pressure.max() <= hardness * (1 + 1e-15)
    assert case.yielded(exact.pressure).sum() == yielded
    for solver in (BEM, *(each for each in installed() if each.plastic)):
        errors = find_errors(
            solver.solve(case, 1e-9).pressure, "displacement", case, exact
        )
        assert errors.load_error < 1e-8
        assert errors.misplaced_nodes == 0
    with pytest.raises(Failure, match="paper's NNLS has no hardness"):
        PAPERS.solve(case, 1e-8)


def broken(nodes, spacing):
    """A peer that raises what nobody expects."""

    def press(case, force, tolerance):
        raise RuntimeError("nan encountered")

    return press


ABSENT = Solver("Absent", broken, "no_such_package", "pip install no-such-package")


def test_faults_of_peers_are_failures():
    case = sample(33, 25.0)
    with pytest.raises(Failure, match="RuntimeError: nan encountered"):
        ABSENT.solve(case, 1e-3)
    with pytest.raises(Failure, match="no kernel 'concentrated-force'"):
        ABSENT.solve(replace(case, kernel="concentrated-force"), 1e-3)
    with pytest.raises(RuntimeError, match="nan encountered"):
        replace(ABSENT, install="").solve(case, 1e-3)


def test_absent_peers_are_left_out_with_how_to_get_them():
    assert installed([ABSENT, BEM]) == [BEM]
    assert missing([ABSENT, BEM, replace(ABSENT, name="again")]) == {
        "no_such_package": "pip install no-such-package"
    }


@pytest.mark.parametrize("kernel", ["uniform-pressure", "concentrated-force"])
def test_exact_solutions_are_exact(kernel):
    case = paper_case(3, 17, kernel)
    dense, _ = press(case.heights, case.delta, case.kernel)
    exact = find_exact(case)
    assert exact.pressure == pytest.approx(
        dense * case.delta / case.spacing, rel=0, abs=1e-12
    )
    assert exact.contact_share == np.count_nonzero(dense) / dense.size


@pytest.mark.parametrize("hardness", [None, 0.05])
def test_exact_solutions_are_proved(hardness):
    """A solve that is off by a relative error of 1e-8 is found out."""
    case = replace(sample(33, 25.0, hardness))  # another object: not found in the cache
    right = case.solve(EXACT_RTOL)
    wrong = replace(right, pressure=right.pressure * (1 - 1e-8))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Case, "solve", lambda *_: wrong)
        with pytest.raises(ArithmeticError, match="uniform-pressure: no exact solution"):
            find_exact(case)
    assert find_exact(case).rtol == EXACT_RTOL
