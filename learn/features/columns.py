"""Names of the feature columns, and the constants of the columns that a coarse solve gives.

Names say what a column is, and how it is made free of units: `delta/h` is Delta over the height h
of `learn.features.rows.Rows.height_unit`, `log(density.L2/h)` a logarithm, `sqrt(delta/h)` a root.
"""

from collections.abc import Mapping

from gen.schema import TABLE_1

# the 22 statistics, in the order of the paper's Table 1
STATISTICS: tuple[str, ...] = tuple(column.name for column in TABLE_1)
# units of Delta and the statistics, by name
UNITS: Mapping[str, str] = {
    "delta": "um",
    **{column.name: column.unit for column in TABLE_1},
}
HEIGHTS = tuple(name for name in STATISTICS if UNITS[name] == "um")
CURVATURES = tuple(name for name in STATISTICS if UNITS[name] == "um-1")
BANDWIDTHS = ("bandwidth_x", "bandwidth_y")
# statistics that are pure numbers as they are
PURE = tuple(
    name for name in STATISTICS if name not in {*HEIGHTS, *CURVATURES, *BANDWIDTHS}
)

ROOT = "sqrt(delta/h)"  # further input of surrogates without units, beside the root of the area
HARDNESS = "hardness/E*"  # the hardness as a feature of sets with units
# the hardness as a feature of sets without units
SCALED_HARDNESS = "log(hardness.L/(E*.h))"
# Square root of the share of the patch that carries the coarse solve's force at the hardness. No
# contact of bodies that yield has a smaller area. It is 0 for elastic bodies.
PLASTIC = "sqrt(coarse_force/(hardness.L2))"
# Nodes along a side, where grids differ; the geometric mean of both axes. A coarser grid leaves out
# short waves, and counts a contact in larger cells.
NODES = "log2(nodes)"

BLOCKS = 33  # blocks per side; on a surface with fewer nodes every node is a block
# Numbers of blocks that a user can choose from. A patch without edges has one block less per side:
# blocks of 2^k nodes a side are then equal, and transforms of their number fast.
BLOCK_COUNTS = (BLOCKS, 65)

FORCE = "coarse_force/(E*.L.delta)"
# share of the nodes above the displacement of the coarse solve, and their mean interference
REFINED = ("refined_share", "refined_interference/delta")
# columns that comparisons of models add to those without units; all are pure numbers, too
COARSE = (
    "bearing_share",
    "bearing_interference/delta",
    "coarse_area_percent",
    FORCE,
    "coarse_displacement/delta",
    *REFINED,
)

# Multiples of the coarse pressures from which the area inside the blocks is estimated. Real local
# contacts lie on other curves than Persson's, and models find them between these.
FACTORS = (0.5, 1.0, 2.0)
# shifts of the displacement above which nodes are counted, over the rms s of the heights that the
# blocks do not resolve
SHIFTS = (-1.0, -0.5, 0.5, 1.0)
# powers of the mean interference of the nodes that stand above the displacement
POWERS = (2, 3)
# Skewness of the heights that the blocks do not resolve, 0 where every node is a block. Self-affine
# surfaces have such heights as high as deep; those with scratches, pits and worn peaks have not.
SKEWNESS = "unresolved_skewness"
# columns of `LOCAL` whose square roots surrogates see too
ROOTED_LOCAL = (
    *(f"local_area({factor:g}p)" for factor in FACTORS),
    *(f"refined_share({shift:+g}s)" for shift in SHIFTS),
)
# columns of the same coarse solve that surrogates see too
LOCAL = (
    *ROOTED_LOCAL,
    *(f"refined_interference_{power}/delta" for power in POWERS),
    "coarse_perimeter/L",
    SKEWNESS,
)
# all 18 columns of a coarse solve, in the order of `SurfaceFeatures.hybrid`
HYBRID = (*COARSE, *LOCAL)
# Columns of `COARSE` whose square roots surrogates see too. Like the area they begin at first touch
# and span decades, and the roots tell small values apart.
ROOTED = ("bearing_share", "coarse_area_percent", FORCE, *REFINED)

# columns of the set without units
WITHOUT_UNITS = (
    *(f"{name}/h" for name in ("delta", *HEIGHTS)),
    *(f"log({name}.L2/h)" for name in CURVATURES),
    *(f"log({name})" for name in BANDWIDTHS),
    *PURE,
)
