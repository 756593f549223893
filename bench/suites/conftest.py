"""Entries that all benchmarks record: machine, code and versions."""

import os
from typing import Any

import pytest

from bench.record import circumstances

# One thread, as in production: more would blur every time.
for library in ("OMP", "OPENBLAS", "MKL", "BLIS", "VECLIB_MAXIMUM"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")


@pytest.hookimpl(optionalhook=True)
def pytest_benchmark_update_machine_info(machine_info: dict[str, Any]) -> None:
    """The processor as the system names it, its cores, and the threads that were used."""
    machine_info.update(circumstances()["machine"])


@pytest.hookimpl(optionalhook=True)
def pytest_benchmark_update_json(benchmarks: list[Any], output_json: dict[str, Any]) -> None:
    """Versions of all libraries, once for a file and once for each benchmark."""
    versions = circumstances()["versions"]
    output_json["versions"] = versions
    for benchmark in output_json["benchmarks"]:
        benchmark["extra_info"]["versions"] = versions
