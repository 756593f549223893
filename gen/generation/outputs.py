"""Outputs of a user's function, which is called for every contact of a database.

A scene records the function, the SHA-256 of its source, and the names and units of its outputs.
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

SHOWN_NAMES = 12  # most names of outputs in a message
SHOWN_LETTERS = 60  # most letters of a wrong output in a message


@dataclass(frozen=True)
class FunctionOutput:
    """One output of a user's function for a contact."""

    value: float  # may be infinite or NaN
    unit: str | None  # None if the function returned no unit


def call_function(
    store: Store, contact: bem.Contact, row: int
) -> dict[str, FunctionOutput]:
    """Call the user's function for a contact, whose pressure is made read-only.

    Parameters
    ----------
    store : Store
        Table of a scene, with a function and the hash of its source.
    contact : bem.Contact
        A solved contact.
    row : int
        Number of its row, for messages.

    Returns
    -------
    dict of str to FunctionOutput
        The outputs by their names, whatever the scene has. Numbers beyond all floats are infinite
        and lose their unit.

    Raises
    ------
    SourceError
        If the function fails, or returns anything else than numbers by names.
    ArithmeticError
        As the function raises it.
    """
    contact.pressure.setflags(write=False)
    place = f"{store.function}, row {row}"
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
    """Return what a user's function returned under a name: a number, or a number and its unit.

    A SourceError, which begins with `place`, is raised for anything else.
    """
    value = returned
    unit = None
    if isinstance(returned, tuple) and len(returned) == 2:
        value, unit = returned
    if isinstance(value, np.ndarray | np.generic) and value.ndim == 0:
        value = value.item()
    if not isinstance(name, str):
        raise SourceError(f"{place}: the name {name!r} is not a text")
    if not isinstance(value, Real) or not isinstance(unit, str | None):
        text = str(returned)[:SHOWN_LETTERS]
        raise SourceError(
            f"{place}: {name} is {text!r}, not a number, or one and its unit"
        )
    try:
        return FunctionOutput(float(value), unit)
    except OverflowError:  # a whole number of hundreds of digits
        return FunctionOutput(math.inf, None)


def outputs_for_row(store: Store, contact: bem.Contact, row: int) -> dict[str, float]:
    """Call the user's function for a contact, and check that its outputs are those of the scene.

    Parameters
    ----------
    store : Store
        Table of a completed scene, with a function and its outputs.
    contact : bem.Contact
        A solved contact, whose pressure is made read-only.
    row : int
        Number of its row, for messages.

    Returns
    -------
    dict of str to float
        Values of the outputs by their names, in the units of the scene; perhaps infinite or NaN.

    Raises
    ------
    SourceError
        If the function fails, or an output has another name or unit, or is beyond its bounds.
    ArithmeticError
        As the function raises it.
    """
    units = store.outputs or {}
    outputs = call_function(store, contact, row)
    place = f"{store.function}, row {row}: "
    if outputs.keys() != units.keys():
        raise SourceError(
            f"{place}returned {_listed(outputs)}; the database has {_listed(units)}"
        )
    for name, output in outputs.items():
        smallest, largest = store.bounds(name)
        if output.unit not in {None, units[name]}:
            raise SourceError(
                f"{place}{name} is in {output.unit!r}; the database has {units[name]!r}"
            )
        if output.value < smallest or output.value > largest:
            raise SourceError(
                f"{place}{name} is {output.value:g}; its bounds in the scene are {smallest:g} and"
                f" {largest:g}"
            )
    return {name: output.value for name, output in outputs.items()}


def _listed(outputs: Mapping[str, object]) -> str:
    """List the names of outputs for a message, the first `SHOWN_NAMES` in the alphabet's order."""
    return ", ".join(sorted(outputs)[:SHOWN_NAMES]) or "nothing"
