"""Other solvers beside ours on free patches, bodies that yield, and periodic patches.

Equal accuracy first, then time: each solver at the loosest tolerance that is good enough. `Errors`
says when a solution counts as one, `Trial` finds the tolerance, `compare` times.

On periodic patches all solve the same problem: the displacement of a wave is 2 / (E* |q|) of its
pressure, and zero on average. Surfaces have a power spectrum from a quarter of the side down to
four cells.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import lru_cache, partial
from itertools import product
from statistics import median

import numpy as np

from bench.files import Row
from bench.report import remark
from bench.solvers import others
from bench.solvers.others import installed, missing
from bench.solvers.solver import (
    BEM,
    PAPERS,
    PERIODIC_RTOL,
    Answer,
    Case,
    Control,
    Exact,
    Failure,
    Solver,
    back_and_forth,
    find_exact,
)
from gen.arrays import Values
from gen.generation.plan import surface_random
from gen.quantities import AREA, CONTACT_NODES, DELTA
from gen.runtime.errors import InputError
from gen.scene import load
from gen.spectral import SelfAffineSpectrum, generate_spectral
from gen.surface import generate

SIDE = 1000.0  # um
SIGMA0 = 20.0  # um

# Of the paper preset's surfaces one on which, at 129 nodes a side, H = 0.8 and Delta = 5 um, 6 to
# 18 nodes touch, where MIRCO is at its best; at H = 0.65 its contacts are of middling size.
SURFACE = 18

HURST = 0.65
PAPERS_HURST = 0.8
PAPERS_NODES = 129
PAPERS_DELTAS = (5.0, 15.0, 25.0)  # um

PERIODIC_HURST = 0.8
# Mean pressures over E* times the rms slope: some 1, 10, 50, 90 and 99 % of the nodes touch.
LOADS = (0.004, 0.04, 0.26, 0.75, 1.2)
PERIODIC_LADDER = tuple(10.0**-decade for decade in range(2, 13))


@lru_cache(maxsize=64)  # the same case has its exact solution found once
def sample(
    nodes: int, delta: float, hardness: float | None = None, hurst: float = HURST
) -> Case:
    """Return the surface, 2^k + 1 nodes a side, pressed by Delta [um]; the hardness is over E*."""
    name = f"H = {hurst}, Delta = {delta:g} um"
    if hardness is not None:
        name += f", hardness {hardness:g} E*"
    heights = generate(
        "diamond-square", nodes, hurst, SIGMA0, surface_random(load("paper"), SURFACE)
    )
    return Case(name, heights, SIDE, delta, hardness=hardness, hurst=hurst)


def samples(
    nodes: Sequence[int], deltas: Sequence[float], hardnesses: Sequence[float] = ()
) -> list[Case]:
    """Return the peers' surface at every load on every grid, elastic and with every hardness.

    Without a hardness, contacts of the paper's algorithm are added at its grid.
    """
    bounds = (None, *sorted(hardnesses, reverse=True))
    found = []
    for size in nodes:
        found += [sample(size, *each) for each in product(deltas, bounds)]
        if size == PAPERS_NODES and not hardnesses:
            found += [sample(size, delta, hurst=PAPERS_HURST) for delta in PAPERS_DELTAS]
    return found


# The force at the displacement given, or the displacement of the far field at the force given [1].
LOAD_ERROR = 1e-6
# Nodes in contact in one solution only, of those in contact [1]; one is always allowed.
MISPLACED_SHARE = 5e-4
TURN = 0.05  # s of CPU time that a solver's turn takes at least, by repetition
PATIENCE = 5.0  # s of CPU time of a solve that is not repeated for its median


@dataclass(frozen=True)
class Errors:
    """How far a pressure is from the reference."""

    load_error: (
        float  # of the force, or of the displacement where the force is given, relative
    )
    misplaced_nodes: int  # in contact, or yielded, in it or in the reference, not in both
    pressure_error: float  # the largest, over the largest pressure


def find_errors(pressure: Values, control: Control, case: Case, exact: Exact) -> Errors:
    """Measure the errors of an (n, n) pressure [MPa] that was found under a given load.

    A given force is met by construction, so that its displacement counts, which is computed here
    and not by the peer.
    """
    if control == "force":
        approach = case.displacement(pressure) - (case.heights - case.heights.max())
        load_error = (pressure * approach).sum() / pressure.sum() / case.delta - 1
    else:
        load_error = pressure.sum() * case.spacing**2 / exact.force - 1
    touching = (pressure > 0) != (exact.pressure > 0)
    yielded = case.yielded(pressure) != case.yielded(exact.pressure)
    return Errors(
        load_error=abs(float(load_error)),
        misplaced_nodes=int(np.count_nonzero(touching) + np.count_nonzero(yielded)),
        pressure_error=float(
            np.abs(pressure - exact.pressure).max() / exact.pressure.max()
        ),
    )


class Trial:
    """One solver on one contact."""

    def __init__(self, solver: Solver, case: Case) -> None:
        self.solver, self._case = solver, case
        self.tolerance: float | None = (
            None  # the loosest that is good enough, once it is found
        )
        self.remark = ""  # why there is none
        self._exact = find_exact(case)
        self.contact_nodes = int(np.count_nonzero(self._exact.pressure > 0))
        self._convolutions: int | None = None
        self._errors: Errors | None = None
        self._turns: list[float] = []
        self._seconds: list[float] = []

    def find_tolerance(self) -> None:
        """Find the loosest tolerance of the solver's ladder that is good enough."""
        if self.contact_nodes > self.solver.largest_contact:
            self.remark = (
                f"not tried above {self.solver.largest_contact:g} nodes in contact"
            )
            return
        allowed = max(1.0, MISPLACED_SHARE * self.contact_nodes)
        for tolerance in self.solver.ladder:
            try:
                answer, seconds = self._timed(tolerance)
            except Failure as failure:  # whoever does not reach it reaches no tighter one
                self.remark = f"tolerance {tolerance:.0e}: {failure}"
                return
            errors = find_errors(
                answer.pressure, self.solver.control, self._case, self._exact
            )
            if errors.load_error <= LOAD_ERROR and errors.misplaced_nodes <= allowed:
                self.tolerance, self._errors = tolerance, errors
                self._convolutions = answer.convolutions
                self._seconds = [seconds] if seconds > PATIENCE else []
                return
        self.remark = f"not good enough at {tolerance:.0e}"

    def _timed(self, tolerance: float) -> tuple[Answer, float]:
        began = time.process_time()
        return self.solver.solve(self._case, tolerance), time.process_time() - began

    def take_turn(self) -> None:
        """Time it at its tolerance, unless a time is there that is too long to be repeated."""
        if self.tolerance is None or max(self._seconds, default=0.0) > PATIENCE:
            return
        turn: list[float] = []
        while sum(turn) < TURN:
            turn.append(max(self._timed(self.tolerance)[1], 1e-6))
        self._turns.append(median(turn))
        self._seconds += turn

    @property
    def seconds(self) -> float | None:
        """Median of its times [s]."""
        return median(self._seconds) if self._seconds else None

    def times(self, other: "Trial") -> float | None:
        """Median over the rounds of its time over another's: a machine has slow seconds."""
        rounds = list(zip(self._turns, other._turns, strict=False))
        if rounds:
            return median(own / its for own, its in rounds)
        if self.seconds and other.seconds:  # one of them takes too long to be repeated
            return self.seconds / other.seconds
        return None

    def row(self, ours: "Trial") -> Row:
        """Return the row of the table; `ours` is the trial of the first solver."""
        case, solver, errors = self._case, self.solver, self._errors
        return {
            "nodes": case.nodes,
            "hurst": case.hurst,
            "sigma0_um": SIGMA0 if case.load is None else None,
            DELTA.in_tables: case.delta,
            "mean_pressure": case.load,  # on periodic patches, over E* times the rms slope
            CONTACT_NODES.name: self.contact_nodes,  # of the reference
            AREA.name: 100 * self._exact.contact_share,
            "solver": solver.name,
            "version": solver.version,
            "control": solver.control,
            "tolerance": self.tolerance,  # the loosest of its ladder that is good enough
            "seconds": self.seconds,  # of CPU time of a solve after the set-up, median
            "times_ours": self.times(ours),
            **{each.name: getattr(errors, each.name, None) for each in fields(Errors)},
            "remark": self.remark,  # why there are no numbers
            "hardness": case.hardness,  # over E*, None for elastic bodies
            "yielded_nodes": int(np.count_nonzero(case.yielded(self._exact.pressure))),
            "convolutions": self._convolutions,  # None if the solver does not count them
        }


