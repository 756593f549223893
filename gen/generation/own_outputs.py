"""Outputs of a user's function of each contact, which become columns of a database."""

import math
from collections.abc import Mapping
from numbers import Real
from typing import Any, NamedTuple

import numpy as np

import bem
from gen.runtime.errors import SourceError
from gen.runtime.user_code import Function, faults_of, load_function
from gen.scene import Store


class Output(NamedTuple):
    """One output of a user's function: its value, and its unit where it gives one."""

    value: float
    unit: str | None


def outputs_of(store: Store, contact: bem.Contact, row: int) -> dict[str, float]:
    """Call the user's function for a contact.

    Parameters
    ----------
    store : Store
        The scene's table, with the outputs that its database has.
    contact : bem.Contact
        The contact; its arrays cannot be changed.
    row : int
        Number of its row, for messages.

    Returns
    -------
    dict of str to float
        The outputs by name, in the units of `store.outputs`; perhaps not finite.

    Raises
    ------
    SourceError
        If the function is gone or has changed, raises an exception, or returns anything but these
        outputs.
    """
    expected = store.outputs or {}
    found = called(store, contact, row)
    if found.keys() != expected.keys():
        raise SourceError(
            f"{store.function}, row {row}: returned {_listed(found)}; the database has"
            f" {_listed(expected)}"
        )
    for name, output in found.items():
        if output.unit not in {None, expected[name]}:
            raise SourceError(
                f"{store.function}, row {row}: {name} is in {output.unit!r}; the database has it in"
                f" {expected[name]!r}"
            )
        least, most = store.bounds(name)
        if output.value < least or output.value > most:
            raise SourceError(
                f"{store.function}, row {row}: {name} is {output.value:g}; the scene's bounds of it"
                f" are {least:g} and {most:g}"
            )
    return {name: output.value for name, output in found.items()}


def called(store: Store, contact: bem.Contact, row: int) -> dict[str, Output]:
    """Call the user's function for a contact, whatever its outputs are.

    Parameters and errors are those of `outputs_of`.
    """
    contact.pressure.setflags(write=False)
    place = f"{store.function}, row {row}"
    with faults_of(place):
        returned = _function(store)(contact)
        if not isinstance(returned, Mapping):
            raise SourceError(
                f"{place}: returned a {type(returned).__name__}, not a dictionary of numbers by"
                " their names"
            )
        return {_name(name, place): _output(name, returned[name], place) for name in returned}


def _function(store: Store) -> Function:
    """Load the function, whose source has to be that of the database."""
    assert store.function is not None
    if store.source is None:  # only a file that was not made by a run lacks it
        raise SourceError(f"{store.function}: the scene lacks the hash of its source")
    return load_function(store.function, store.source)


def _name(name: object, place: str) -> str:
    """Return a name that is a text."""
    if not isinstance(name, str):
        raise SourceError(f"{place}: the name {name!r} is not a text")
    return str(name)


def _output(name: str, returned: Any, place: str) -> Output:
    """Read a number, or a pair of a number and its unit."""
    paired = isinstance(returned, tuple) and len(returned) == 2
    value, unit = returned if paired else (returned, None)
    if isinstance(value, np.ndarray | np.generic) and value.ndim == 0:
        value = value.item()
    if not isinstance(value, Real) or not isinstance(unit, str | None):
        raise SourceError(
            f"{place}: {name} is {str(returned)[:60]!r}, not a number or a pair of a number and its"
            " unit"
        )
    try:
        return Output(float(value), unit)
    except OverflowError:  # a whole number of hundreds of digits
        return Output(math.inf, unit)


def _listed(names: Mapping[str, object]) -> str:
    """List names in words."""
    return ", ".join(sorted(names)[:12]) + (" ..." if len(names) > 12 else "") or "nothing"
