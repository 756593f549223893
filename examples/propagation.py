"""How much does the contact area scatter over a population of surfaces?

    python examples/propagation.py area.surrogate --delta 15 --surfaces 1000

Surfaces of one process (Hurst exponent, sigma0) differ by chance. Each is asked once; a few are
solved too, to see whether the surrogate's answer can be trusted.
"""

import argparse
import sys

import numpy as np

import bem
from gen.surface import generate
from learn import Surrogate


def main(arguments: list[str]) -> np.ndarray:
    """Return the population's areas [%]."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("surrogate", help="made by python -m learn fit")
    parser.add_argument("--delta", type=float, default=15.0, help="far-field displacement [um]")
    parser.add_argument("--hurst", type=float, default=0.65)
    parser.add_argument("--sigma0", type=float, default=12.5, help="[um]")
    parser.add_argument("--surfaces", type=int, default=1000)
    parser.add_argument("--small", action="store_true", help="20 surfaces")
    parser.add_argument("--plot", metavar="FILE", help="a histogram")
    given = parser.parse_args(arguments)
    surrogate = Surrogate.load(given.surrogate)
    (nodes, _), (side, _) = surrogate.card["nodes"], surrogate.card["side"]
    areas, flagged, solved = [], 0, []
    for number in range(20 if given.small else given.surfaces):
        random = np.random.default_rng([2025, number])
        heights = generate("diamond-square", nodes, given.hurst, given.sigma0, random)
        answer = surrogate.predict(heights, side, given.delta)
        areas.append(answer.area[0])
        flagged += not answer.inside[0]
        if number < 10:
            solved.append(bem.solve(heights, side, given.delta).area_percent)
    low, middle, high = np.quantile(areas, [0.05, 0.5, 0.95])
    print(f"area at Delta = {given.delta:g} um: {np.mean(areas):.3g} +- {np.std(areas):.2g} %")
    print(f"median {middle:.3g} %, nine of ten surfaces between {low:.3g} and {high:.3g} %")
    print(f"{flagged} of {len(areas)} surfaces lie outside the training ranges")
    error = np.mean(np.abs(np.array(areas[:10]) - solved)) / np.mean(solved)
    print(f"mean error on the {len(solved)} surfaces that were solved too: {100 * error:.2g} %")
    if given.plot:
        from matplotlib.figure import Figure

        figure = Figure(figsize=(5, 3.5), layout="constrained")
        axis = figure.subplots()
        axis.hist(areas, bins=30)
        axis.set(xlabel="effective contact area [%]", ylabel="surfaces")
        figure.savefig(given.plot)
    return np.array(areas)


if __name__ == "__main__":
    main(sys.argv[1:])
