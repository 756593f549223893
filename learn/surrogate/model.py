"""A surrogate: what was learnt, and what it says about a surface."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gen.errors import InputError
from learn.features import FeatureSet, SurfaceFeatures, chosen
from learn.features.sets import build, target_scale
from learn.models import STEP
from learn.surrogate import storage
from learn.surrogate.conformal import Calibration

Values = NDArray[np.float64]

PART = 2000
"""Rows that are predicted together: kernels need memory for rows times training rows."""

CEILING = {"area_percent": 100.0}
"""Largest value of a target, where there is one; the smallest is 0."""


@dataclass(frozen=True, eq=False)
class Learnt:
    """One target's model.

    Attributes
    ----------
    column : the target's column in `gen.schema`
    unit : its unit
    pipeline : scaling and estimator, fitted to (target / scale - mean) / deviation
    mean, deviation : of the target over its scale
    calibration : of the target over its scale
    """

    column: str
    unit: str
    pipeline: Any
    mean: float
    deviation: float
    calibration: Calibration

    def raw(self, inputs: Values) -> Values:
        """Predict the target over its scale."""
        found = [self._predict(part) for part in _parts(inputs)]
        return self.mean + self.deviation * np.concatenate(found)

    def _predict(self, inputs: Values) -> Values:
        """Predict some rows: kernel ridge without scikit-learn's checks of its training rows.

        With 9,000 training rows they took half of a single prediction's time.
        """
        if self._expansion is None:
            return np.asarray(self.pipeline.predict(inputs), dtype=np.float64).reshape(-1)
        centres, squares, gamma, weights = self._expansion
        scaling = self.pipeline.steps[0][1]
        scaled = inputs if scaling == "passthrough" else scaling.transform(inputs)
        distances = squares - 2.0 * (scaled @ centres.T)
        distances += np.einsum("ij,ij->i", scaled, scaled)[:, None]
        np.maximum(distances, 0.0, out=distances)
        distances *= -gamma
        return np.asarray(np.exp(distances, out=distances) @ weights)

    @cached_property
    def _expansion(self) -> tuple[Values, Values, float, Values] | None:
        """Centres, their squares, gamma and weights of kernel ridge with radial functions."""
        ridge = self.pipeline.named_steps[STEP]
        if getattr(ridge, "kernel", None) != "rbf" or not hasattr(ridge, "X_fit_"):
            return None
        centres = np.asarray(ridge.X_fit_, dtype=np.float64)
        gamma = 1.0 / centres.shape[1] if ridge.gamma is None else float(ridge.gamma)
        weights = np.asarray(ridge.dual_coef_, dtype=np.float64).reshape(-1)
        return centres, np.einsum("ij,ij->i", centres, centres), gamma, weights

    def spread(self, inputs: Values) -> Values | None:
        """Standard deviation of a Gaussian process, over the scale; None of other models."""
        process = self.pipeline.named_steps[STEP]
        if not hasattr(process, "log_marginal_likelihood"):
            return None
        if process.L_ is None:
            process.L_ = storage.factor(process)
        found = [self.pipeline.predict(part, return_std=True)[1] for part in _parts(inputs)]
        return np.concatenate(found).reshape(-1) * self.deviation


def _parts(inputs: Values) -> list[Values]:
    """Cut rows into parts, one at least."""
    return [inputs[start : start + PART] for start in range(0, max(len(inputs), 1), PART)]


@dataclass(frozen=True, eq=False)
class Prediction:
    """What a surrogate says about n rows.

    Attributes
    ----------
    delta : (n,) far-field displacement [um]
    values : (n,) predictions by target: "area" [%], "force" [uN], "mean_gap" [um] ...
    low, high : (n,) ends of the intervals by target; empty if none were asked for
    std : (n,) standard deviations by target, of Gaussian processes, if asked for
    reasons : n texts: what lies outside the training, "" if nothing does
    """

    delta: Values
    values: dict[str, Values]
    low: dict[str, Values] = field(default_factory=dict)
    high: dict[str, Values] = field(default_factory=dict)
    std: dict[str, Values] = field(default_factory=dict)
    reasons: tuple[str, ...] = ()

    @property
    def area(self) -> Values:
        """(n,) effective contact area [%]."""
        return self.values["area"]

    @property
    def force(self) -> Values:
        """(n,) normal force [uN]."""
        return self.values["force"]

    @property
    def inside(self) -> NDArray[np.bool_]:
        """(n,) whether a row lies inside the training ranges."""
        return np.array([not reason for reason in self.reasons], dtype=np.bool_)


class Rows(NamedTuple):
    """Rows to predict, ready for the models.

    Attributes
    ----------
    inputs : (n, d) features
    statistics : (n, 22)
    delta : (n,) [um]
    length : scan length L, one or (n,) [um]
    notes : what is odd about all rows, or about each
    """

    inputs: Values
    statistics: Values
    delta: Values
    length: Values | float
    notes: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Surrogate:
    """Fitted models of one or more targets, with all that their use needs.

    Attributes
    ----------
    card : what it was made of and how good it is (`learn.surrogate.card`)
    learnt : models by the short name of their target
    low, high : (d,) training ranges of the features
    remarks : what the libraries say about the file that it was loaded from
    """

    card: dict[str, Any]
    learnt: Mapping[str, Learnt]
    low: Values
    high: Values
    remarks: tuple[str, ...] = ()

    @classmethod
    def load(cls, path: Path | str) -> Self:
        """Read a surrogate's file; nothing in it is run.

        Raises
        ------
        InputError
            If it is no surrogate.
        """
        content, remarks = storage.load(Path(path))
        try:
            learnt = {
                name: Learnt(
                    column=str(each["column"]),
                    unit=str(each["unit"]),
                    pipeline=each["pipeline"],
                    mean=float(each["mean"]),
                    deviation=float(each["deviation"]),
                    calibration=Calibration(each["borders"], tuple(each["scores"])),
                )
                for name, each in content["targets"].items()
            }
            loaded = cls(content["card"], learnt, content["low"], content["high"], tuple(remarks))
            loaded._check()
        except (KeyError, TypeError, AttributeError, ValueError) as error:
            raise InputError(f"{path}: is not whole ({type(error).__name__}: {error})") from None
        return loaded

    def save(self, path: Path | str) -> None:
        """Write the one file that `load` reads; an older one is replaced by a whole one."""
        factors = {}
        for name, each in self.learnt.items():
            process = each.pipeline.named_steps[STEP]
            if hasattr(process, "L_"):
                factors[name] = storage.without_factor(process)
        try:
            storage.save(
                Path(path),
                {
                    "card": self.card,
                    "low": self.low,
                    "high": self.high,
                    "targets": {
                        name: {
                            "column": each.column,
                            "unit": each.unit,
                            "pipeline": each.pipeline,
                            "mean": each.mean,
                            "deviation": each.deviation,
                            "borders": each.calibration.borders,
                            "scores": list(each.calibration.scores),
                        }
                        for name, each in self.learnt.items()
                    },
                },
            )
        finally:
            for name, kept in factors.items():
                self.learnt[name].pipeline.named_steps[STEP].L_ = kept

    @property
    def features(self) -> FeatureSet:
        """The feature set that the models were trained on."""
        return chosen(str(self.card["features"]))

    @property
    def modulus(self) -> float:
        """E* of the training [MPa]."""
        return float(self.card["modulus"])

    def predict(
        self,
        surface: ArrayLike,
        side: float | tuple[float, float],
        delta: ArrayLike,
        *,
        e_star: float | None = None,
        level: float | None = 0.9,
    ) -> Prediction:
        """Predict contacts of one surface.

        Parameters
        ----------
        surface : (nx, ny) heights [um]
        side : scan length, one or one per axis [um]
        delta : one or more far-field displacements [um]
        e_star : E* that forces and pressures are for; that of the training unless given [MPa]
        level : coverage of the intervals, None for none

        Returns
        -------
        Prediction

        Raises
        ------
        InputError
            For heights, lengths or displacements that no contact has.
        """
        return self.for_surface(surface, side).predict(delta, e_star=e_star, level=level)

    def for_surface(
        self, surface: ArrayLike, side: float | tuple[float, float], name: str = "the surface"
    ) -> "OnSurface":
        """Compute what is the same for all displacements, once.

        Parameters
        ----------
        surface, side : see `predict`
        name : what messages call it
        """
        heights = np.asarray(surface, dtype=np.float64)
        sides = (float(side[0]), float(side[1])) if isinstance(side, tuple) else (float(side),) * 2
        if heights.ndim != 2 or min(heights.shape) < 2 or not np.isfinite(heights).all():
            raise InputError(f"{name}: give 2-D heights, 2 x 2 or more, all finite")
        if not all(0 < each < np.inf for each in sides):
            raise InputError(f"{name}: side {side!r}: give lengths above 0 um")
        return OnSurface(self, SurfaceFeatures(heights, sides, name=name))

    def of_statistics(
        self, statistics: Values, delta: Values, length: Values | float, notes: tuple[str, ...] = ()
    ) -> Rows:
        """Rows of statistics, ready for `predict_rows`.

        Parameters
        ----------
        statistics : (n, 22) in the order and units of Table 1
        delta : (n,) far-field displacement [um]
        length : scan length L, one or (n,) [um]
        notes : what is odd about all rows, or about each

        Raises
        ------
        InputError
            If the surrogate needs the surface itself, or a row is not finite.
        """
        if self.features.needs_surface:
            raise InputError(
                f"{self.features.name} features need the surface, not its statistics alone: give"
                " its heights, or fit with --features dimensionless"
            )
        inputs = build(self.features, statistics, delta, length)
        bad = np.flatnonzero(~np.isfinite(inputs).all(axis=1) | ~(delta > 0))
        if bad.size:
            raise InputError(
                f"row {bad[0] + 1} of {len(delta)}: statistics and Delta must be finite, densities,"
                " curvatures and Delta above 0"
            )
        return Rows(inputs, statistics, delta, length, notes)

    def predict_rows(
        self,
        rows: Rows,
        *,
        e_star: float | None = None,
        level: float | None = 0.9,
        std: bool = False,
        reasons: bool = True,
    ) -> Prediction:
        """Predict rows whose features are there.

        Parameters
        ----------
        rows : from `of_statistics` or `OnSurface.rows`
        e_star, level : see `predict`
        std : True for the standard deviations of Gaussian processes
        reasons : False to leave out what lies outside the training ranges
        """
        if e_star is not None and not 0 < e_star < np.inf:
            raise InputError(f"E* {e_star:g}: give a modulus above 0 MPa")
        ratio = 1.0 if e_star is None else e_star / self.modulus
        found = Prediction(
            rows.delta, {}, reasons=self.reasons(rows) if reasons else ("",) * len(rows.delta)
        )
        for name, learnt in self.learnt.items():
            scale = target_scale(
                self.features, learnt.column, rows.statistics, rows.delta, rows.length, self.modulus
            )
            if learnt.column in {"force", "largest_pressure"}:
                scale = scale * ratio
            ceiling = CEILING.get(learnt.column, np.inf)
            raw = learnt.raw(rows.inputs)
            found.values[name] = np.clip(raw * scale, 0.0, ceiling)
            if level is not None:
                half = learnt.calibration.half_width(raw, level)
                found.low[name] = np.clip((raw - half) * scale, 0.0, ceiling)
                found.high[name] = np.clip((raw + half) * scale, 0.0, ceiling)
            spread = learnt.spread(rows.inputs) if std else None
            if spread is not None:
                found.std[name] = spread * scale
        return found

    def reasons(self, rows: Rows) -> tuple[str, ...]:
        """Say for each row what lies outside the training, "" if nothing does."""
        outside = (rows.inputs < self.low) | (rows.inputs > self.high)
        notes = rows.notes if len(rows.notes) == len(rows.delta) else rows.notes * len(rows.delta)
        notes = notes or ("",) * len(rows.delta)
        if not outside.any():
            return notes
        names, found = self.features.columns, []
        for row, note in enumerate(notes):
            beyond = [
                f"{names[place]} {rows.inputs[row, place]:.4g} outside {self.low[place]:.4g} to"
                f" {self.high[place]:.4g}"
                for place in np.flatnonzero(outside[row])
            ]
            found.append("; ".join([note, *beyond] if note else beyond))
        return tuple(found)

    def note(self, shape: tuple[int, int], sides: tuple[float, float]) -> str:
        """Say how a grid differs from the training's, "" if it does not."""
        nodes, side = int(self.card["nodes"]), float(self.card["side"])
        said = []
        if shape != (nodes, nodes):
            said.append(f"{shape[0]} x {shape[1]} nodes, trained on {nodes} x {nodes}")
        if not np.isclose(sides[0], sides[1], rtol=1e-3):
            said.append(f"{sides[0]:.6g} x {sides[1]:.6g} um, trained on square patches")
        elif not self.features.scaled and not np.isclose(sides[0], side, rtol=1e-3):
            said.append(f"side {sides[0]:.6g} um, trained on {side:.6g} um")
        if not self.features.scaled:
            spacing, own = sides[0] / max(shape[0] - 1, 1), float(self.card["spacing"])
            if not np.isclose(spacing, own, rtol=0.02):
                said.append(f"spacing {spacing:.4g} um, trained on {own:.4g} um")
        return "; ".join(said)

    def _check(self) -> None:
        """Refuse a file whose parts do not belong together; raises what `load` catches."""
        width = len(self.features.columns)
        if self.low.shape != (width,) or self.high.shape != (width,):
            raise ValueError(f"{width} features have ranges of {self.low.shape}")
        for each in self.learnt.values():
            if int(each.pipeline.named_steps[STEP].n_features_in_) != width:
                raise ValueError(f"the model of {each.column} has other inputs")
        if not self.learnt:
            raise ValueError("no target")
        float(self.card["nodes"]), float(self.card["side"]), float(self.card["spacing"])
        float(self.card["modulus"])


