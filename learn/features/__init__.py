"""Four feature sets, computed from the rows of a database or from the heights of a surface.

- `paper`: Delta and the 22 statistics of the surface, without a change of their units.
- `dimensionless`: Delta and the statistics made free of units. They do not change if heights and
  Delta are scaled together, or if the scan length L is scaled; nor does the contact area.
- `hybrid`: the dimensionless features, bearing area and bearing interference, and the results of a
  loose contact solve on 33 x 33 blocks. They need the heights of the surface.
- `scene`: the parameters that the scene draws for a row, and its load (`learn.features.scene`).

Surrogates see further features: square roots with both sets without units, and further results of
the coarse solve with `hybrid` (see `learn.features.sets.chosen`).
"""

from learn.features.sets import OF_SURFACES, SETS, FeatureSet, chosen
from learn.features.surface import SurfaceFeatures, Undefined

__all__ = ["OF_SURFACES", "SETS", "FeatureSet", "SurfaceFeatures", "Undefined", "chosen"]
