"""Patches without edges: random contacts beside dense references, mirror images and shifts."""

from collections.abc import Callable

import pytest

from bench.stability.edgeless import (
    Judge,
    judge,
    judge_images,
    judge_shift,
    mirrored_problem,
    periodic_problem,
    problem,
)
from bench.stability.setup import Setup

SEEDS = [
    *((problem, judge, seed) for seed in range(150)),
    *((mirrored_problem, judge_images, seed) for seed in range(40)),
    *((periodic_problem, judge_shift, seed) for seed in range(20)),
]


@pytest.mark.few(60)
@pytest.mark.parametrize(("draw", "compare", "seed"), SEEDS)
def test_contact_is_that_of_another_way(
    draw: Callable[[int], Setup], compare: Judge, seed: int
) -> None:
    asked = draw(seed)
    assert not [str(each) for each in compare(asked, asked.solve()) if not each.passed]
