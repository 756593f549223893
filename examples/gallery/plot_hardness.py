"""
Bodies that yield
=================

Elastic asperities would carry pressures that no metal bears. With a hardness the softer body
yields: no node carries more than the hardness, and the load goes to more nodes.
"""

# %%
# One steel surface under rising pressures, elastic and with three hardnesses.

import matplotlib.pyplot as plt
import numpy as np

import bem
from gen.runtime.figure import log_axis
from gen.spectral import SelfAffineSpectrum, generate_spectral

side = 256.0  # um
spectrum = SelfAffineSpectrum(hurst=0.8, roll_off=64.0, cut_off=8.0)
random = np.random.default_rng(2025)
heights = generate_spectral((128, 128), side, spectrum, random, rms_slope=0.1)
steel = {"modulus": 210e3, "poisson": 0.3, "boundary": "periodic"}  # MPa
pressures = np.geomspace(10, 500, 8)  # MPa
areas = {}
for hardness in (None, 6000.0, 2000.0, 1000.0):  # MPa
    contacts = bem.ladder(heights, side, pressures=pressures, hardness=hardness, **steel)
    areas[hardness] = np.array([contact.area_percent for contact in contacts])

# %%
# The areas of yielding bodies approach load / hardness, whatever the surface: this is why friction
# and conductance are nearly proportional to the load. The pictures show the pressures at 300 MPa.

elastic = bem.solve(heights, side, pressure=300.0, **steel)
yielding = bem.solve(heights, side, pressure=300.0, hardness=2000.0, **steel)
print(f"largest pressure: elastic {elastic.largest_pressure:.0f} MPa,", end=" ")
print(f"with a hardness of 2,000 MPa {yielding.largest_pressure:.0f} MPa")
print(
    f"yielded: {yielding.yielded_percent:.2f} of {yielding.area_percent:.2f} % in contact"
)

figure, (left, middle, right) = plt.subplots(
    1, 3, figsize=(11, 3.6), layout="constrained"
)
for hardness, area in areas.items():
    name = "elastic" if hardness is None else f"{hardness:,.0f} MPa"
    left.loglog(pressures, area, "o-", label=name)
left.set(xlabel="nominal pressure [MPa]", ylabel="contact area [%]")
left.legend(title="hardness", loc="lower right", fontsize="small")
log_axis(left.xaxis)
log_axis(left.yaxis)
for axis, contact, name in ((middle, elastic, "elastic"), (right, yielding, "2,000 MPa")):
    image = axis.imshow(
        np.ma.masked_equal(contact.pressure, 0).T,
        origin="lower",
        vmin=0,
        vmax=8000,
        cmap="viridis",
    )
    axis.set(title=f"{name}, at 300 MPa", xticks=[], yticks=[])
figure.colorbar(image, ax=(middle, right), label="contact pressure [MPa]", extend="max")
plt.show()

# %%
# Every build of the manual holds this example to its numbers.

np.testing.assert_allclose(areas[2000.0][-1], 25.67, rtol=5e-3)
np.testing.assert_allclose(elastic.largest_pressure, 36480, rtol=0.01)
