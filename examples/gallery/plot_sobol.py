"""
Which input decides: Sobol indices
==================================

Hurst exponent, sigma0, Delta or chance: which of them makes the contact area scatter? Sobol indices
divide the variance among the inputs. SALib draws the samples, a surrogate answers them.
"""

# %%
# A surrogate of the sample database.

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from SALib.analyze import sobol as analysis
from SALib.sample import sobol as sampling

from gen.surface import generate
from learn import Surrogate, cli

path = Path(tempfile.mkdtemp()) / "area.surrogate"
code = cli.main(["fit", "../sample.h5", "--target", "area", "-o", str(path)])
surrogate = Surrogate.load(path)

# %%
# Chance is an input as well: the seed of the surface's random numbers.

problem = {
    "num_vars": 4,
    "names": ["Hurst exponent", "sigma0", "Delta", "chance"],
    "bounds": [[0.5, 0.8], [10.0, 15.0], [5.0, 25.0], [0, 2**20]],
}
inputs = sampling.sample(problem, 256, calc_second_order=False, seed=2025)


def area(hurst: float, sigma0: float, delta: float, seed: float) -> float:
    """Return the predicted area of one surface [%]."""
    heights = generate(
        "diamond-square", 129, hurst, sigma0, np.random.default_rng(int(seed))
    )
    return float(surrogate.predict(heights, 1000.0, delta, level=None).area[0])


indices = analysis.analyze(
    problem, np.array([area(*row) for row in inputs]), calc_second_order=False, seed=2025
)
for name, first, total in zip(
    problem["names"], indices["S1"], indices["ST"], strict=True
):
    print(f"{name:14} first order {first:5.2f}, total {total:5.2f}")

# %%
# The first order is an input's own share; the total includes its interplay with the others.

places = np.arange(4)
figure, axis = plt.subplots(figsize=(6, 3.5), layout="constrained")
axis.bar(places - 0.2, indices["S1"], 0.4, yerr=indices["S1_conf"], label="first order")
axis.bar(places + 0.2, indices["ST"], 0.4, yerr=indices["ST_conf"], label="total")
axis.set_xticks(places, problem["names"])
axis.set(ylabel="share of the variance")
axis.legend()
plt.show()

# %%
# Every build of the manual holds this example to its number.

np.testing.assert_allclose(indices["ST"][2], 0.59, atol=0.1)  # of Delta
