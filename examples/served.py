"""How large is the mean contact area of a process, by quasi-Monte Carlo on the served solver?

    asperity serve quick &
    python examples/served.py http://127.0.0.1:4242 quick

All inputs of the model scatter evenly between their limits: here the Hurst exponent, sigma0 and
Delta. QMCPy draws them from a lattice, asks the server through UM-Bridge, and stops when its own
error estimate is small enough. The mean is that of the first number of the first output.
"""

import argparse

import numpy as np
import qmcpy
import umbridge

from gen.runtime.command_line import run_script

LIMITS = "0.5:0.8,10:15,5:25"
"""Limits of the Hurst exponent [1], sigma0 [um] and Delta [um]."""


def limits(text: str) -> np.ndarray:
    """Read the limits of all inputs, shape (2, inputs)."""
    return np.array(
        [[float(end) for end in pair.split(":")] for pair in text.split(",")]
    ).T


def main(arguments: list[str]) -> float:
    """Return the mean, of the contact area [%] as a rule."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("address", help="where asperity serve listens")
    parser.add_argument("model", help="name of the served scene")
    parser.add_argument(
        "--limits", type=limits, default=LIMITS, help="LOW:HIGH of each input"
    )
    parser.add_argument("--tolerance", type=float, default=0.05, help="error of the mean")
    parser.add_argument(
        "--nodes", type=int, help="nodes a side, the fidelity; the scene's if none"
    )
    given = parser.parse_args(arguments)
    model = umbridge.HTTPModel(given.address, given.model)
    config = {} if given.nodes is None else {"nodes": given.nodes}
    sizes, (lowest, highest) = model.get_input_sizes(config), given.limits
    if sum(sizes) != len(lowest):
        parser.error(
            f"--limits: {len(lowest)} pairs; {given.model} has inputs of sizes {sizes}"
        )

    def area(points: np.ndarray) -> np.ndarray:
        """Contact areas at points (n, inputs), on the one surface whose index is the default."""
        inputs = (np.split(point, np.cumsum(sizes)[:-1]) for point in points)
        return np.array(
            [model([part.tolist() for part in each], config)[0][0] for each in inputs]
        )

    lattice = qmcpy.Lattice(dimension=len(lowest), seed=7)
    uniform = qmcpy.Uniform(lattice, lower_bound=lowest, upper_bound=highest)
    integrand = qmcpy.CustomFun(uniform, area)
    found, data = qmcpy.CubQMCLatticeG(
        integrand, abs_tol=given.tolerance, n_init=2**8, n_limit=2**12
    ).integrate()
    mean = float(np.squeeze(found))
    error = float(np.squeeze(data.comb_bound_high - data.comb_bound_low)) / 2
    bar = f" +- {error:.2g}" if 0 < error < np.inf else ""
    print(f"mean of the first output {mean:.4g}{bar} after {data.n_total} questions")
    return mean


if __name__ == "__main__":
    run_script(main)
