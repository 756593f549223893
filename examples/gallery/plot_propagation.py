"""
Scatter of a population
=======================

Surfaces of one process differ by chance, and so do their contacts. A surrogate propagates the
uncertainty: it is asked for each of 300 surfaces, and the solver checks a few of its answers.
"""

# %%
# Dimensionless features, the default, need no solve at all.

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import bem
from gen.surface import generate
from learn import Surrogate, cli

path = Path(tempfile.mkdtemp()) / "area.surrogate"
code = cli.main(["fit", "../sample.h5", "--target", "area", "-o", str(path)])
surrogate = Surrogate.load(path)

# %%
# The same Hurst exponent and sigma0 for all; only the random numbers differ.

delta, areas, solved = 15.0, [], []
for number in range(300):
    heights = generate(
        "diamond-square", 129, 0.65, 12.5, np.random.default_rng([2025, number])
    )
    areas.append(surrogate.predict(heights, 1000.0, delta, level=None).area[0])
    if number < 30:
        solved.append(bem.solve(heights, 1000.0, delta).area_percent)
areas = np.array(areas)
low, middle, high = np.quantile(areas, [0.05, 0.5, 0.95])
print(f"median {middle:.2f} %, nine of ten surfaces from {low:.2f} to {high:.2f} %")
print(
    f"mean of the first 30: {areas[:30].mean():.2f} %, by the solver {np.mean(solved):.2f} %"
)

# %%

figure, axis = plt.subplots(figsize=(6, 3.5), layout="constrained")
axis.hist(areas, bins=30, density=True, label="surrogate, 300 surfaces")
axis.hist(
    solved, bins=10, density=True, histtype="step", color="k", label="solver, 30 of them"
)
axis.axvspan(low, high, alpha=0.15, label="nine of ten surfaces")
axis.set(xlabel="effective contact area at 15 um [%]", ylabel="density")
axis.legend()
plt.show()

# %%
# Every build of the manual holds this example to its numbers.

np.testing.assert_allclose(middle, 4.85, rtol=0.05)
np.testing.assert_allclose(areas[:30].mean(), np.mean(solved), rtol=0.1)
