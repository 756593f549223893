"""A surrogate, and its predictions for a surface."""

from __future__ import annotations  # so that help() shows the short names of types

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

import bem
from bem.checks import LARGEST, Range, real_array, real_number
from bem.problem import Boundary, checked, node_spacing
from gen.arrays import Values
from gen.material import Bodies, LayeredBody
from gen.quantities import Powers
from gen.runtime.errors import InputError, input_errors
from learn.features import FeatureSet, SurfaceFeatures
from learn.features.layers import Layers
from learn.features.rows import Rows
from learn.features.scene import checked_numbers
from learn.surrogate.interval import Distance
from learn.surrogate.learnt import Contents, Learnt, read_contents, write_contents
from learn.surrogate.scale import keeps_its_scale, scale_notes
from learn.surrogate.training import Training, hardness_range_text

# Ranges of the user's numbers, with the words of their refusals.
MODULUS = Range(0, np.inf, "a modulus above 0 MPa")
HARDNESS = Range(0, np.inf, "a hardness above 0 MPa")
LEVEL = Range(0, 1, "a coverage between 0 and 1, as 0.9")


@dataclass(frozen=True, eq=False)
class Prediction:
    """Predictions for n rows.

    Attributes
    ----------
    delta : ndarray, shape (n,)
        Far-field displacement [um]; NaN if the load is another quantity, which is then in `given`.
    values : dict of str to ndarray, shape (n,)
        Predictions by target: "area" [%], "force" [uN], "mean_gap" [um] ...; NaN where the
        surrogate has no finite prediction.
    low, high : dict of str to ndarray, shape (n,)
        Lower and upper ends of the intervals by target, in the units of `values`; empty if the
        question had no level. They hold for rows inside the training only; the tables of
        `learn predict` have no ends for other rows.
    reasons : tuple of str
        For each row, what is outside the training, or which targets have no finite prediction; ""
        if the row is inside.
    given : dict of str to ndarray, shape (n,)
        For a surrogate of surfaces by pressure: the "pressure" of each row [MPa]. For a surrogate
        of a scene's own features: the parameters and the load by their names, in the scene's units.
        For other surrogates the dictionary is empty.
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
        """True for rows that have no reason, shape (n,): they are inside the training."""
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
        Smallest and largest value of each feature in the training.
    distance : Distance
        Measure of distances from the training, with the limit of the flag.
    training : Training
        The facts about the training that predictions need: features, E*, hardness, boundary, grids.
        It is made from the other attributes.
    """

    card: dict[str, Any]
    learnt: Mapping[str, Learnt]
    low: Values
    high: Values
    distance: Distance
    training: Training = field(init=False)

    def __post_init__(self) -> None:
        """Make the training from the card, the ranges and the distances."""
        training = Training.of(self.card, self.low, self.high, self.distance)
        # The class is frozen, so that an ordinary assignment would be refused.
        object.__setattr__(self, "training", training)

    @property
    def features(self) -> FeatureSet:
        """The feature set that the models were trained on."""
        return self.training.features

    @property
    def modulus(self) -> float:
        """E* of the training [MPa]."""
        return self.training.modulus

    @property
    def boundary(self) -> Boundary:
        """Boundary of the training's patches, and of the patches of every prediction."""
        return self.training.boundary

    @property
    def hardness_limits(self) -> tuple[float, float] | None:
        """Smallest and largest hardness over E* of the training; None if all bodies are elastic."""
        return self.training.hardness_limits

    @classmethod
    def load(cls, path: Path | str) -> Self:
        """Read the file of a surrogate.

        Code that a file names is not imported or run, unless it is of the types that models of
        `learn fit` are made of.

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
            If the file is no surrogate, is damaged, has another format, or cannot be used with the
            libraries installed here.
        """
        contents = read_contents(Path(path))
        return cls(
            card=contents.card,
            learnt=contents.learnt,
            low=contents.low,
            high=contents.high,
            distance=contents.distance,
        )

    def save(self, path: Path | str) -> None:
        """Write a file that `load` reads.

        An error leaves no partly written file.

        Parameters
        ----------
        path : Path or str
            The file to write.

        Raises
        ------
        InputError
            If the file cannot be written.
        ValueError
            If a model contains a type that models of `learn fit` never contain.
        """
        contents = Contents(
            card=self.card,
            learnt=self.learnt,
            low=self.low,
            high=self.high,
            distance=self.distance,
        )
        write_contents(Path(path), contents)

    def predict(
        self,
        surface: ArrayLike | None = None,
        side: float | tuple[float, float] | None = None,
        delta: ArrayLike | None = None,
        *,
        e_star: float | None = None,
        hardness: ArrayLike | None = None,
        body: bem.Layered | None = None,
        level: float | None = 0.9,
        mean: bool = False,
        **numbers: ArrayLike,
    ) -> Prediction:
        """Predict contacts of one surface, or of a scene's surfaces by their parameters.

        A surrogate of surfaces needs `surface`, `side` and a load. A surrogate of a scene's own
        features takes no surface, side or E*, but the scene's parameters and its load by their
        names, as `predict(hurst=0.7, rms_height=1.2, pressure=[10.0, 20.0])`. Each of these is a
        number, or an array; all arrays have the same length.

        Parameters
        ----------
        surface : ArrayLike, optional
            Heights, shape (nx, ny) [um].
        side : float or tuple of float, optional
            Scan length; one number, or one for each axis [um].
        delta : ArrayLike, optional
            One or more far-field displacements [um]. A surrogate that was fitted with --load
            pressure does not use them.
        e_star : float, optional
            E* of forces and pressures; that of the training by default [MPa].
        hardness : ArrayLike, optional
            Hardness of the softer body [MPa], for a surrogate of bodies that yield: one number, or
            an array for a surrogate of a scene's own features. Left out for a surface: elastic
            bodies if the training includes some; otherwise the hardness over E* of the training,
            which must then have only one.
        body : bem.Layered, optional
            Body with a layer, for a surrogate of surfaces on layers, in place of `e_star`. Left
            out: the body of the training, which must then have only one.
        level : float or None
            Coverage of the intervals, between 0 and 1; None for no intervals. A level above
            `largest_level` is not lowered: the ends of its intervals are infinite, or the bounds of
            the target. Give `min(0.9, surrogate.largest_level)` for the level that `learn predict`
            takes by default.
        mean : bool
            True for intervals of the mean over all surfaces with these parameters. False for
            intervals of a single new surface.
        **numbers : ArrayLike
            Parameters and load of a surrogate of a scene's own features, in the scene's units; or
            `pressure` for a surrogate of surfaces that was fitted with --load pressure [MPa].

        Returns
        -------
        Prediction
            Predictions of all targets, one row for each load or set of numbers.

        Raises
        ------
        InputError
            If heights, lengths, loads, `e_star`, `hardness`, `level` or parameters are impossible;
            if a surface, hardness, layer, parameter or load is missing, unknown, or for another
            kind of surrogate only; if a statistic of the surface is undefined, a feature is too
            large, or a coarse solve fails; or if the model has no intervals of the mean.
        """
        if self.features.of_scene:
            # The scene fixes E*, and its parameters replace the surface.
            refused_arguments = (surface, side, e_star, body)
            if any(argument is not None for argument in refused_arguments):
                names = ", ".join(self.features.names)
                raise InputError(
                    f"the surrogate asks for {names}, not for a surface or E*"
                )
            # `delta` and `hardness` may be numbers of the scene, too; None if they are left out.
            by_name = {"delta": delta, "hardness": hardness, **numbers}
            scene_numbers = {
                name: value for name, value in by_name.items() if value is not None
            }
            rows = self.of_numbers(scene_numbers)
            return self.predict_rows(rows, level=level, mean=mean)
        load = self.features.load
        loads = delta
        if load == "pressure":
            loads = numbers.pop("pressure", None)
        # The `numbers` that remain are parameters of a scene, which this surrogate has not learnt.
        if surface is None or side is None or loads is None or numbers or mean:
            raise InputError(
                f"the surrogate asks for a surface, its side and {load}: parameters of a scene and"
                " means over its surfaces need one fitted with --features scene"
            )
        on_surface = self.for_surface(surface, side)
        checked_hardness: float | None = None
        if hardness is not None:
            with input_errors():
                checked_hardness = real_number("hardness", hardness, HARDNESS)
        return on_surface.predict(
            loads, e_star=e_star, hardness=checked_hardness, body=body, level=level
        )

    @property
    def largest_level(self) -> float:
        """Largest level that the intervals of all targets reach, rounded down to three digits.

        Intervals that K surfaces, maps or databases calibrate reach a level of K / (K + 1).
        """
        return min(learnt.calibration.largest_level for learnt in self.learnt.values())

    def bodies(
        self,
        e_star: float | None,
        hardness: float | None,
        body: bem.Layered | None = None,
    ) -> Bodies:
        """Check the material of a prediction, and complete it by that of the training.

        Parameters
        ----------
        e_star : float or None
            E* [MPa]; None for that of the training.
        hardness : float or None
            Hardness of the softer body [MPa]. None: elastic bodies if the training includes some;
            otherwise the hardness over E* of the training, which must then have only one.
        body : bem.Layered or None
            Body with a layer. None: half-spaces, or the body of a training with one layer.

        Returns
        -------
        Bodies
            E* and hardness; no hardness for elastic bodies. E* is that of the layer, if there is
            one. `has_modulus` is True if `e_star` or a layer is given.

        Raises
        ------
        InputError
            If a number is not above 0; if a hardness is given, but all bodies of the training are
            elastic; or if none is given, but the training has several and no elastic bodies. Also
            if a layer is given for a training on half-spaces or is of another kind, if it is
            missing for a training with several layers, or if `e_star` is given for a training on
            layers.
        """
        layer = self._checked_layer(body, e_star)
        modulus = self.modulus
        if layer is not None:
            modulus = layer.e_star
        with input_errors():
            if e_star is not None:
                modulus = real_number("e_star", e_star, MODULUS)
            if hardness is not None:
                hardness = real_number("hardness", hardness, HARDNESS)
        layered: LayeredBody | None = None
        if layer is not None:
            layered = LayeredBody.of(layer)
        return Bodies(
            e_star=modulus,
            hardness=self._completed_hardness(hardness, modulus),
            has_modulus=e_star is not None or body is not None,
            layered=layered,
        )

    def _completed_hardness(self, hardness: float | None, modulus: float) -> float | None:
        """Return the hardness of a prediction [MPa]; None for elastic bodies.

        If `hardness` is None, the bodies are elastic if the training includes elastic ones.
        Otherwise their hardness over E* is that of the training; `modulus` is the E* of the
        prediction [MPa]. Raises InputError if a hardness is given, but all bodies of the training
        are elastic, or if none is given, but the training has several and no elastic bodies.
        """
        limits = self.hardness_limits  # over E*
        if hardness is not None:
            if limits is None:
                raise InputError(
                    f"--hardness {hardness:g}: the surrogate was trained on elastic bodies: leave"
                    " that out, or fit one to a database whose scene has a hardness"
                )
            return hardness
        if limits is None or self.features.elastic:
            return None
        # All bodies of the training yield. The default is their hardness, unless it varies.
        smallest, largest = limits
        if smallest < largest:
            raise InputError(
                "give --hardness: the surrogate was trained on bodies that yield at"
                f" {hardness_range_text(limits)} E*"
            )
        return smallest * modulus

    def _checked_layer(
        self, body: bem.Layered | None, e_star: float | None
    ) -> bem.Layered | None:
        """Return the body with the layer of a prediction; None for half-spaces.

        If `body` is None, it is that of the training, which must then have only one. Raises
        InputError if the body is not of the training's kind, or `e_star` is given beside layers.
        """
        layers = self.training.layers
        if layers is None:
            if body is not None:
                raise InputError(
                    "the surrogate was trained on half-spaces: leave out the layer, or fit one to"
                    " a database whose scene has [contact.layer]"
                )
            return None
        if body is None:
            if layers.only is None or e_star is not None:
                raise InputError(
                    "give --layer-thickness and --layer-young (in Python: body): the surrogate was"
                    f" trained on layers of {layers.text}"
                )
            return layers.only
        if e_star is not None:
            raise InputError("E* is that of the layer: leave out --e-star")
        layers.require_kind(body)
        if not self.features.scaled:
            layers.require_only(body)
        return body

    def of_numbers(self, numbers: Mapping[str, ArrayLike]) -> Rows:
        """Turn parameters and loads of a scene into rows for `predict_rows`.

        Parameters
        ----------
        numbers : mapping of str to ArrayLike
            Parameters and load by the names of `features.names`, in the scene's units. Each is a
            number or an array; all arrays have the same length n.

        Returns
        -------
        Rows
            n rows to predict.

        Raises
        ------
        InputError
            If the surrogate has features of surfaces, a name is missing or unknown, lengths differ,
            an array has more than one dimension, or a number is masked or not finite, or not above
            0 where its logarithm is a feature.
        """
        if not self.features.of_scene:
            raise InputError(
                "the surrogate asks for surfaces: numbers need --features scene"
            )
        columns = checked_numbers(self.features.columns, numbers)
        size = next(iter(columns.values())).size
        # Delta is unknown if the scene's load is another quantity.
        delta = columns.get("delta", np.full(size, np.nan))
        # A scene's own features need no statistics and no length.
        return Rows(
            statistics=np.empty((size, 0)),
            delta=delta,
            length=1.0,
            scene_numbers=columns,
        )

    def for_surface(
        self,
        surface: ArrayLike,
        side: float | tuple[float, float],
        name: str = "the surface",
    ) -> OnSurface:
        """Apply the surrogate to a surface, for predictions at as many loads as needed.

        Parameters
        ----------
        surface : ArrayLike
            Heights, shape (nx, ny) [um]. The patch is taken to have the boundary of the training.
        side : float or tuple of float
            Scan length; one number, or one for each axis [um].
        name : str
            Name of the surface in messages.

        Returns
        -------
        OnSurface
            The surrogate with this surface, whose statistics are computed once.

        Raises
        ------
        InputError
            If heights or lengths are impossible, or the surrogate has a scene's own features, which
            need no surface.
        """
        if self.features.of_scene:
            names = ", ".join(self.features.names)
            raise InputError(f"{name}: the surrogate asks for {names}, not for a surface")
        with input_errors(name):
            heights = real_array("heights", surface)
            sides = _checked_sides(side)
        if heights.ndim != 2 or min(heights.shape) < 2 or not np.isfinite(heights).all():
            raise InputError(f"{name}: give 2-D heights, 2 x 2 or more, all finite")
        spacing = (
            node_spacing(heights.shape[0], sides[0], self.boundary),
            node_spacing(heights.shape[1], sides[1], self.boundary),
        )
        features = SurfaceFeatures(
            heights=heights,
            sides=sides,
            spacing=spacing,
            name=name,
            boundary=self.boundary,
        )
        return OnSurface(surrogate=self, surface=features)

    def of_statistics(
        self,
        statistics: Values,
        delta: Values,
        length: Values | float,
        hardness_ratio: float | None = None,
        nodes: Values | None = None,
        body: bem.Layered | None = None,
    ) -> Rows:
        """Turn rows of statistics into rows for `predict_rows`.

        Parameters
        ----------
        statistics : ndarray, shape (n, 22)
            Statistics in the order and units of the paper's Table 1.
        delta : ndarray, shape (n,)
            Far-field displacements [um].
        length : ndarray, shape (n,), or float
            Scan length L, the geometric mean of both sides [um].
        hardness_ratio : float, optional
            Hardness over E*; None for elastic bodies.
        nodes : ndarray, shape (n,), optional
            Number of nodes along a side, the geometric mean of both axes. Needed only if it is
            among the features, or the training has layers.
        body : bem.Layered, optional
            Body with a layer, one for all rows, for a surrogate that was trained on layers.

        Returns
        -------
        Rows
            n rows to predict.

        Raises
        ------
        InputError
            If a statistic is NaN, an array has masked elements or entries that are no real
            numbers, or a layer is missing, or not of the training's kind.
        """
        with input_errors():
            statistics = real_array("statistics", statistics)
            delta = real_array("Delta", delta)
            length = real_array("lengths", length)
        if np.isnan(statistics).any():
            raise InputError("statistics must be finite: some are NaN")
        layer = self._checked_layer(body, e_star=None)
        return Rows(
            statistics=statistics,
            delta=delta,
            length=length,
            hardness_ratio=hardness_ratio,
            nodes=nodes,
            layers=None if layer is None else Layers.of_bodies([layer]),
        )

    def predict_rows(
        self,
        rows: Rows,
        *,
        e_star: float | None = None,
        level: float | None = 0.9,
        mean: bool = False,
    ) -> Prediction:
        """Predict all targets of rows, with intervals and reasons.

        Parameters
        ----------
        rows : Rows
            n rows from `of_statistics`, `of_numbers` or `OnSurface.rows`.
        e_star : float, optional
            E* of forces and pressures; that of the training by default [MPa]. Rows of layers have
            their own E*, which replaces it.
        level : float or None
            Coverage of the intervals, between 0 and 1; None for no intervals. See `predict`.
        mean : bool
            True for intervals of the mean over all surfaces with the parameters of a row. Only a
            surrogate made with --model population has them.

        Returns
        -------
        Prediction
            Predictions of all targets, one for each row.

        Raises
        ------
        InputError
            If E*, the level or a Delta is out of range; if a feature is too large, or undefined in
            a row whose statistics are all defined; if the rows lack the columns of a coarse solve,
            the nodes or a parameter that the features need; or if the model has no intervals of the
            mean.
        """
        with input_errors():
            if e_star is not None:
                e_star = real_number("e_star", e_star, MODULUS)
            if level is not None:
                level = real_number("level", level, LEVEL)
        inputs = self.features.of(rows)
        if not self.features.of_scene:  # `of_numbers` has checked the numbers of a scene
            _require_numbers(rows, inputs)
        values: dict[str, Values] = {}
        lows: dict[str, Values] = {}
        highs: dict[str, Values] = {}
        for name, learnt in self.learnt.items():
            answer = self._answer(learnt, rows, inputs, e_star)
            values[name] = answer.values
            if level is None:
                continue
            if mean:
                lows[name], highs[name] = answer.mean_interval(level, inputs)
            else:
                lows[name], highs[name] = answer.interval(level, inputs)
        delta = rows.delta.copy()
        if "pressure" in rows.scene_numbers:
            # Delta is not the load. For features of a surface, `rows.delta` is p L / E* or the
            # Delta of the coarse solve.
            delta = np.full(delta.shape, np.nan)
        return Prediction(
            delta=delta,
            values=values,
            low=lows,
            high=highs,
            reasons=self._reasons(rows, inputs, values, e_star),
            given=dict(rows.scene_numbers),
        )

    def _answer(
        self, learnt: Learnt, rows: Rows, inputs: Values, e_star: float | None
    ) -> _Answer:
        """Predict one target of n rows, of which `inputs` are the features, (n, d).

        `e_star` is that of the prediction [MPa]; None for that of the training. Values that are not
        finite become NaN.
        """
        scale = self._scale(learnt.powers, rows, e_star)
        raw = learnt.raw(inputs)
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            restored = raw * scale
            is_finite = np.isfinite(restored)
            raw[~is_finite] = np.nan
            restored[~is_finite] = np.nan
            values = np.clip(restored, *learnt.bounds)
            # The middle of an interval is the value within the bounds. About a value outside of
            # them, both ends of the interval could be clipped to one bound. Where the bounds change
            # nothing, the middle is `raw` itself, without the rounding of a division.
            is_unchanged = values == restored
            centre = np.where(is_unchanged, raw, values / scale)
        return _Answer(learnt=learnt, values=values, centre=centre, scale=scale)

    def _scale(self, powers: Powers | None, rows: Rows, e_star: float | None) -> Values:
        """Return the numbers that turn predictions over the scale into targets, (n,).

        They are in the unit of the target. `powers` are the powers that the target scales with;
        None if they are unknown. `e_star` is the E* of the prediction [MPa]; None for the E* of the
        training.
        """
        scale = self.features.scale(powers, rows, self.modulus)
        if rows.layers is not None:
            return scale
        if e_star is None or powers is None or not powers.modulus:
            return scale
        # `scale` is for the E* of the training. For features with units it is 1 at this E*.
        return scale * (e_star / self.modulus) ** powers.modulus

    def _reasons(
        self,
        rows: Rows,
        inputs: Values,
        values: Mapping[str, Values],
        e_star: float | None,
    ) -> tuple[str, ...]:
        """Return the reason of each of n rows: its notes, joined by "; ", or "" without notes.

        The notes are on targets without a finite prediction, then on the differences from the
        training, then on the scale of targets without known powers. `inputs` are the features,
        (n, d), and `values` the predictions by target, (n,) each.
        """
        targets_of_one_scale = [
            name
            for name, learnt in self.learnt.items()
            if not keeps_its_scale(learnt.powers, self.features)
        ]
        notes_on_training = self.training.reasons(rows, inputs)
        notes_on_scale = scale_notes(self.training, targets_of_one_scale, rows, e_star)
        # The notes on several targets are in reverse order of the targets.
        notes_on_targets: list[list[str]] = [[] for _ in notes_on_training]
        # A row with an undefined feature has a note on that already.
        is_defined = ~np.isnan(inputs).any(axis=1)
        for name, predicted in values.items():
            for row in np.flatnonzero(np.isnan(predicted) & is_defined):
                notes_on_targets[row].insert(0, f"the surrogate has no finite {name}")
        notes_of_rows = zip(
            notes_on_targets, notes_on_training, notes_on_scale, strict=True
        )
        return tuple(
            "; ".join(filter(None, [*on_targets, on_training, on_scale]))
            for on_targets, on_training, on_scale in notes_of_rows
        )


