"""Equal accuracy first, then time: each solver at the loosest tolerance that is good enough."""

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from statistics import median

import numpy as np

from bench.peers.accuracy import Errors, find_errors, loosest
from bench.peers.sample import SIGMA0, Sample
from bench.solvers.case import Case, find_exact
from bench.solvers.solver import REFERENCE_RTOL, Failure, Solver

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
    hardness, yielded_nodes : over E*, None for elastic bodies, and nodes of the reference at it
    solver, version : which
    control : what it was given, "displacement" or "force"
    set_up_seconds : CPU time of making what serves all contacts on the grid [s]
    tolerance : the loosest of its ladder that was good enough; None if none was
    seconds : CPU time of a solve after that, median [s]
    times_ours : `seconds` over that of the first solver, ours [1]
    load_error, misplaced_nodes, pressure_error : see `Errors`
    convolutions : applications of the influence matrix, None if the solver does not count them
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
    hardness: float | None = None
    yielded_nodes: int = 0
    convolutions: int | None = None


class Trial:
    """One solver on one contact: the tolerance that it needs, its errors there, its times.

    Parameters
    ----------
    solver, case : who solves what

    Attributes
    ----------
    tolerance : the loosest that is good enough, once it has been found
    errors : at that tolerance
    remark : why there is none
    """

    def __init__(self, solver: Solver, case: Case) -> None:
        self.solver = solver
        self.tolerance: float | None = None
        self.errors: Errors | None = None
        self.remark = ""
        self._case = case
        self._exact = find_exact(case, REFERENCE_RTOL)
        self.contact_nodes = int(np.count_nonzero(self._exact.pressure > 0))
        self.yielded_nodes = int(np.count_nonzero(case.yielded(self._exact.pressure)))
        self.convolutions: int | None = None
        self._tried: dict[float, tuple[Errors, float, int | None]] = {}
        self._seconds: list[float] = []
        self._failed = 0.0

    def find_tolerance(self, guess: float) -> None:
        """Search the solver's ladder."""
        if self.contact_nodes > self.solver.largest_contact:
            self.remark = f"not tried above {self.solver.largest_contact:g} nodes in contact"
            return
        self.tolerance = loosest(self._good_enough, self.solver.ladder, guess)
        if self.tolerance is not None:
            self.errors, seconds, self.convolutions = self._tried[self.tolerance]
            self._seconds = [seconds] if seconds > PATIENCE else []
            self.remark = ""
        elif not self.remark:
            self.remark = f"not good enough at {self.solver.ladder[-1]:.0e}"

    def _good_enough(self, tolerance: float) -> bool:
        if tolerance < self._failed:  # whoever does not reach one tolerance reaches no tighter one
            return False
        began = time.process_time()
        try:
            answer = self.solver.solve(self._case, tolerance)
        except Failure as failure:
            self._failed = tolerance
            self.remark = f"tolerance {tolerance:.0e}: {failure}"
            return False
        seconds = time.process_time() - began
        errors = find_errors(answer.pressure, self.solver.control, self._case, self._exact)
        self._tried[tolerance] = errors, seconds, answer.convolutions
        return errors.good_enough(self.contact_nodes)

    def take_turn(self) -> None:
        """Time it at its tolerance, unless a time is there that is too long to be repeated."""
        if self.tolerance is None or max(self._seconds, default=0.0) > PATIENCE:
            return
        spent = 0.0
        while spent < TURN:
            began = time.process_time()
            self.solver.solve(self._case, self.tolerance)
            self._seconds.append(time.process_time() - began)
            spent += max(self._seconds[-1], 1e-6)

    @property
    def seconds(self) -> float | None:
        """Median of its times [s]."""
        return median(self._seconds) if self._seconds else None


def compare(
    samples: Sequence[Sample],
    solvers: Sequence[Solver],
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
        rows += _rows(sample, trials, set_ups[case.nodes])
    return rows


def _set_up_seconds(solver: Solver, case: Case) -> float:
    solver.set_up(case.nodes, case.spacing)  # imports the package
    began = time.process_time()
    solver.set_up(case.nodes, case.spacing)
    return time.process_time() - began


def _rows(
    sample: Sample, trials: Sequence[Trial], set_up_seconds: Sequence[float]
) -> Iterator[Row]:
    ours = trials[0].seconds
    for trial, set_up in zip(trials, set_up_seconds, strict=True):
        solver = trial.solver
        good = trial.errors is not None and trial.seconds is not None
        yield Row(
            sample.nodes,
            sample.hurst,
            SIGMA0,
            sample.delta,
            trial.contact_nodes,
            solver.name,
            solver.version,
            solver.control,
            set_up,
            remark=trial.remark,
            tolerance=trial.tolerance if good else None,
            seconds=trial.seconds if good else None,
            times_ours=trial.seconds / ours if good and trial.seconds and ours else None,
            hardness=sample.hardness,
            yielded_nodes=trial.yielded_nodes,
            convolutions=trial.convolutions if good else None,
            **(asdict(trial.errors) if good and trial.errors else {}),
        )
