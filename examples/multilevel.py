"""How large is the mean contact area of a population, for as little time as possible?

    python examples/multilevel.py quick --nodes 33,65,129,257 --error 0.1

Multilevel Monte Carlo: many contacts on a coarse grid, and ever fewer corrections from a grid to
the next finer one, on the same surfaces. A correction is the finer result less the coarser one,
times the factor with which it scatters least. A few surfaces that are pressed on all grids tell
these factors, and how many surfaces each correction is worth. Samples are rows of the scene.
"""

import argparse
import time

import numpy as np

from asperity import SceneFunction
from gen.generation.plan import parameters
from gen.runtime.command_line import run_script
from gen.scene import load

PILOTS = 30
"""Surfaces that are pressed on all grids."""


def timed(function, scene, first, last, nodes):
    """Press rows of a scene on a grid; return the results, and the processor's time [s]."""
    began, plan = time.process_time(), parameters(scene, first, last)
    given = {name: plan.drawn[name] for name in function.inputs.parameters}
    given[function.names[len(given)]] = plan.load
    if function.inputs.hardness:
        given["hardness"] = plan.hardness
    results = function(surface=plan.surface, nodes=nodes, **given)[:, 0]
    return results, time.process_time() - began


def main(arguments: list[str]) -> tuple[float, float, float]:
    """Return the mean, its standard error, and the time over that of plain Monte Carlo."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scene", help="a shipped scene, as quick, or a TOML file")
    parser.add_argument("--output", default="area_percent", help="a column of a database")
    parser.add_argument(
        "--nodes", default="33,65,129,257", help="of all grids, coarse to fine"
    )
    parser.add_argument(
        "--error", type=float, default=0.1, help="standard error of the mean"
    )
    given = parser.parse_args(arguments)
    grids, scene = [int(number) for number in given.nodes.split(",")], load(given.scene)
    function = SceneFunction(scene, [given.output])
    pilots = [timed(function, scene, 0, PILOTS, nodes) for nodes in grids]
    results = np.array([values for values, _ in pilots])
    seconds = np.array([spent for _, spent in pilots]) / PILOTS
    both = np.cov(results)
    factors = np.append(
        0.0, np.diag(both, -1) / np.diag(both)[:-1]
    )  # of the coarser results
    weights = np.append(
        np.cumprod(factors[:0:-1])[::-1], 1.0
    )  # of corrections, in the mean
    coarser = np.vstack([np.zeros(PILOTS), results[:-1]])
    scatter = weights * (results - factors[:, None] * coarser).std(axis=1, ddof=1)
    costs = seconds + np.append(0.0, seconds[:-1])
    numbers = scatter / np.sqrt(costs) * (scatter * np.sqrt(costs)).sum() / given.error**2
    mean, variance, spent, first = 0.0, 0.0, seconds.sum() * PILOTS, PILOTS
    for level, number in enumerate(np.ceil(np.maximum(numbers, 10)).astype(int).tolist()):
        parts = [  # no row twice, so that the corrections are independent of each other
            timed(function, scene, first, first + number, nodes)
            for nodes in grids[max(level - 1, 0) : level + 1]
        ]
        first += number
        values = parts[-1][0] - factors[level] * parts[0][0] * (level > 0)
        mean += weights[level] * values.mean()
        variance += weights[level] ** 2 * values.var(ddof=1) / number
        spent += sum(each for _, each in parts)
        print(
            f"{grids[level]} nodes: {number} surfaces, coarser result x {factors[level]:.3f}"
        )
    plain = both[-1, -1] / variance * seconds[-1]
    print(f"mean {given.output} {mean:.4g} +- {variance**0.5:.2g} (standard error)")
    print(
        f"{spent:.3g} s; plain Monte Carlo on {grids[-1]} nodes would take {plain:.3g} s"
    )
    return mean, float(variance**0.5), float(spent / plain)


if __name__ == "__main__":
    run_script(main)
