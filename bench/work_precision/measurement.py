"""One measurement: a solver on a case at a tolerance, its errors and its cost.

A row of results is either a measurement, with the columns of `evaluate`, or has the keys study,
solver and reason, and says what was left out and why.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from bench.solvers.case import Case, Exact
from bench.solvers.solver import Answer, Failure, Solver, back_and_forth

Row = dict[str, Any]

# What a solver has to meet before any of its times counts: relative errors of force and pressure,
# and the share of the contact nodes that may be wrong, rounded up.
FORCE_GATE = 1e-4
PRESSURE_GATE = 1e-3
AREA_GATE = 1e-3


@dataclass(frozen=True, eq=False)
class Task:
    """A measurement that is to be made: of a study, to a tolerance, against an exact solution."""

    study: str
    solver: Solver
    case: Case
    rtol: float
    exact: Exact

    def run(self) -> Row:
        """Solve the case, and return the row of the answer; raise `Failure` if that fails."""
        return evaluate(self, self.solver.solve(self.case, self.rtol))

    def left_out(self, reason: object) -> Row:
        """Return the row that says why there is no measurement."""
        place = f"{self.case.name}, {self.case.kernel}, {self.case.nodes} nodes a side"
        words = f"{place}, tolerance {self.rtol:.0e}: {reason}"
        return {"study": self.study, "solver": self.solver.name, "reason": words}


def admit(tasks: Sequence[Task]) -> tuple[list[Task], list[Row]]:
    """Let a solver be timed on a case only if it solves it; this also warms its caches up.

    Parameters
    ----------
    tasks : sequence of Task
        One solver on one case, the tightest tolerance first, held against the exact solution on
        the same grid. The answer that counts is that at the tightest tolerance that is reached.

    Returns
    -------
    admitted : list of Task
        The tasks that may be timed; none if that answer is wrong.
    left_out : list of dict
        Rows of the tasks that may not.
    """
    left_out = []
    for place, task in enumerate(tasks):
        try:
            fault = complaint(task.run())
        except Failure as failure:
            left_out.append(task.left_out(failure))
            continue
        return ([], [*left_out, task.left_out(fault)]) if fault else (list(tasks[place:]), left_out)
    return [], left_out


def complaint(row: Row) -> str:
    """Say what is wrong with an answer on the grid of its reference; "" if nothing is."""
    right = row["area_percent"] / 100 * row["nodes"] ** 2
    found = (
        ("force", row["force_error"] or 0.0, FORCE_GATE),
        ("pressure", row["pressure_error"], PRESSURE_GATE),
        ("contact nodes", row["area_error_nodes"] or 0, math.ceil(round(AREA_GATE * right, 9))),
    )
    return "; ".join(
        f"{name} off by {error:.3g}, allowed is {gate:g}"
        for name, error, gate in found
        if not error <= gate
    )


def evaluate(task: Task, answer: Answer) -> Row:
    """Return the row of an answer: its setting, its cost and its errors."""
    case, exact, pressure = task.case, task.exact, answer.pressure
    touching = int(np.count_nonzero(pressure > 0))
    right = round(exact.contact_share * exact.nodes**2)
    given_force = task.solver.control == "force"
    force_error = abs(float(pressure.sum()) * case.spacing**2 / exact.force - 1)
    difference = np.linalg.norm(pressure - exact.pressure) / np.linalg.norm(exact.pressure)
    return {
        "study": task.study,
        "solver": task.solver.name,
        "kernel": case.kernel,
        "precision": task.solver.precision,
        "control": task.solver.control,
        "case": case.name,
        "nodes": case.nodes,  # a side
        "rtol": task.rtol,  # in the solver's own definition
        "delta_um": case.delta,  # of the far field, from this grid's first touch on
        "reference": exact.method,
        "reference_nodes": exact.nodes,
        "area_percent": 100 * exact.contact_share,  # of the reference's nodes
        "seconds": answer.seconds,  # of wall time, the shortest of the rounds
        "convolutions": answer.convolutions,  # None where the solver does not say
        "iterations": answer.iterations,
        "force_error": None if given_force else force_error,  # relative
        "area_error_nodes": abs(touching - right) if exact.nodes == case.nodes else None,
        "area_error_percent": 100 * abs(touching / pressure.size / exact.contact_share - 1),
        # L2 norm over that of the pressure; of averages over coarse cells against a finer grid
        "pressure_error": float(difference),
        "hardness": case.hardness,  # over E*, None for elastic bodies
    }


def measure(tasks: Sequence[Task], rounds: int) -> Iterator[Row]:
    """Do all tasks in turn, keep the shortest time of each, and yield their rows in order.

    The shortest time, since other work on the machine can only add to it.
    """
    rows: dict[int, Row] = {}
    for index in back_and_forth(range(len(tasks)), rounds):
        before = rows.get(index, {"seconds": math.inf})
        if "reason" in before:
            continue
        try:
            row = tasks[index].run()
        except Failure as failure:
            row = tasks[index].left_out(failure)
        if "reason" in row or row["seconds"] < before["seconds"]:
            rows[index] = row
    yield from (rows[index] for index in range(len(tasks)))
