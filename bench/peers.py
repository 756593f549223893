"""Other solvers beside ours on free patches, bodies that yield, and periodic patches.

Solvers are compared at equal accuracy: each is timed at the loosest tolerance that is good enough.
`find_errors` measures the accuracy, `Trial` finds the tolerance, `compare` times.

On periodic patches all solvers solve one problem: the displacement of a wave is 2 / (E* |q|) times
its pressure, and the mean displacement is zero. The surfaces have a power spectrum with waves from
a quarter of the side down to four cells.
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
"""Standard deviation of the first displacement of these surfaces [um]."""

SURFACE = 18
"""Row of the paper preset whose random numbers make the surfaces.

At 129 nodes a side, H = 0.8 and Delta = 5 um, 6 to 18 nodes touch, which suits MIRCO best. At
H = 0.65 the contacts are neither small nor large.
"""

HURST = 0.65
"""Hurst exponent of the surfaces on free patches, except those with `PAPERS_HURST` [1]."""

PAPERS_HURST = 0.8
"""Hurst exponent of the contacts that suit the paper's algorithm [1]."""

PAPERS_NODES = 129
"""Nodes a side of the contacts that suit the paper's algorithm."""

PAPERS_DELTAS = (5.0, 15.0, 25.0)
"""Displacements of the contacts that suit the paper's algorithm [um]."""

PERIODIC_HURST = 0.8
"""Hurst exponent of the surfaces of periodic patches [1]."""

LOADS = (0.004, 0.04, 0.26, 0.75, 1.2)
"""Mean pressures on periodic patches [E* times the rms slope]. They bring about 1, 10, 50, 90 and
99 % of the nodes into contact."""

PERIODIC_LADDER = tuple(10.0**-decade for decade in range(2, 13))
"""Tolerances that are tried on periodic patches, falling [1]."""

LOAD_ERROR = 1e-6
"""Largest accepted relative error of the force, or of the displacement if the force is given
[1]."""

MISPLACED_SHARE = 5e-4
"""Largest accepted number of misplaced nodes over the number of nodes in contact [1].

One misplaced node is always accepted. `Errors` says which nodes are misplaced.
"""

TURN = 0.05
"""Least CPU time for which a solver repeats a solve in each of its turns [s]."""

PATIENCE = 5.0
"""CPU time of a solve above which it is timed only once [s]."""


@lru_cache(maxsize=64)
def sample(
    nodes: int, delta: float, hardness: float | None = None, hurst: float = HURST
) -> Case:
    """Return a contact of the surface of row `SURFACE`, on a free patch.

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
        Hardnesses over E* [1]. If there are none, contacts that suit the paper's algorithm are
        added on the grid of `PAPERS_NODES`.

    Returns
    -------
    list of Case
        The contacts, grid after grid and displacement after displacement. At each displacement
        elastic bodies come first, then bodies with falling hardness.
    """
    bounds = (None, *sorted(hardnesses, reverse=True))  # None: elastic bodies
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
    # Nodes in contact in only one of the solutions, plus nodes that yield in only one of them.
    misplaced_nodes: int
    # Largest difference of pressures, over the largest pressure [1].
    pressure_error: float


