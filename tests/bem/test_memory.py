"""Memory that stays with the process from one solve to the next."""

import platform
import subprocess
import sys

import pytest

SOLVES = """
import numpy as np, resource, bem
heights = np.random.default_rng(1).standard_normal((256, 256))
faults = []
for _ in range(6):
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    bem.solve(heights, 1.0, pressure=20.0, boundary="periodic", rtol=1e-2)
    faults.append(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
print(min(faults))
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="about glibc's heap")
def test_a_solve_finds_the_memory_of_the_one_before() -> None:
    """It would wait for hundreds of pages otherwise, of 4 KB each."""
    run = subprocess.run([sys.executable, "-c", SOLVES], capture_output=True, text=True, check=True)
    assert int(run.stdout) < 20
