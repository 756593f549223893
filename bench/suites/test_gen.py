"""Time the farm, the writer, and surfaces of every kind. Each benchmark asserts its answer.

    pytest bench/suites/test_gen.py --benchmark-only

`asperity bench writers` measures both writers on any number of ranks. Budgets at the paper's size
on one core: 1 ms for a window of a map and for `describe`, 3 ms for a spectral surface.
"""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from pytest_benchmark.fixture import BenchmarkFixture

from bench.farm import Spec, require_rows, template_of
from bench.farm import write as write_rows
from bench.references import exact
from gen import database
from gen.generation.plan import parameters
from gen.generation.run import blocks_of
from gen.generation.sample import surface_of
from gen.maps.library import (
    PreparedMap,
    Tiling,
    cut_window,
    draw_window,
    stored_maps,
    write_maps,
)
from gen.runtime import farm
from gen.runtime.farm import World
from gen.scene import Scene
from gen.statistics import describe
from gen.surface import GENERATORS, generate

SPECS = {"smoke": Spec(32, 33, 1), "paper": Spec(256, 129, 1), "large": Spec(32, 513, 1)}
"""Rows and nodes a side of the databases that are written, by size of the benchmark."""


@pytest.mark.parametrize("size", SPECS)
def test_write_by_one(benchmark: Any, tmp_path: Path, size: str) -> None:
    """Write rows with their pressure fields to the disk; creating the file is not timed."""
    spec = SPECS[size]
    path = tmp_path / "rows.h5"
    blocks = list(blocks_of(spec.scene, [range(spec.rows)], World().workers))
    template = template_of(spec.scene, blocks)

    def create() -> None:
        """Replace the file by an empty database."""
        path.unlink(missing_ok=True)
        database.create(path, spec.scene)

    def write() -> None:
        write_rows(path, spec.scene, blocks, template, World())

    benchmark.pedantic(write, setup=create, rounds=3)
    require_rows(path, blocks, template)
    if benchmark.enabled:
        megabytes_per_second = spec.megabytes / benchmark.stats["median"]
        benchmark.extra_info["megabytes_per_second"] = megabytes_per_second


TASKS = {"smoke": 256, "paper": 15_878, "large": 100_000}
"""Number of tasks that the farm hands out, by size of the benchmark."""


def dispatch(tasks: int) -> int:
    """Hand out tasks that cost nothing, and return the sum of their results.

    The tasks are the numbers from 0 to `tasks` - 1, and each result is the number itself.
    """
    results: list[int] = []

    def take_result(_task: int, result: int) -> None:
        results.append(result)

    farm.run(abs, iter(range(tasks)), take_result, World())
    return sum(results)


@pytest.mark.parametrize("size", TASKS)
def test_dispatch_serially(benchmark: Any, size: str) -> None:
    """Time the work of the farm itself, with tasks that cost nothing."""
    tasks = TASKS[size]
    assert benchmark(dispatch, tasks) == tasks * (tasks - 1) // 2
    if benchmark.enabled:
        benchmark.extra_info["seconds_per_task"] = benchmark.stats["median"] / tasks


SIZES = {"smoke": 33, "paper": 129, "large": 513}
"""Nodes a side of the surfaces, by size of the benchmark."""

SPACING = 1.0
"""Distance between neighbouring nodes of windows [um]."""

sizes = pytest.mark.parametrize("nodes", SIZES.values(), ids=SIZES)


def stream(surface: int) -> np.random.Generator:
    """Make the random generator of the surface with this number, as scenes do."""
    sequence = np.random.SeedSequence(7, spawn_key=(surface,))
    return np.random.Generator(np.random.PCG64(sequence))


@sizes
def test_window(benchmark: BenchmarkFixture, nodes: int, tmp_path: Path) -> None:
    """Draw and cut a window of a map in shared memory, and shift its lowest node to 0."""
    heights = np.random.default_rng(3).normal(size=(2 * nodes + 9, 2 * nodes + 5))
    path = tmp_path / "a.maps"
    spacing = (SPACING, SPACING)
    write_maps(path, "key", iter([PreparedMap(heights, spacing)]), replace=False)
    stored = stored_maps(path, "key", verify=True)
    assert stored is not None
    (prepared,) = stored.maps
    tiling = Tiling((heights.shape,), (nodes, nodes), square=True)

    def window() -> np.ndarray:
        """Draw a place by a fixed seed, and cut the window there."""
        place = draw_window(stream(5), tiling)
        return cut_window(prepared.heights, place, tiling.window)

    surface = benchmark(window)
    assert surface.shape == (nodes, nodes)
    assert surface.min() == 0.0
    x, y = draw_window(stream(5), tiling).corner
    assert np.ptp(surface) == np.ptp(heights[x : x + nodes, y : y + nodes])


@sizes
def test_spectral_window(benchmark: BenchmarkFixture, nodes: int) -> None:
    """Make a free spectral patch, which is cut from twice its length, with waves from two nodes."""
    scene = Scene.parse(
        f"samples = 1\n[surface]\ngenerator = 'spectral'\nnodes = {nodes}\n"
        f"side = {(nodes - 1) * SPACING}\nroll_off = {nodes / 4}\ncut_off = 2.0\nrms_slope = 0.1",
        "the benchmark",
    )
    plan = parameters(scene, 0, 1)
    surface = benchmark(lambda: surface_of(scene, plan, 0))
    assert surface.shape == (nodes, nodes)
    assert surface.min() == 0.0


SIDE = 1000.0
"""Scan length of the generated surfaces [um]."""

STEP = 1 / 8192
"""Heights are rounded to multiples of this [um], so that exact statistics take only seconds."""


def generated(generator: str, nodes: int) -> NDArray[np.float64]:
    """Generate heights of random midpoint displacement, (nodes, nodes) [um]."""
    return generate(
        generator, nodes, hurst=0.65, sigma0=12.0, random=np.random.default_rng(7)
    )


@sizes
@pytest.mark.parametrize("generator", GENERATORS)
def test_generate(benchmark: BenchmarkFixture, generator: str, nodes: int) -> None:
    """Generate a surface, which has the nodes of a coarser surface of the same seed."""
    heights = benchmark(generated, generator, nodes)
    coarse = generated(generator, 17)
    step = (nodes - 1) // 16
    shared = heights[::step, ::step]
    assert heights.shape == (nodes, nodes)
    assert heights.min() == 0.0
    # Each surface is shifted so that its lowest node is at 0.
    assert shared - shared[0, 0] == pytest.approx(coarse - coarse[0, 0], abs=1e-10)


@sizes
def test_describe(benchmark: BenchmarkFixture, nodes: int) -> None:
    """Compute the 22 statistics, and compare them with an exact computation in fractions."""
    heights = np.round(generated("diamond-square", nodes) / STEP) * STEP
    spacing = SIDE / (nodes - 1)
    description = benchmark(describe, heights, spacing)
    expected = exact.statistics(heights, (spacing, spacing))
    assert description.reason == ""
    assert description.values == pytest.approx(expected, rel=1e-10)
