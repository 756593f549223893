"""Time to generate and to describe a surface, with the answers asserted.

    pytest bench/suites/test_statistics.py

Budget of `describe` at the paper's size: 1 ms on one core.
"""

import numpy as np
import pytest
from numpy.typing import NDArray
from pytest_benchmark.fixture import BenchmarkFixture

from gen.statistics import describe
from gen.surface import GENERATORS, generate

SIZES = {"smoke": 33, "paper": 129, "large": 513}
SIDE = 1000.0

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
    heights, spacing = surface("diamond-square", nodes), SIDE / (nodes - 1)
    description = benchmark(describe, heights, spacing)
    values, inside = description.values, heights[1:-1, 1:-1]
    pairs_x, pairs_y = (
        (heights[:-2, 1:-1], heights[2:, 1:-1]),
        (heights[1:-1, :-2], heights[1:-1, 2:]),
    )
    summits = np.logical_and.reduce([inside > other for other in (*pairs_x, *pairs_y)])
    curvatures = (2 * inside - (sum(pairs_x) + sum(pairs_y)) / 2) / spacing**2
    expected = {
        "height_max": heights.max(),
        "height_mean": heights.mean(),
        "height_rms": heights.std(),
        "asperity_density": summits.sum() / heights.size,
        "asperity_mean": inside[summits].mean(),
        "asperity_rms": inside[summits].std(),
        "asperity_curvature_mean": curvatures[summits].mean(),
        "asperity_curvature_rms": curvatures[summits].std(),
    }
    assert description.reason == ""
    assert {name: values[name] for name in expected} == pytest.approx(expected, rel=1e-10)
