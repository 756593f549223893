"""
A sphere against Hertz
======================

A ball of 5 mm radius is pressed onto a plane. Hertz (1882) gives the force and the area in closed
form, so this contact shows how far the numbers of any other contact can be trusted.
"""

# %%
# The surface is the cap of the sphere, a paraboloid, on 129 x 129 nodes.

import matplotlib.pyplot as plt
import numpy as np

import bem

side, radius = 400.0, 5000.0  # um
young, poisson = 210e3, 0.3  # MPa, 1: an elastic steel plane under a rigid ball
x = np.linspace(-side / 2, side / 2, 129)
heights = -(x[:, None] ** 2 + x**2) / (2 * radius)

# %%
# A ladder solves one contact after another; each starts from the contacts before it.

deltas = np.linspace(0.2, 2.0, 10)  # um
contacts = list(bem.ladder(heights, side, deltas, modulus=young, poisson=poisson))
forces = np.array([contact.force for contact in contacts])
areas = np.array([contact.area_percent for contact in contacts]) / 100 * side**2

e_star = young / (1 - poisson**2)
hertz_forces = 4 / 3 * e_star * np.sqrt(radius) * deltas**1.5
hertz_areas = np.pi * radius * deltas
force_error = forces / hertz_forces - 1
for delta, force, error in zip(deltas, forces, force_error, strict=True):
    print(
        f"Delta {delta:3.1f} um: {force / 1e6:7.4f} N, {100 * error:+5.2f} % from Hertz"
    )

# %%
# The forces agree closely. Areas are counted in whole cells, which shows where few cells touch.

figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.5), layout="constrained")
left.plot(deltas, hertz_forces / 1e6, "k-", label="Hertz")
left.plot(deltas, forces / 1e6, "o", label="solved")
left.set(xlabel="Delta [µm]", ylabel="force [N]")
left.legend()
right.plot(deltas, hertz_areas, "k-", label="Hertz")
right.plot(deltas, areas, "o", label="solved")
right.set(xlabel="Delta [µm]", ylabel="contact area [µm²]")
plt.show()

# %%
# Every build of the manual holds this example to its number.

np.testing.assert_allclose(forces, hertz_forces, rtol=1e-3)