@dataclass(frozen=True, eq=False)
class _Answer:
    """Predictions of one target for n rows."""

    learnt: Learnt  # model of the target
    values: Values  # (n,), predictions in the unit of the target, within its bounds
    centre: Values  # (n,), middle of the intervals, over the scale of the target
    scale: Values  # (n,), scale of the target, in its unit

    def interval(self, level: float, inputs: Values) -> tuple[Values, Values]:
        """Return lower and upper ends of intervals for a new surface, each (n,).

        They are in the unit of the target. `level` is the coverage, `inputs` the features, (n, d).
        """
        low, high = self.learnt.calibration.ends(self.centre, level, inputs)
        return self._restored(low), self._restored(high)

    def mean_interval(self, level: float, inputs: Values) -> tuple[Values, Values]:
        """Return lower and upper ends of intervals for the mean over surfaces, each (n,).

        They are in the unit of the target. `level` is the coverage, `inputs` the features, (n, d).
        Raises InputError if the model is not the mean of a population.
        """
        low, high = self.learnt.mean_ends(self.centre, level, inputs)
        return self._restored(low), self._restored(high)

    def _restored(self, end: Values) -> Values:
        """Return ends over the scale, (n,), in the unit of the target and within its bounds."""
        return np.asarray(np.clip(end * self.scale, *self.learnt.bounds))


