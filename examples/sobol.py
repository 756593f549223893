"""Which input makes the contact area scatter: H, sigma0, Delta, or chance?

    pip install -e ".[examples]"
    python examples/sobol.py area.surrogate --samples 512

Sobol indices by SALib. Chance is an input too: which of 2^20 seeds makes the noise. First order is
an input's own share of the variance, the total includes its interplay with the others.
"""

import argparse
import sys

import numpy as np
from SALib.analyze import sobol as analysis
from SALib.sample import sobol as sampling

from gen.scene import Scene
from gen.surface import generate
from learn import Surrogate


def main(arguments: list[str]) -> dict[str, np.ndarray]:
    """Return the indices "S1" and "ST" of H, sigma0, Delta and the seed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("surrogate", help="made by python -m learn fit")
    parser.add_argument("--samples", type=int, default=512, help="a power of two")
    parser.add_argument("--small", action="store_true", help="32 samples")
    given = parser.parse_args(arguments)
    surrogate = Surrogate.load(given.surrogate)
    scene = Scene.from_text(surrogate.card["scene"])
    problem = {
        "num_vars": 4,
        "names": ["H", "sigma0", "Delta", "chance"],
        "bounds": [scene.surface.hurst, scene.surface.sigma0, surrogate.card["delta"], [0, 2**20]],
    }
    number = 32 if given.small else given.samples
    inputs = sampling.sample(problem, number, calc_second_order=False, seed=2025)
    areas = np.array([area(surrogate, scene, row) for row in inputs])
    found = analysis.analyze(problem, areas, calc_second_order=False, seed=2025)
    print(f"{len(areas)} areas, mean {areas.mean():.3g} %, standard deviation {areas.std():.3g} %")
    for place, name in enumerate(problem["names"]):
        first, total = (
            f"{found[index][place]:5.2f} +- {found[f'{index}_conf'][place]:4.2f}"
            for index in ("S1", "ST")
        )
        print(f"{name:8} first order {first}, total {total}")
    return {index: found[index] for index in ("S1", "ST")}


def area(surrogate: Surrogate, scene: Scene, inputs: np.ndarray) -> float:
    """Area of one surface [%]."""
    hurst, sigma0, delta, seed = inputs
    random = np.random.default_rng([2025, int(seed)])
    heights = generate(scene.surface.generator, scene.surface.nodes, hurst, sigma0, random)
    return float(surrogate.predict(heights, scene.surface.side, delta, level=None).area[0])


if __name__ == "__main__":
    main(sys.argv[1:])
