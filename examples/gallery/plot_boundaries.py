"""
Patches without edges
=====================

A measured map is a piece of a larger surface. Pressed alone, its free borders carry too much.
Mirror images of the map, or copies of it, take the borders away.
"""

# %%
# One map under one mean pressure, with each of the three boundaries.

import matplotlib.pyplot as plt
import numpy as np

import bem
from gen.spectral import SelfAffineSpectrum, generate_spectral

side = 256.0  # um
spectrum = SelfAffineSpectrum(hurst=0.8, roll_off=64.0, cut_off=8.0)
random = np.random.default_rng(1)
heights = generate_spectral((128, 128), side, spectrum, random, rms_slope=0.05)
contacts = {
    boundary: bem.solve(heights, side, pressure=1000.0, modulus=230e3, boundary=boundary)
    for boundary in ("free", "periodic", "mirror")
}

# %%
# The share of the force on the outer 5 % of each side; these nodes are 18 % of the map.

border = np.ones(heights.shape, dtype=bool)
border[6:-6, 6:-6] = False
shares = {
    name: each.pressure[border].sum() / each.pressure.sum()
    for name, each in contacts.items()
}
for name, share in shares.items():
    print(
        f"{name:8} {100 * share:4.1f} % of the force on {100 * border.mean():.0f} % of the nodes"
    )

# %%
# The free patch is a punch: its pressures rise towards its borders. The other two know no border.

figure, axes = plt.subplots(1, 3, figsize=(11, 3.6), layout="constrained")
for axis, (name, contact) in zip(axes, contacts.items(), strict=True):
    image = axis.imshow(
        np.ma.masked_equal(contact.pressure, 0).T, origin="lower", vmin=0, vmax=10000
    )
    title = f"{name}: {100 * shares[name]:.0f} % on the border"
    axis.set(title=title, xticks=[], yticks=[])
figure.colorbar(image, ax=axes, label="contact pressure [MPa]", extend="max")
plt.show()

# %%
# Every build of the manual holds this example to its numbers.

np.testing.assert_allclose(border.mean(), 0.18, atol=5e-3)
np.testing.assert_allclose([*shares.values()], [0.375, 0.211, 0.206], rtol=0.01)
