"""
A conducting contact for finite elements
========================================

A finite-element program wants two curves of a joint: pressure over closure, and conductance over
pressure. ``gen law`` computes both and writes them as input for CalculiX or Abaqus.
"""

# %%
# The surface is generated here; ``numpy.save`` writes any map of heights in um.

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from gen import cli
from gen.surface import generate

folder = Path(tempfile.mkdtemp())
heights = generate("diamond-square", 129, 0.7, 1.0, np.random.default_rng(0))
np.save(folder / "surface.npy", heights)

# %%
# Steel with a hardness of 2,000 MPa, which conducts 50 W/(m K).

options = "--side 1000 --pressure 0.1:100:12:log --young 210e3 --poisson 0.3 --hardness 2000"
table, include = folder / "law.csv", folder / "joint.inp"
code = cli.main(
    [
        *("law", str(folder / "surface.npy"), *options.split(), "--conductivity", "50"),
        *("--calculix", str(include), "--csv", str(table)),
    ]
)

# %%
# This is the file that CalculiX includes by ``*INCLUDE, INPUT=joint.inp``, in mm, N, s and K. A
# contact pair of the type SURFACE TO SURFACE names its interaction.

lines = include.read_text().splitlines()
print("\n".join([*lines[:24], "..."]))

# %%
# The two curves.

laws = np.genfromtxt(table, delimiter=",", names=True, dtype=None, encoding="utf-8")
laws = laws[laws["against"] == "pressure_MPa"]
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.5), layout="constrained")
left.semilogy(laws["closure_um"], laws["pressure_MPa"], "o-")
left.set(xlabel="closure [um]", ylabel="pressure [MPa]")
right.loglog(laws["pressure_MPa"], laws["conductance_W_per_mm2_K"], "o-")
right.set(xlabel="pressure [MPa]", ylabel="conductance [W/(mm2 K)]")
plt.show()
