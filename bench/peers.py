"""Other solvers beside ours on free patches, bodies that yield, and periodic patches.

Solvers are first brought to equal accuracy, then timed: each runs at the loosest tolerance that is
good enough. `find_errors` measures the accuracy, `Trial` finds the tolerance, `compare` times.

On periodic patches all solvers have one problem: the displacement of a wave is 2 / (E* |q|) of its
pressure, and the mean displacement is zero. The surfaces have a power spectrum with waves from a
quarter of the side down to four cells.
"""

import math
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields, replace
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

SIDE = 1000.0
"""Scan length of the surfaces on free patches [um]."""

SIGMA0 = 20.0
"""Standard deviation of their first displacement [um]."""

SURFACE = 18
"""Row of the paper preset whose random numbers make the surfaces.

At 129 nodes a side, H = 0.8 and Delta = 5 um, 6 to 18 nodes touch, where MIRCO is at its best. At
H = 0.65 the contacts are of middling size.
"""

HURST = 0.65
"""Hurst exponent of the surfaces on all grids [1]."""

PAPERS_HURST = 0.8
"""Hurst exponent of the contacts that suit the paper's algorithm [1]."""

PAPERS_NODES = 129
"""Nodes a side of these contacts."""

PAPERS_DELTAS = (5.0, 15.0, 25.0)
"""Displacements of these contacts [um]."""

PERIODIC_HURST = 0.8
"""Hurst exponent of the surfaces of periodic patches [1]."""

LOADS = (0.004, 0.04, 0.26, 0.75, 1.2)
"""Mean pressures on periodic patches, with some 1, 10, 50, 90 and 99 % of contact [E* h']."""

PERIODIC_LADDER = tuple(10.0**-decade for decade in range(2, 13))
"""Tolerances that are tried on periodic patches, falling [1]."""

LOAD_ERROR = 1e-6
"""Allowed relative error of the force, or of the displacement if the force is given [1]."""

MISPLACED_SHARE = 5e-4
"""Allowed number of nodes in contact in one solution only, over all nodes in contact [1].

One node is always allowed.
"""

TURN = 0.05
"""Shortest CPU time of a turn, in which a solver repeats a solve [s]."""

PATIENCE = 5.0
"""CPU time above which a solve is timed once, not repeated for a median [s]."""


@lru_cache(maxsize=64)
def sample(
    nodes: int, delta: float, hardness: float | None = None, hurst: float = HURST
) -> Case:
    """Return a contact of the surface `SURFACE`.

    Calls with equal arguments return one object, so that its exact solution is found once.

    Parameters
    ----------
    nodes : int
        Nodes a side, 2^k + 1.
    delta : float
        Displacement [um].
    hardness : float, optional
        Hardness over E* [1]; None for elastic bodies.
    hurst : float
        Hurst exponent [1].

    Returns
    -------
    Case
        The contact.
    """
    name = f"H = {hurst}, Delta = {delta:g} um"
    if hardness is not None:
        name += f", hardness {hardness:g} E*"
    random = surface_random(load("paper"), SURFACE)
    heights = generate("diamond-square", nodes, hurst, SIGMA0, random)
    return Case(name, heights, SIDE, delta, hardness=hardness, hurst=hurst)


def samples(
    nodes: Sequence[int], deltas: Sequence[float], hardnesses: Sequence[float] = ()
) -> list[Case]:
    """Return contacts on every grid, at every displacement, elastic and with every hardness.

    Parameters
    ----------
    nodes : sequence of int
        Nodes a side, each 2^k + 1.
    deltas : sequence of float
        Displacements [um].
    hardnesses : sequence of float
        Hardnesses over E* [1]. Without any, contacts that suit the paper's algorithm are added at
        `PAPERS_NODES`.

    Returns
    -------
    list of Case
        The contacts, grid after grid; at a displacement from elastic bodies to the softest.
    """
    bounds = (None, *sorted(hardnesses, reverse=True))
    cases: list[Case] = []
    for size in nodes:
        cases += [sample(size, delta, bound) for delta, bound in product(deltas, bounds)]
        if size == PAPERS_NODES and not hardnesses:
            cases += [sample(size, delta, hurst=PAPERS_HURST) for delta in PAPERS_DELTAS]
    return cases


