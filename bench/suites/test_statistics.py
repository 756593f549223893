"""Time to generate and to describe a surface, with the answers asserted.

    pytest bench/suites/test_statistics.py

Budget of `describe` at the paper's size: 1 ms on one core.
"""

import numpy as np
import pytest
from numpy.typing import NDArray
from pytest_benchmark.fixture import BenchmarkFixture

from bench.stability import exact
from gen.statistics import describe
from gen.surface import GENERATORS, generate

SIZES = {"smoke": 33, "paper": 129, "large": 513}
SIDE = 1000.0
STEP = 1 / 8192  # of heights, so that their exact statistics take seconds [um]

sizes = pytest.mark.parametrize("nodes", SIZES.values(), ids=SIZES)


def surface(generator: str, nodes: int) -> NDArray[np.float64]:
    return generate(generator, nodes, 0.65, 12.0, np.random.default_rng(7))


@sizes
@pytest.mark.parametrize("generator", GENERATORS)
def test_generate(benchmark: BenchmarkFixture, generator: str, nodes: int) -> None:
    heights = benchmark(surface, generator, nodes)
    coarse = surface(generator, 17)
    shared = heights[:: (nodes - 1) // 16, :: (nodes - 1) // 16]
    assert heights.shape == (nodes, nodes)
    assert heights.min() == 0.0
    assert shared - shared[0, 0] == pytest.approx(coarse - coarse[0, 0], abs=1e-10)


@sizes
def test_describe(benchmark: BenchmarkFixture, nodes: int) -> None:
    heights = np.round(surface("diamond-square", nodes) / STEP) * STEP
    spacing = SIDE / (nodes - 1)
    description = benchmark(describe, heights, spacing)
    expected = exact.statistics(heights, (spacing, spacing))
    assert description.reason == ""
    assert description.values == pytest.approx(expected, rel=1e-10)
