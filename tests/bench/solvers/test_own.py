"""Our own solvers: two algorithms that share no code find the same pressure."""

import numpy as np
import pytest

from bench.solvers.own import BEM, PAPERS
from bench.work_precision import paper_case


def test_both_algorithms_end_in_the_same_answer() -> None:
    small = paper_case(0, 33)
    ours, papers = BEM.solve(small, 1e-12), PAPERS.solve(small, 1e-12)
    assert ours.pressure == pytest.approx(papers.pressure, rel=0, abs=1e-10)
    np.testing.assert_array_equal(ours.pressure > 0, papers.pressure > 0)
