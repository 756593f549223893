"""
A spectral surface and its spectrum
===================================

A self-affine surface is described by its power spectrum: flat up to the roll-off, then a power law
with the Hurst exponent, and nothing beyond the cut-off. Here such a surface is generated, and its
spectrum is measured.
"""

# %%
# All waves have random phases and exact amplitudes, so every surface has this spectrum exactly.

import matplotlib.pyplot as plt
import numpy as np

from gen.spectral import SelfAffineSpectrum, generate_spectral

side, nodes = 512.0, 512  # um, 1
spectrum = SelfAffineSpectrum(hurst=0.8, roll_off=100.0, cut_off=4.0)
heights = generate_spectral(
    (nodes, nodes), side, spectrum, np.random.default_rng(4), rms_height=0.5
)

# %%
# The spectrum as measured: squared Fourier amplitudes, averaged over rings of wavevectors.

waves = np.fft.fft2(heights) * (side / nodes) ** 2
density = np.abs(waves) ** 2 / side**2
q = 2 * np.pi * np.fft.fftfreq(nodes, side / nodes)
length = np.hypot(q[:, None], q)
rings = np.geomspace(2 * np.pi / side, 2 * np.pi / 4, 30)
ring = np.digitize(length, rings)
means = [
    density[ring == number].mean() for number in range(1, 30) if (ring == number).any()
]
middles = [
    length[ring == number].mean() for number in range(1, 30) if (ring == number).any()
]
middles, means = np.array(middles), np.array(means)

# %%
# Between roll-off and cut-off the density falls as q^(-2 - 2H): its slope gives the Hurst exponent
# back.

law = (middles > 1.3 * 2 * np.pi / 100) & (middles < 2 * np.pi / 4.5)
slope = np.polyfit(np.log(middles[law]), np.log(means[law]), 1)[0]
hurst = -slope / 2 - 1
print(f"Hurst exponent of the spectrum: {hurst:.3f}")

figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.8), layout="constrained")
image = left.imshow(heights.T, origin="lower", extent=(0, side, 0, side), cmap="cividis")
left.set(xlabel="x [µm]", ylabel="y [µm]")
figure.colorbar(image, ax=left, label="height [µm]")
right.loglog(middles, means, "o", label="measured")
right.axvline(2 * np.pi / 100, color="0.6", linestyle="--", label="roll-off")
right.axvline(2 * np.pi / 4, color="0.6", linestyle=":", label="cut-off")
right.set(xlabel="wavenumber q [1/µm]", ylabel="spectral density [µm⁴]")
right.legend()
plt.show()

# %%
# Every build of the manual holds this example to its number.

np.testing.assert_allclose(hurst, 0.8, atol=0.01)
