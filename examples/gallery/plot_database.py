"""
A database read with pandas
===========================

A database is an HDF5 file that opens as netCDF, so xarray and pandas read it. This one, the first
200 samples of the paper's scene, stands in the repository.
"""

# %%
# One row for each sample. The column ``status`` is 1 where the sample was solved.

import matplotlib.pyplot as plt
import numpy as np
import xarray

database = xarray.open_dataset("../sample.h5")
rows = database.to_dataframe()
done = rows[rows.status == 1]
print(done[["hurst", "delta", "height_rms", "area_percent", "force"]].describe().round(2))

# %%
# Units and meanings stand in the file.

for name in ("delta", "height_rms", "area_percent"):
    print(
        f"{name}: {database[name].attrs['long_name']} [{database[name].attrs['units']}]"
    )

# %%
# The interference decides: Delta over the rms height explains most of the area.

reduced = done.delta / done.height_rms
correlation = reduced.corr(done.area_percent, method="spearman")
print(f"rank correlation of Delta / rms height and area: {correlation:.3f}")

figure, axes = plt.subplots(1, 2, figsize=(9, 3.5), layout="constrained", sharey=True)
for axis, values, name in (
    (axes[0], done.delta, "Delta [µm]"),
    (axes[1], reduced, "Delta / rms height"),
):
    points = axis.scatter(values, done.area_percent, c=done.hurst, s=12)
    axis.set(xlabel=name)
axes[0].set(ylabel="effective contact area [%]", yscale="log", ylim=(0.01, 100))
figure.colorbar(points, ax=axes, label="Hurst exponent")
plt.show()

# %%
# Every build of the manual holds this example to its number.

np.testing.assert_allclose(correlation, 0.924, atol=1e-3)
