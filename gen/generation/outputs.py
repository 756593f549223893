"""Call the user's function for a contact, and check the outputs that it returns.

A scene can name a function in its table [store]. The function is called for every contact of the
database, and each number that it returns is a column. A completed scene has the function's name,
the SHA-256 of its source, and the names and units of its outputs.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from numbers import Real
from typing import Any

import numpy as np

import bem
from gen.runtime.errors import SourceError
from gen.runtime.user_code import load_function, source_errors
from gen.scene import Store

SHOWN_NAMES = 12
"""Largest number of names of outputs that a message lists."""

SHOWN_LETTERS = 60
"""Largest number of letters of a wrong output that a message shows."""


@dataclass(frozen=True)
class FunctionOutput:
    """One output of a user's function for a contact."""

    value: float  # number in the unit; may be infinite or NaN
    unit: str | None  # None if the function has returned a number without a unit


def call_function(
    store: Store, contact: bem.Contact, row: int
) -> dict[str, FunctionOutput]:
    """Call the user's function for a contact, and return its outputs without comparing them.

    The array `contact.pressure` is made read-only first, and stays so.

    Parameters
    ----------
    store : Store
        Table [store] of a scene, with a function and the hash of its source.
    contact : bem.Contact
        A solved contact.
    row : int
        Number of its row, for messages.

    Returns
    -------
    dict of str to FunctionOutput
        The outputs by their names, also if the scene lists other outputs. A whole number that is
        too large for a float becomes infinity without a unit.

    Raises
    ------
    SourceError
        If the function fails, or returns anything else than a mapping of names to numbers or to
        pairs of a number and its unit.
    ArithmeticError
        If the function raises it.
    """
    contact.pressure.setflags(write=False)  # the function must not change what is stored
    place = f"{store.function}, row {row}"  # beginning of messages
    outputs = {}
    with source_errors(place):
        returned = load_function(str(store.function), store.source)(contact)
        if not isinstance(returned, Mapping):
            kind = type(returned).__name__
            raise SourceError(
                f"{place}: returned a {kind}, not a dictionary of numbers by names"
            )
        for name in returned:
            outputs[name] = _output(place, name, returned[name])
    return outputs


def _output(place: str, name: Any, returned: Any) -> FunctionOutput:
    """Make the output of the value that a user's function has returned under a name.

    The value is a number, or a tuple of a number and its unit. For any other value, and for a name
    that is not a text, a SourceError is raised, whose message begins with `place`.
    """
    value = returned
    unit = None
    if isinstance(returned, tuple) and len(returned) == 2:
        value, unit = returned
    if isinstance(value, np.ndarray | np.generic) and value.ndim == 0:
        value = value.item()  # numpy's number as one of Python
    if not isinstance(name, str):
        raise SourceError(f"{place}: the name {name!r} is not a text")
    if not isinstance(value, Real) or not isinstance(unit, str | None):
        text = str(returned)[:SHOWN_LETTERS]
        raise SourceError(
            f"{place}: {name} is {text!r}, not a number, or one and its unit"
        )
    try:
        return FunctionOutput(value=float(value), unit=unit)
    except OverflowError:  # a whole number of hundreds of digits
        return FunctionOutput(value=math.inf, unit=None)


def outputs_for_row(store: Store, contact: bem.Contact, row: int) -> dict[str, float]:
    """Call the user's function for a contact, and require the outputs that the scene lists.

    The array `contact.pressure` is made read-only first, and stays so.

    Parameters
    ----------
    store : Store
        Table [store] of a completed scene, with a function and its outputs.
    contact : bem.Contact
        A solved contact.
    row : int
        Number of its row, for messages.

    Returns
    -------
    dict of str to float
        Values of the outputs by their names, in the units of the scene. They may be infinite or
        NaN.

    Raises
    ------
    SourceError
        If the function fails, if an output is missing, unknown or in another unit, or if a value is
        outside of its bounds in the scene.
    ArithmeticError
        If the function raises it.
    """
    units = store.outputs or {}  # the listed outputs: units by names
    outputs = call_function(store, contact, row)
    place = f"{store.function}, row {row}"  # beginning of messages
    if outputs.keys() != units.keys():
        raise SourceError(
            f"{place}: returned {_listed(outputs)}; the database has {_listed(units)}"
        )
    for name, output in outputs.items():
        smallest, largest = store.bounds(name)
        if output.unit not in {None, units[name]}:  # a number without a unit is accepted
            raise SourceError(
                f"{place}: {name} is in {output.unit!r}; the database has {units[name]!r}"
            )
        # NaN is within all bounds: it is neither below the smallest value nor above the largest.
        if output.value < smallest or output.value > largest:
            raise SourceError(
                f"{place}: {name} is {output.value:g}; its bounds in the scene are {smallest:g} and"
                f" {largest:g}"
            )
    return {name: output.value for name, output in outputs.items()}


def _listed(outputs: Mapping[str, object]) -> str:
    """Return the names of outputs for a message, sorted and separated by commas.

    Only the first `SHOWN_NAMES` names are listed. The text is "nothing" if there are no outputs.
    """
    return ", ".join(sorted(outputs)[:SHOWN_NAMES]) or "nothing"
