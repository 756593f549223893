"""
Spots of contact, and whether a joint seals
===========================================

Contact comes in spots. Current and heat flow through them, and what leaks flows between them: a
joint seals once no open gap connects opposite sides.
"""

# %%
# One periodic surface under two pressures, on either side of sealing.

import matplotlib.pyplot as plt
import numpy as np

import bem
from gen.spectral import SelfAffineSpectrum, generate_spectral

side, slope = 256.0, 0.1  # um, 1
spectrum = SelfAffineSpectrum(hurst=0.8, roll_off=64.0, cut_off=8.0)
random = np.random.default_rng(7)
heights = generate_spectral((128, 128), side, spectrum, random, rms_slope=slope)
light, heavy = (
    bem.solve(heights, side, pressure=share * slope, boundary="periodic")
    for share in (0.1, 0.5)
)  # E* = 1 MPa: pressures are shares of E* times the rms slope

# %%
# ``Contact.spots`` counts the spots; ``gap_connects`` says whether the gap leaks along x and y.

for contact in (light, heavy):
    spots = contact.spots
    print(
        f"{contact.area_percent:4.1f} % in contact: {spots.number} spots, the largest has"
        f" {spots.largest_share:.0%} of the area; the gap leaks along x, y: {spots.gap_connects}"
    )

# %%
# Spots in colours; the open gap, which leaks, is white, and closed pockets are grey.

figure, axes = plt.subplots(1, 2, figsize=(9, 4.4), layout="constrained")
for axis, contact in zip(axes, (light, heavy), strict=True):
    spots = contact.spots
    axis.imshow(
        np.where(spots.open_gap, 1.0, 0.75).T, cmap="gray", vmin=0, vmax=1, origin="lower"
    )
    colours = np.ma.masked_equal(spots.labels, 0) % 20
    axis.imshow(colours.T, cmap="tab20", origin="lower", interpolation="nearest")
    sealed = "leaks" if any(spots.gap_connects) else "seals"
    axis.set(
        title=f"{contact.area_percent:.0f} % in contact: {sealed}", xticks=[], yticks=[]
    )
plt.show()

# %%
# Every build of the manual holds this example to its numbers.

np.testing.assert_allclose(
    [light.area_percent, heavy.area_percent], [22.77, 76.21], rtol=5e-3
)
np.testing.assert_allclose([light.spots.number, heavy.spots.number], [72, 6], atol=1)