def compare(
    cases: Sequence[Case], solvers: Sequence[Solver], rounds: int = 4
) -> list[Row]:
    """Bring solvers to the same accuracy on each contact, and time them there in turn.

    The first solver is ours, over whose time the others' are taken; each has as many turns as there
    are rounds.
    """
    rows: list[Row] = []
    for case in cases:
        remark(f"{case.nodes} nodes a side, {case.name}")
        trials = [Trial(solver, case) for solver in solvers]
        for trial in trials:
            trial.find_tolerance()
        for trial in back_and_forth(trials, rounds):
            trial.take_turn()
        rows += [trial.row(trials[0]) for trial in trials]
    return rows


_peer = partial(Solver, install="peers", ladder=PERIODIC_LADDER)
_by_force = partial(_peer, control="force")
_aspher = partial(_by_force, package="aspher")
PERIODIC_SOLVERS = (
    replace(BEM, control="force", ladder=PERIODIC_LADDER),
    _by_force(
        "ContactMechanics primal",
        partial(others.primal_gradients, control="force", boundary="periodic"),
        "ContactMechanics",
    ),
    _peer(
        "ContactMechanics dual",
        partial(others.dual_gradients, boundary="periodic"),
        "ContactMechanics",
    ),
    _by_force(
        "Tamaas", partial(others.projected_gradients, boundary="periodic"), "tamaas"
    ),
    _aspher(
        "ASPHER", partial(others.single_grid, precond="fourier-fft", backend="periodic")
    ),
    _aspher(
        "ASPHER nested, FFT",
        partial(others.nested_grids, engine="fft", backend="periodic"),
    ),
)


