"""The features of a scene: the parameters that it draws for a row, and the load.

A surrogate of these features answers for all surfaces of a population. It is asked with parameters,
not with a surface. If the largest value of a number is at least `SPAN` times the smallest, the
feature is the logarithm: the column `log(pressure)` for the number `pressure`. Otherwise the
feature is the number, and the column is called `pressure`.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from bem.checks import real_array
from gen.arrays import Values
from gen.distribution import limits
from gen.generators import GENERATORS
from gen.quantities import LAYER_MODULUS, LAYER_THICKNESS
from gen.runtime.errors import InputError, input_errors
from gen.scene import Scene, parameter_columns
from learn.features.layers import Layers

# Name of the feature set.
SCENE = "scene"
# Smallest ratio of the largest to the smallest value of a number whose feature is its logarithm.
SPAN = 3.0

# Units of the loads by name. Every database has the first three. The two relative loads are Delta
# over the rms height, and pressure over E* times the rms slope. A database has a relative load only
# if its scene draws it.
LOADS: Mapping[str, str] = {
    "delta": "um",
    "pressure": "MPa",
    "force": "uN",
    "relative_delta": "1",
    "relative_pressure": "1",
}
# Names of the relative loads in `LOADS`, by their names in `Scene.quantity`.
RELATIVE: Mapping[str, str] = {
    "delta/height_rms": "relative_delta",
    "pressure/(E* slope_rms)": "relative_pressure",
}
# Loads under which Delta is a result.
BY_FORCE = frozenset({"pressure", "force", "relative_pressure"})
# Units of the two numbers for the hardness of a scene; the ratio is over E*.
HARDNESSES: Mapping[str, str] = {"hardness": "MPa", "hardness_ratio": "1"}
# Units of the numbers of a layer that scenes can draw.
LAYER_NUMBERS: Mapping[str, str] = {LAYER_THICKNESS: "um", LAYER_MODULUS: "MPa"}


@dataclass(frozen=True, eq=False)
class Ranges:
    """The ranges of d features."""

    low: Values  # (d,), smallest values
    high: Values  # (d,), largest values


@dataclass(frozen=True)
class Limits:
    """The limits of a number, in its unit."""

    low: float  # smallest value
    high: float  # largest value


def load_of(scene: Scene) -> str:
    """Return the name of the load that a scene draws.

    Parameters
    ----------
    scene : Scene
        The scene. Its own names of relative loads are the keys of `RELATIVE`.

    Returns
    -------
    str
        One of `LOADS`.
    """
    # Loads that are not relative have one name in scenes and in `LOADS`.
    return RELATIVE.get(scene.quantity, scene.quantity)


def unit_of(column: str) -> str:
    """Return the unit of a parameter, a load or a hardness.

    Parameters
    ----------
    column : str
        Name of the number, or of its feature: the logarithm has the unit of its number.

    Returns
    -------
    str
        The unit; "1" for parameters of a user's own generator.
    """
    units: dict[str, str] = {}
    for generator in GENERATORS:
        for name, parameter in generator.PARAMETERS.items():
            units[name] = parameter.unit
    units |= LOADS
    units |= HARDNESSES
    units |= LAYER_NUMBERS
    return units.get(plain(column), "1")


def plain(column: str) -> str:
    """Return the name of the number behind a feature.

    Parameters
    ----------
    column : str
        Name of a feature, such as `log(pressure)` or `hurst`.

    Returns
    -------
    str
        Name of the number, `pressure` or `hurst`.
    """
    if not column.startswith("log("):
        return column
    return column.removeprefix("log(").removesuffix(")")


def _is_logarithm(column: str) -> bool:
    """Tell whether a feature is the logarithm of its number."""
    return column != plain(column)


def numbers_of_rows(scene: Scene, column: Callable[[str], Values]) -> dict[str, Values]:
    """Return the numbers from which the features of a scene are chosen, for all rows.

    Parameters
    ----------
    scene : Scene
        The scene of the database.
    column : callable
        Function that reads a column of the database, (n,), by its name.

    Returns
    -------
    dict of str to ndarray, shape (n,)
        Numbers by name: the parameters that the scene draws, Delta [um], force [uN], pressure
        [MPa], the load that the scene draws, for bodies with a layer its `LAYER_NUMBERS`, and for
        bodies that yield both `HARDNESSES`.
    """
    # Each node has a whole cell, also at the border of the patch.
    nominal_area = float(np.prod(scene.grid.shape) * np.prod(scene.grid.spacing))  # [um2]
    numbers = {}
    for name, stored_name in parameter_columns(scene).items():
        numbers[name] = column(stored_name)
    numbers |= _layer_numbers_of_rows(scene, column)
    numbers |= _hardnesses_of_rows(scene, column)
    force = column("force")
    numbers["delta"] = column("delta")
    numbers["force"] = force
    numbers["pressure"] = force / nominal_area
    if scene.quantity != "delta":
        # A force or pressure that was drawn replaces the solver's, which agrees with it only to the
        # solver's tolerance. A relative load has a name of its own, and replaces nothing.
        numbers[load_of(scene)] = column("load")
    return numbers


def _layer_numbers_of_rows(
    scene: Scene, column: Callable[[str], Values]
) -> dict[str, Values]:
    """Return the `LAYER_NUMBERS` of n rows by name, (n,) each; an empty dict for half-spaces.

    A number that the scene does not draw is repeated for all rows. `column` is that of
    `numbers_of_rows`.
    """
    layer = scene.contact.layer
    if layer is None:
        return {}
    numbers = {}
    for name, distribution in layer.numbers.items():
        if name in layer.drawn:
            numbers[name] = column(name)
        else:
            fixed_number = limits(distribution).smallest
            numbers[name] = np.full_like(column("delta"), fixed_number)
    return numbers


def _hardnesses_of_rows(
    scene: Scene, column: Callable[[str], Values]
) -> dict[str, Values]:
    """Return both `HARDNESSES` of n rows by name, (n,) each; an empty dict for elastic bodies.

    The ratio is that to the E* of the layer, if there is one. `column` is that of
    `numbers_of_rows`.
    """
    contact = scene.contact
    if contact.hardness_limits is None:
        return {}
    if contact.draws_hardness:
        hardness = column("hardness")
    else:
        # Both limits are the constant hardness of the scene.
        constant_hardness, _ = contact.hardness_limits
        hardness = np.full_like(column("delta"), constant_hardness)
    e_star: Values | float = contact.e_star
    layers = Layers.of_rows(scene, column)
    if layers is not None:
        e_star = layers.e_star
    return {"hardness": hardness, "hardness_ratio": hardness / e_star}


def checked_numbers(
    columns: Sequence[str], numbers: Mapping[str, ArrayLike]
) -> dict[str, Values]:
    """Check a user's numbers for features, and return arrays of one length.

    Parameters
    ----------
    columns : sequence of str
        Names of the features.
    numbers : mapping of str to array_like
        Numbers by name. Each is one number or has the shape (n,).

    Returns
    -------
    dict of str to ndarray, shape (n,)
        Numbers by name, in the order of the features. A single number is repeated n times.

    Raises
    ------
    InputError
        If a name is missing or unknown, arrays have several dimensions or unequal lengths, entries
        are masked or no real numbers, or a number is not finite, or not above 0 although its
        feature is the logarithm.
    """
    names = tuple(map(plain, columns))
    _require_names(names, numbers)
    with input_errors():
        entries = {name: np.atleast_1d(real_array(name, numbers[name])) for name in names}
    for name, values in entries.items():
        if values.ndim != 1:
            raise InputError(
                f"{', '.join(names)}: give numbers or arrays of one dimension, not {name} of"
                f" shape {values.shape}"
            )
    try:
        arrays = np.broadcast_arrays(*entries.values())
    except ValueError:
        lengths = ", ".join(f"{name} {values.size}" for name, values in entries.items())
        raise InputError(
            f"arrays of unequal lengths: {lengths}; give one length"
        ) from None
    for column, values in zip(columns, arrays, strict=True):
        _require_finite(column, values)
    return dict(zip(names, arrays, strict=True))


def _require_names(names: Sequence[str], numbers: Mapping[str, ArrayLike]) -> None:
    """Refuse numbers unless their names are exactly `names`, those that a surrogate asks for.

    The message of the InputError lists missing names; if none is missing, it lists unknown ones.
    """
    missing = set(names) - set(numbers)
    unknown = set(numbers) - set(names)
    if not missing and not unknown:
        return
    if missing:
        fault = f"{', '.join(sorted(missing))} not given"
    else:
        fault = f"{', '.join(sorted(unknown))}: unknown"
    fault += f": the surrogate asks for {', '.join(names)}"
    for quantity, name in RELATIVE.items():
        if name in names:
            fault += f"; {name} is {quantity}"
    raise InputError(fault)


def _require_finite(column: str, values: Values) -> None:
    """Refuse numbers, (n,), that are not finite, or not above 0 if the feature is a logarithm.

    `column` is the name of the feature. The message of the InputError quotes the first such number.
    """
    wrong = ~np.isfinite(values)
    advice = "give finite numbers"
    if _is_logarithm(column):
        wrong |= values <= 0
        advice += " above 0"
    if wrong.any():
        raise InputError(f"{plain(column)} = {values[wrong][0]:g}: {advice}")


def columns_of(scenes: Sequence[Scene], load: str) -> tuple[str, ...]:
    """Choose the features of scenes: the numbers that are not constant, and then the load.

    Parameters
    ----------
    scenes : sequence of Scene
        One scene or more.
    load : str
        One of `LOADS`, or "" for the load of the first scene.

    Returns
    -------
    tuple of str
        Names of the features: those of the parameters, of a hardness, and of the load.

    Raises
    ------
    InputError
        If a number is defined in some of the scenes only, or a relative load is not that of all
        scenes.
    """
    columns = []
    for name in _numbers_of(scenes):
        joint_limits = _joint_limits(scenes, name)
        if joint_limits is None:
            # Some or all scenes do not define the number. If only some do not, they are refused. If
            # none defines it (the hardness, if all bodies are elastic), there is no feature.
            if any(_limits(scene, name) is not None for scene in scenes):
                raise InputError(
                    f"--features {SCENE}: {name} is a number of some of the databases only: they"
                    " cannot be learnt together"
                )
        # A constant number tells a model nothing.
        elif joint_limits.low < joint_limits.high:
            columns.append(_column(name, joint_limits))
    load = load or load_of(scenes[0])
    if load in RELATIVE.values() and any(load_of(scene) != load for scene in scenes):
        raise InputError(
            f"--load {load}: not all databases draw it: give --load pressure"
        )
    limits_of_load = _joint_limits(scenes, load)
    if limits_of_load is None:
        # The load is a result in one scene or more, and has no limits there. It spans decades:
        # limits with the ratio `SPAN` make its feature the logarithm.
        limits_of_load = Limits(low=1.0, high=SPAN)
    return (*columns, _column(load, limits_of_load))


def _numbers_of(scenes: Sequence[Scene]) -> list[str]:
    """Return the names of drawn parameters, of the numbers of a layer, and of the hardness.

    The parameters are those that any scene draws. There are no layers if all scenes have
    half-spaces. The name of the hardness is "hardness" if any scene gives it in MPa. Otherwise it
    is "hardness_ratio", also if all bodies are elastic and have no hardness.
    """
    names: list[str] = []
    for scene in scenes:
        names += [name for name in scene.drawn_parameters if name not in names]
    if any(scene.contact.layer is not None for scene in scenes):
        names += LAYER_NUMBERS
    if all(scene.contact.hardness is None for scene in scenes):
        return [*names, "hardness_ratio"]
    return [*names, "hardness"]


def _column(name: str, limits_of_number: Limits) -> str:
    """Return the name of the feature of a number: "log(NAME)" or "NAME".

    The feature is the logarithm if the limits of the number are above 0 and their ratio is at least
    `SPAN`, otherwise the number itself.
    """
    low = limits_of_number.low
    if low > 0 and limits_of_number.high >= SPAN * low:
        return f"log({name})"
    return name


def _joint_limits(scenes: Sequence[Scene], name: str) -> Limits | None:
    """Return the limits of a number over all scenes; None if any scene does not define them."""
    lows = []
    highs = []
    for scene in scenes:
        of_scene = _limits(scene, name)
        if of_scene is None:
            return None
        lows.append(of_scene.low)
        highs.append(of_scene.high)
    return Limits(low=min(lows), high=max(highs))


def _limits(scene: Scene, name: str) -> Limits | None:
    """Return the limits of a parameter, hardness or load in a scene, by its name here.

    Returns None if the scene does not draw the parameter or load, or, for a hardness, if the bodies
    are elastic.
    """
    contact = scene.contact
    distributions = dict(scene.drawn_parameters)
    if contact.layer is not None:
        distributions |= contact.layer.numbers
    if name in distributions:
        low, high = limits(distributions[name])
        return Limits(low=low, high=high)
    if name in HARDNESSES:
        if contact.hardness_limits is None:
            return None
        low, high = contact.hardness_limits
        if name == "hardness":
            return Limits(low=low, high=high)
        return Limits(low=low / contact.e_star, high=high / contact.e_star)
    if name != load_of(scene):
        return None
    # The range of the load may be drawn from several pieces.
    ends_of_pieces = [limits(piece.range) for piece in scene.pieces]
    return Limits(
        low=min(low for low, _ in ends_of_pieces),
        high=max(high for _, high in ends_of_pieces),
    )


def inputs(columns: Sequence[str], numbers: Mapping[str, Values]) -> Values:
    """Compute the features of a scene from its numbers.

    Parameters
    ----------
    columns : sequence of str
        Names of d features.
    numbers : mapping of str to ndarray, shape (n,)
        Numbers by name, with those of all features.

    Returns
    -------
    ndarray, shape (n, d)
        The features.
    """
    features = []
    for column in columns:
        values = numbers[plain(column)]
        if _is_logarithm(column):
            values = np.log(values)
        features.append(values)
    return np.column_stack(features)


def shown(columns: Sequence[str], values: Values) -> Values:
    """Turn features of a scene back into its numbers.

    Parameters
    ----------
    columns : sequence of str
        Names of d features.
    values : ndarray, shape (..., d)
        Features.

    Returns
    -------
    ndarray, shape (..., d)
        Numbers of the scene in their units.
    """
    logarithms = np.array([_is_logarithm(column) for column in columns])
    # `np.exp` computes all columns: numbers that are no logarithms could overflow.
    exponents = np.where(logarithms, values, 0.0)
    return np.where(logarithms, np.exp(exponents), values)


def training_ranges(
    scenes: Sequence[Scene], columns: Sequence[str], seen: Values
) -> Ranges:
    """Return the ranges of a scene's features that a training covers.

    Parameters
    ----------
    scenes : sequence of Scene
        Scenes of the training rows.
    columns : sequence of str
        Names of d features.
    seen : ndarray, shape (n, d)
        Features of the training rows.

    Returns
    -------
    Ranges
        Ranges of the features. If all scenes define the limits of a number, these are its range;
        otherwise the range is that of the training rows.
    """
    low = seen.min(axis=0)
    high = seen.max(axis=0)
    for place, column in enumerate(columns):
        name = plain(column)
        joint_limits = _joint_limits(scenes, name)
        if joint_limits is not None:
            # Compute the features of two rows: one has the lower limit, the other the upper one.
            numbers = {name: np.array([joint_limits.low, joint_limits.high])}
            ends = inputs([column], numbers)[:, 0]
            low[place] = ends[0]
            high[place] = ends[1]
    return Ranges(low=low, high=high)
