"""Bodies that yield, pressed by a given load up to full contact.

An open report on ContactMechanics' plastic system finds no convergence where the mean pressure
approaches the hardness. Both solvers are given the same surface, load, hardness and tolerance.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

import bem
from bench.peers.compare import Row
from bench.peers.sample import sample
from bench.report import remark
from bench.solvers.case import Case
from bench.solvers.contact_mechanics import primal_gradients
from bench.solvers.others import installed
from bench.solvers.solver import MAX_ITERATIONS, Failure

HARDNESS = 0.1  # over E* [1]
# Over E*; at the hardness every node has yielded [1].
MEAN_PRESSURES = (0.01, 0.03, 0.05, 0.06, 0.07, 0.08, 0.09, 0.095, 0.099)

RTOL = 1e-6
THEIRS = "ContactMechanics"


def up_to_full_contact(nodes: int) -> Iterator[Row]:
    """Press a surface by rising loads, up to 99 % of the hardness.

    Yields
    ------
    dict
        A load, and how both solvers did under it.
    """
    case = sample(nodes, 1.0, HARDNESS)
    for mean_pressure in MEAN_PRESSURES:
        remark(f"{nodes} nodes a side, mean pressure {mean_pressure:g} E*")
        contact = _ours(case, mean_pressure)
        yield {
            "nodes": nodes,
            "hardness": HARDNESS,
            "mean_pressure": mean_pressure,
            "delta_um": contact.delta,
            "area_percent": contact.area_percent,
            "yielded_percent": contact.yielded_percent,
            "converged": contact.residual <= RTOL,
            "convolutions": contact.convolutions,
            "residual": contact.residual,  # over Delta
            **_theirs(case, contact),
        }


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


def _theirs(case: Case, contact: bem.Contact) -> Row:
    """Solve the same with ContactMechanics; say in `theirs` if it has a solution, or why not."""
    columns = "theirs", "their_iterations", "their_convolutions", "pressure_difference"
    row: Row = dict.fromkeys(columns)
    if THEIRS not in {solver.package for solver in installed()}:
        return row | {"theirs": "not installed"}
    press = primal_gradients(case.nodes, case.spacing, control="force")
    try:
        answer = press(replace(case, delta=contact.delta), contact.force, RTOL)
    except Failure as failure:
        return row | {"theirs": str(failure)}
    difference = float(np.abs(answer.pressure - contact.pressure).max() / HARDNESS)
    return dict(
        zip(columns, ("yes", answer.iterations, answer.convolutions, difference), strict=True)
    )
