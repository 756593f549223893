"""A surrogate, and its predictions for a surface."""

from __future__ import annotations  # short signatures in help()

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bem.checks import LARGEST, Range, real_array, real_number
from bem.problem import Boundary, checked, node_spacing
from gen.arrays import Values
from gen.material import Bodies
from gen.runtime.errors import InputError, input_errors
from learn.features import SETS, FeatureSet, SurfaceFeatures
from learn.features.rows import Rows
from learn.features.scene import SCENE, checked_numbers, plain
from learn.surrogate.interval import Distance, between, reasons_of
from learn.surrogate.learnt import Learnt, load_parts, write_parts
from learn.surrogate.scale import scale_notes

MODULUS = Range(0, np.inf, "a modulus above 0 MPa")
HARDNESS = Range(0, np.inf, "a hardness above 0 MPa")
LEVEL = Range(0, 1, "a coverage between 0 and 1, as 0.9")


@dataclass(frozen=True, eq=False)
class Prediction:
    """Predictions for n rows.

    Attributes
    ----------
    delta : ndarray, shape (n,)
        Far-field displacement [um].
    values : dict of str to ndarray, shape (n,)
        Predictions by target: "area" [%], "force" [uN], "mean_gap" [um] ...
    low, high : dict of str to ndarray, shape (n,)
        Ends of the intervals by target; empty if no level was given. They only hold for rows
        inside the training; tables leave them out for the other rows.
    reasons : tuple of str
        For each row, the features outside the training; "" if there is none.
    given : dict of str to ndarray, shape (n,)
        The pressure of each row, or a scene's parameters and load, for a surrogate that has learnt
        these. There `delta` is NaN unless it is the load.
    """

    delta: Values
    values: dict[str, Values]
    low: dict[str, Values] = field(default_factory=dict)
    high: dict[str, Values] = field(default_factory=dict)
    reasons: tuple[str, ...] = ()
    given: dict[str, Values] = field(default_factory=dict)

    @property
    def area(self) -> Values:
        """Effective contact area, shape (n,) [%]."""
        return self.values["area"]

    @property
    def force(self) -> Values:
        """Normal force, shape (n,) [uN]."""
        return self.values["force"]

    @property
    def inside(self) -> NDArray[np.bool_]:
        """Rows inside the training ranges, True or False, shape (n,)."""
        return np.array([not reason for reason in self.reasons], dtype=np.bool_)


