"""How large is the mean contact area of a process, by quasi-Monte Carlo on the served solver?

    asperity serve quick &
    python examples/served.py http://127.0.0.1:4242 quick

The Hurst exponent, sigma0 and Delta scatter evenly between their limits. QMCPy draws them from a
lattice, asks the server through UM-Bridge, and stops when its own error estimate is small enough.
"""

import argparse
import sys

import numpy as np
import qmcpy
import umbridge

LOWEST, HIGHEST = [0.5, 10.0, 5.0], [0.8, 15.0, 25.0]
"""Limits of the Hurst exponent [1], sigma0 [um] and Delta [um]."""


def main(arguments: list[str]) -> float:
    """Return the mean contact area [%]."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("address", help="where asperity serve listens")
    parser.add_argument("model", help="name of the served scene")
    parser.add_argument("--tolerance", type=float, default=0.05, help="error of the mean [%%]")
    parser.add_argument("--nodes", type=int, help="nodes a side, the fidelity; the scene's if none")
    given = parser.parse_args(arguments)
    model = umbridge.HTTPModel(given.address, given.model)
    config = {} if given.nodes is None else {"nodes": given.nodes}

    def area(points: np.ndarray) -> np.ndarray:
        """Contact areas at points (n, 3), on the one surface whose index is the default."""
        inputs = ([[hurst, sigma0], [delta]] for hurst, sigma0, delta in points.tolist())
        return np.array([model(each, config)[0][0] for each in inputs])

    lattice = qmcpy.Lattice(dimension=3, seed=7)
    uniform = qmcpy.Uniform(lattice, lower_bound=LOWEST, upper_bound=HIGHEST)
    integrand = qmcpy.CustomFun(uniform, area)
    mean, data = qmcpy.CubQMCLatticeG(
        integrand, abs_tol=given.tolerance, n_init=2**8, n_limit=2**12
    ).integrate()
    area_mean = float(np.squeeze(mean))
    print(f"mean area {area_mean:.3f} % +- {given.tolerance:g} % after {data.n_total} solves")
    return area_mean


if __name__ == "__main__":
    main(sys.argv[1:])
