"""Equal accuracy first, then time: each solver at the loosest tolerance that is good enough."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from statistics import median

import numpy as np

from bench.peers import aspher, contact_mechanics, tamaas
from bench.peers.accuracy import Errors, find_errors, loosest
from bench.peers.own import Ours, PapersAlgorithm
from bench.peers.peer import REFERENCE_RTOL, Contender, Peer
from bench.peers.sample import SIGMA0, Sample
from bench.work_precision.case import Case, find_exact
from bench.work_precision.solvers import Failure

PEERS: tuple[Peer, ...] = (*contact_mechanics.PEERS, *tamaas.PEERS, *aspher.PEERS)

FIRST_GUESS = 1e-4  # of a tolerance; later ones are what the last contact took
TURN = 0.05  # s of CPU time that a solver's turn takes at least, by repetition
PATIENCE = 5.0  # s of CPU time of a solve that is not repeated for its median


@dataclass(frozen=True)
class Row:
    """How one solver did on one contact: a row of the table.

    Attributes
    ----------
    nodes, hurst, sigma0, delta : the contact, see `Sample`; sigma0 and delta in um
    contact_nodes : nodes in contact in the reference
    solver, version : which
    control : what it was given, "displacement" or "force"
    set_up_seconds : CPU time of making what serves all contacts on the grid [s]
    tolerance : the loosest of its ladder that was good enough; None if none was
    seconds : CPU time of a solve after that, median [s]
    times_ours : `seconds` over that of the first solver, ours [1]
    load_error, misplaced_nodes, pressure_error : see `Errors`
    remark : why there are no numbers
    """

    nodes: int
    hurst: float
    sigma0: float
    delta: float
    contact_nodes: int
    solver: str
    version: str
    control: str
    set_up_seconds: float
    tolerance: float | None = None
    seconds: float | None = None
    times_ours: float | None = None
    load_error: float | None = None
    misplaced_nodes: int | None = None
    pressure_error: float | None = None
    remark: str = ""


class Trial:
    """One solver on one contact: the tolerance that it needs, its errors there, its times.

    Parameters
    ----------
    contender, case : who solves what

    Attributes
    ----------
    tolerance : the loosest that is good enough, once it has been found
    errors : at that tolerance
    remark : why there is none
    """

    def __init__(self, contender: Contender, case: Case) -> None:
        self.contender = contender
        self.tolerance: float | None = None
        self.errors: Errors | None = None
        self.remark = ""
        self._case = case
        self._exact = find_exact(case, REFERENCE_RTOL)
        self.contact_nodes = int(np.count_nonzero(self._exact.pressure > 0))
        self._tried: dict[float, tuple[Errors, float]] = {}
        self._seconds: list[float] = []

    def find_tolerance(self, guess: float) -> None:
        """Search the solver's ladder."""
        if self.contact_nodes > self.contender.largest_contact:
            self.remark = f"not tried above {self.contender.largest_contact:g} nodes in contact"
            return
        self.tolerance = loosest(self._good_enough, self.contender.ladder, guess)
        if self.tolerance is not None:
            self.errors, seconds = self._tried[self.tolerance]
            self._seconds = [seconds] if seconds > PATIENCE else []
            self.remark = ""
        elif not self.remark:
            self.remark = f"not good enough at {self.contender.ladder[-1]:.0e}"

    def _good_enough(self, tolerance: float) -> bool:
        began = time.process_time()
        try:
            pressure = self.contender.solve(self._case, tolerance).pressure
        except Failure as failure:
            self.remark = f"tolerance {tolerance:.0e}: {failure}"
            return False
        seconds = time.process_time() - began
        errors = find_errors(pressure, self.contender.control, self._case, self._exact)
        self._tried[tolerance] = errors, seconds
        return errors.good_enough(self.contact_nodes)

    def take_turn(self) -> None:
        """Time it at its tolerance, unless a time is there that is too long to be repeated."""
        if self.tolerance is None or max(self._seconds, default=0.0) > PATIENCE:
            return
        spent = 0.0
        while spent < TURN:
            began = time.process_time()
            self.contender.solve(self._case, self.tolerance)
            self._seconds.append(time.process_time() - began)
            spent += max(self._seconds[-1], 1e-6)

    @property
    def seconds(self) -> float | None:
        """Median of its times [s]."""
        return median(self._seconds) if self._seconds else None


def contenders(peers: Sequence[Peer] = PEERS) -> list[Contender]:
    """Ours first, the paper's algorithm, and those of the peers that are installed."""
    return [Ours(), PapersAlgorithm(), *(peer for peer in peers if peer.installed)]


def compare(
    samples: Sequence[Sample],
    solvers: Sequence[Contender],
    rounds: int = 4,
    announce: Callable[[str], None] = lambda line: None,
) -> list[Row]:
    """Bring solvers to the same accuracy on each contact, and time them there in turn.

    Parameters
    ----------
    samples : the contacts
    solvers : who solves them; the first is ours, over whose time the others' are taken
    rounds : turns that each has, forth and back (A B B A), so that a machine that warms up or
        slows down favours nobody
    announce : told what is about to be solved
    """
    rows: list[Row] = []
    guesses = [FIRST_GUESS] * len(solvers)
    set_ups: dict[int, list[float]] = {}
    for sample in samples:
        case = sample.case()
        announce(f"{case.nodes} nodes a side, {case.name}")
        if case.nodes not in set_ups:
            set_ups[case.nodes] = [_set_up_seconds(solver, case) for solver in solvers]
        trials = [Trial(solver, case) for solver in solvers]
        for trial, guess in zip(trials, guesses, strict=True):
            trial.find_tolerance(guess)
        guesses = [trial.tolerance or guess for trial, guess in zip(trials, guesses, strict=True)]
        for number in range(rounds):
            for trial in trials if number % 2 == 0 else reversed(trials):
                trial.take_turn()
        ours = trials[0].seconds
        rows += [
            _row(sample, trial, set_up_seconds, ours)
            for trial, set_up_seconds in zip(trials, set_ups[case.nodes], strict=True)
        ]
    return rows


def _set_up_seconds(solver: Contender, case: Case) -> float:
    solver.set_up(case.nodes, case.spacing)  # imports the package
    began = time.process_time()
    solver.set_up(case.nodes, case.spacing)
    return time.process_time() - began


def _row(sample: Sample, trial: Trial, set_up_seconds: float, ours: float | None) -> Row:
    row = Row(
        nodes=sample.nodes,
        hurst=sample.hurst,
        sigma0=SIGMA0,
        delta=sample.delta,
        contact_nodes=trial.contact_nodes,
        solver=trial.contender.name,
        version=trial.contender.version,
        control=trial.contender.control,
        set_up_seconds=set_up_seconds,
        remark=trial.remark,
    )
    if trial.errors is None or trial.seconds is None:
        return row
    return replace(
        row,
        tolerance=trial.tolerance,
        seconds=trial.seconds,
        times_ours=trial.seconds / ours if ours else None,
        load_error=trial.errors.load_error,
        misplaced_nodes=trial.errors.misplaced_nodes,
        pressure_error=trial.errors.pressure_error,
    )
