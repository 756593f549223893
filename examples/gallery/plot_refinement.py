"""
What the grid decides, and what it does not
===========================================

A self-affine surface has ever finer detail. Its elastic contact area shrinks as the grid is
refined. The mean gap under a load hardly changes, and a hardness gives the area a limit.
"""

# %%
# One surface on ever finer grids: the coarse ones leave out nodes of the finest.

import matplotlib.pyplot as plt
import numpy as np

import bem
from gen.runtime.figure import log_axis
from gen.surface import generate

side, finest = 1000.0, 513
heights = generate("diamond-square", finest, 0.7, 1.0, np.random.default_rng(1))
steps = [32, 16, 8, 4, 2, 1]
nodes = [(finest - 1) // step + 1 for step in steps]
steel = {"modulus": 210e3, "poisson": 0.3}
elastic = [bem.solve(heights[::s, ::s], side, pressure=20.0, **steel) for s in steps]
yielding = [
    bem.solve(heights[::s, ::s], side, pressure=20.0, hardness=2000.0, **steel)
    for s in steps
]

# %%
# Under 20 MPa the elastic area falls with every refinement. With a hardness of 2,000 MPa it cannot
# fall below load / hardness, which is 1 %.

elastic_area, yielding_area = (
    np.array([contact.area_percent for contact in contacts])
    for contacts in (elastic, yielding)
)
for count, first, second in zip(nodes, elastic_area, yielding_area, strict=True):
    print(
        f"{count:4} nodes a side: elastic {first:.3f} %, with a hardness {second:.3f} %"
    )

figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.5), layout="constrained")
left.loglog(nodes, elastic_area, "o-", label="elastic")
left.loglog(nodes, yielding_area, "s-", label="hardness of 2,000 MPa")
left.axhline(1.0, color="k", linestyle=":", label="load / hardness")
left.set(xlabel="nodes a side", ylabel="contact area [%]")
left.legend()
for contacts, style, name in ((elastic, "o-", "elastic"), (yielding, "s-", "hardness")):
    right.semilogx(nodes, [contact.mean_gap for contact in contacts], style, label=name)
right.set(xlabel="nodes a side", ylabel="mean gap [µm]", ylim=(0, None))
for axis in (left, right):
    axis.set_xticks(nodes, nodes)
    axis.minorticks_off()
log_axis(left.yaxis)
plt.show()

# %%
# Every build of the manual holds this example to its numbers, on 513 nodes.

np.testing.assert_allclose(elastic_area[-1], 0.969, rtol=0.01)
np.testing.assert_allclose(yielding_area[-1], 1.338, rtol=0.01)
