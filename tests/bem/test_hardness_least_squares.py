"""Bodies that yield: random contacts of every kind beside bounded least squares."""

from functools import lru_cache

import pytest

from bench.stability.hardness.cases import FORCE, ROUNDING, conditions, unlike_nodes
from bench.stability.hardness.problems import RTOL, YieldingProblem, problem

pytestmark = pytest.mark.usefixtures("both_ways")

drawn = lru_cache(problem)  # both ways have the same problems, and one reference


@pytest.mark.parametrize("seed", range(100))
def test_contact_is_that_of_bounded_least_squares(seed: int) -> None:
    asked: YieldingProblem = drawn(seed)
    contact = asked.solve()
    pressure, gap = asked.expected
    force = float(pressure.sum()) * asked.aspect
    assert contact.force == pytest.approx(force, rel=FORCE)
    assert unlike_nodes(asked, contact, pressure, gap) == 0
    deviations = conditions(asked, contact)
    assert deviations.pop("beyond") == 0
    assert deviations.pop("stated") < 1e-12
    assert max(deviations.values()) <= RTOL + ROUNDING