@dataclass(frozen=True)
class Errors:
    """Differences between a pressure and the exact solution."""

    # Relative error of the force, or of the displacement if the force is given [1].
    load_error: float
    # Nodes in contact in one solution only, plus nodes that yield in one solution only.
    misplaced_nodes: int
    # Largest difference of pressures, over the largest pressure [1].
    pressure_error: float


def find_errors(pressure: Values, control: Control, case: Case, exact: Exact) -> Errors:
    """Measure the errors of a pressure.

    A given force is met by construction. Then the error of the displacement counts, which is
    computed here and not by the solver.

    Parameters
    ----------
    pressure : ndarray, shape (n, n)
        Contact pressure [MPa].
    control : {"displacement", "force"}
        Quantity that the solver was given.
    case : Case
        The contact.
    exact : Exact
        Its exact solution.

    Returns
    -------
    Errors
        The errors.
    """
    if control == "force":
        approach = case.displacement(pressure) - (case.heights - case.heights.max())
        delta = (pressure * approach).sum() / pressure.sum()
        load_error = delta / case.delta - 1
    else:
        load_error = pressure.sum() * case.spacing**2 / exact.force - 1
    touching = (pressure > 0) != (exact.pressure > 0)
    yielded = case.yielded(pressure) != case.yielded(exact.pressure)
    misplaced = int(np.count_nonzero(touching) + np.count_nonzero(yielded))
    difference = np.abs(pressure - exact.pressure).max()
    return Errors(
        load_error=abs(float(load_error)),
        misplaced_nodes=misplaced,
        pressure_error=float(difference / exact.pressure.max()),
    )


