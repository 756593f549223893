"""Messages about a scene that breaks a rule: the key, its value, and what is allowed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from gen.generators import TAGS
from gen.scene.hints import UnknownKey, hint, keys_of_scene

if TYPE_CHECKING:
    from pydantic import ValidationError
    from pydantic_core import ErrorDetails

    from gen.distribution import Table

Location = tuple[int | str, ...]
"""Keys and indices of nested tables and arrays, from the outermost one to a value."""

LETTERS = 80  # most letters of a value in a message


@dataclass(frozen=True)
class _Fault:
    """One broken rule of a scene."""

    rule: (
        str  # pydantic's name of the rule, or "conflict", see `gen.distribution.conflict`
    )
    location: Location  # place of the value in the scene; empty for the whole scene
    value: object  # the wrong value; that of the whole table for a missing key
    generator: str  # generator whose table has the key; "" outside of the table [surface]
    message: str  # pydantic's message
    refusal: str  # message of a validator's ValueError; "" for other rules

    @property
    def key(self) -> str:
        """The location as a dotted key."""
        return dotted(self.location)

    @property
    def names(self) -> list[str]:
        """The keys of the location without the indices of arrays."""
        return [part for part in self.location if isinstance(part, str)]

    @classmethod
    def of(cls, details: ErrorDetails) -> _Fault:
        """Make the record of a fault that pydantic reports, with its location in the scene's file.

        Pydantic's locations inside the table `[surface]` contain the name of the generator too.
        """
        rule = details["type"]
        location = details["loc"]
        value = details["input"]
        if rule == "union_tag_invalid":
            # Pydantic gives the location of the whole table.
            location = (*location, "generator")
            value = value["generator"]
        generator = ""
        if len(location) > 1 and location[0] == "surface" and location[1] in TAGS:
            generator = str(location[1])
            location = ("surface", *location[2:])
        refusal = ""
        if rule == "value_error":
            refusal = str(details["ctx"]["error"])
        return cls(rule, location, value, generator, details["msg"], refusal)


def dotted(location: Location) -> str:
    """Write a location as a dotted key.

    Parameters
    ----------
    location : tuple of int and str
        Keys and indices from the outermost table to a value.

    Returns
    -------
    str
        The key, for example "delta.pieces[0].share"; "" for an empty location.
    """
    key = ""
    for part in location:
        key += f"[{part}]" if isinstance(part, int) else f".{part}"
    return key.removeprefix(".")


def shown(value: object) -> str:
    """Write a value for a message, in TOML's notation.

    Parameters
    ----------
    value : object
        A value of a scene; None for a missing one.

    Returns
    -------
    str
        At most `LETTERS` letters; the end of a longer value is left out.
    """
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return str(value).lower()
    try:
        text = repr(value)
    except ValueError:  # Python refuses to write out whole numbers of over 4,300 digits
        return "a number of thousands of digits"
    if len(text) > LETTERS:
        return f"{text[: LETTERS - 4]} ..."
    return text


def first_fault(error: ValidationError, root: type[Table]) -> str:
    """Describe the first fault of a scene, and count the others.

    Parameters
    ----------
    error : ValidationError
        What pydantic reports about the scene.
    root : type of Table
        The class of scenes.

    Returns
    -------
    str
        One line. A fault that is not a conflict of keys names the allowed values.
    """
    faults = [_Fault.of(details) for details in _causes(error)]
    text = _description(_most_telling(faults), root)
    if len(faults) == 1:
        return text
    return f"{text} (and {len(faults) - 1} more)"


def _causes(error: ValidationError) -> list[ErrorDetails]:
    """Return the reported faults, apart from missing keys of a table with an unknown key."""
    faults = error.errors(include_url=False)
    tables_with_slips = {
        fault["loc"][:-1] for fault in faults if fault["type"] == "extra_forbidden"
    }
    return [
        fault
        for fault in faults
        if fault["type"] != "missing" or fault["loc"][:-1] not in tables_with_slips
    ]


def _most_telling(faults: list[_Fault]) -> _Fault:
    """Return the first unknown key, which tells more than other faults, or else the first fault."""
    for fault in faults:
        if fault.rule == "extra_forbidden":
            return fault
    return faults[0]


def _description(fault: _Fault, root: type[Table]) -> str:
    """Return one line about a fault: its key and value, and a hint or the allowed values."""
    value = shown(fault.value)
    if fault.rule == "conflict":
        if not fault.key:
            return fault.message
        return f"{fault.key}: {fault.message}"
    if not fault.key:
        return f"a scene is a table of keys, not {value}"
    scene_keys = keys_of_scene(root, fault.generator)
    if fault.rule == "extra_forbidden":
        advice = hint(
            UnknownKey.of(fault.names, fault.value, fault.generator), scene_keys
        )
        return f"unknown key {fault.key} = {value}; {advice}"
    state = "is missing" if fault.rule == "missing" else f"= {value}"
    text = f"{fault.key} {state}; allowed: {_allowed_values(fault.names, scene_keys)}"
    if fault.refusal:
        return f"{text} ({fault.refusal})"
    return text


def _allowed_values(names: list[str], scene_keys: Mapping[str, str]) -> str:
    """Return in words what is allowed at a location, given by its keys from the outermost one.

    A value may lie inside a table that is a single value to scenes, as a distribution is one: then
    the words are those of the innermost key that scenes know.
    """
    inner = list(names)
    while ".".join(inner) not in scene_keys:
        inner.pop()
    return scene_keys[".".join(inner)]