@dataclass(frozen=True, eq=False)
class Surrogate:
    """Fitted models of one or more targets, with their card and their training ranges.

    Attributes
    ----------
    card : dict of str to object
        Data, settings and scores.
    learnt : mapping of str to Learnt
        Models by the short names of their targets.
    low, high : ndarray, shape (d,)
        Training ranges of the features.
    distance : Distance
        Distances from the training.
    features : FeatureSet
        The feature set that the models were trained on.
    modulus : float
        E* of the training [MPa].
    boundary : str
        Boundary of the training's patches: that of every prediction too.
    hardness_limits : tuple of float or None
        Smallest and largest hardness over E* of the training; None if no bodies yield.
    """

    card: dict[str, Any]
    learnt: Mapping[str, Learnt]
    low: Values
    high: Values
    distance: Distance
    features: FeatureSet = field(init=False)
    modulus: float = field(init=False)
    boundary: Boundary = field(init=False)
    hardness_limits: tuple[float, float] | None = field(init=False)

    def __post_init__(self) -> None:
        """Read of the card what predictions need."""
        card, limits = self.card, self.card.get("hardness_ratio")
        columns = tuple(name for name, _ in card["columns"])
        of_scene = card["features"] == SCENE
        features = replace(
            SETS[card["features"]],
            columns=columns,
            blocks=int(card.get("blocks", 0)),
            load=plain(columns[-1]) if of_scene else str(card.get("load") or "delta"),
            elastic=bool(card.get("elastic")),
        )
        vars(self).update(
            features=features,
            modulus=float(card["modulus"]),
            boundary=card.get("boundary", "free"),
            hardness_limits=None if limits is None else tuple(map(float, limits)),
        )

    @classmethod
    def load(cls, path: Path | str) -> Self:
        """Read a surrogate's file; no code that it names is imported or runs.

        Parameters
        ----------
        path : Path or str
            File that `learn fit` or `save` wrote.

        Returns
        -------
        Surrogate
            The surrogate in the file.

        Raises
        ------
        InputError
            If the file is no surrogate, is damaged or of another format, or does not fit the
            libraries installed here.
        """
        return cls(*load_parts(Path(path)))

    def save(self, path: Path | str) -> None:
        """Write the file that `load` reads, whole or not at all.

        Parameters
        ----------
        path : Path or str
            File to write.

        Raises
        ------
        InputError
            If it cannot be written.
        ValueError
            If a model has settings that `learn fit` never gives.
        """
        write_parts(Path(path), self)

    def predict(
        self,
        surface: ArrayLike | None = None,
        side: float | tuple[float, float] | None = None,
        delta: ArrayLike | None = None,
        *,
        e_star: float | None = None,
        hardness: ArrayLike | None = None,
        level: float | None = 0.9,
        mean: bool = False,
        **given: ArrayLike,
    ) -> Prediction:
        """Predict contacts of one surface, or of a scene's surfaces by their parameters.

        A surrogate of a scene's own features takes its parameters and its load by their names, as
        `predict(hurst=0.7, rms_height=1.2, pressure=[10.0, 20.0])`, arrays of one length or
        numbers, and no surface.

        Parameters
        ----------
        surface : ArrayLike
            Heights, shape (nx, ny) [um].
        side : float or tuple of float
            Scan length; one number, or one for each axis [um].
        delta : ArrayLike
            One or more far-field displacements [um].
        e_star : float, optional
            E* of forces and pressures; that of the training by default [MPa].
        hardness : ArrayLike, optional
            Hardness of the softer body, for a surrogate of bodies that yield; by default that of
            the training, if it has only one [MPa].
        level : float or None
            Coverage of the intervals; None for no intervals. It is taken as it is: above
            `largest_level` the ends of intervals are infinite, or the bounds of the target. Give
            `min(0.9, surrogate.largest_level)` for what `learn predict` takes by default.
        mean : bool
            True for intervals of the mean over all surfaces of the parameters, not of a new one.
        **given : ArrayLike
            Parameters and load of a surrogate of a scene's own features, in the scene's units; or
            `pressure`, of one of surfaces that was fitted with --load pressure [MPa].

        Returns
        -------
        Prediction
            Predictions of all targets, one row for each displacement, or set of numbers.

        Raises
        ------
        InputError
            If heights, lengths, displacements, `e_star` or `hardness` are impossible, or the
            training asks for a hardness, a parameter or a load that is not given.
        """
        load = self.features.load
        if self.features.of_scene:
            if surface is not None or side is not None or e_star is not None:
                asks = ", ".join(self.features.names)
                raise InputError(
                    f"the surrogate asks for {asks}, not for a surface or E*"
                )
            named = {"delta": delta, "hardness": hardness} | given
            rows = self.of_numbers({k: v for k, v in named.items() if v is not None})
            return self.predict_rows(rows, level=level, mean=mean)
        loads = given.pop("pressure", None) if load == "pressure" else delta
        if surface is None or side is None or loads is None or given or mean:
            raise InputError(
                f"the surrogate asks for a surface, its side and {load}: parameters of a scene and"
                " means over its surfaces need one fitted with --features scene"
            )
        on_surface = self.for_surface(surface, side)
        with input_errors():
            one = (
                None if hardness is None else real_number("hardness", hardness, HARDNESS)
            )
        return on_surface.predict(loads, e_star=e_star, hardness=one, level=level)

    @property
    def largest_level(self) -> float:
        """Largest level of intervals that holds for all targets, rounded down to three digits.

        It is K / (K + 1) for intervals that are calibrated by K surfaces, maps or databases.
        """
        return min(learnt.calibration.largest_level for learnt in self.learnt.values())

    def bodies(self, e_star: float | None, hardness: float | None) -> Bodies:
        """Return the bodies of a prediction, which are those of the training unless given.

        Parameters
        ----------
        e_star, hardness : float or None
            E* and hardness [MPa]. Without a hardness bodies are elastic if the training has some,
            otherwise they have the only hardness of the training.

        Returns
        -------
        Bodies
            E* and hardness.

        Raises
        ------
        InputError
            If the training has no hardness, or several and none is given.
        """
        limits, modulus = self.hardness_limits, self.modulus
        with input_errors():
            if e_star is not None:
                modulus = real_number("e_star", e_star, MODULUS)
            if hardness is not None:
                hardness = real_number("hardness", hardness, HARDNESS)
        if hardness is not None and limits is None:
            raise InputError(
                f"--hardness {hardness:g}: the surrogate was trained on elastic bodies: leave that"
                " out, or fit one to a database whose scene has a hardness"
            )
        if hardness is None and limits is not None and not self.features.elastic:
            if limits[0] < limits[1]:
                raise InputError(
                    "give --hardness: the surrogate was trained on bodies that yield at"
                    f" {between(limits)} E*"
                )
            hardness = limits[0] * modulus
        return Bodies(modulus, hardness, has_modulus=e_star is not None)

    def of_numbers(self, given: Mapping[str, ArrayLike]) -> Rows:
        """Turn parameters and loads into rows for `predict_rows`.

        Parameters
        ----------
        given : mapping of str to ArrayLike
            Numbers or arrays of one length, (n,), by the names of `features.names`.

        Returns
        -------
        Rows
            n rows to predict.

        Raises
        ------
        InputError
            If a name is missing or unknown, lengths differ, or a number is not finite, or not above
            0 where its logarithm is learnt.
        """
        if not self.features.of_scene:
            raise InputError(
                "the surrogate asks for surfaces: numbers need --features scene"
            )
        numbers = checked_numbers(self.features.columns, given)
        ones = np.ones(next(iter(numbers.values())).size)
        delta = numbers.get("delta", np.nan * ones)
        return Rows(np.empty((ones.size, 0)), delta, 1.0, scene_numbers=numbers)

    def for_surface(
        self,
        surface: ArrayLike,
        side: float | tuple[float, float],
        name: str = "the surface",
    ) -> OnSurface:
        """Apply the surrogate to a surface; its statistics are computed once.

        Parameters
        ----------
        surface, side : ArrayLike
            See `predict`, which also tells what is raised; the boundary is that of the training.
        name : str
            Name of the surface in messages.

        Returns
        -------
        OnSurface
            The surrogate with the features of this surface.
        """
        if self.features.of_scene:
            asks = ", ".join(self.features.names)
            raise InputError(f"{name}: the surrogate asks for {asks}, not for a surface")
        with input_errors(name):
            heights = real_array("heights", surface)
            lengths: Any = (
                [side, side] if isinstance(side, str) or np.ndim(side) == 0 else side
            )
            if len(lengths) != 2:
                raise InputError(f"side {side!r}: give one length or one for each axis")
            sides = checked("side", lengths[0]), checked("side", lengths[1])
        if heights.ndim != 2 or min(heights.shape) < 2 or not np.isfinite(heights).all():
            raise InputError(f"{name}: give 2-D heights, 2 x 2 or more, all finite")
        dx, dy = map(node_spacing, heights.shape, sides, [self.boundary] * 2)
        return OnSurface(
            self, SurfaceFeatures(heights, sides, (dx, dy), name, self.boundary)
        )

    def of_statistics(
        self,
        statistics: Values,
        delta: Values,
        length: Values | float,
        hardness_ratio: float | None = None,
        nodes: Values | None = None,
    ) -> Rows:
        """Turn rows of statistics into rows for `predict_rows`.

        Parameters
        ----------
        statistics, delta : ndarray, shape (n, 22) and (n,)
            Statistics in the order and units of Table 1, and far-field displacement [um].
        length : ndarray, shape (n,), or float
            Scan length L, the geometric mean of both sides [um].
        hardness_ratio : float, optional
            Hardness over E*; None for elastic bodies.
        nodes : ndarray, shape (n,), optional
            Nodes along a side, the geometric mean of both axes, if the features need them.

        Returns
        -------
        Rows
            n rows to predict.

        Raises
        ------
        InputError
            If a statistic is NaN, or an array is masked in places.
        """
        with input_errors():
            statistics = real_array("statistics", statistics)
            delta = real_array("Delta", delta)
            length = real_array("lengths", length)
        if np.isnan(statistics).any():
            raise InputError("statistics must be finite: some are NaN")
        return Rows(statistics, delta, length, hardness_ratio, nodes)

    def predict_rows(
        self,
        rows: Rows,
        *,
        e_star: float | None = None,
        level: float | None = 0.9,
        mean: bool = False,
    ) -> Prediction:
        """Predict rows.

        Parameters
        ----------
        rows : Rows
            Rows from `of_statistics` or `OnSurface.rows`.
        e_star, level : float, optional
            See `predict`.
        mean : bool
            True for intervals of the mean over surfaces, of a surrogate of a scene's own features.

        Returns
        -------
        Prediction
            Predictions of all targets, one for each row.

        Raises
        ------
        InputError
            If E* or a Delta is not above 0, features are beyond numbers, or they need the heights
            of the surface, or its nodes, which the rows lack.
        """
        with input_errors():
            if e_star is not None:
                e_star = real_number("e_star", e_star, MODULUS)
            if level is not None:
                level = real_number("level", level, LEVEL)
        features, number = self.features, len(rows.delta)
        inputs = features.of(rows)
        known = ~np.isnan(inputs).any(axis=1)
        if not features.of_scene:  # whose numbers `of_numbers` has checked
            defined = ~np.isnan(rows.statistics).any(axis=1)
            wrong = defined & ~(np.abs(inputs) <= LARGEST).all(axis=1)
            bad = np.flatnonzero(wrong | ~(rows.delta > 0))
            if bad.size:
                raise InputError(
                    f"row {bad[0] + 1} of {number}: statistics and Delta must be finite, densities,"
                    f" curvatures and Delta above 0, and no feature beyond {LARGEST:.0e}"
                )
        said = reasons_of(self, rows, inputs)
        for place, note in enumerate(scale_notes(self, rows, e_star)):
            said[place] = "; ".join(filter(None, (said[place], note)))
        delta = (
            rows.delta.copy()
            if "pressure" not in rows.scene_numbers
            else np.nan * rows.delta
        )
        found = Prediction(delta, {}, given=dict(rows.scene_numbers))
        for name, learnt in self.learnt.items():
            scale = features.scale(learnt.powers, rows, self.modulus)
            if e_star is not None and learnt.powers is not None and learnt.powers.modulus:
                scale = scale * (e_star / self.modulus) ** learnt.powers.modulus
            raw = learnt.raw(inputs)
            with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
                raw[~np.isfinite(raw * scale)] = np.nan
                answer = np.clip(raw * scale, *learnt.bounds)
                # About what is answered, so that bounds leave no interval without width.
                centre = np.where(answer == raw * scale, raw, answer / scale)
            for row in np.flatnonzero(np.isnan(raw) & known):
                fault = f"the surrogate has no finite {name}"
                said[row] = f"{fault}; {said[row]}" if said[row] else fault
            found.values[name] = answer
            if level is not None:
                ends = learnt.mean_ends if mean else learnt.calibration.ends
                low, high = ends(centre, level, inputs)
                found.low[name] = np.clip(low * scale, *learnt.bounds)
                found.high[name] = np.clip(high * scale, *learnt.bounds)
        return replace(found, reasons=tuple(said))