class Trial:
    """A solver on one contact: its loosest tolerance that is good enough, and its times there.

    Parameters
    ----------
    solver : Solver
        The solver.
    case : Case
        The contact, which is solved exactly at once.

    Attributes
    ----------
    tolerance : float or None
        The loosest tolerance that is good enough; None until `find_tolerance` has found it.
    remark : str
        Reason why there is none; empty without a reason.
    contact_nodes : int
        Number of nodes in contact in the exact solution.
    """

    def __init__(self, solver: Solver, case: Case) -> None:
        self.solver = solver
        self.tolerance: float | None = None
        self.remark = ""
        self._case = case
        self._exact = find_exact(case)
        self.contact_nodes = int(np.count_nonzero(self._exact.pressure > 0))
        self._convolutions: int | None = None  # None if the solver does not count them
        self._errors: Errors | None = None  # errors at the tolerance
        self._turns: list[float] = []  # median CPU time of each turn [s]
        self._seconds: list[float] = []  # CPU times of all solves [s]

    def find_tolerance(self) -> None:
        """Find the loosest tolerance of the solver's ladder that is good enough.

        Sets `tolerance`, or else `remark`. A solver that fails at a tolerance is not tried at
        tighter ones.
        """
        if self.contact_nodes > self.solver.largest_contact:
            largest = self.solver.largest_contact
            self.remark = f"not tried above {largest:g} nodes in contact"
            return
        allowed = max(1.0, MISPLACED_SHARE * self.contact_nodes)
        for tolerance in self.solver.ladder:
            try:
                answer, seconds = self._timed(tolerance)
            except Failure as failure:
                self.remark = f"tolerance {tolerance:.0e}: {failure}"
                return
            errors = find_errors(
                answer.pressure, self.solver.control, self._case, self._exact
            )
            if errors.load_error <= LOAD_ERROR and errors.misplaced_nodes <= allowed:
                self.tolerance = tolerance
                self._errors = errors
                self._convolutions = answer.convolutions
                if seconds > PATIENCE:  # `take_turn` does not repeat the solve
                    self._seconds = [seconds]
                return
        self.remark = f"not good enough at {tolerance:.0e}"

    def _timed(self, tolerance: float) -> tuple[Answer, float]:
        """Solve the case at a tolerance; return the answer and the CPU time [s]."""
        began = time.process_time()
        answer = self.solver.solve(self._case, tolerance)
        return answer, time.process_time() - began

    def take_turn(self) -> None:
        """Time the solver at its tolerance, unless it has none or a solve takes too long."""
        if self.tolerance is None or max(self._seconds, default=0.0) > PATIENCE:
            return
        turn: list[float] = []
        while sum(turn) < TURN:
            _, seconds = self._timed(self.tolerance)
            turn.append(max(seconds, 1e-6))  # a clock may be too coarse for a solve
        self._turns.append(median(turn))
        self._seconds += turn

    @property
    def seconds(self) -> float | None:
        """Median CPU time of a solve [s]; None without any."""
        return median(self._seconds) if self._seconds else None

    def times(self, reference: "Trial") -> float | None:
        """Return the time of a solve over that of another trial.

        Parameters
        ----------
        reference : Trial
            The other trial, which took its turns in the same rounds.

        Returns
        -------
        float or None
            Median over the rounds of the ratio within a round, as a machine has slow seconds [1].
            It is the ratio of the medians if one of the trials was timed once, and None if one was
            not timed.
        """
        rounds = list(zip(self._turns, reference._turns, strict=False))
        if rounds:
            return median(turn / other for turn, other in rounds)
        if self.seconds and reference.seconds:
            return self.seconds / reference.seconds
        return None

    def row(self, ours: "Trial") -> Row:
        """Return the row of the table.

        Parameters
        ----------
        ours : Trial
            Trial of the first solver on this contact.

        Returns
        -------
        Row
            Contact, solver, tolerance, times and errors; None where a value is not known.
        """
        case = self._case
        solver = self.solver
        yielded = case.yielded(self._exact.pressure)
        return {
            "nodes": case.nodes,
            "hurst": case.hurst,
            "sigma0_um": SIGMA0 if case.load is None else None,
            DELTA.in_tables: case.delta,
            "mean_pressure": case.load,  # on periodic patches, over E* h'
            CONTACT_NODES.name: self.contact_nodes,
            AREA.name: 100 * self._exact.contact_share,
            "solver": solver.name,
            "version": solver.version,
            "control": solver.control,
            "tolerance": self.tolerance,
            "seconds": self.seconds,
            "times_ours": self.times(ours),
            **self._error_columns(),
            "remark": self.remark,
            "hardness": case.hardness,  # over E*
            "yielded_nodes": int(np.count_nonzero(yielded)),
            "convolutions": self._convolutions,
        }

    def _error_columns(self) -> Row:
        """Return the errors by their columns, the fields of `Errors`; None without a tolerance."""
        if self._errors is None:
            return dict.fromkeys(error.name for error in fields(Errors))
        return asdict(self._errors)


