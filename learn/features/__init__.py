"""Four feature sets, computed from the rows of a database; three also from a surface's heights.

- `paper`: Delta and the 22 statistics, in um, without a change.
- `dimensionless`: the same without units. Scaling heights and Delta together, or the scan length L,
  changes neither the contact area nor these features.
- `hybrid`: in addition, bearing area and interference, and a loose contact solve on 33 x 33 blocks.
- `scene`: the numbers that the scene draws for a row, and its load (`learn.features.scene`).

Surrogates see more: square roots with both sets without units, and more of the coarse solve with
`hybrid` (`learn.features.sets.chosen`).
"""

from learn.features.sets import OF_SURFACES, SETS, FeatureSet, chosen
from learn.features.surface import SurfaceFeatures, Undefined

__all__ = ["OF_SURFACES", "SETS", "FeatureSet", "SurfaceFeatures", "Undefined", "chosen"]
