"""
Why a count of nodes is too large
=================================

A node touches as soon as its own height does, so that a count of nodes reaches beyond the border of
contact. The pressures and gaps beside the border tell where it lies between the nodes.
"""

# %%
# One surface on 8 nodes in its shortest wave, and on 64.

import matplotlib.pyplot as plt
import numpy as np

import bem


def surface(nodes, shortest, seed=3):
    """Random waves of one period and shorter, the same on any grid."""
    random, k = np.random.default_rng(seed), np.arange(-shortest, shortest + 1)
    size = np.hypot(k[:, None], k)
    inside = (size >= 1) & (size <= shortest)
    waves = np.where(inside, np.where(inside, size, 1) ** -1.8, 0) / 100
    waves = waves * np.exp(2j * np.pi * random.random(size.shape))
    phases = np.exp(2j * np.pi * np.outer(np.arange(nodes) / nodes, k))
    return (phases @ waves @ phases.T).real


shortest, pressure = 8, 0.01
coarse, fine = (
    bem.solve(surface(nodes, shortest), 1.0, pressure=pressure, boundary="periodic")
    for nodes in (8 * shortest, 64 * shortest)
)
error = coarse.grid_error()
print(
    f"count of nodes {coarse.area_percent:.2f} %, on the fine grid {fine.area_percent:.2f} %"
)
print(
    f"area in the continuum {coarse.continuum_area_percent:.2f} +- {error.area_percent:.2f} %"
)
print(f"on the fine grid {fine.continuum_area_percent:.2f} %; resolved: {error.resolved}")

# %%
# The same on ever finer grids, and for a surface whose waves go on down to every grid: its area has
# no limit, and is that of the grid.

grids = np.array([24, 32, 48, 64, 96, 128, 192, 256])
areas = np.empty((2, 2, grids.size))
for place, nodes in enumerate(grids.tolist()):
    for kind, waves in enumerate((shortest, nodes // 2 - 1)):
        contact = bem.solve(
            surface(nodes, waves), 1.0, pressure=pressure, boundary="periodic"
        )
        areas[kind, :, place] = contact.area_percent, contact.continuum_area_percent

figure, (left, right) = plt.subplots(1, 2, figsize=(9.5, 4), layout="constrained")
part = slice(0, 32)
left.imshow(
    coarse.pressure[part, part].T > 0,
    origin="lower",
    extent=(0, 0.5, 0, 0.5),
    cmap="Blues",
)
places = (np.arange(256) + 0.5) / 512 + 0.5 / 64 - 0.5 / 512
left.contour(places, places, (fine.pressure[:256, :256] > 0).T, [0.5], colors="C1")
left.set(title="nodes in contact, and the border", xlabel="x", ylabel="y")
for kind, name in enumerate(("shortest wave 1/8", "waves down to the grid")):
    right.semilogx(grids, areas[kind, 0], f"C{kind}o--", label=f"{name}: count of nodes")
    right.semilogx(grids, areas[kind, 1], f"C{kind}s-", label=f"{name}: continuum")
right.set(xlabel="nodes a side", ylabel="contact area [%]", ylim=0)
right.set_xticks(grids[::2], [str(each) for each in grids[::2]])
right.minorticks_off()
right.legend(fontsize="small")
plt.show()

# %%
# Every build of the manual holds this example to its numbers.

np.testing.assert_allclose(coarse.continuum_area_percent, 10.87, rtol=5e-3)
np.testing.assert_allclose(areas[0, 1, 1:], fine.continuum_area_percent, rtol=0.01)
