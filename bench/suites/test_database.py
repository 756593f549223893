"""Time to write rows with fields into a database, with both writers; what arrived is asserted.

    pytest bench --benchmark-only -k write

`python -m bench writers` measures both side by side, on any number of ranks.
"""

from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest

from bench.farm.launch import launch
from bench.farm.writers import Spec, create, require_rows, template_of, write
from gen import database
from gen.generation.run import Target, blocks_of
from gen.runtime.farm import World

SIZES = {"smoke": Spec(32, 33, 1), "paper": Spec(256, 129, 1), "large": Spec(32, 513, 1)}
RANKS = 3


@pytest.mark.parametrize("size", SIZES)
def test_write_by_one(benchmark: Any, tmp_path: Path, size: str) -> None:
    """Rows with their pressure fields, to the kernel; creating the file is not timed."""
    spec, path = SIZES[size], tmp_path / "rows.h5"
    blocks = list(blocks_of(spec.scene, [(0, spec.rows)], World().workers))
    template, target = template_of(spec.scene, blocks), Target(path, spec.scene, parallel=False)
    arguments = (target, blocks, template, World())
    benchmark.pedantic(lambda: write(*arguments), setup=lambda: create(target), rounds=3)
    require_rows(path, blocks, template)
    if benchmark.enabled:
        benchmark.extra_info["megabytes_per_second"] = spec.megabytes / benchmark.stats["median"]


@pytest.mark.parametrize("size", SIZES)
def test_write_by_all(benchmark: Any, tmp_path: Path, size: str) -> None:
    """By two workers under mpiexec; a round is the whole program, which writes with both writers.

    The program asserts that all rows arrived; the rates of the extra info are those of the writers.
    """
    if not database.parallel_hdf5():
        pytest.skip("this h5py has no MPI: make parallel")
    spec = SIZES[size]
    arguments = (RANKS, "bench.farm.writers", asdict(spec), tmp_path)
    seconds = benchmark.pedantic(launch, args=arguments, rounds=1)
    for writer in ("single", "parallel"):
        (found,) = seconds[writer]
        benchmark.extra_info[f"{writer}_megabytes_per_second"] = spec.megabytes / found
