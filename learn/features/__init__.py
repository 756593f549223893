"""What a model is given: three feature sets, from a database's rows or from a surface of one's own.

- `paper`: Delta and the 22 statistics, in um, as they stand.
- `dimensionless`: the same without units. Scaling heights and Delta together, or the scan length L,
  changes no contact area, and does not change these either.
- `hybrid`: besides those, what a look at the surface itself says (`pytest bench -k features`
  times it): bearing area and interference, and a loose contact solve on 33 x 33 blocks.
  Dimensionless too.
"""

from learn.features.sets import SETS, FeatureSet, chosen
from learn.features.surface import SurfaceFeatures

__all__ = ["SETS", "FeatureSet", "SurfaceFeatures", "chosen"]