def compare(
    cases: Sequence[Case], solvers: Sequence[Solver], rounds: int = 4
) -> list[Row]:
    """Bring solvers to equal accuracy on each contact, and time them there in turn.

    Prints the name of each contact on standard error.

    Parameters
    ----------
    cases : sequence of Case
        The contacts.
    solvers : sequence of Solver
        The solvers. The first is ours; times of the others are over its time.
    rounds : int
        Number of turns of each solver.

    Returns
    -------
    list of Row
        A row for each contact and solver.
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
"""Makes another solver that is given the displacement of a periodic patch."""

_peer_by_force = partial(_peer, control="force")
"""Makes another solver that is given the force on a periodic patch."""

PERIODIC_SOLVERS = (
    replace(BEM, control="force", ladder=PERIODIC_LADDER),
    _peer_by_force(
        "ContactMechanics primal",
        partial(others.primal_gradients, control="force", boundary="periodic"),
        package="ContactMechanics",
    ),
    _peer(
        "ContactMechanics dual",
        partial(others.dual_gradients, boundary="periodic"),
        package="ContactMechanics",
    ),
    _peer_by_force(
        "Tamaas",
        partial(others.projected_gradients, boundary="periodic"),
        package="tamaas",
    ),
    _peer_by_force(
        "ASPHER",
        partial(others.single_grid, precond="fourier-fft", backend="periodic"),
        package="aspher",
    ),
    _peer_by_force(
        "ASPHER nested, FFT",
        partial(others.nested_grids, engine="fft", backend="periodic"),
        package="aspher",
    ),
)
"""The solvers on periodic patches, ours first."""


@lru_cache(maxsize=4)
def periodic_sample(nodes: int, hurst: float, load: float) -> Case:
    """Return a contact on a periodic patch with a side of 1 um and a rms slope of 1.

    Solves it, to find the displacement.

    Parameters
    ----------
    nodes : int
        Nodes a side.
    hurst : float
        Hurst exponent [1].
    load : float
        Mean pressure over E* times the rms slope [1].

    Returns
    -------
    Case
        The contact.
    """
    spectrum = SelfAffineSpectrum(hurst, roll_off=0.25, cut_off=4 / nodes)
    random = np.random.default_rng(25)
    heights = generate_spectral((nodes, nodes), 1.0, spectrum, random, rms_slope=1.0)
    name = f"H = {hurst:g}, p / (E* h') = {load:g}"
    case = Case(name, heights, side=1.0, delta=np.nan, hurst=hurst, load=load)
    contact = case.solve(PERIODIC_RTOL)
    return replace(case, delta=contact.delta)


def peers(nodes: Sequence[int], deltas: Sequence[float], rounds: int) -> list[Row]:
    """Compare all installed solvers, and the paper's algorithm, at equal accuracy.

    Prints on standard error which packages are not installed.

    Parameters
    ----------
    nodes : sequence of int
        Nodes a side, each 2^k + 1.
    deltas : sequence of float
        Displacements [um].
    rounds : int
        Number of turns of each solver.

    Returns
    -------
    list of Row
        A row for each contact and solver.

    Raises
    ------
    InputError
        If a number is not possible.
    """
    _check(nodes, deltas)
    for package, install in missing().items():
        remark(f"{package} is not installed and left out: {install}")
    return compare(samples(nodes, deltas), [BEM, PAPERS, *installed()], rounds)


def hardness(
    nodes: Sequence[int], deltas: Sequence[float], hardness: Sequence[float], rounds: int
) -> list[Row]:
    """Compare the installed solvers that know a hardness, on elastic bodies and ones that yield.

    Parameters
    ----------
    nodes : sequence of int
        Nodes a side, each 2^k + 1.
    deltas : sequence of float
        Displacements [um].
    hardness : sequence of float
        Hardnesses over E* [1].
    rounds : int
        Number of turns of each solver.

    Returns
    -------
    list of Row
        A row for each contact and solver.

    Raises
    ------
    InputError
        If a number is not possible.
    """
    _check(nodes, (*deltas, *hardness))
    plastic = [solver for solver in (BEM, *installed()) if solver.plastic]
    return compare(samples(nodes, deltas, hardness), plastic, rounds)


def periodic(nodes: Sequence[int], rounds: int) -> list[Row]:
    """Compare all installed solvers on periodic patches, a surface of each grid under all loads.

    Parameters
    ----------
    nodes : sequence of int
        Nodes a side, each a power of two of at least `others.COARSEST`.
    rounds : int
        Number of turns of each solver.

    Returns
    -------
    list of Row
        A row for each contact and solver.

    Raises
    ------
    InputError
        If a number of nodes is not possible.
    """
    for size in nodes:
        is_power_of_two = not size & (size - 1)
        if size < others.COARSEST or not is_power_of_two:
            raise InputError(
                f"nodes {size}: give 2^k from {others.COARSEST} on, as 128, 256, 512"
            )
    cases = [
        periodic_sample(size, PERIODIC_HURST, load)
        for size, load in product(nodes, LOADS)
    ]
    ours, *peers = PERIODIC_SOLVERS
    return compare(cases, [ours, *installed(peers)], rounds)


def _check(nodes: Sequence[int], values: Sequence[float]) -> None:
    """Raise InputError if a number of nodes is not 2^k + 1, or a value not finite and above 0."""
    for size in nodes:
        is_power_and_one = not (size - 1) & (size - 2)
        if size < 3 or not is_power_and_one:
            raise InputError(f"nodes {size}: give 2^k + 1, as 129, 257, 513")
    for value in values:
        if not 0 < value < math.inf:
            raise InputError(f"{value:g}: give displacements and hardnesses above 0")