@dataclass(frozen=True, eq=False)
class OnSurface:
    """A surrogate on one surface: what does not depend on Delta is computed once.

    Attributes
    ----------
    surrogate : what is asked
    surface : about which surface
    """

    surrogate: Surrogate
    surface: SurfaceFeatures

    def rows(self, delta: ArrayLike) -> Rows:
        """Features at one or more displacements [um]."""
        surface, surrogate = self.surface, self.surrogate
        deltas = np.atleast_1d(np.asarray(delta, dtype=np.float64))
        inputs = surface.features(surrogate.features, deltas)
        statistics = np.broadcast_to(surface.statistics, (deltas.size, surface.statistics.size))
        shape = (surface.heights.shape[0], surface.heights.shape[1])
        note = surrogate.note(shape, surface.sides)
        return Rows(inputs, statistics, deltas, surface.length, (note,))

    def predict(
        self,
        delta: ArrayLike,
        *,
        e_star: float | None = None,
        level: float | None = 0.9,
        std: bool = False,
        reasons: bool = True,
    ) -> Prediction:
        """Predict contacts at one or more displacements.

        Parameters
        ----------
        delta : above 0, one or (n,) [um]
        e_star, level, std, reasons : see `Surrogate.predict_rows`

        Returns
        -------
        Prediction
        """
        return self.surrogate.predict_rows(
            self.rows(delta), e_star=e_star, level=level, std=std, reasons=reasons
        )
