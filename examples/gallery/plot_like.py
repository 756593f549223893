"""
Surfaces like a map
===================

A map is one surface of many that the same process makes. ``gen scene --like`` finds the population
that the map is of, and presses up to ten surfaces of it beside the map. This example draws three of
them, and their areas over the pressure with those of the map.
"""

# %%
# The map is made here: ground along x, worn, and measured with a tilt, spikes and holes. A file of
# your own takes its place.

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import bem
from gen import cli
from gen.maps.prepare import prepare
from gen.maps.read import read
from gen.maps.settings import Reading
from gen.population import Population, generate_like
from gen.runtime.figure import log_axis
from gen.spectral import SelfAffineSpectrum, generate_spectral

folder = Path(tempfile.mkdtemp())
random = np.random.default_rng(3)
ground = SelfAffineSpectrum(hurst=0.8, roll_off=40.0, cut_off=3.0, stretch=2.0)
heights = generate_spectral((256, 256), 256.0, ground, random, rms_height=0.8)
heights -= 0.2 * heights**2  # worn: deeper valleys than summits
heights += 0.02 * np.arange(256)  # tilted
heights.flat[random.choice(heights.size, 20, replace=False)] += 10.0  # spikes
heights[random.random(heights.shape) < 0.002] = np.nan  # holes
lengths = "Width: 256 um\nHeight: 256 um\nValue units: um"
np.savetxt(folder / "map.txt", heights.T, header=lengths)

# %%
# The command prepares the map, compares it with up to ten surfaces by the contact, and writes a
# scene with the population.

scene = f"scene --like {folder / 'map.txt'} --young 210e3 --poisson 0.3 --hardness 2000"
code = cli.main([*scene.split(), "-o", str(folder / "mine.toml")])

# %%
# Three surfaces of the population, as large as the map, with its preparation.

text = (folder / "mine.population.json").read_text(encoding="utf-8")
population = Population.parse(text, "mine.population.json")
settings = Reading(prepare=True)
measured = prepare(read(folder / "map.txt", settings), settings).heights
surfaces = {"the map, prepared": measured}
for number in (1, 2, 3):
    phases = np.random.default_rng(number)
    made = generate_like(population, measured.shape, population.nodes, phases)
    surfaces[f"made surface {number}"] = made

# %%
# Their areas over the pressure. A node touches at the hardness, so the areas of all surfaces meet
# load / hardness at large loads.

pressures = np.geomspace(5, 500, 8)
steel = {"modulus": 210e3, "poisson": 0.3, "hardness": 2000.0, "boundary": "mirror"}
areas = {}
for name, surface in surfaces.items():
    contacts = bem.ladder(surface, 256.0, pressures=pressures, **steel)
    areas[name] = np.array([contact.area_percent for contact in contacts])
off = np.array([areas[name] / areas["the map, prepared"] - 1 for name in surfaces])
print(f"areas of made surfaces are within {100 * np.abs(off).max():.2g} % of the map's")

figure = plt.figure(figsize=(9.5, 4.4), layout="constrained")
left, right = figure.subfigures(1, 2, width_ratios=[1.2, 1.0])
for axis, (name, surface) in zip(left.subplots(2, 2).flat, surfaces.items(), strict=True):
    image = axis.imshow(
        surface.T, origin="lower", extent=(0, 256, 0, 256), vmin=-3, vmax=2
    )
    axis.set_title(name, fontsize="small")
    axis.set(xticks=[0, 256], yticks=[0, 256])
left.colorbar(image, ax=left.axes, label="height [µm]")
axis = right.subplots()
for name, style in zip(areas, ("ko", "C0-", "C1-", "C2-"), strict=True):
    axis.loglog(pressures, areas[name], style, ms=4, label=name)
axis.loglog(pressures, 100 * pressures / 2000, "k:", label="load / hardness")
axis.set(xlabel="nominal pressure [MPa]", ylabel="contact area [%]")
axis.legend(fontsize="small")
log_axis(axis.xaxis)
log_axis(axis.yaxis)
plt.show()

# %%
# Every build of the manual holds this example to its number.

np.testing.assert_allclose(np.abs(off).max(), 0.095, atol=0.01)