@dataclass(frozen=True, eq=False)
class OnSurface:
    """A surrogate applied to one surface, whose statistics are computed once.

    Attributes
    ----------
    surrogate : Surrogate
        The surrogate.
    surface : SurfaceFeatures
        The surface.
    """

    surrogate: Surrogate
    surface: SurfaceFeatures

    def rows(
        self,
        delta: ArrayLike,
        bodies: Bodies | None = None,
        hardness: Values | None = None,
    ) -> Rows:
        """Compute what features need at one or more loads.

        Parameters
        ----------
        delta : ArrayLike
            One displacement above 0, or n of them [um]; pressures [MPa] if these were learnt.
        bodies : Bodies, optional
            Bodies from `Surrogate.bodies`; those of the training if left out.
        hardness : ndarray, shape (n,), optional
            Hardness at each load instead of the bodies' [MPa].

        Returns
        -------
        Rows
            The surface's statistics, and the columns of the coarse solve, at n loads.

        Raises
        ------
        InputError
            If a load is not above 0, or a statistic that the features need is undefined.
        """
        features = self.surrogate.features
        if bodies is None:
            one = None if hardness is None else float(hardness[0])
            bodies = self.surrogate.bodies(None, one)
        ratio = bodies.hardness_ratio if hardness is None else hardness / bodies.e_star
        with input_errors(self.surface.name):
            loads = real_array(features.load, delta).reshape(-1)
        return self.surface.rows(features, loads, ratio, bodies.e_star)

    def predict(
        self,
        delta: ArrayLike,
        *,
        e_star: float | None = None,
        hardness: float | None = None,
        level: float | None = 0.9,
    ) -> Prediction:
        """Predict contacts at one or more loads above 0.

        Parameters
        ----------
        delta : ArrayLike
            One displacement, or n of them; see `rows`.
        e_star, hardness, level : float, optional
            See `Surrogate.predict`, which also tells what is raised.

        Returns
        -------
        Prediction
            Predictions of all targets, one row for each load.
        """
        rows = self.rows(delta, self.surrogate.bodies(e_star, hardness))
        return self.surrogate.predict_rows(rows, e_star=e_star, level=level)
