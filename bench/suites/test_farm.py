"""Time to hand out tasks that cost nothing, serially and under mpiexec; every one has to be done.

    pytest bench --benchmark-only -k dispatch

Under mpiexec the time of a round is that of the whole program; `seconds_per_task` in the extra info
is the farm's alone.
"""

from pathlib import Path
from typing import Any

import pytest

from bench.farm.launch import dispatch, expected, launch
from gen.runtime.errors import InputError
from gen.runtime.farm import World

TASKS = {"smoke": 256, "paper": 15_878, "large": 100_000}
RANKS = 3


@pytest.mark.parametrize("size", TASKS)
def test_dispatch_serially(benchmark: Any, size: str) -> None:
    tasks = TASKS[size]
    assert benchmark(dispatch, tasks, World()) == expected(tasks)
    if benchmark.enabled:
        benchmark.extra_info["seconds_per_task"] = benchmark.stats["median"] / tasks


@pytest.mark.parametrize("size", TASKS)
def test_dispatch_to_workers(benchmark: Any, size: str, tmp_path: Path) -> None:
    tasks = TASKS[size]
    if size != "smoke" and not benchmark.enabled:
        pytest.skip("the smoke size asserts the same; this one is for times")
    arguments = (RANKS, "bench.farm.launch", {"tasks": tasks}, tmp_path)
    try:
        found = benchmark.pedantic(launch, args=arguments, rounds=1)
    except InputError as error:
        if "no mpiexec" not in str(error):
            raise
        pytest.skip(str(error))
    assert found["workers"] == RANKS - 1
    assert found["total"] == expected(tasks)
    benchmark.extra_info["seconds_per_task"] = found["seconds"] / tasks
