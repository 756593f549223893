"""
Layers: a rubber sheet and a hard coating
=========================================

A wave of the pressure reaches about as deep as it is long. Waves that are short beside the
thickness of a layer feel the layer alone, long ones what is below.
"""

# %%
# A sheet of rubber of 1 mm on steel, and 2 um of hard carbon on steel. The compliance of a body to
# waves of pressure, over that of a thick block of the layer's material:

import matplotlib.pyplot as plt
import numpy as np

import bem
from gen.runtime.figure import log_axis
from gen.spectral import SelfAffineSpectrum, generate_spectral

steel = bem.HalfSpace(modulus=210e3, poisson=0.3)  # MPa
rubber = bem.Layered(thickness=1000.0, modulus=2.4, poisson=0.5, base=steel)  # um, MPa
carbon = bem.Layered(thickness=2.0, modulus=700e3, poisson=0.2, base=steel)

# %%
# A coarse map presses into the sheet, a fine one into the coating. Each is also pressed into a
# thick block of one of the materials.


def areas(body, side, slope, pressures):
    """Return the contact areas [%] under some pressures [MPa] on a map of this side [um]."""
    spectrum = SelfAffineSpectrum(hurst=0.8, roll_off=side / 2, cut_off=side / 16)
    random = np.random.default_rng(2025)
    heights = generate_spectral((128, 128), side, spectrum, random, rms_slope=slope)
    contacts = bem.ladder(
        heights, side, pressures=pressures, body=body, boundary="periodic"
    )
    return np.array([contact.area_percent for contact in contacts])


cases = {
    "1 mm of rubber on steel": (
        *(rubber, bem.HalfSpace(2.4, 0.5), "rubber alone"),
        *(8000.0, 0.1, np.geomspace(0.01, 0.2, 6)),
    ),
    "2 um of hard carbon on steel": (
        *(carbon, steel, "steel alone"),
        *(64.0, 0.02, np.geomspace(20, 1000, 6)),
    ),
}
largest = {}  # areas at the largest pressure [%], on the layer and on the block
figure, axes = plt.subplots(2, 2, figsize=(9, 6), layout="constrained")
for name, row in zip(cases, axes, strict=True):
    body, block, block_name, side, slope, pressures = cases[name]
    waves = np.geomspace(side / 128, 4 * side, 200)  # um
    row[0].semilogx(waves, body.relative_compliance(2 * np.pi / waves))
    row[0].axvline(body.thickness, color="0.7")
    row[0].set(
        title=name, xlabel="wavelength [µm]", ylabel="compliance over the layer's own [1]"
    )
    coated, bare = (areas(one, side, slope, pressures) for one in (body, block))
    row[1].loglog(pressures, coated, "o-", label="layer on steel")
    row[1].loglog(pressures, bare, "s--", label=block_name)
    row[1].set(xlabel="nominal pressure [MPa]", ylabel="contact area [%]")
    row[1].legend()
    log_axis(row[1].xaxis)
    log_axis(row[1].yaxis)
    largest[name] = coated[-1], bare[-1]
    print(f"{name}: {coated[-1]:.1f} % in contact at {pressures[-1]:g} MPa,", end=" ")
    print(f"{block_name} {bare[-1]:.1f} %")
plt.show()

# %%
# Every build of the manual holds this example to its numbers.

np.testing.assert_allclose([*largest.values()], [[72.3, 84.0], [21.1, 42.5]], atol=0.1)
