"""Time for a surface of each kind that scenes have besides random midpoint displacement.

    pytest bench/suites/test_populations.py

Budgets at the paper's size on one core: 1 ms for a window of a map, 3 ms for a spectral surface.
"""

from pathlib import Path

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from gen.generation.plan import parameters
from gen.generation.sample import surface_of
from gen.maps.store import PreparedMap, opened, write
from gen.maps.windows import Tiling, cut, drawn
from gen.scene import Scene
from gen.spectral import SelfAffineSpectrum, generate_spectral

SIZES = {"smoke": 33, "paper": 129, "large": 513}
SPACING = 1.0

sizes = pytest.mark.parametrize("nodes", SIZES.values(), ids=SIZES)


def stream(surface: int) -> np.random.Generator:
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(7, spawn_key=(surface,))))


@sizes
def test_window(benchmark: BenchmarkFixture, nodes: int, tmp_path: Path) -> None:
    """Out of a map in shared memory: stream of the surface, draw, cut, lowest node to 0."""
    heights = np.random.default_rng(3).normal(size=(2 * nodes + 9, 2 * nodes + 5))
    path = tmp_path / "a.maps"
    spacing = (SPACING, SPACING)
    write(path, "key", iter([(PreparedMap(heights), spacing)]), replace=False)
    stored = opened(path, "key", verify=True)
    assert stored is not None
    (prepared,) = stored.maps
    tiling = Tiling((heights.shape,), (nodes, nodes))

    def window() -> np.ndarray:
        place = drawn(stream(5), tiling, square=True)
        return cut(prepared.heights, place, tiling.window)

    surface = benchmark(window)
    assert surface.shape == (nodes, nodes)
    assert surface.min() == 0.0
    (x, y) = drawn(stream(5), tiling, square=True).corner
    own = heights[x : x + nodes, y : y + nodes]
    assert np.ptp(surface) == np.ptp(own)


@sizes
def test_spectral(benchmark: BenchmarkFixture, nodes: int) -> None:
    """A period of a self-affine surface."""
    spectrum = SelfAffineSpectrum(hurst=0.8, roll_off=nodes / 4, cut_off=4 * SPACING)

    def surface() -> np.ndarray:
        return generate_spectral(
            (nodes, nodes), nodes * SPACING, spectrum, stream(5), rms_height=1.0
        )

    assert benchmark(surface).std() == pytest.approx(1.0, rel=1e-12)


@sizes
def test_spectral_window(benchmark: BenchmarkFixture, nodes: int) -> None:
    """A free patch of a scene, cut from twice its length, with the shortest waves that it holds."""
    scene = Scene.parse(
        f"samples = 1\n[surface]\ngenerator = 'spectral'\nnodes = {nodes}\n"
        f"side = {(nodes - 1) * SPACING}\nroll_off = {nodes / 4}\ncut_off = 2.0\nrms_slope = 0.1",
        "the benchmark",
    )
    plan = parameters(scene, 0, 1)
    surface = benchmark(lambda: surface_of(scene, plan, 0))
    assert surface.shape == (nodes, nodes)
    assert surface.min() == 0.0
