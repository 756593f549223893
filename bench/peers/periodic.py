"""Periodic patches: our solver beside those of other people, under given loads.

All solve the same problem: the displacement of a wave is 2 / (E* |q|) of its pressure, and zero on
average. Surfaces have a power spectrum from a quarter of the side down to four cells.
"""

import time
from collections.abc import Iterator, Sequence
from functools import lru_cache, partial
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

import bem
from bench.page import content
from bench.peers.accuracy import Errors, loosest
from bench.picture import draw_curves, new_figure
from bench.remarks import remark
from bench.report import Report
from bench.solvers import aspher, contact_mechanics, tamaas
from bench.solvers.case import Case, Field
from bench.solvers.others import installed
from bench.solvers.solver import Answer, Failure, Press, Solver, back_and_forth
from gen.runtime.errors import InputError
from gen.spectral import SelfAffineSpectrum, generate_spectral

Row = dict[str, Any]

HURSTS = (0.8, 0.3, 0.5, 0.65, 0.95)
"""One surface each; solvers are timed on the first."""

LOADS = (0.004, 0.04, 0.26, 0.75, 1.2)
"""Mean pressures over E* times the rms slope: some 1, 10, 50, 90 and 99 % of the nodes touch."""

REFERENCE_RTOL = 1e-13
LADDER = tuple(10.0**-decade for decade in range(2, 13))
GUESS = 1e-5
LARGEST = 512
"""Nodes a side up to which all surfaces are solved, as closely as each solver can."""


def _edgeless(nodes: int, spacing: float) -> Press:
    """Open `bem.solve` for periodic patches."""
    side = nodes * spacing

    def press(case: Case, force: float, tolerance: float) -> Answer:
        load = case.mean_pressure(force)
        try:
            contact = bem.solve(
                case.heights, side, pressure=load, boundary="periodic", rtol=tolerance
            )
        except bem.NotConverged as failure:
            raise Failure(str(failure)) from None
        return Answer(contact.pressure, contact.iterations, contact.convolutions)

    return press


