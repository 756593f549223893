"""
Theories of random contact
==========================

Persson's theory, and that of Bush, Gibson and Thomas, give the contact area of a random surface
without its details. At light load, solved contacts on periodic patches lie between
them.
"""

# %%
# The mean of a few surfaces, under pressures that are reduced by E* and the rms slope h'.

import matplotlib.pyplot as plt
import numpy as np

import bem
from bem.analytic import BUSH_GIBSON_THOMAS, PERSSON, area_share
from gen.spectral import SelfAffineSpectrum, generate_spectral

side, nodes, slope = 128.0, 128, 0.1
spectrum = SelfAffineSpectrum(hurst=0.8, roll_off=32.0, cut_off=8.0)
reduced = np.geomspace(0.01, 1.0, 10)
areas = []
for seed in range(4):
    random = np.random.default_rng(seed)
    heights = generate_spectral((nodes, nodes), side, spectrum, random, rms_slope=slope)
    ladder = bem.ladder(heights, side, pressures=slope * reduced, boundary="periodic")
    areas.append([contact.continuum_area_percent for contact in ladder])
mean = np.mean(areas, axis=0) / 100

# %%
# At light load the area is kappa p / (E* h'), with a slope kappa that the theories do not agree on.

kappa = mean[0] / reduced[0]
print(
    f"kappa {kappa:.2f}: Persson {PERSSON:.2f}, Bush, Gibson and Thomas {BUSH_GIBSON_THOMAS:.2f}"
)

fine = np.geomspace(0.01, 1.0, 200)
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained")
left.plot(fine, 100 * area_share(fine), "k-", label="Persson")
left.plot(reduced, 100 * mean, "o", label="solved, mean of 4")
left.set(xlabel="p / (E* h')", ylabel="contact area [%]")
left.legend()
right.semilogx(fine, area_share(fine) / fine, "k-", reduced, mean / reduced, "o")
right.axhline(
    BUSH_GIBSON_THOMAS, color="0.5", linestyle="--", label="Bush, Gibson, Thomas"
)
right.axhline(PERSSON, color="k", linestyle=":", label="Persson, at light load")
right.set(xlabel="p / (E* h')", ylabel="kappa: area / (p / (E* h'))", ylim=(0, 3))
right.legend()
plt.show()

# %%
# Every build of the manual holds this example to its number.

np.testing.assert_allclose(kappa, 2.476, rtol=5e-3)