def find_errors(pressure: Values, control: Control, case: Case, exact: Exact) -> Errors:
    """Measure the errors of a pressure.

    A solver that is given the force has no error of the force. Its error of the displacement is
    measured instead, with the displacement that follows from the pressure.

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
        # The mean, weighted by the pressure, of the Delta at which each node just touches.
        touch = case.displacement(pressure) - (case.heights - case.heights.max())
        delta = (pressure * touch).sum() / pressure.sum()
        load_error = delta / case.delta - 1
    else:
        load_error = pressure.sum() * case.spacing**2 / exact.force - 1
    touching_unlike = (pressure > 0) != (exact.pressure > 0)
    yielded_unlike = case.yielded(pressure) != case.yielded(exact.pressure)
    misplaced = int(np.count_nonzero(touching_unlike) + np.count_nonzero(yielded_unlike))
    difference = np.abs(pressure - exact.pressure).max()
    return Errors(
        load_error=abs(float(load_error)),
        misplaced_nodes=misplaced,
        pressure_error=float(difference / exact.pressure.max()),
    )


class Trial:
    """A solver on one contact: the loosest tolerance that is good enough, and the times at it.

    Parameters
    ----------
    solver : Solver
        The solver.
    case : Case
        The contact, which is solved exactly when the trial is made.

    Attributes
    ----------
    tolerance : float or None
        The loosest tolerance that is good enough; None until `find_tolerance` has found one.
    remark : str
        Reason why `find_tolerance` has found none; otherwise empty.
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

        It sets `tolerance`; if there is none, it sets `remark`. A solver that fails at a tolerance
        is not tried at tighter ones.
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
                if seconds > PATIENCE:  # `take_turn` will not repeat this solve
                    self._seconds = [seconds]
                return
        self.remark = f"not good enough at {tolerance:.0e}"

    def _timed(self, tolerance: float) -> tuple[Answer, float]:
        """Solve the case at a tolerance; return the answer and the CPU time [s]."""
        began = time.process_time()
        answer = self.solver.solve(self._case, tolerance)
        return answer, time.process_time() - began

    def take_turn(self) -> None:
        """Time some solves at the tolerance.

        It does nothing without a tolerance, or if a solve takes longer than `PATIENCE`.
        """
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
        """Median CPU time of the timed solves [s]; None if there are none."""
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
            Median over the rounds of the ratio of both times in a round [1], on which slow seconds
            of the machine have little effect. If one of the trials was timed only once, it is the
            ratio of the median times. It is None if one of them was not timed.
        """
        rounds = list(zip(self._turns, reference._turns, strict=False))
        if rounds:
            return median(turn / other for turn, other in rounds)
        if self.seconds and reference.seconds:
            return self.seconds / reference.seconds
        return None

    def row(self, ours: "Trial") -> Row:
        """Return the row of this trial for the table of `compare`.

        Parameters
        ----------
        ours : Trial
            Trial of our solver on this contact.

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
        """Return the fields of `Errors` by their names; all are None without a tolerance."""
        if self._errors is None:
            return dict.fromkeys(error.name for error in fields(Errors))
        return asdict(self._errors)


def compare(
    cases: Sequence[Case], solvers: Sequence[Solver], rounds: int = 4
) -> list[Row]:
    """Time solvers on each contact in turn, each at its loosest tolerance that is good enough.

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
"""Makes a solver by other people for periodic patches that is given the displacement."""

_peer_by_force = partial(_peer, control="force")
"""Makes a solver by other people for periodic patches that is given the force."""

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
    """Return a contact on a periodic patch with a side of 1 um and an rms slope of 1.

    The contact is solved here, to find its displacement.

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
        If a number of nodes is not 2^k + 1, or another number is not finite and above 0.
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
        If a number of nodes is not 2^k + 1, or another number is not finite and above 0.
    """
    _check(nodes, (*deltas, *hardness))
    plastic = [solver for solver in (BEM, *installed()) if solver.plastic]
    return compare(samples(nodes, deltas, hardness), plastic, rounds)


def periodic(nodes: Sequence[int], rounds: int) -> list[Row]:
    """Compare all installed solvers on periodic patches, a surface of each grid under all loads.

    Parameters
    ----------
    nodes : sequence of int
        Nodes a side, each a power of two that is at least `others.COARSEST`.
    rounds : int
        Number of turns of each solver.

    Returns
    -------
    list of Row
        A row for each contact and solver.

    Raises
    ------
    InputError
        If a number of nodes is not a power of two, or is below `others.COARSEST`.
    """
    for size in nodes:
        is_power_of_two = not size & (size - 1)  # only the highest bit is set
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
    """Check the numbers of a command.

    Raises InputError if a number of nodes is not 2^k + 1, or a displacement or hardness in `values`
    is not finite and above 0.
    """
    for size in nodes:
        is_power_and_one = not (size - 1) & (size - 2)  # size - 1 is a power of two
        if size < 3 or not is_power_and_one:
            raise InputError(f"nodes {size}: give 2^k + 1, as 129, 257, 513")
    for value in values:
        if not 0 < value < math.inf:
            raise InputError(f"{value:g}: give displacements and hardnesses above 0")
