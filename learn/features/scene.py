"""The features of a scene: the numbers that it draws for a row, and the load as it is given.

A surrogate of these answers for all surfaces of a population: it needs parameters, and no surface.
Numbers that span a ratio of `SPAN` or more, as loads do, are learnt as logarithms: the feature of
the number `pressure` is then the column `log(pressure)`, otherwise `pressure`.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from bem.checks import real_array
from gen.arrays import Values
from gen.distribution import limits
from gen.generators import GENERATORS
from gen.runtime.errors import InputError, input_errors
from gen.scene import Scene, parameter_columns

SCENE = "scene"  # name of the feature set
SPAN = 3.0  # largest over smallest value from which on a number is learnt as a logarithm

# Loads with their units. Every database gives the first three; relative ones are over the rms
# height, or over E* times the rms slope, and only scenes that draw them give them.
LOADS: Mapping[str, str] = {
    "delta": "um",
    "pressure": "MPa",
    "force": "uN",
    "relative_delta": "1",
    "relative_pressure": "1",
}
# relative loads by the names of the quantities of scenes
RELATIVE: Mapping[str, str] = {
    "delta/height_rms": "relative_delta",
    "pressure/(E* slope_rms)": "relative_pressure",
}
# loads at which Delta is a result
BY_FORCE = frozenset({"pressure", "force", "relative_pressure"})
# both ways in which a scene gives the hardness; the ratio is over E*
HARDNESSES: Mapping[str, str] = {"hardness": "MPa", "hardness_ratio": "1"}


@dataclass(frozen=True, eq=False)
class Ranges:
    """The ranges of d features."""

    low: Values  # (d,), smallest values
    high: Values  # (d,), largest values


@dataclass(frozen=True)
class Limits:
    """The smallest and the largest value of a number, in its unit."""

    low: float
    high: float


def load_of(scene: Scene) -> str:
    """Return the name of the load that a scene draws.

    Parameters
    ----------
    scene : Scene
        The scene.

    Returns
    -------
    str
        One of `LOADS`.
    """
    return RELATIVE.get(scene.quantity, scene.quantity)


def unit_of(column: str) -> str:
    """Return the unit of a parameter, a load or a hardness.

    Parameters
    ----------
    column : str
        Name of the number, or of its feature.

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
    return units.get(plain(column), "1")


def plain(column: str) -> str:
    """Return the name of the number whose feature a column is.

    Parameters
    ----------
    column : str
        Name of a feature, as `log(pressure)` or `hurst`.

    Returns
    -------
    str
        The name without the logarithm.
    """
    if not column.startswith("log("):
        return column
    return column.removeprefix("log(").removesuffix(")")


def _is_logarithm(column: str) -> bool:
    """Tell whether a feature is the logarithm of its number."""
    return column != plain(column)


def numbers_of_rows(scene: Scene, column: Callable[[str], Values]) -> dict[str, Values]:
    """Return the numbers of all rows of a database that may be features of its scene.

    Parameters
    ----------
    scene : Scene
        The scene of the database.
    column : callable
        Reads a column of the database by its name, (n,).

    Returns
    -------
    dict
        By name, (n,) each: the parameters that the scene draws, Delta [um], force [uN] and pressure
        [MPa], the load that the scene draws, and both hardnesses of bodies that yield.
    """
    patch = float(np.prod(scene.grid.shape) * np.prod(scene.grid.spacing))
    numbers = {}
    for name, stored_name in parameter_columns(scene).items():
        numbers[name] = column(stored_name)
    contact = scene.contact
    if contact.hardness_limits is not None:
        hardness = contact.hardness_limits[0] + 0 * column("delta")
        if contact.draws_hardness:
            hardness = column("hardness")
        numbers["hardness"] = hardness
        numbers["hardness_ratio"] = hardness / contact.e_star
    force = column("force")
    numbers["delta"] = column("delta")
    numbers["force"] = force
    numbers["pressure"] = force / patch
    if scene.quantity != "delta":
        numbers[load_of(scene)] = column("load")
    return numbers


def checked_numbers(
    columns: Sequence[str], numbers: Mapping[str, ArrayLike]
) -> dict[str, Values]:
    """Return copies of the numbers that features need, all of one length.

    Parameters
    ----------
    columns : sequence of str
        Names of the features.
    numbers : mapping
        Numbers by name, each one number or (n,).

    Returns
    -------
    dict
        Numbers by name in the order of the features, (n,) each.

    Raises
    ------
    InputError
        If a name is missing or unknown, lengths differ, or a number is masked, not finite, or not
        above 0 where its logarithm is learnt.
    """
    names = tuple(map(plain, columns))
    _require_names(names, numbers)
    with input_errors():
        copies = {name: np.atleast_1d(real_array(name, numbers[name])) for name in names}
    for name, values in copies.items():
        if values.ndim != 1:
            raise InputError(
                f"{', '.join(names)}: give numbers or arrays of one dimension, not {name} of"
                f" shape {values.shape}"
            )
    try:
        arrays = np.broadcast_arrays(*copies.values())
    except ValueError:
        lengths = ", ".join(f"{name} {values.size}" for name, values in copies.items())
        raise InputError(
            f"arrays of unequal lengths: {lengths}; give one length"
        ) from None
    for column, values in zip(columns, arrays, strict=True):
        _require_finite(column, values)
    return dict(zip(names, arrays, strict=True))


