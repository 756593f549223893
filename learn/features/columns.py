"""Names of the feature columns, and the constants of the columns that a coarse solve gives.

A name says how the column is made free of units: `delta/h` is Delta over the height unit h (see
`learn.features.rows.Rows.height_unit`), `log(density.L2/h)` is the logarithm of density L^2 / h,
`sqrt(delta/h)` is a square root.
"""

from collections.abc import Mapping

from gen.schema import TABLE_1

# The 22 statistics, in the order of the paper's Table 1.
STATISTICS: tuple[str, ...] = tuple(column.name for column in TABLE_1)
# Units of Delta and of the statistics, by name.
UNITS: Mapping[str, str] = {
    "delta": "um",
    **{column.name: column.unit for column in TABLE_1},
}
# Statistics that are heights [um]. Sets without units divide them by h.
HEIGHTS = tuple(name for name in STATISTICS if UNITS[name] == "um")
# Statistics that are curvatures [1/um]. Sets without units multiply them by L^2 / h.
CURVATURES = tuple(name for name in STATISTICS if UNITS[name] == "um-1")
# Statistics that are pure numbers over decades. Sets without units take their logarithms.
BANDWIDTHS = ("bandwidth_x", "bandwidth_y")
# Statistics that are pure numbers, and that sets without units do not change.
PURE = tuple(
    name for name in STATISTICS if name not in {*HEIGHTS, *CURVATURES, *BANDWIDTHS}
)

# Square root of Delta / h, a further feature of surrogates without units.
ROOT = "sqrt(delta/h)"
# Hardness / E*: the form of the hardness that is a feature of sets with units.
HARDNESS = "hardness/E*"
# Logarithm of hardness L / (E* h): the form of the hardness that is a feature of sets without
# units.
SCALED_HARDNESS = "log(hardness.L/(E*.h))"
# Square root of the share of the patch that would carry the force of the coarse solve if the
# pressure were the hardness everywhere. No contact of bodies that yield has a smaller area. The
# feature is 0 for elastic bodies.
PLASTIC = "sqrt(coarse_force/(hardness.L2))"
# Logarithm of the nodes along a side (the geometric mean of both axes), a feature if grids differ.
# A coarser grid leaves out short waves, and counts a contact in larger cells.
NODES = "log2(nodes)"

# Logarithm of the thickness of a layer times the wave number of the surface (its rms slope over its
# rms height), a feature of bodies with a layer.
LAYER_DEPTH = "log(wave_number.thickness)"
# Logarithm of E* of the base over E* of the layer, a feature if it differs between rows.
BASE_RATIO = "log(base_E*/E*)"

# Number of blocks per side in the coarse solve. If a side has fewer nodes, each node is a block.
BLOCKS = 33
# Numbers of blocks from which a user can choose. A patch without edges has one block less per side,
# 32 or 64: these are of equal size on grids of 2^k nodes, and their Fourier transforms are fast.
BLOCK_COUNTS = (BLOCKS, 65)

# Force of the coarse solve, made free of units.
FORCE = "coarse_force/(E*.L.delta)"
# Share of the nodes that are above the displacement of the coarse solve; and the mean over all
# nodes of their height above it, with 0 for nodes that are not above it.
REFINED = ("refined_share", "refined_interference/delta")
# Columns of the coarse solve that the hybrid set has; all are free of units.
COARSE = (
    "bearing_share",
    "bearing_interference/delta",
    "coarse_area_percent",
    FORCE,
    "coarse_displacement/delta",
    *REFINED,
)

# Multiples of the coarse pressures for which the area inside the blocks is computed by Persson's
# theory. Real contacts differ from his theory; models interpolate between these multiples.
FACTORS = (0.5, 1.0, 2.0)
# The displacement of the coarse solve is shifted upwards by these multiples of s, the rms of the
# heights that the blocks do not resolve. A feature is the share of the nodes above it.
SHIFTS = (-1.0, -0.5, 0.5, 1.0)
# Powers p of the norms (mean of interference^p)^(1/p) of the nodes above the displacement.
POWERS = (2, 3)
# Skewness of the heights that the blocks do not resolve, 0 if each node is a block. It is about 0
# for self-affine surfaces, and not for surfaces with scratches, pits or worn peaks.
SKEWNESS = "unresolved_skewness"
# Columns of `LOCAL` whose square roots surrogates see, too.
ROOTED_LOCAL = (
    *(f"local_area({factor:g}p)" for factor in FACTORS),
    *(f"refined_share({shift:+g}s)" for shift in SHIFTS),
)
# Columns of the coarse solve that surrogates see in addition to `COARSE`.
LOCAL = (
    *ROOTED_LOCAL,
    *(f"refined_interference_{power}/delta" for power in POWERS),
    "coarse_perimeter/L",
    SKEWNESS,
)
# All 18 columns of a coarse solve, in the order of `SurfaceFeatures.hybrid`.
HYBRID = (*COARSE, *LOCAL)
# Columns of `COARSE` whose square roots surrogates see, too. Like the area, these columns are 0 at
# first touch and span decades; the roots tell small values apart.
ROOTED = ("bearing_share", "coarse_area_percent", FORCE, *REFINED)

# Columns of the dimensionless set, with Delta first.
WITHOUT_UNITS = (
    *(f"{name}/h" for name in ("delta", *HEIGHTS)),
    *(f"log({name}.L2/h)" for name in CURVATURES),
    *(f"log({name})" for name in BANDWIDTHS),
    *PURE,
)
