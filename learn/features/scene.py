"""The features of a scene: the numbers that it draws for a row, and the load as it is given.

A surrogate of these answers for all surfaces of a population: it needs parameters, and no surface.
Numbers that span a ratio of `SPAN` or more, as loads do, are learnt as logarithms.
"""

from collections.abc import Callable, Mapping, Sequence

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
RELATIVE = {
    "delta/height_rms": "relative_delta",
    "pressure/(E* slope_rms)": "relative_pressure",
}
BY_FORCE = frozenset(
    {"pressure", "force", "relative_pressure"}
)  # at these Delta is a result
# both ways in which a scene gives the hardness; the ratio is over E*
HARDNESSES: Mapping[str, str] = {"hardness": "MPa", "hardness_ratio": "1"}


def load_of(scene: Scene) -> str:
    """Return the name of the load that a scene draws, of `LOADS`."""
    return RELATIVE.get(scene.quantity, scene.quantity)


def unit_of(name: str) -> str:
    """Return the unit of a parameter or a load; "1" for those of a user's own."""
    known = {
        key: each.unit for table in GENERATORS for key, each in table.PARAMETERS.items()
    }
    return {**known, **LOADS, **HARDNESSES}.get(plain(name), "1")


def plain(column: str) -> str:
    """Return the name of the number that a feature is of."""
    return (
        column.removeprefix("log(").removesuffix(")")
        if column.startswith("log(")
        else column
    )


def given_values(scene: Scene, column: Callable[[str], Values]) -> dict[str, Values]:
    """Return the numbers of all rows of a database, (n,) each, by their names; see `inputs`."""
    patch = float(np.prod(scene.grid.shape) * np.prod(scene.grid.spacing))
    found = {name: column(own) for name, own in parameter_columns(scene).items()}
    contact = scene.contact
    if (ends := contact.hardness_limits) is not None:
        hardness = (
            column("hardness")
            if contact.draws_hardness
            else ends[0] + 0 * column("delta")
        )
        found |= {"hardness": hardness, "hardness_ratio": hardness / contact.e_star}
    force = column("force")
    found |= {"delta": column("delta"), "force": force, "pressure": force / patch}
    if scene.quantity != "delta":
        found[load_of(scene)] = column("load")
    return found


def checked_numbers(
    columns: Sequence[str], given: Mapping[str, ArrayLike]
) -> dict[str, Values]:
    """Return copies of the numbers that features are of, by their names, (n,) each.

    InputError is raised if a name is missing or unknown, lengths differ, or a number is masked, not
    finite, or not above 0 where its logarithm is learnt.
    """
    wanted = tuple(map(plain, columns))
    asked = ", ".join(wanted)
    missing, unknown = {*wanted} - {*given}, {*given} - {*wanted}
    for names, fault in ((missing, " not given"), (unknown, ": unknown")):
        if names:
            meant = [
                f"; {name} is {of}" for of, name in RELATIVE.items() if name in wanted
            ]
            raise InputError(
                f"{', '.join(sorted(names))}{fault}: the surrogate asks for {asked}{''.join(meant)}"
            )
    with input_errors():
        copies = {name: np.atleast_1d(real_array(name, given[name])) for name in wanted}
    for name, values in copies.items():
        if values.ndim != 1:
            raise InputError(
                f"{asked}: give numbers or arrays of one dimension, not {name} of"
                f" shape {values.shape}"
            )
    try:
        every = np.broadcast_arrays(*copies.values())
    except ValueError:
        lengths = ", ".join(f"{name} {values.size}" for name, values in copies.items())
        raise InputError(
            f"arrays of unequal lengths: {lengths}; give one length"
        ) from None
    for name, column, values in zip(wanted, columns, every, strict=True):
        bad = ~np.isfinite(values) | ((values <= 0) & (column != name))
        if bad.any():
            above = " above 0" if column != name else ""
            raise InputError(f"{name} = {values[bad][0]:g}: give finite numbers{above}")
    return dict(zip(wanted, every, strict=True))


def columns_of(scenes: Sequence[Scene], load: str) -> tuple[str, ...]:
    """Return the features: what a scene draws or scenes differ in, hardness, and then the load."""
    names = [*dict.fromkeys(name for scene in scenes for name in scene.drawn_parameters)]
    ratios = all(scene.contact.hardness is None for scene in scenes)
    names.append("hardness_ratio" if ratios else "hardness")
    columns = []
    for name in names:
        ends = _ends(scenes, name)
        if ends is None and any(_limits(scene, name) for scene in scenes):
            raise InputError(
                f"--features {SCENE}: {name} is a number of some of the databases only: they cannot"
                " be learnt together"
            )
        if ends is not None and ends[0] < ends[1]:
            columns.append(_column(name, ends))
    load = load or load_of(scenes[0])
    if load in RELATIVE.values() and any(load_of(scene) != load for scene in scenes):
        raise InputError(
            f"--load {load}: not all databases draw it: give --load pressure"
        )
    return (*columns, _column(load, _ends(scenes, load) or (1.0, SPAN)))


def _column(name: str, ends: tuple[float, float]) -> str:
    """Return the feature of a number with these ends."""
    return f"log({name})" if ends[0] > 0 and ends[1] >= SPAN * ends[0] else name


def _ends(scenes: Sequence[Scene], name: str) -> tuple[float, float] | None:
    """Return the ends of a number in all scenes; None if one does not give it."""
    ends = [each for scene in scenes if (each := _limits(scene, name)) is not None]
    if len(ends) < len(scenes):
        return None
    return min(low for low, _ in ends), max(high for _, high in ends)


def _limits(scene: Scene, name: str) -> tuple[float, float] | None:
    """Return the least and the largest value that a scene gives a number; None if it does not."""
    if name in scene.drawn_parameters:
        return limits(scene.drawn_parameters[name])
    if name in HARDNESSES:
        ends, contact = scene.contact.hardness_limits, scene.contact
        if ends is None or name == "hardness":
            return ends
        return ends[0] / contact.e_star, ends[1] / contact.e_star
    if name != load_of(scene):
        return None
    ranges = [limits(piece.range) for piece in scene.pieces]
    return min(low for low, _ in ranges), max(high for _, high in ranges)


def inputs(columns: Sequence[str], given: Mapping[str, Values]) -> Values:
    """Return the features, (n, d), of numbers by their names, each (n,)."""
    named = [(column, given[plain(column)]) for column in columns]
    return np.column_stack(
        [np.log(v) if column != plain(column) else v for column, v in named]
    )


def shown(columns: Sequence[str], values: Values) -> Values:
    """Return features, (..., d), as the numbers that they are of."""
    logarithms = np.array([column != plain(column) for column in columns])
    return np.where(logarithms, np.exp(np.where(logarithms, values, 0.0)), values)


def training_ranges(
    scenes: Sequence[Scene], columns: Sequence[str], seen: Values
) -> tuple[Values, Values]:
    """Return the ends of features, (d,): those of the scenes, or of rows `seen`, (n, d)."""
    low, high = seen.min(axis=0), seen.max(axis=0)
    for place, column in enumerate(columns):
        if (ends := _ends(scenes, plain(column))) is not None:
            low[place], high[place] = inputs([column], {plain(column): np.array(ends)})[
                :, 0
            ]
    return low, high
