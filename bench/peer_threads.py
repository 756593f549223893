"""How much faster other solvers are on threads of their own.

Tamaas and ASPHER are built with OpenMP, which reads the number of threads from the environment as
it starts: every measurement is a process of its own. Their solves of a large free patch take up to
minutes, so that a few iterations are timed. Each applies the operator once, and in ASPHER the
preconditioner.
"""

import importlib
import os
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from importlib.util import find_spec
from statistics import median
from typing import Any

import numpy as np

from bem.workers import THREADS_VARIABLE
from bench.growth import SIDE, surface
from bench.report import remark
from bench.solvers import aspher
from bench.solvers.tamaas import OPERATOR
from bench.table import formatted

Row = dict[str, Any]

# Iterations that are timed, and the mean pressure [E*] and tolerance at which they are.
ITERATIONS = 3
PRESSURE = 0.02
NEVER_MET = 1e-30

# ASPHER's preconditioner that takes the fewest iterations: a transform of the grid.
FILTER = "fourier-fft"

COLUMNS = {
    "solver": "{solver}",
    "nodes": "{nodes}",
    "threads": "{threads}",
    "seconds on one": "{seconds_one:.3g}",
    "seconds": "{seconds:.3g}",
    "gain": "{gain:.2f}",
}


def measure(nodes: Sequence[int], threads: int, rounds: int) -> list[Row]:
    """Time iterations of other solvers on one and on several threads, of those that are installed.

    Raises
    ------
    subprocess.CalledProcessError
        If a process of one of them fails.
    """
    rows = []
    for name, (package, install, _) in PEERS.items():
        if find_spec(package) is None:
            remark(f"{name} is missing: {install}")
            continue
        for size in nodes:
            rows.append(_measured(name, size, threads, rounds))
            remark(f"{name}, {size} nodes: {rows[-1]['gain']:.2f} times as fast")
    return rows


def _measured(name: str, nodes: int, threads: int, rounds: int) -> Row:
    """Time iterations of one of them on one and on several threads in turn."""
    seconds: dict[int, list[float]] = {1: [], threads: []}
    for turn in range(rounds):
        for many in (1, threads) if turn % 2 else (threads, 1):
            seconds[many].append(_timed_apart(name, nodes, many))
    return {
        "solver": f"{name}, {ITERATIONS} iterations",
        "nodes": nodes,
        "threads": threads,
        "seconds_one": median(seconds[1]),
        "seconds": median(seconds[threads]),
        "gain": gain(seconds[1], seconds[threads]),
    }


def gain(slow: Sequence[float], fast: Sequence[float]) -> float:
    """Return how many times as long the slow one of a turn takes, the median over the turns."""
    return median(one / other for one, other in zip(slow, fast, strict=True))


def table(rows: Sequence[Row]) -> str:
    """Return the table of the rows, or what to install for it."""
    if not rows:
        remedies = "; ".join(install for _, install, _ in PEERS.values())
        return f"Other solvers on threads of their own: none installed: {remedies}"
    return f"Other solvers on threads of their own:\n\n{formatted(COLUMNS, rows)}"


def _timed_apart(name: str, nodes: int, threads: int) -> float:
    """Return the time of some iterations in a process that has a number of threads [s]."""
    command = [sys.executable, "-m", "bench.peer_threads", name, str(nodes)]
    environment = os.environ | {THREADS_VARIABLE: str(threads)}
    done = subprocess.run(command, env=environment, stdout=subprocess.PIPE, check=True, text=True)
    return float(done.stdout.split()[-1])


def _iterate_tamaas(nodes: int) -> float:
    """Return the time of some iterations of Tamaas on a free patch [s]."""
    tamaas: Any = importlib.import_module("tamaas")

    tamaas.set_log_level(tamaas.LogLevel.error)
    model = tamaas.ModelFactory.createModel(
        tamaas.model_type.basic_2d, [SIDE, SIDE], [nodes, nodes]
    )
    model.E, model.nu = 1.0, 0.0
    tamaas.ModelFactory.registerNonPeriodic(model, OPERATOR)
    heights = np.ascontiguousarray(surface(nodes, 0))
    seconds = 0.0
    for iterations in (1, ITERATIONS):  # the first solve makes plans and tables
        model.traction[:] = 0
        model.displacement[:] = 0
        solver = tamaas.PolonskyKeerRey(model, heights, NEVER_MET)
        solver.setIntegralOperator(OPERATOR)
        solver.max_iter = iterations
        began = time.perf_counter()
        solver.solve(PRESSURE)
        seconds = time.perf_counter() - began
    return seconds


def _iterate_aspher(nodes: int) -> float:
    """Return the time of some iterations of ASPHER on a free patch [s]."""
    solver: Any = importlib.import_module("aspher").ContactSolver(
        grid_size=nodes, domain_size=SIDE, E_star=1.0, backend="fft"
    )
    gaps = -surface(nodes, 0).ravel()
    seconds = 0.0
    for iterations in (1, ITERATIONS):  # the first solve makes plans and tables
        began = time.perf_counter()
        solver.solve(gaps, p_nominal=PRESSURE, tol=NEVER_MET, max_iter=iterations, precond=FILTER)
        seconds = time.perf_counter() - began
    return seconds


PEERS: dict[str, tuple[str, str, Callable[[int], float]]] = {
    "Tamaas": ("tamaas", "pip install tamaas", _iterate_tamaas),
    "ASPHER": ("aspher", aspher.SOLVERS[0].install, _iterate_aspher),
}
"""Package of each solver, how to install it, and the function that times its iterations."""

if __name__ == "__main__":
    print(PEERS[sys.argv[1]][2](int(sys.argv[2])))  # noqa: T201  read by the parent process
