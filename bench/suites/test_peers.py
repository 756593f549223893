"""Time of one contact by each solver at equal accuracy, answers asserted.

    pytest bench --benchmark-only -k by_solver

The paper's surface at 129 nodes a side with few enough nodes in contact for the paper's algorithm;
`python -m bench peers` compares at every load and on larger grids.
"""

import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from bench.peers import Trial, find_errors, sample
from bench.solvers.case import find_exact
from bench.solvers.others import OTHERS
from bench.solvers.own import BEM, PAPERS
from bench.solvers.solver import Solver

CASE = sample(129, 15.0)


@pytest.mark.parametrize("solver", [BEM, PAPERS, *OTHERS], ids=lambda solver: solver.name)
def test_contact_by_solver(benchmark: BenchmarkFixture, solver: Solver) -> None:
    if not solver.version:
        pytest.skip(f"{solver.package} is not installed: {solver.install}")
    trial = Trial(solver, CASE)
    trial.find_tolerance(1e-4)
    assert trial.tolerance is not None, trial.remark
    pressure = benchmark(solver.solve, CASE, trial.tolerance).pressure
    benchmark.extra_info["tolerance"] = trial.tolerance
    errors = find_errors(pressure, solver.control, CASE, find_exact(CASE))
    assert errors.good_enough(trial.contact_nodes)
