"""
From a scan to its contact law
==============================

An instrument's map is tilted and has spikes and holes. The commands ``gen contact`` and ``gen law``
prepare it by options. This example calls ``gen law`` from Python and draws the law from its CSV
file.
"""

# %%
# The map is made here, as an instrument would leave it. A file of your own takes its place.

import csv
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from gen import cli
from gen.spectral import SelfAffineSpectrum, generate_spectral

folder = Path(tempfile.mkdtemp())
random = np.random.default_rng(3)
rough = SelfAffineSpectrum(hurst=0.8, roll_off=60.0, cut_off=4.0)  # wavelengths in um
heights = generate_spectral((128, 128), 128.0, rough, random, rms_height=0.8)
heights += 0.02 * np.arange(128)  # tilted
heights.flat[random.choice(heights.size, 10, replace=False)] += 10.0  # spikes
heights[random.random(heights.shape) < 0.01] = np.nan  # holes
np.save(folder / "ground.npy", heights)

# %%
# The law of the prepared map: steel, with the hardness of its softer body. Spikes become the median
# of their neighbours, the tilt is taken out, and the holes are filled.

law = folder / "law.csv"
options = "--side 128 --despike 7 --level plane --fill --young 210e3 --poisson 0.3 --hardness 2000"
loads = "--pressure 1:1000:10:log"
code = cli.main(
    [
        "law",
        str(folder / "ground.npy"),
        *options.split(),
        *loads.split(),
        "--csv",
        str(law),
    ]
)

# %%
# The CSV file holds two tables: the law over Delta, and over the pressures that were asked for.

with law.open(newline="") as file:
    rows = [row for row in csv.DictReader(file) if row["against"] == "pressure_MPa"]
pressure, closure, area = (
    np.array([float(row[name]) for row in rows])
    for name in ("pressure_MPa", "closure_um", "area_percent")
)
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.5), layout="constrained")
left.semilogx(pressure, closure, "o-")
left.set(xlabel="nominal pressure [MPa]", ylabel="closure [µm]")
right.loglog(pressure, area, "o-", label="this map")
right.loglog(pressure, 100 * pressure / 2000, "k--", label="load / hardness")
right.set(xlabel="nominal pressure [MPa]", ylabel="contact area [%]")
right.legend()
plt.show()

# %%
# Every build of the manual holds this example to its number, the load over the hardness.

np.testing.assert_allclose(area[-1], 50, atol=1)