def under_a_rigid_body(layered: LayeredBody) -> bem.Layered:
    """Return a layered body for a prediction, and refuse a second elastic body.

    Parameters
    ----------
    layered : LayeredBody
        The layered body, and what is pressed on it.

    Returns
    -------
    bem.Layered
        The layered body.

    Raises
    ------
    InputError
        If the other body is elastic, too: scenes have a rigid one.
    """
    if layered.other is not None:
        raise InputError(
            "--young was given twice: the surrogate was trained on a rigid body that is pressed on"
            " a layer; give that of what is below the layer"
        )
    return layered.alone


def _checked_sides(side: float | tuple[float, float]) -> tuple[float, float]:
    """Return the lengths of a patch along x and y [um]; a single number is the length of both.

    Raises ValueError for an impossible length, and InputError for a sequence that has not two
    lengths.
    """
    # A text goes to `checked`, which refuses it; "ab" would pass as a sequence of two lengths.
    if isinstance(side, str) or np.ndim(side) == 0:
        length = checked("side", side)
        return length, length
    lengths: Any = side
    if len(lengths) != 2:
        raise InputError(f"side {side!r}: give one length or one for each axis")
    return checked("side", lengths[0]), checked("side", lengths[1])


def _require_numbers(rows: Rows, inputs: Values) -> None:
    """Raise InputError if a Delta is not above 0, or a feature is undefined or beyond `LARGEST`.

    `inputs` are the features of n rows, (n, d); `LARGEST` limits their magnitudes. Features are not
    checked in rows with a NaN among the statistics: predictions of these rows are NaN.
    """
    is_defined = ~np.isnan(rows.statistics).any(axis=1)
    in_range = (np.abs(inputs) <= LARGEST).all(axis=1)  # False for NaN, too
    has_load = rows.delta > 0  # False for NaN, too
    has_faulty_features = is_defined & ~in_range
    faulty = np.flatnonzero(has_faulty_features | ~has_load)
    if faulty.size:
        raise InputError(
            f"row {faulty[0] + 1} of {len(rows.delta)}: statistics and Delta must be finite,"
            " densities, curvatures and Delta above 0, and no feature beyond"
            f" {LARGEST:.0e}"
        )


