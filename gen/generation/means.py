"""Means of columns over the rows of a scene, with standard errors, and the expected ones.

The rows of a surface are no independent samples of a population, so that the standard error of a
mean comes from the scatter between surfaces [1]_. A mean is as expected if it differs from the one
in the table `[expect]` of the scene by its tolerance and `STANDARD_ERRORS` at most.

References
----------
.. [1] W. G. Cochran, Sampling Techniques, 3rd edition, Wiley, 1977, chapter 6: ratio estimators.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from gen.arrays import Columns, Values
from gen.database import Reader
from gen.generation.sample import compute_rows
from gen.quantities import stored_quantities
from gen.scene import ExpectedMean, Scene, averaged_columns
from gen.schema import Status

STANDARD_ERRORS = 4.0
"""Largest difference of a mean from the expected one, besides its tolerance [standard errors].

One of 15,000 right means is beyond it if their errors are normal, one of 900 if they come from 16
surfaces.
"""

ROUNDING = 1e-12
"""Relative difference of two equal means that rounding of their sums can explain."""

ERRORS_OF_TOLERANCE = 2.0
"""Tolerance of a mean that is proposed for a scene [standard errors]."""


@dataclass(frozen=True)
class PopulationMean:
    """Mean of a column over the rows of some surfaces."""

    column: str  # name of the column
    unit: str
    mean: float  # of the finite values; NaN if there are none
    standard_error: float  # of the mean; NaN if there are fewer than two surfaces
    surfaces: int  # number of surfaces with finite values
    left_out: int  # number of done rows whose value is not finite

    @property
    def in_words(self) -> str:
        """The mean with its standard error, the number of surfaces, and rows that are left out."""
        unit = "" if self.unit == "1" else f" {self.unit}"
        surfaces = "1 surface" if self.surfaces == 1 else f"{self.surfaces} surfaces"
        words = f"mean {self.column} {self.mean:.4g}{unit} of {surfaces}"
        if not math.isnan(self.standard_error):
            words += f", standard error {self.standard_error:.2g}"
        if self.left_out:
            words += f" ({self.left_out} rows that are not finite left out)"
        return words


@dataclass(frozen=True)
class ComparedMean:
    """Mean of a column beside the one that the scene expects."""

    measured: PopulationMean
    expected: ExpectedMean

    @property
    def is_judged(self) -> bool:
        """Whether there are enough surfaces to tell the scatter of the mean."""
        return not math.isnan(self.measured.standard_error)

    @property
    def allowed(self) -> float:
        """Largest difference from the expected mean, in the unit of the column."""
        scatter = STANDARD_ERRORS * self.measured.standard_error
        return self.expected.tolerance + scatter + ROUNDING * abs(self.expected.mean)

    @property
    def is_met(self) -> bool:
        """Whether the mean is as expected. A mean that is not judged is no fault."""
        if not self.is_judged:
            return True
        return abs(self.measured.mean - self.expected.mean) <= self.allowed

    @property
    def in_words(self) -> str:
        """Both means, and whether they agree, in one line."""
        expected = f"{self.expected.mean:.6g}"
        if self.expected.tolerance:
            expected += f" to within {self.expected.tolerance:.4g}"
        words = f"{self.measured.in_words}; expected {expected}"
        if not self.is_judged:
            return f"{words}: not judged, as two surfaces are needed"
        if self.is_met:
            return f"{words}: as expected"
        difference = abs(self.measured.mean - self.expected.mean)
        return (
            f"{words}: differs by {difference:.2g}, more than the {self.allowed:.2g} of"
            f" tolerance and {STANDARD_ERRORS:g} standard errors"
        )


def compared_means(
    expected: Mapping[str, ExpectedMean], measured: Sequence[PopulationMean]
) -> list[ComparedMean]:
    """Put measured means beside the expected ones.

    Parameters
    ----------
    expected : mapping of str to ExpectedMean
        Expected means by the names of columns.
    measured : sequence of PopulationMean
        Means of at least these columns.

    Returns
    -------
    list of ComparedMean
        One for each expected mean, in their order.
    """
    by_name = {mean.column: mean for mean in measured}
    return [ComparedMean(by_name[name], mean) for name, mean in expected.items()]


def proposed_columns(scene: Scene) -> list[str]:
    """Return the columns whose means are proposed for the table `[expect]` of a scene.

    Parameters
    ----------
    scene : Scene
        A completed scene.

    Returns
    -------
    list of str
        Names of the results of contacts that are no whole numbers, and of the outputs of a user's
        function. A Delta that the scene draws is left out.
    """
    results = {quantity.name for quantity in stored_quantities()}
    results |= (scene.store.outputs or {}).keys()
    if scene.quantity == "delta":
        results.discard("delta")
    return [
        column.name
        for column in averaged_columns(scene)
        if column.name in results and column.dtype[0] == "f"
    ]


def means_of_database(reader: Reader, names: Sequence[str]) -> list[PopulationMean]:
    """Average columns over all done rows of a database.

    Parameters
    ----------
    reader : Reader
        An open database.
    names : sequence of str
        Names of the columns, of those in `gen.scene.averaged_columns`.

    Returns
    -------
    list of PopulationMean
        One mean for each column.
    """
    columns = {
        name: reader.column(name) for name in dict.fromkeys(("status", "surface", *names))
    }
    return _means(reader.scene, columns, names)


def means_of_scene(
    scene: Scene, surfaces: int, names: Sequence[str]
) -> list[PopulationMean]:
    """Compute the rows of the first surfaces of a scene, and average columns over them.

    Parameters
    ----------
    scene : Scene
        A completed scene, whose surfaces are ready (`make_ready`).
    surfaces : int
        Number of surfaces; of a scene with fewer ones all are computed.
    names : sequence of str
        Names of the columns, of those in `gen.scene.averaged_columns`.

    Returns
    -------
    list of PopulationMean
        One mean for each column.

    Raises
    ------
    InputError
        If a contact does not fit into memory.
    SourceError
        If a function of the user's fails, or a map is missing. It is a kind of InputError.
    """
    chunks: list[Columns] = []
    for surface in range(min(surfaces, scene.surfaces)):
        start = surface * scene.samples_per_surface
        stop = min(start + scene.samples_per_surface, scene.samples)
        computed = compute_rows(scene, start, stop)
        # Fields of all nodes are not kept.
        chunks.append({name: computed[name] for name in ("status", "surface", *names)})
    columns = {
        name: np.concatenate([chunk[name] for chunk in chunks]) for name in chunks[0]
    }
    return _means(scene, columns, names)


def _means(scene: Scene, columns: Columns, names: Sequence[str]) -> list[PopulationMean]:
    """Average columns over done rows; `columns` has "status" and "surface" too."""
    done = columns["status"] == Status.DONE
    surfaces = columns["surface"][done]
    units = {column.name: column.unit for column in averaged_columns(scene)}
    means = []
    for name in names:
        values = columns[name][done].astype(np.float64)
        is_finite = np.isfinite(values)
        mean, error = clustered_mean(values[is_finite], surfaces[is_finite])
        means.append(
            PopulationMean(
                column=name,
                unit=units[name],
                mean=mean,
                standard_error=error,
                surfaces=np.unique(surfaces[is_finite]).size,
                left_out=int((~is_finite).sum()),
            )
        )
    return means


def clustered_mean(values: Values, clusters: Values) -> tuple[float, float]:
    """Compute the mean of values, and its standard error from the scatter between clusters.

    The mean is the ratio of two sums over clusters: of their values, and of the numbers of these.
    The standard error is that of a ratio estimator, for clusters drawn at random.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Finite values.
    clusters : ndarray, shape (n,)
        Number of the cluster of each value.

    Returns
    -------
    tuple of two float
        Mean and standard error, in the unit of the values. The mean of no value is NaN, and so is
        the error of fewer than two clusters.
    """
    if not values.size:
        return math.nan, math.nan
    # Squares of values are then far from the largest number of double precision.
    scale = float(np.abs(values).max()) or 1.0
    _, cluster_of_value = np.unique(clusters, return_inverse=True)
    sizes = np.bincount(cluster_of_value)
    sums = np.bincount(cluster_of_value, weights=values / scale)
    mean = sums.sum() / values.size
    if sizes.size < 2:
        return float(mean * scale), math.nan
    deviations = sums - mean * sizes
    correction = sizes.size / (sizes.size - 1)
    error = math.sqrt(correction * float(deviations @ deviations)) / values.size
    return float(mean * scale), error * scale


def toml_of(means: Sequence[PopulationMean]) -> list[str]:
    """Write means as the table `[expect]` of a scene.

    Parameters
    ----------
    means : sequence of PopulationMean
        The means.

    Returns
    -------
    list of str
        Lines of TOML, with `ERRORS_OF_TOLERANCE` standard errors as tolerances, rounded up to two
        digits. A mean without a standard error is left out.
    """
    lines = ["[expect]"]
    for mean in means:
        if math.isnan(mean.standard_error):
            continue
        tolerance = _rounded_up(ERRORS_OF_TOLERANCE * mean.standard_error)
        # As many digits as the tolerance has.
        digits = 6
        if tolerance and mean.mean:
            ratio = abs(mean.mean) / tolerance
            digits = max(2, 2 + math.ceil(math.log10(ratio)))
        lines.append(
            f"{mean.column} = {{ mean = {_in_toml(mean.mean, digits)},"
            f" tolerance = {_in_toml(tolerance, 2)} }}"
        )
    return lines


def _in_toml(number: float, digits: int) -> str:
    """Write a number with its significant digits, and an exponent only if it is far from 1."""
    if number and not 1e-4 <= abs(number) < 1e7:
        return f"{number:.{digits}g}"
    return np.format_float_positional(
        number, precision=digits, unique=False, fractional=False, trim="-"
    )


def _rounded_up(number: float) -> float:
    """Round a number of 0 or more up to two significant digits."""
    if not number:
        return 0.0
    unit = 10.0 ** (math.floor(math.log10(number)) - 1)
    return math.ceil(number / unit) * unit
