"""Equal accuracy first, then time: each solver at the loosest tolerance that is good enough.

`Errors` says when a solution counts as one, `loosest` finds the tolerance, `compare` times.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from statistics import median
from typing import Any

import numpy as np

from bench.peers.sample import SIGMA0
from bench.report import remark
from bench.solvers.case import Case, Exact, find_exact
from bench.solvers.solver import REFERENCE_RTOL, Answer, Control, Failure, Solver, back_and_forth
from gen.arrays import Values

# The force at the displacement given, or the displacement of the far field at the force given [1].
LOAD_ERROR = 1e-6
# Nodes in contact in one solution only, of those in contact [1]; one is always allowed.
MISPLACED_SHARE = 5e-4
Row = dict[str, Any]
FIRST_GUESS = 1e-4  # of a tolerance; later ones are what the last contact took
TURN = 0.05  # s of CPU time that a solver's turn takes at least, by repetition
PATIENCE = 5.0  # s of CPU time of a solve that is not repeated for its median
UNKNOWN = dict.fromkeys(("load_error", "misplaced_nodes", "pressure_error", "convolutions"))


@dataclass(frozen=True)
class Errors:
    """How far a pressure is from the reference."""

    load_error: float  # of the force, or of the displacement where the force is given, relative
    misplaced_nodes: int  # in contact, or yielded, in it or in the reference, not in both
    pressure_error: float  # the largest, over the largest pressure

    def good_enough(self, contact_nodes: int) -> bool:
        """Say whether a solution of a contact of this many nodes may have these errors."""
        allowed = max(1.0, MISPLACED_SHARE * contact_nodes)
        return self.load_error <= LOAD_ERROR and self.misplaced_nodes <= allowed


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
        pressure_error=float(np.abs(pressure - exact.pressure).max() / exact.pressure.max()),
    )


def loosest(
    good_enough: Callable[[float], bool], ladder: Sequence[float], guess: float
) -> float | None:
    """Find the loosest tolerance of a falling ladder that is good enough, or None if none is.

    Begin at the nearest tolerance that is not looser than the guess. Go looser from one that is
    good enough, as far as that holds; go tighter from one that is not.
    """
    rung = next((r for r, tolerance in enumerate(ladder) if tolerance <= guess), len(ladder) - 1)
    if good_enough(ladder[rung]):
        while rung > 0 and good_enough(ladder[rung - 1]):
            rung -= 1
        return ladder[rung]
    return next((tolerance for tolerance in ladder[rung + 1 :] if good_enough(tolerance)), None)


class Trial:
    """One solver on one contact."""

    def __init__(self, solver: Solver, case: Case) -> None:
        self.solver, self._case = solver, case
        self.tolerance: float | None = None  # the loosest that is good enough, once it is found
        self.remark = ""  # why there is none
        self._exact = find_exact(case, REFERENCE_RTOL)
        self.contact_nodes = int(np.count_nonzero(self._exact.pressure > 0))
        self._tried: dict[float, Row] = {}
        self._turns: list[float] = []
        self._seconds: list[float] = []
        self._failed = 0.0

    def find_tolerance(self, guess: float) -> None:
        """Search the solver's ladder."""
        if self.contact_nodes > self.solver.largest_contact:
            self.remark = f"not tried above {self.solver.largest_contact:g} nodes in contact"
            return
        self.tolerance = loosest(self._good_enough, self.solver.ladder, guess)
        if self.tolerance is not None:
            self.remark = ""
            if self._tried[self.tolerance]["seconds"] > PATIENCE:
                self._seconds = [self._tried[self.tolerance]["seconds"]]
        elif not self.remark:
            self.remark = f"not good enough at {self.solver.ladder[-1]:.0e}"

    def _good_enough(self, tolerance: float) -> bool:
        if tolerance < self._failed:  # whoever does not reach one tolerance reaches no tighter one
            return False
        try:
            answer, seconds = self._timed(tolerance)
        except Failure as failure:
            self._failed = tolerance
            self.remark = f"tolerance {tolerance:.0e}: {failure}"
            return False
        errors = find_errors(answer.pressure, self.solver.control, self._case, self._exact)
        work = {"seconds": seconds, "convolutions": answer.convolutions}
        self._tried[tolerance] = work | asdict(errors)
        return errors.good_enough(self.contact_nodes)

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

    def row(self, set_up_seconds: float, ours: "Trial") -> Row:
        """Return the row of the table; `ours` is the trial of the first solver."""
        case, solver, seconds = self._case, self.solver, self.seconds
        found = UNKNOWN if self.tolerance is None else self._tried[self.tolerance]
        return {
            "nodes": case.nodes,
            "hurst": case.hurst,
            "sigma0_um": SIGMA0,
            "delta_um": case.delta,
            "contact_nodes": self.contact_nodes,  # of the reference
            "solver": solver.name,
            "version": solver.version,
            "control": solver.control,
            "set_up_seconds": set_up_seconds,  # of making what serves all contacts on the grid
            "tolerance": self.tolerance,  # the loosest of its ladder that is good enough
            "seconds": seconds,  # of CPU time of a solve after the set-up, median
            "times_ours": self.times(ours),
            "load_error": found["load_error"],  # and two more of `Errors`
            "misplaced_nodes": found["misplaced_nodes"],
            "pressure_error": found["pressure_error"],
            "remark": self.remark,  # why there are no numbers
            "hardness": case.hardness,  # over E*, None for elastic bodies
            "yielded_nodes": int(np.count_nonzero(case.yielded(self._exact.pressure))),
            "convolutions": found["convolutions"],  # None if the solver does not count them
        }


def compare(cases: Sequence[Case], solvers: Sequence[Solver], rounds: int = 4) -> list[Row]:
    """Bring solvers to the same accuracy on each contact, and time them there in turn.

    Parameters
    ----------
    cases : sequence of Case
        The contacts.
    solvers : sequence of Solver
        The first is ours, over whose time the others' are taken.
    rounds : int
        Turns that each solver has.
    """
    rows: list[Row] = []
    guesses = [FIRST_GUESS] * len(solvers)
    set_ups: dict[int, list[float]] = {}
    for case in cases:
        remark(f"{case.nodes} nodes a side, {case.name}")
        if case.nodes not in set_ups:
            set_ups[case.nodes] = [_set_up_seconds(solver, case) for solver in solvers]
        trials = [Trial(solver, case) for solver in solvers]
        for trial, guess in zip(trials, guesses, strict=True):
            trial.find_tolerance(guess)
        guesses = [trial.tolerance or guess for trial, guess in zip(trials, guesses, strict=True)]
        for trial in back_and_forth(trials, rounds):
            trial.take_turn()
        pairs = zip(trials, set_ups[case.nodes], strict=True)
        rows += [trial.row(set_up, trials[0]) for trial, set_up in pairs]
    return rows


def _set_up_seconds(solver: Solver, case: Case) -> float:
    solver.set_up(case.nodes, case.spacing)  # imports the package
    began = time.process_time()
    solver.set_up(case.nodes, case.spacing)
    return time.process_time() - began
