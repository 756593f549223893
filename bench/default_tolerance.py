"""The measurement from which the default tolerance of the solver, `bem.problem.RTOL`, was chosen.

Samples of the paper preset are solved with falling tolerances, and with a far tighter one, whose
solutions are taken as exact. A tolerance is right if the number of nodes in contact, and so the
area, is exact in at least `RIGHT_PERCENT` of the samples. The default is the loosest tolerance that
is right together with all tighter ones.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import takewhile
from statistics import fmean

import bem
from bem.problem import RTOL
from bench.files import Row
from bench.report import Report, remark
from gen.arrays import Heights
from gen.generation.plan import parameters
from gen.generation.sample import settings_of, surface_of
from gen.scene import Scene, load

# Tolerances that are compared, from loose to tight [Delta].
LADDER = (1e-3, 1e-4, 1e-5, 3e-6, 1e-6, 5e-7, RTOL, 1e-7, 1e-8)

# Tolerance of the solution that is taken as exact [Delta].
EXACT_RTOL = 1e-12

# Smallest share of the samples with the exact number of nodes in contact [%].
RIGHT_PERCENT = 99.9

# Number of samples between two remarks on the progress.
PROGRESS = 100


@dataclass(frozen=True)
class Solved:
    """The results of a contact that was solved with one tolerance.

    Attributes
    ----------
    nodes : int
        Number of nodes in contact.
    force : float
        Normal force [uN].
    convolutions : int
        Number of applications of the influence matrix.
    """

    nodes: int
    force: float
    convolutions: int


def default_tolerance(samples: int) -> Report:
    """Compare solutions with the tolerances of `LADDER` with exact ones, and choose a default.

    Prints the progress on standard error.

    Parameters
    ----------
    samples : int
        Number of samples: the first rows of the paper preset.

    Returns
    -------
    Report
        Table `default-tolerance` with a row for each tolerance, from loose to tight, and a text
        with the tolerance that these choose and the present default.
    """
    scene = load("paper")
    plan = parameters(scene, 0, samples)
    exact: list[Solved] = []
    ladder: dict[float, list[Solved]] = {rtol: [] for rtol in LADDER}
    for sample in range(samples):
        heights = surface_of(scene, plan, sample)
        delta = float(plan.load[sample])
        exact.append(_solve(scene, heights, delta, EXACT_RTOL))
        for rtol, solutions in ladder.items():
            solutions.append(_solve(scene, heights, delta, rtol))
        if (sample + 1) % PROGRESS == 0:
            remark(f"{sample + 1} of {samples} samples")
    rows = [_compared(rtol, solutions, exact) for rtol, solutions in ladder.items()]
    text = (
        f"Loosest tolerance with {RIGHT_PERCENT:g} % of the samples right:"
        f" {_loosest_right(rows)}; the default is {RTOL:g}.\n"
    )
    return Report({"default-tolerance": rows}, text=text)


def _solve(scene: Scene, heights: Heights, delta: float, rtol: float) -> Solved:
    """Press a surface by a displacement [um], with the settings of the scene and a tolerance."""
    settings = settings_of(scene, None) | {"rtol": rtol}
    contact = bem.solve(heights, scene.grid.sides, delta, **settings)
    return Solved(
        nodes=contact.contact_nodes,
        force=contact.force,
        convolutions=contact.convolutions,
    )


def _compared(rtol: float, solutions: Sequence[Solved], exact: Sequence[Solved]) -> Row:
    """Return the row of a tolerance: errors over all samples, and mean number of convolutions.

    `solutions` and `exact` have one result for each sample. A sample is wrong if its number of
    nodes in contact differs.
    """
    pairs = list(zip(solutions, exact, strict=True))
    misses = [abs(solution.nodes - truth.nodes) for solution, truth in pairs]
    force_errors = [
        abs(solution.force / truth.force - 1)
        for solution, truth in pairs
        if truth.force  # a force of 0 has no relative error
    ]
    wrong = sum(miss > 0 for miss in misses)
    return {
        "rtol": rtol,
        "right_percent": 100 * (len(pairs) - wrong) / len(pairs),
        "wrong_samples": wrong,
        "samples": len(pairs),
        "largest_miss_nodes": max(misses),
        "largest_force_error": max(force_errors, default=0.0),  # relative
        "convolutions": fmean(solution.convolutions for solution in solutions),
    }


def _loosest_right(rows: Sequence[Row]) -> str:
    """Return the loosest tolerance that is right together with all tighter ones, as a text.

    The text is "none of these" if the tightest tolerance is not right.
    """
    tightest_first = sorted(rows, key=lambda row: float(row["rtol"]))
    right = list(
        takewhile(lambda row: row["right_percent"] >= RIGHT_PERCENT, tightest_first)
    )
    return f"{right[-1]['rtol']:g}" if right else "none of these"
