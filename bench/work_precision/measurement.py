"""One measurement: a solver on a case at a tolerance, its errors and its cost."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bench.solvers.case import Case, Exact
from bench.solvers.solver import Answer, Failure, Solver

# What a solver has to meet before any of its times counts: relative errors of force and pressure,
# and the share of the contact nodes that may be wrong, rounded up.
FORCE_GATE = 1e-4
PRESSURE_GATE = 1e-3
AREA_GATE = 1e-3


@dataclass(frozen=True)
class Point:
    """A point of a work-precision diagram: a row of the table.

    Attributes
    ----------
    study : what is varied: "tolerance", "grid", "precision", "peers" or "hardness"
    solver : what solved it
    kernel : influence coefficients
    precision : of the numbers iterated with, "mixed" or "float64"
    control : what the solver was given, "displacement" of the far field or "force"
    case : which surface
    nodes : nodes a side of the grid
    rtol : the tolerance asked for, in the solver's own definition
    delta : displacement of the far field from this grid's first touch on [um]
    reference : how the solution was found that errors are against
    reference_nodes : nodes a side of its grid
    area_percent : area of contact of that solution [% of its nodes]
    seconds : shortest wall time of the rounds [s]
    convolutions, iterations : applications of H, and steps; None where the solver does not say
    force_error : relative error of the force [1]; None where the force was given
    area_error_nodes : difference in contact nodes; None where the reference has another grid
    area_error_percent : error of the area [% of the exact area]
    pressure_error : norm of the error of the pressure over the norm of the pressure [1]; against a
        finer grid, of pressures averaged over the coarse cells
    hardness : over E*, None for elastic bodies [1]
    """

    study: str
    solver: str
    kernel: str
    precision: str
    control: str
    case: str
    nodes: int
    rtol: float
    delta: float
    reference: str
    reference_nodes: int
    area_percent: float
    seconds: float
    convolutions: int | None
    iterations: int | None
    force_error: float | None
    area_error_nodes: int | None
    area_error_percent: float
    pressure_error: float
    hardness: float | None


@dataclass(frozen=True)
class LeftOut:
    """What was not measured, and why."""

    study: str
    solver: str
    reason: str


@dataclass(frozen=True, eq=False)
class Task:
    """A measurement that is to be made."""

    study: str
    solver: Solver
    case: Case
    rtol: float
    exact: Exact

    def left_out(self, reason: str) -> LeftOut:
        """The record that it was not made."""
        place = f"{self.case.name}, {self.case.kernel}, {self.case.nodes} nodes a side"
        return LeftOut(
            self.study, self.solver.name, f"{place}, tolerance {self.rtol:.0e}: {reason}"
        )


def admit(
    study: str, solver: Solver, case: Case, rtols: Sequence[float], exact: Exact
) -> tuple[list[float], list[LeftOut]]:
    """Let a solver be timed on a case only if it solves it; this also warms its caches up.

    Parameters
    ----------
    study, solver, case : who and what
    rtols : tolerances that are going to be timed; the answer that counts is that at the tightest
        which the solver reaches
    exact : the solution on the same grid

    Returns
    -------
    rtols : the tolerances that may be timed, in their order; none if that answer is wrong
    left_out : what may not, and why
    """
    left_out: list[LeftOut] = []
    for rtol in sorted(rtols):
        task = Task(study, solver, case, rtol, exact)
        try:
            fault = complaint(evaluate(task, solver.solve(case, rtol)))
        except Failure as failure:
            left_out.append(task.left_out(str(failure)))
            continue
        if fault:
            return [], [*left_out, task.left_out(fault)]
        return [other for other in rtols if other >= rtol], left_out
    return [], left_out


def complaint(point: Point) -> str:
    """What is wrong with an answer on the grid of its reference, "" if nothing is."""
    right = point.area_percent / 100 * point.nodes**2
    allowed = math.ceil(round(AREA_GATE * right, 9))
    found = (
        ("force", point.force_error or 0.0, FORCE_GATE),
        ("pressure", point.pressure_error, PRESSURE_GATE),
        ("contact nodes", point.area_error_nodes or 0, allowed),
    )
    faults = [
        f"{name} off by {error:.3g}, allowed is {gate:g}"
        for name, error, gate in found
        if not error <= gate
    ]
    return "; ".join(faults)


def evaluate(task: Task, answer: Answer) -> Point:
    """The errors of an answer."""
    case, exact = task.case, task.exact
    pressure = answer.pressure
    touching = int(np.count_nonzero(pressure > 0))
    share = touching / pressure.size
    same_grid = exact.nodes == case.nodes
    right = round(exact.contact_share * exact.nodes**2)
    found_force = task.solver.control == "displacement"
    force_error = abs(float(pressure.sum()) * case.spacing**2 / exact.force - 1)
    difference = np.linalg.norm(pressure - exact.pressure) / np.linalg.norm(exact.pressure)
    return Point(
        study=task.study,
        solver=task.solver.name,
        kernel=case.kernel,
        precision=task.solver.precision,
        control=task.solver.control,
        case=case.name,
        nodes=case.nodes,
        rtol=task.rtol,
        delta=case.delta,
        reference=exact.method,
        reference_nodes=exact.nodes,
        area_percent=100 * exact.contact_share,
        seconds=answer.seconds,
        convolutions=answer.convolutions,
        iterations=answer.iterations,
        force_error=force_error if found_force else None,
        area_error_nodes=abs(touching - right) if same_grid else None,
        area_error_percent=100 * abs(share / exact.contact_share - 1),
        pressure_error=float(difference),
        hardness=case.hardness,
    )


def measure(tasks: Sequence[Task], rounds: int) -> tuple[list[Point], list[LeftOut]]:
    """Do all tasks in turn, back and forth, and keep the shortest time of each.

    Forth and back (A B B A) so that a machine that warms up or slows down favours nobody; the
    shortest, since other work on the machine can only add.

    Returns
    -------
    points : of the tasks that were solved, in their order
    left_out : the others
    """
    points: dict[int, Point] = {}
    failed: dict[int, LeftOut] = {}
    for number in range(rounds):
        order: Iterable[int] = range(len(tasks))
        for index in order if number % 2 == 0 else reversed(range(len(tasks))):
            task = tasks[index]
            if index in failed:
                continue
            try:
                answer = task.solver.solve(task.case, task.rtol)
            except Failure as failure:
                failed[index] = task.left_out(str(failure))
                continue
            if index not in points:
                points[index] = evaluate(task, answer)
            elif answer.seconds < points[index].seconds:
                points[index] = replace(points[index], seconds=answer.seconds)
    return [points[index] for index in sorted(points)], list(failed.values())