@dataclass(frozen=True, eq=False)
class OnSurface:
    """A surrogate applied to one surface.

    Attributes
    ----------
    surrogate : Surrogate
        The surrogate.
    surface : SurfaceFeatures
        The surface, whose statistics are computed once.
    """

    surrogate: Surrogate
    surface: SurfaceFeatures

    def rows(
        self,
        delta: ArrayLike,
        bodies: Bodies | None = None,
        hardness: Values | None = None,
        layered: Sequence[bem.Layered] = (),
    ) -> Rows:
        """Make the rows of the surface at one or more loads.

        Parameters
        ----------
        delta : ArrayLike
            One displacement above 0, or n of them [um]; pressures [MPa] for a surrogate by
            pressure.
        bodies : Bodies, optional
            Bodies from `Surrogate.bodies`; by default those of `Surrogate.bodies(None, None)`, or
            bodies with the E* of the training if `hardness` is given.
        hardness : ndarray, shape (n,), optional
            Hardness at each load, in place of the bodies' one [MPa].
        layered : sequence of bem.Layered
            Body with a layer at each load, in place of the bodies' one.

        Returns
        -------
        Rows
            The surface's statistics, and the columns of the coarse solve, at n loads.

        Raises
        ------
        InputError
            If a load is not finite and above 0, any of the 22 statistics is undefined, or a coarse
            solve fails. If `bodies` is left out, also in two cases: `hardness` is given, and all
            bodies of the training are elastic; or `hardness` is left out, and all bodies of the
            training yield, with several ratios of hardness to E*. For layers see
            `Surrogate.bodies`.
        """
        features = self.surrogate.features
        if bodies is None:
            bodies = self._default_bodies(hardness, layered)
        if bodies.layered is not None and not layered:
            layered = [bodies.layered.alone]
        e_star: Values | float = bodies.e_star
        if layered:
            e_star = np.array([body.e_star for body in layered])
        hardness_ratio: Values | float | None = None
        if hardness is not None:
            hardness_ratio = hardness / e_star
        elif bodies.hardness is not None:
            hardness_ratio = bodies.hardness / e_star
        with input_errors(self.surface.name):
            loads = real_array(features.load, delta).reshape(-1)
        return self.surface.rows(features, loads, hardness_ratio, bodies.e_star, layered)

    def _default_bodies(
        self, hardness: Values | None, layered: Sequence[bem.Layered]
    ) -> Bodies:
        """Return bodies with the E* of the training, or with the first of the layers.

        `hardness`, (n,) [MPa], and `layered` are those of `rows`. Raises InputError if the
        surrogate cannot predict bodies of the first hardness and with the first layer.
        """
        # `Surrogate.bodies` takes one hardness and one layer. The first ones serve for its checks;
        # `rows` computes the hardness over E* at each load.
        first_hardness: float | None = None
        if hardness is not None:
            first_hardness = float(hardness[0])
        first_layer = layered[0] if layered else None
        return self.surrogate.bodies(None, first_hardness, first_layer)

    def predict(
        self,
        delta: ArrayLike,
        *,
        e_star: float | None = None,
        hardness: float | None = None,
        body: bem.Layered | None = None,
        level: float | None = 0.9,
    ) -> Prediction:
        """Predict contacts at one or more loads.

        Parameters
        ----------
        delta : ArrayLike
            One displacement above 0, or n of them [um]; pressures [MPa] for a surrogate by
            pressure.
        e_star : float, optional
            E* of forces and pressures; that of the training by default [MPa].
        hardness : float, optional
            Hardness of the softer body [MPa]. Left out: elastic bodies if the training includes
            some; otherwise the hardness over E* of the training, which must then have only one.
        body : bem.Layered, optional
            Body with a layer, see `Surrogate.predict`.
        level : float or None
            Coverage of the intervals, between 0 and 1; None for no intervals. See
            `Surrogate.predict`.

        Returns
        -------
        Prediction
            Predictions of all targets, one row for each load.

        Raises
        ------
        InputError
            If a load, `e_star`, `hardness` or `level` is impossible; if the hardness is left out,
            but the training has several and no elastic bodies; if the layer is missing, or not of
            the training's kind; if any of the 22 statistics is undefined, a feature is too large,
            or a coarse solve fails.
        """
        rows = self.rows(delta, self.surrogate.bodies(e_star, hardness, body))
        return self.surrogate.predict_rows(rows, e_star=e_star, level=level)
