"""Bodies that yield: random contacts of every kind beside bounded least squares."""

from functools import lru_cache

import pytest

from bench.stability.hardness import judge, problem

pytestmark = pytest.mark.usefixtures("both_ways")

drawn = lru_cache(problem)  # both ways have the same problems, and one reference


@pytest.mark.parametrize("seed", range(100))
def test_contact_is_that_of_bounded_least_squares(seed: int) -> None:
    asked = drawn(seed)
    failed = [str(finding) for finding in judge(asked, asked.solve()) if not finding.passed]
    assert not failed