_cm = partial(Solver, package="ContactMechanics", install="peers")
_aspher = partial(Solver, package="aspher", install="peers", control="force")
SOLVERS = (
    Solver("bem", _edgeless, control="force", precision="mixed"),
    _cm(
        "ContactMechanics primal",
        partial(contact_mechanics.primal_gradients, control="force", boundary="periodic"),
        control="force",
    ),
    _cm("ContactMechanics dual", partial(contact_mechanics.dual_gradients, boundary="periodic")),
    Solver(
        "Tamaas",
        partial(tamaas.projected_gradients, boundary="periodic"),
        package="tamaas",
        install="peers",
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
def contact_of(nodes: int, hurst: float, load: float) -> bem.Contact:
    """Return the reference, on a side of 1 um with a rms slope of 1 and E* = 1 MPa."""
    spectrum = SelfAffineSpectrum(hurst, roll_off=0.25, cut_off=4 / nodes)
    random = np.random.default_rng(25)
    heights = generate_spectral((nodes, nodes), 1.0, spectrum, random, rms_slope=1.0)
    return bem.solve(heights, 1.0, pressure=load, boundary="periodic", rtol=REFERENCE_RTOL)


class Trial:
    """One solver on one contact."""

    def __init__(self, solver: Solver, exact: bem.Contact) -> None:
        nodes = len(exact.pressure)
        # A case is of nodes that end at the border: this side makes its spacing that of the cells.
        heights = np.array(exact.problem.heights)
        self.case = Case("periodic", heights, (nodes - 1) / nodes, exact.delta)
        self.solver, self.exact = solver, exact
        self.press = solver.set_up(nodes, 1 / nodes)
        self.seconds: list[float] = []
        self.convolutions: int | None = None
        self.remark = ""

    def errors(self, tolerance: float) -> Errors | None:
        """Solve, and compare; None if the solver fails."""
        began = time.process_time()
        try:
            answer = self.press(self.case, self.exact.force, tolerance)
        except Exception as failure:
            if not (self.solver.install or isinstance(failure, Failure)):
                raise  # only other people's code may fail in any way
            self.remark = f"tolerance {tolerance:.0e}: {failure}"
            return None
        self.seconds = [*self.seconds, time.process_time() - began]
        pressure, exact = answer.pressure, self.exact
        self.convolutions = answer.convolutions
        waves = np.fft.rfft2(pressure) * _compliances(len(pressure))
        moved = np.fft.irfft2(waves, s=pressure.shape)
        depth = moved - (self.case.heights - self.case.heights.max())
        given = {"force": (pressure * depth).sum() / pressure.sum() / exact.delta}
        load = given.get(self.solver.control, pressure.mean() / exact.pressure.mean())
        return Errors(
            abs(float(load) - 1),
            int(np.count_nonzero((pressure > 0) != (exact.pressure > 0))),
            float(np.abs(pressure - exact.pressure).max() / exact.pressure.max()),
        )

    def good_enough(self, tolerance: float) -> bool:
        """Say whether a tolerance gives load and contact as closely as the comparison asks."""
        errors = self.errors(tolerance)
        return errors is not None and errors.good_enough(self.exact.contact_nodes)


def _compliances(nodes: int) -> Field:
    """Return 2 / |q| of all waves on a side of 1 um."""
    orders = np.hypot.outer(np.fft.fftfreq(nodes, 1 / nodes), np.arange(nodes // 2 + 1.0))
    orders[0, 0] = np.inf
    return np.asarray(1 / (np.pi * orders))


def rows_of(nodes: int, hurst: float, load: float, rounds: int) -> Iterator[Row]:
    """Compare all solvers on a contact; without rounds, only how close they come to it."""
    exact = contact_of(nodes, hurst, load)
    remark(f"{nodes} nodes a side, H = {hurst:g}, p / (E* h') = {load:g}")
    trials = [Trial(solver, exact) for solver in (SOLVERS[0], *installed(SOLVERS[1:]))]
    closest = [_closest(trial) if nodes <= LARGEST else None for trial in trials]
    found = [loosest(each.good_enough, LADDER, GUESS) if rounds else None for each in trials]
    for trial in trials:
        trial.seconds = []
    timed = [pair for pair in zip(trials, found, strict=True) if pair[1] is not None]
    for trial, tolerance in back_and_forth(timed, rounds):
        trial.errors(float(tolerance or 0))
    ours = median(trials[0].seconds) if trials[0].seconds else None
    for trial, tolerance, close in zip(trials, found, closest, strict=True):
        seconds = median(trial.seconds) if trial.seconds else None
        yield {
            "nodes": nodes,
            "hurst": hurst,
            "mean_pressure": load,  # over E* times the rms slope
            "area_percent": exact.area_percent,
            "solver": trial.solver.name,
            "version": trial.solver.version,
            "closest_load_error": close.load_error if close else None,
            "closest_misplaced_nodes": close.misplaced_nodes if close else None,
            "closest_pressure_error": close.pressure_error if close else None,
            "tolerance": tolerance,  # the loosest that is good enough
            "seconds": seconds,  # of CPU time, median
            "times_ours": seconds / ours if seconds and ours else None,
            "convolutions": trial.convolutions if tolerance else None,
            "remark": "" if close or tolerance else trial.remark,
        }


def _closest(trial: Trial) -> Errors | None:
    """Return the errors at the tightest tolerance that the solver reaches."""
    return next(filter(None, map(trial.errors, (1e-12, 1e-10, 1e-8, 1e-6))), None)


def compare(nodes: Sequence[int], rounds: int) -> list[Row]:
    """Compare on all surfaces and loads: closeness of all, CPU time on the first surface."""
    for size in nodes:
        if size < aspher.COARSEST or size & (size - 1):
            raise InputError(f"nodes {size}: give 2^k from {aspher.COARSEST} on, as 128, 256, 512")
    return [
        row
        for size in nodes
        for hurst in (HURSTS if size <= LARGEST else HURSTS[:1])
        for load in LOADS
        for row in rows_of(size, hurst, load, rounds if hurst == HURSTS[0] else 0)
    ]


def report(rows: Sequence[Row]) -> Report:
    """Return the table, and a picture of the times over ours."""
    nodes = list(dict.fromkeys(row["nodes"] for row in rows))
    figure = new_figure(3.2 * len(nodes), 3.6)
    panels = figure.subplots(1, len(nodes), sharey=True, squeeze=False)[0]
    for panel, size in zip(panels, nodes, strict=True):
        timed = [row for row in rows if row["nodes"] == size and row["seconds"]]
        draw_curves(panel, timed, "mean_pressure", "times_ours", by="solver")
        panel.set(title=f"{size} × {size} nodes", xlabel="p / (E* h′)", xscale="log", yscale="log")
    panels[0].set_ylabel("processor time over ours")
    panels[0].legend(fontsize="x-small")
    tables = {
        "periodic": [row for row in rows if row["seconds"] or row["remark"]],
        "periodic-agreement": list(agreement(rows)),
    }
    return Report(tables, pictures={"periodic": figure})


def agreement(rows: Sequence[Row]) -> Iterator[Row]:
    """Yield how far each solver is from ours at most, over all surfaces and loads of a grid."""
    errors = ("closest_load_error", "closest_misplaced_nodes", "closest_pressure_error")
    for nodes, solver in dict.fromkeys((row["nodes"], row["solver"]) for row in rows):
        own = [row for row in rows if (row["nodes"], row["solver"]) == (nodes, solver)]
        found = [row for row in own if row[errors[0]] is not None]
        if found:
            largest = {error: max(row[error] for row in found) for error in errors}
            counts = {"contacts": len(own), "solved": len(found)}
            yield {"nodes": nodes, "solver": solver, **counts, **largest}


def contents(folder: Path) -> list[content.Content]:
    """List what a folder holds of this comparison."""
    table = folder / "periodic.csv"
    command = "python -m bench peers --boundary periodic --nodes 128,256 --rounds 2 -o DIR"
    return [
        content.Figure(
            folder / "periodic.png",
            "Periodic patches: processor time over ours against the load, at which 1 to 99 % of the"
            " nodes touch, each solver at its loosest tolerance with the displacement within 1e-6"
            " and the contact set within 0.05 %. Above 1 we are faster.",
            command,
            (table,),
        ),
        content.Table(
            table,
            "The same as numbers.",
            command,
            (
                *("nodes", "mean_pressure", "area_percent", "solver", "tolerance", "seconds"),
                *("times_ours", "convolutions", "remark"),
            ),
        ),
        content.Table(
            folder / "periodic-agreement.csv",
            "How far solvers of periodic patches are from ours at most, each at its tightest"
            " tolerance, on five surfaces under five loads: displacement, or force where the"
            " displacement is given, nodes in contact, and pressure over the largest.",
            command,
        ),
    ]
