"""Fits that are too large for the machine, or for what other fits leave of it."""

import subprocess
import sys

import numpy as np
from comparisons import run

from learn import memory


def test_too_little_memory_is_refused_with_the_numbers(solved, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(memory, "available", lambda: memory.PROCESS + 50_000)
    assert run("compare", solved, "-o", tmp_path / "out", "--model", "gaussian-process") == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "GiB for 72 training rows" in said
    assert "--train-rows" in said


def test_two_fits_that_do_not_fit_together_wait_for_each_other(tmp_path):
    code = (
        "import sys, time\n"
        "from learn import memory\n"
        "memory.available = lambda: 1000 * memory.MIB\n"
        "memory.tempfile.gettempdir = lambda: sys.argv[1]\n"
        "with memory.reserved(int(sys.argv[2]) * memory.MIB):\n"
        "    print(time.time(), flush=True); time.sleep(1.0); print(time.time(), flush=True)\n"
    )

    def spans(sizes):
        each = [
            subprocess.Popen(
                [sys.executable, "-c", code, str(tmp_path), str(size)],
                stdout=subprocess.PIPE,
                text=True,
            )
            for size in sizes
        ]
        return [[float(line) for line in one.communicate(timeout=60)[0].split()] for one in each]

    (begin_a, end_a), (begin_b, end_b) = spans([600, 600])
    assert begin_b >= end_a - 0.01 or begin_a >= end_b - 0.01
    together = spans([300, 300, 300])
    assert max(begin for begin, _ in together) < min(end for _, end in together) + 5
    assert np.isfinite(together).all()