def _require_names(names: Sequence[str], numbers: Mapping[str, ArrayLike]) -> None:
    """Refuse numbers of which a name is missing, and then those with an unknown name."""
    missing = set(names) - set(numbers)
    unknown = set(numbers) - set(names)
    if not missing and not unknown:
        return
    fault = f"{', '.join(sorted(unknown))}: unknown"
    if missing:
        fault = f"{', '.join(sorted(missing))} not given"
    fault += f": the surrogate asks for {', '.join(names)}"
    for quantity, name in RELATIVE.items():
        if name in names:
            fault += f"; {name} is {quantity}"
    raise InputError(fault)


def _require_finite(column: str, values: Values) -> None:
    """Refuse numbers that are not finite, or not above 0 where the feature is their logarithm."""
    wrong = ~np.isfinite(values)
    advice = "give finite numbers"
    if _is_logarithm(column):
        wrong |= values <= 0
        advice += " above 0"
    if wrong.any():
        raise InputError(f"{plain(column)} = {values[wrong][0]:g}: {advice}")


def columns_of(scenes: Sequence[Scene], load: str) -> tuple[str, ...]:
    """Return the features of scenes: numbers that vary in or between them, and then the load.

    Parameters
    ----------
    scenes : sequence of Scene
        One scene or more.
    load : str
        One of `LOADS`; the load of the first scene if it is "".

    Returns
    -------
    tuple of str
        Names of the features.

    Raises
    ------
    InputError
        If some of the scenes alone give a number, or draw a relative load.
    """
    columns = []
    for name in _numbers_of(scenes):
        ends = _joint_limits(scenes, name)
        if ends is None and any(_limits(scene, name) is not None for scene in scenes):
            raise InputError(
                f"--features {SCENE}: {name} is a number of some of the databases only: they cannot"
                " be learnt together"
            )
        if ends is not None and ends.low < ends.high:
            columns.append(_column(name, ends))
    load = load or load_of(scenes[0])
    if load in RELATIVE.values() and any(load_of(scene) != load for scene in scenes):
        raise InputError(
            f"--load {load}: not all databases draw it: give --load pressure"
        )
    # Loads that result from another one have no limits, and span decades.
    ends = _joint_limits(scenes, load) or Limits(1.0, SPAN)
    return (*columns, _column(load, ends))


def _numbers_of(scenes: Sequence[Scene]) -> list[str]:
    """Return the names of parameters that a scene draws, once each, and of the hardness."""
    names: list[str] = []
    for scene in scenes:
        names += [name for name in scene.drawn_parameters if name not in names]
    if all(scene.contact.hardness is None for scene in scenes):
        return [*names, "hardness_ratio"]
    return [*names, "hardness"]


def _column(name: str, ends: Limits) -> str:
    """Return the feature of a number between these limits."""
    if ends.low > 0 and ends.high >= SPAN * ends.low:
        return f"log({name})"
    return name


def _joint_limits(scenes: Sequence[Scene], name: str) -> Limits | None:
    """Return the limits of a number over all scenes; None if one does not give it."""
    ends = []
    for scene in scenes:
        of_scene = _limits(scene, name)
        if of_scene is None:
            return None
        ends.append(of_scene)
    return Limits(min(end.low for end in ends), max(end.high for end in ends))


def _limits(scene: Scene, name: str) -> Limits | None:
    """Return the limits that a scene gives a number; None if it does not."""
    if name in scene.drawn_parameters:
        return Limits(*limits(scene.drawn_parameters[name]))
    contact = scene.contact
    if name in HARDNESSES:
        if contact.hardness_limits is None:
            return None
        low, high = contact.hardness_limits
        if name == "hardness":
            return Limits(low, high)
        return Limits(low / contact.e_star, high / contact.e_star)
    if name != load_of(scene):
        return None
    ranges = [Limits(*limits(piece.range)) for piece in scene.pieces]
    return Limits(min(piece.low for piece in ranges), max(piece.high for piece in ranges))


def inputs(columns: Sequence[str], numbers: Mapping[str, Values]) -> Values:
    """Return features from the numbers of a scene.

    Parameters
    ----------
    columns : sequence of str
        Names of d features.
    numbers : mapping
        Their numbers by name, (n,) each.

    Returns
    -------
    ndarray, shape (n, d)
        The features.
    """
    features = []
    for column in columns:
        values = numbers[plain(column)]
        features.append(np.log(values) if _is_logarithm(column) else values)
    return np.column_stack(features)


def shown(columns: Sequence[str], values: Values) -> Values:
    """Return features of a scene as its numbers.

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
    # Features that are no logarithms may be too large for an exponential.
    exponents = np.where(logarithms, values, 0.0)
    return np.where(logarithms, np.exp(exponents), values)


def training_ranges(
    scenes: Sequence[Scene], columns: Sequence[str], seen: Values
) -> Ranges:
    """Return the ranges of a scene's features in a training.

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
        Limits that all scenes give a number, otherwise the ends of the rows' features.
    """
    low = seen.min(axis=0)
    high = seen.max(axis=0)
    for place, column in enumerate(columns):
        ends = _joint_limits(scenes, plain(column))
        if ends is not None:
            limits_of_number = np.array([ends.low, ends.high])
            low[place], high[place] = inputs([column], {plain(column): limits_of_number})[
                :, 0
            ]
    return Ranges(low, high)