@lru_cache(maxsize=4)
def periodic_sample(nodes: int, hurst: float, load: float) -> Case:
    """Return a contact on a side of 1 um with a rms slope of 1; the load is a mean pressure."""
    spectrum = SelfAffineSpectrum(hurst, roll_off=0.25, cut_off=4 / nodes)
    random = np.random.default_rng(25)
    heights = generate_spectral((nodes, nodes), 1.0, spectrum, random, rms_slope=1.0)
    name = f"H = {hurst:g}, p / (E* h') = {load:g}"
    case = Case(name, heights, side=1.0, delta=np.nan, hurst=hurst, load=load)
    return replace(case, delta=case.solve(PERIODIC_RTOL).delta)


def peers(nodes: Sequence[int], deltas: Sequence[float], rounds: int) -> list[Row]:
    """Compare all solvers that are installed, and the paper's algorithm, at equal accuracy."""
    _check(nodes, deltas)
    for package, install in missing().items():
        remark(f"{package} is not installed and left out: {install}")
    return compare(samples(nodes, deltas), [BEM, PAPERS, *installed()], rounds)


def hardness(
    nodes: Sequence[int], deltas: Sequence[float], hardness: Sequence[float], rounds: int
) -> list[Row]:
    """Compare the solvers that know a hardness on bodies that yield, elastic ones beside them."""
    _check(nodes, (*deltas, *hardness))
    plastic = [solver for solver in (BEM, *installed()) if solver.plastic]
    return compare(samples(nodes, deltas, hardness), plastic, rounds)


def periodic(nodes: Sequence[int], rounds: int) -> list[Row]:
    """Compare all solvers that are installed on periodic patches, a surface under all loads."""
    for size in nodes:
        if size < others.COARSEST or size & (size - 1):
            raise InputError(
                f"nodes {size}: give 2^k from {others.COARSEST} on, as 128, 256, 512"
            )
    cases = [
        periodic_sample(size, PERIODIC_HURST, load)
        for size, load in product(nodes, LOADS)
    ]
    return compare(cases, [PERIODIC_SOLVERS[0], *installed(PERIODIC_SOLVERS[1:])], rounds)


def _check(nodes: Sequence[int], values: Sequence[float]) -> None:
    for size in nodes:
        if size < 3 or (size - 1) & (size - 2):
            raise InputError(f"nodes {size}: give 2^k + 1, as 129, 257, 513")
    for value in values:
        if not 0 < value < float("inf"):
            raise InputError(f"{value:g}: give displacements and hardnesses above 0")
