"""How does the contact area depend on the Hurst exponent and on Delta?

    python examples/study.py area.surrogate --csv study.csv

Each surface's features are computed once for all displacements; the same noise at every Hurst
exponent takes chance out of the comparison.
"""

import argparse
import sys

import numpy as np

from gen.surface import generate
from learn import Surrogate


def main(arguments: list[str]) -> np.ndarray:
    """Return mean areas (Hurst exponents, displacements) [%]."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("surrogate", help="made by python -m learn fit")
    parser.add_argument("--sigma0", type=float, default=12.5, help="[um]")
    parser.add_argument("--surfaces", type=int, default=50, help="for each Hurst exponent")
    parser.add_argument("--small", action="store_true", help="3 surfaces, 3 x 4 points")
    parser.add_argument("--csv", metavar="FILE", help="the table as a file")
    parser.add_argument("--plot", metavar="FILE", help="curves")
    given = parser.parse_args(arguments)
    surrogate = Surrogate.load(given.surrogate)
    (nodes, _), (side, _) = surrogate.card["nodes"], surrogate.card["side"]
    exponents = np.linspace(0.5, 0.8, 3 if given.small else 7)
    deltas = np.linspace(*surrogate.card["delta"], 4 if given.small else 20)
    areas = np.zeros((exponents.size, deltas.size))
    surfaces = 3 if given.small else given.surfaces
    for row, hurst in enumerate(exponents):
        for number in range(surfaces):
            random = np.random.default_rng([2025, number])
            heights = generate("diamond-square", nodes, hurst, given.sigma0, random)
            areas[row] += surrogate.for_surface(heights, side).predict(deltas).area / surfaces
    print("mean area [%]   Delta [um] " + " ".join(f"{delta:6.1f}" for delta in deltas))
    for hurst, row in zip(exponents, areas, strict=True):
        print(f"{'H':>20} = {hurst:.2f} " + " ".join(f"{area:6.2f}" for area in row))
    if given.csv:
        table = np.column_stack([exponents, areas])
        header = "hurst," + ",".join(f"delta {delta:.4g} um" for delta in deltas)
        np.savetxt(given.csv, table, delimiter=",", header=header, comments="", fmt="%.6g")
    if given.plot:
        from matplotlib.figure import Figure

        figure = Figure(figsize=(5, 3.5), layout="constrained")
        axis = figure.subplots()
        axis.plot(deltas, areas.T, label=[f"H = {hurst:.2f}" for hurst in exponents])
        axis.set(xlabel="Delta [um]", ylabel="effective contact area [%]")
        axis.legend()
        figure.savefig(given.plot)
    return areas


if __name__ == "__main__":
    main(sys.argv[1:])
