"""
A conducting contact for finite elements
========================================

A finite-element program wants two curves of a joint: pressure over closure, and conductance over
pressure. ``gen law`` computes both and writes them as input for CalculiX or Abaqus.
"""

# %%
# The surface is generated here; ``numpy.save`` writes any map of heights in um.

import re
import shutil
import subprocess
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

options = (
    "--side 1000 --pressure 0.1:100:12:log --young 210e3 --poisson 0.3 --hardness 2000"
)
table, include = folder / "law.csv", folder / "joint-calculix.inp"
code = cli.main(
    [
        *("law", str(folder / "surface.npy"), *options.split(), "--conductivity", "50"),
        *("--calculix", str(include), "--csv", str(table)),
    ]
)

# %%
# This is the file that CalculiX includes by ``*INCLUDE, INPUT=joint-calculix.inp``, in mm, N, s and
# K. A contact pair of the type SURFACE TO SURFACE names its interaction.

lines = include.read_text().splitlines()
print("\n".join([*lines[:28], "..."]))

# %%
# Two blocks with this joint between them: the top is pushed down by 1 um, and 100 K warmer.

deck = Path("../../bench/two-blocks.inp").read_text()
(folder / "two-blocks.inp").write_text(deck)
print(deck[deck.index("*MATERIAL") :])

# %%
# CalculiX, where it is installed, prints displacements of both faces and the force on the top.

pressed = []
if shutil.which("ccx"):
    subprocess.run(["ccx", "two-blocks"], cwd=folder, check=True, capture_output=True)
    printed = (folder / "two-blocks.dat").read_text().splitlines()
    numbers = [line.split() for line in printed if re.fullmatch(r"[-+ 0-9.E]+", line)]
    low, high, *_, force = [list(map(float, line)) for line in numbers]
    pressed = [1e3 * (low[3] - high[3]), -force[2]]  # um, MPa on 1 mm2
    print("closure {:.4f} um at {:.2f} MPa".format(*pressed))

# %%
# The two curves.

laws = np.genfromtxt(table, delimiter=",", names=True, dtype=None, encoding="utf-8")
laws = laws[laws["against"] == "pressure_MPa"]
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.5), layout="constrained")
left.semilogy(laws["closure_um"], laws["pressure_MPa"], "o-")
if pressed:
    left.plot(*pressed, "s", label="CalculiX")
    left.legend()
left.set(xlabel="closure [µm]", ylabel="pressure [MPa]")
right.loglog(laws["pressure_MPa"], laws["conductance_W_per_mm2_K"], "o-")
right.set(xlabel="pressure [MPa]", ylabel="conductance [W/(mm2 K)]")
plt.show()

# %%
# Every build of the manual holds this example to its numbers, at 100 MPa.

np.testing.assert_allclose(laws["closure_um"][-1], 0.687, rtol=0.01)
np.testing.assert_allclose(laws["conductance_W_per_mm2_K"][-1], 0.1476, rtol=0.02)
