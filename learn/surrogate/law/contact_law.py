"""Contact laws: area, force and mean gap against Delta and nominal pressure, monotone, with slopes.

What a finite-element code needs at a Gauss point. Laws come from the surrogate, or contact by
contact from the solver, at the loads that were asked for; of one surface, or of a population as
mean and quantiles over its surfaces, at given Delta and at given pressure.

The mean gap follows from the force where no surrogate was trained on it: it is (z_max - mean z)
- Delta plus the mean displacement, which is exactly linear in the pressures and, for a given patch,
nearly F / (E* L) times a number that says where the load sits: the coarse contact solve's.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from gen.runtime.errors import InputError
from learn.reading import Reading
from learn.surrogate.law import predicted, solved
from learn.surrogate.law.curves import Curves
from learn.surrogate.law.subjects import Subjects, found_in
from learn.surrogate.model import Surrogate
from learn.surrogate.sources import deltas_from, pressures_from

Values = NDArray[np.float64]

STEPS = 40
"""Displacements of a law unless loads are given, over the training's or the scene's range."""


@dataclass(frozen=True)
class Order:
    """What law is wanted.

    Attributes
    ----------
    inputs : surfaces, folders of them, databases or scenes
    delta : displacements as text, "" for the training's range, or those of the pressures
    pressure : nominal pressures as text, "" for those at the displacements
    solver : True to solve instead of predicting
    surfaces : of the population of a database or scene
    level : coverage of the band
    e_star : E*, None for the training's, the scene's, or 1 MPa [MPa]
    reading : how files are read
    command : as it was typed, for the record
    """

    inputs: tuple[str, ...]
    delta: str = ""
    pressure: str = ""
    solver: bool = False
    surfaces: int = 50
    level: float = 0.9
    e_star: float | None = None
    reading: Reading = field(default_factory=Reading)
    command: str = ""


@dataclass(frozen=True, eq=False)
class Law:
    """Tables of a contact law.

    Attributes
    ----------
    order : what was asked for
    over_delta : table against the far-field displacement, from 0 on [um]
    over_pressure : table against the nominal pressure; Delta among its curves [MPa]
    e_star : E* [MPa]
    band : what the band is, in words
    origins : what surfaces the law is of, a line each
    notes : how it was made, a line each
    """

    order: Order
    over_delta: Curves
    over_pressure: Curves
    e_star: float
    band: str
    origins: tuple[str, ...]
    notes: tuple[str, ...]


def make(surrogate: Surrogate | None, order: Order, say: Callable[[str], None]) -> Law:
    """Make a law.

    Parameters
    ----------
    surrogate : what predicts; where the contacts are solved, only its E* and its range of Delta
        are taken, unless given, and it may be None
    order : what is wanted
    say : called with what was done to each file

    Raises
    ------
    InputError
        For input that cannot be used, or a pressure that the law does not reach.
    """
    if not order.solver:
        _check_surrogate(surrogate)
    deltas = np.unique(deltas_from(order.delta)) if order.delta else None
    pressures = np.unique(pressures_from(order.pressure)) if order.pressure else None
    subjects = found_in(order.inputs, order.surfaces, order.reading, say)
    e_star = _modulus(surrogate, order, subjects)
    if deltas is None and (pressures is None or not order.solver):
        deltas = _usual_deltas(surrogate, subjects)
    if order.solver:
        material = order.e_star is not None
        over_delta, over_pressure, notes = solved.tables(
            subjects.surfaces, deltas, pressures, order.level, e_star, material=material
        )
        how = "solved contact by contact"
    else:
        assert surrogate is not None
        assert deltas is not None
        over_delta, over_pressure, notes = predicted.tables(
            surrogate, subjects.surfaces, deltas, pressures, order.level, e_star
        )
        how = f"predicted by {surrogate.card['title']}"
    return Law(
        order=order,
        over_delta=over_delta,
        over_pressure=over_pressure,
        e_star=e_star,
        band=_band(order, len(subjects.surfaces)),
        origins=tuple(subjects.origins),
        notes=(how, *(each for each in subjects.origins if ": " in each), *notes),
    )


def _check_surrogate(surrogate: Surrogate | None) -> None:
    if surrogate is None:
        raise InputError("a law needs a surrogate, or --solver, which needs none")
    if not {"area", "force"} <= set(surrogate.learnt):
        raise InputError("a law needs a surrogate of both area and force: fit --target both")


def _modulus(surrogate: Surrogate | None, order: Order, subjects: Subjects) -> float:
    """E* from the options, the surrogate's training, the scenes; else 1 MPa."""
    if order.e_star is not None:
        return order.e_star
    if surrogate is not None:
        return surrogate.modulus
    return subjects.modulus() or 1.0


def _usual_deltas(surrogate: Surrogate | None, subjects: Subjects) -> Values:
    """Displacements over the range of the training or of the scenes [um]."""
    limits = subjects.displacements() if surrogate is None else surrogate.card["delta"]
    if limits is None:
        raise InputError("give --delta or --pressure: without a surrogate nothing says a range")
    low, high = limits
    found = np.unique(np.linspace(float(low), float(high), STEPS))
    if not found[-1] > 0:
        raise InputError("give --delta or --pressure: the scene presses nothing")
    return found[found > 0]


def _band(order: Order, surfaces: int) -> str:
    """What the band is, in words."""
    share = f"{100 * order.level:g} %"
    if surfaces > 1:
        return f"quantiles of {surfaces} surfaces, {share} between them"
    if order.solver:
        return "none, one surface was solved"
    return f"{share} conformal interval"
