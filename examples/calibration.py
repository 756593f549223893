"""How hard is the softer body, if its contact area is seen under some pressures?

    python examples/calibration.py scene.toml areas.csv --noise 0.05

The scene draws the hardness from its prior and gives its load as pressures; the table has columns
`pressure` [MPa] and `area_percent`. Bayes' rule on a grid of hardnesses: logarithms of the areas of
some surfaces have a mean and a scatter at each hardness. Noise of the measurement adds to it.
"""

import argparse

import numpy as np

from asperity import SceneFunction
from gen.generation.plan import parameters
from gen.runtime.command_line import run_script
from gen.runtime.documents import read_columns
from gen.scene import load


def log_likelihoods(areas: np.ndarray, measured: np.ndarray, noise: float) -> np.ndarray:
    """Return the logarithm of the likelihood of each hardness, Student's for few surfaces.

    `areas` has the shape (hardnesses, surfaces, pressures), `measured` (pressures,).
    """
    likelihoods, number = [], areas.shape[1]
    for logarithms in np.log(areas):
        covariance = np.cov(logarithms.T) + noise**2 * np.eye(measured.size)
        off = np.log(measured) - logarithms.mean(axis=0)
        _, size = np.linalg.slogdet(covariance)
        distance = off @ np.linalg.solve(covariance, off) / (1 + 1 / number)
        likelihoods.append(-0.5 * (number * np.log1p(distance / (number - 1)) + size))
    return np.array(likelihoods)


def main(arguments: list[str]) -> tuple[float, float, float]:
    """Return the median of the hardness and the ends of its 90 % interval [MPa]."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scene", help="a TOML file that draws a hardness")
    parser.add_argument("measured", help="a table (.csv)")
    parser.add_argument(
        "--noise", type=float, default=0.05, help="relative, of a measured area"
    )
    parser.add_argument("--surfaces", type=int, default=20, help="for each hardness")
    parser.add_argument("--hardnesses", type=int, default=25, help="of the grid")
    parser.add_argument(
        "--nodes", type=int, help="nodes a side, the fidelity; the scene's if none"
    )
    given = parser.parse_args(arguments)
    pressures, measured = read_columns(given.measured, "pressure", "area_percent")
    if min(measured.min(), pressures.min()) <= 0:
        parser.error(f"{given.measured}: pressures and areas have to be above 0")
    scene = load(given.scene)
    function, limits = (
        SceneFunction(scene, ["area_percent"]),
        scene.contact.hardness_limits,
    )
    if not {"pressure", "hardness"} <= {*function.names}:
        parser.error(
            f"{given.scene}: has {', '.join(function.names)}; pressure, hardness wanted"
        )
    if limits[0] <= pressures.max():
        parser.error(
            f"the largest pressure is above the least hardness, {limits[0]:g} MPa"
        )
    plan = parameters(scene, 0, given.surfaces * scene.samples_per_surface)
    chosen = slice(None, None, scene.samples_per_surface)
    hardnesses = np.geomspace(*limits, given.hardnesses)
    areas = function(
        **{name: plan.drawn[name][chosen, None] for name in function.inputs.parameters},
        surface=plan.surface[chosen, None],
        pressure=pressures,
        hardness=hardnesses[:, None, None],
        nodes=given.nodes,
    )[..., 0]
    logarithms = log_likelihoods(areas, measured, given.noise)
    fine = np.geomspace(*limits, 2000)  # the prior is uniform in the logarithm
    weights = np.interp(np.log(fine), np.log(hardnesses), logarithms)
    below = np.cumsum(np.exp(weights - weights.max()))
    low, median, high = np.interp([0.05, 0.5, 0.95], below / below[-1], fine)
    print(f"hardness {median:.4g} MPa; 90 % interval {low:.4g} to {high:.4g} MPa")
    return float(median), float(low), float(high)


if __name__ == "__main__":
    run_script(main)
