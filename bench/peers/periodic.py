"""Periodic patches: our solver beside those of other people, under given loads.

All solve the same problem: the displacement of a wave is 2 / (E* |q|) of its pressure, and zero on
average. Surfaces have a power spectrum from a quarter of the side down to four cells.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import lru_cache, partial

import numpy as np

from bench.files import Row
from bench.peers.compare import Errors, find_errors
from bench.peers.compare import compare as equal_accuracy
from bench.report import Report
from bench.solvers import aspher, contact_mechanics, tamaas
from bench.solvers.case import PERIODIC_RTOL, Case, find_exact
from bench.solvers.others import installed
from bench.solvers.own import press_boundary_elements
from bench.solvers.solver import REFERENCE_RTOL, Failure, Press, Solver
from gen.runtime.errors import InputError
from gen.spectral import SelfAffineSpectrum, generate_spectral

HURSTS = (0.8, 0.3, 0.5, 0.65, 0.95)  # one surface each; solvers are timed on the first
# Mean pressures over E* times the rms slope: some 1, 10, 50, 90 and 99 % of the nodes touch.
LOADS = (0.004, 0.04, 0.26, 0.75, 1.2)

CLOSEST = "closest_load_error", "closest_misplaced_nodes", "closest_pressure_error"
MEASURED = "tolerance", "seconds", "times_ours", "convolutions"
LADDER = tuple(10.0**-decade for decade in range(2, 13))
LARGEST = 512  # nodes a side up to which all surfaces are solved, as closely as each solver can
LONG, FEW_ROUNDS = 512, 3  # nodes a side from which on solves take long, and rounds at most there


def _edgeless(nodes: int, spacing: float) -> Press:
    """Open `bem.solve` for periodic patches, which keeps nothing for a grid."""
    return press_boundary_elements


_peer = partial(Solver, install="peers", ladder=LADDER)
_cm = partial(_peer, package="ContactMechanics")
_aspher = partial(_peer, package="aspher", control="force")
SOLVERS = (
    Solver("bem", _edgeless, control="force", precision="mixed", ladder=LADDER),
    _cm(
        "ContactMechanics primal",
        partial(contact_mechanics.primal_gradients, control="force", boundary="periodic"),
        control="force",
    ),
    _cm("ContactMechanics dual", partial(contact_mechanics.dual_gradients, boundary="periodic")),
    _peer(
        "Tamaas",
        partial(tamaas.projected_gradients, boundary="periodic"),
        package="tamaas",
        control="force",
    ),
    _aspher("ASPHER", partial(aspher.single_grid, precond="fourier-fft", backend="periodic")),
    _aspher(
        "ASPHER nested, FFT",
        partial(aspher.nested_grids, engine="fft", backend="periodic"),
        precision="mixed",
    ),
)


@lru_cache(maxsize=4)
def sample(nodes: int, hurst: float, load: float) -> Case:
    """Return a contact on a side of 1 um with a rms slope of 1; the load is a mean pressure."""
    spectrum = SelfAffineSpectrum(hurst, roll_off=0.25, cut_off=4 / nodes)
    random = np.random.default_rng(25)
    heights = generate_spectral((nodes, nodes), 1.0, spectrum, random, rms_slope=1.0)
    name = f"H = {hurst:g}, p / (E* h') = {load:g}"
    case = Case(name, heights, side=1.0, delta=np.nan, hurst=hurst, load=load)
    return replace(case, delta=case.solve(PERIODIC_RTOL).delta)


def errors_of(solver: Solver, case: Case, tolerance: float) -> Errors:
    """Solve, and compare with the exact solution; raise `Failure` if the solver fails."""
    pressure = solver.solve(case, tolerance).pressure
    return find_errors(pressure, solver.control, case, find_exact(case, REFERENCE_RTOL))


def _closest(solver: Solver, case: Case) -> tuple[Errors | None, str]:
    """Return the errors at the tightest tolerance that a solver reaches, or why there are none."""
    why = ""
    for tolerance in (1e-12, 1e-10, 1e-8, 1e-6):
        try:
            return errors_of(solver, case, tolerance), ""
        except Failure as failure:
            why = f"tolerance {tolerance:.0e}: {failure}"
    return None, why


def rows_of(nodes: int, hurst: float, load: float, rounds: int) -> Iterator[Row]:
    """Compare all solvers on a contact; without rounds, only how close they come to it."""
    case, solvers = sample(nodes, hurst, load), [SOLVERS[0], *installed(SOLVERS[1:])]
    share = find_exact(case, REFERENCE_RTOL).contact_share
    timed = {row["solver"]: row for row in equal_accuracy([case], solvers, rounds)}
    for solver in solvers:
        close, why = _closest(solver, case) if nodes <= LARGEST else (None, "")
        row = timed[solver.name] if rounds else {"remark": why}
        yield {
            "nodes": nodes,
            "hurst": hurst,
            "mean_pressure": load,  # over E* times the rms slope
            "area_percent": 100 * share,
            "solver": solver.name,
            "version": solver.version,
            **{error: getattr(close, error.removeprefix("closest_"), None) for error in CLOSEST},
            **{name: row.get(name) for name in MEASURED},
            "remark": "" if close or row.get("tolerance") else row["remark"],
        }


def compare(nodes: Sequence[int], rounds: int) -> list[Row]:
    """Compare on all surfaces and loads: closeness of all, CPU time on the first surface."""
    for size in nodes:
        if size < aspher.COARSEST or size & (size - 1):
            raise InputError(f"nodes {size}: give 2^k from {aspher.COARSEST} on, as 128, 256, 512")
    return [
        row
        for size in nodes
        for turns in [rounds if size < LONG else min(rounds, FEW_ROUNDS)]
        for hurst in (HURSTS if size <= LARGEST else HURSTS[:1])
        for load in LOADS
        for row in rows_of(size, hurst, load, turns if hurst == HURSTS[0] else 0)
    ]


def report(rows: Sequence[Row]) -> Report:
    """Make a report of the timed contacts, and of how far solvers are from ours at most."""
    tables = {
        "periodic": [row for row in rows if row["seconds"] or row["remark"]],
        "periodic-agreement": list(agreement(rows)),
    }
    return Report(tables, of="periodic")


def agreement(rows: Sequence[Row]) -> Iterator[Row]:
    """Yield how far each solver is from ours at most, over all surfaces and loads of a grid."""
    for nodes, solver in dict.fromkeys((row["nodes"], row["solver"]) for row in rows):
        own = [row for row in rows if (row["nodes"], row["solver"]) == (nodes, solver)]
        found = [row for row in own if row[CLOSEST[0]] is not None]
        if found:
            largest = {error: max(row[error] for row in found) for error in CLOSEST}
            counts = {"contacts": len(own), "solved": len(found)}
            yield {"nodes": nodes, "solver": solver, **counts, **largest}
