"""Bodies that yield, pressed by a given load up to full contact.

An open report on ContactMechanics' plastic system finds no convergence where the mean pressure
approaches the hardness. Both solvers are given the same surface, load, hardness and tolerance.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

import bem
from bench.peers.sample import HURST, Sample
from bench.solvers.case import Case
from bench.solvers.contact_mechanics import PrimalGradients
from bench.solvers.others import installed
from bench.solvers.solver import MAX_ITERATIONS, Failure

HARDNESS = 0.1
"""Over E* [1]."""

MEAN_PRESSURES = (0.01, 0.03, 0.05, 0.06, 0.07, 0.08, 0.09, 0.095, 0.099)
"""Over E*; at the hardness every node has yielded [1]."""

RTOL = 1e-6
THEIRS = "ContactMechanics"


@dataclass(frozen=True)
class Pressed:
    """A load, and how both solvers did under it.

    Attributes
    ----------
    nodes : nodes a side
    hardness, mean_pressure : over E* [1]
    delta : displacement of the far field [um]
    area_percent, yielded_percent : of the nodes, by our solution [%]
    converged, convolutions, residual : of our solution; the residual over Delta
    theirs : "yes", or why ContactMechanics has no solution
    their_iterations, their_convolutions : None where it has none
    pressure_difference : largest difference of both pressures over the hardness [1]
    """

    nodes: int
    hardness: float
    mean_pressure: float
    delta: float
    area_percent: float
    yielded_percent: float
    converged: bool
    convolutions: int
    residual: float
    theirs: str
    their_iterations: int | None = None
    their_convolutions: int | None = None
    pressure_difference: float | None = None


def up_to_full_contact(
    nodes: int, announce: Callable[[str], None] = lambda line: None
) -> Iterator[Pressed]:
    """Press a surface by rising loads, up to 99 % of the hardness.

    Parameters
    ----------
    nodes : int
        Nodes a side.
    announce : callable
        Told which load is about to be solved.
    """
    case = Sample(nodes, HURST, 1.0, HARDNESS).case()
    for mean_pressure in MEAN_PRESSURES:
        announce(f"{nodes} nodes a side, mean pressure {mean_pressure:g} E*")
        contact = _ours(case, mean_pressure)
        yield Pressed(
            nodes=nodes,
            hardness=HARDNESS,
            mean_pressure=mean_pressure,
            delta=contact.delta,
            area_percent=contact.area_percent,
            yielded_percent=contact.yielded_percent,
            converged=contact.residual <= RTOL,
            convolutions=contact.convolutions,
            residual=contact.residual,
            **_theirs(case, contact),
        )


def _ours(case: Case, mean_pressure: float) -> bem.Contact:
    """Return our contact, as far as it was reached."""
    try:
        return bem.solve(
            case.heights,
            case.side,
            pressure=mean_pressure,
            hardness=HARDNESS,
            rtol=RTOL,
            max_iterations=MAX_ITERATIONS,
        )
    except bem.NotConverged as failure:
        return failure.contact


def _theirs(case: Case, contact: bem.Contact) -> dict[str, Any]:
    """Solve the same with ContactMechanics; return the columns of `Pressed` about it."""
    if THEIRS not in {solver.package for solver in installed()}:
        return {"theirs": "not installed"}
    force = contact.force
    posed = replace(case, delta=contact.delta)
    session = PrimalGradients(case.nodes, case.spacing)
    try:
        answer = session.press_by_force(posed, force, RTOL)
    except Failure as failure:
        return {"theirs": str(failure)}
    difference = np.abs(answer.pressure - contact.pressure).max() / HARDNESS
    return {
        "theirs": "yes",
        "their_iterations": answer.iterations,
        "their_convolutions": answer.convolutions,
        "pressure_difference": float(difference),
    }
