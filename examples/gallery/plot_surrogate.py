"""
A surrogate, its interval and the solver
========================================

A surrogate answers without a solve and gives an interval that holds in nine of ten cases. Here it
learns from 200 samples and is compared with the solver on surfaces that it has not seen.
"""

# %%
# ``learn fit`` trains it. Hybrid features are those of the surface and of a loose solve on a coarse
# grid; they are kept beside the database, so this example works on a copy.

import shutil
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import bem
from gen.surface import generate
from learn import Surrogate, cli

folder = Path(tempfile.mkdtemp())
database = shutil.copy("../sample.h5", folder)
path = folder / "area.surrogate"
code = cli.main(
    ["fit", database, "--features", "hybrid", "--target", "area", "-o", str(path)]
)
surrogate = Surrogate.load(path)

# %%
# Twenty new surfaces at one displacement each.

random = np.random.default_rng(5)
solved, predicted, low, high = (np.zeros(20) for _ in range(4))
for row in range(20):
    heights = generate("diamond-square", 129, random.uniform(0.5, 0.8), 12.5, random)
    delta = random.uniform(8, 25)  # um
    answer = surrogate.predict(heights, 1000.0, delta)
    predicted[row], low[row], high[row] = (
        values[0] for values in (answer.area, answer.low["area"], answer.high["area"])
    )
    solved[row] = bem.solve(heights, 1000.0, delta).area_percent
inside = np.mean((low <= solved) & (solved <= high))
error = np.abs(predicted - solved).mean() / solved.mean()
print(
    f"mean error {100 * error:.1f} % of the mean area; {inside:.0%} inside their 90 % interval"
)

# %%

figure, axis = plt.subplots(figsize=(5, 4), layout="constrained")
axis.errorbar(solved, predicted, [predicted - low, high - predicted], fmt="o", capsize=2)
axis.axline((1, 1), slope=1, color="k", linewidth=1)
axis.set(xlabel="area by the solver [%]", ylabel="area by the surrogate [%]")
plt.show()

# %%
# Every build of the manual holds this example to its numbers.

np.testing.assert_allclose(error, 0.017, atol=0.01)
np.testing.assert_allclose(inside, 0.9, atol=0.1)
