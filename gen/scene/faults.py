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

LETTERS = 80  # largest number of letters of a value in a message


@dataclass(frozen=True)
class _Fault:
    """One broken rule of a scene."""

    # pydantic's name of the rule, or "conflict", see `gen.distribution.conflict`
    rule: str
    location: Location  # location of the value in the scene; empty for the whole scene
    value: object  # the wrong value; for a missing key, the value of its whole table
    # Generator of the table [surface] that has the key; "" for other tables.
    generator: str
    message: str  # pydantic's message; for a conflict, the words of this project
    refusal: str  # message of the ValueError that a validator raised; "" for other rules

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
        """Make the record of a fault from pydantic's report.

        The location becomes that in the scene's file: inside the table `[surface]`, pydantic's
        locations also contain the name of the generator.
        """
        rule = details["type"]
        location = details["loc"]
        value = details["input"]
        if rule == "union_tag_invalid":
            # The generator is unknown. Pydantic gives the location and value of the whole table.
            location = (*location, "generator")
            value = value["generator"]
        generator = ""
        if len(location) > 1 and location[0] == "surface" and location[1] in TAGS:
            generator = str(location[1])
            location = ("surface", *location[2:])
        refusal = ""
        if rule == "value_error":
            refusal = str(details["ctx"]["error"])
        return cls(
            rule=rule,
            location=location,
            value=value,
            generator=generator,
            message=details["msg"],
            refusal=refusal,
        )


def dotted(location: Location) -> str:
    """Write a location as a key with dots.

    Parameters
    ----------
    location : tuple of int and str
        Keys and indices, from the outermost table to a value.

    Returns
    -------
    str
        The key, for example "delta.pieces[0].share"; "" for an empty location.
    """
    key = ""
    for part in location:
        if isinstance(part, int):
            key += f"[{part}]"
        else:
            key += f".{part}"
    return key.removeprefix(".")


def shown(value: object) -> str:
    """Write a value of a scene for a message.

    Parameters
    ----------
    value : object
        The value; None if there is none.

    Returns
    -------
    str
        "nothing" for None, otherwise the value as TOML writes it, or nearly so. The end is left out
        if there are more than `LETTERS` letters.
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
    """Describe one fault of a scene, and say how many more there are.

    Parameters
    ----------
    error : ValidationError
        Pydantic's report about the scene.
    root : type of Table
        The class of scenes.

    Returns
    -------
    str
        One line about the first unknown key, or about the first fault if no key is unknown. It has
        the key, its value and the allowed values or a hint; for keys that contradict each other it
        has the message of the rule.
    """
    faults = [_Fault.of(details) for details in _causes(error)]
    text = _description(_most_telling(faults), root)
    if len(faults) == 1:
        return text
    return f"{text} (and {len(faults) - 1} more)"


def _causes(error: ValidationError) -> list[ErrorDetails]:
    """Return pydantic's reports without reports of missing keys in tables that have unknown keys.

    If a table lacks a key and has an unknown one, the unknown key is probably the missing one,
    misspelt.
    """
    reports = error.errors(include_url=False)
    tables_with_unknown_key = {
        report["loc"][:-1] for report in reports if report["type"] == "extra_forbidden"
    }
    causes = []
    for report in reports:
        is_missing_key = report["type"] == "missing"
        if is_missing_key and report["loc"][:-1] in tables_with_unknown_key:
            continue
        causes.append(report)
    return causes


def _most_telling(faults: list[_Fault]) -> _Fault:
    """Return the first unknown key, as it may have caused other faults, or else the first fault."""
    for fault in faults:
        if fault.rule == "extra_forbidden":
            return fault
    return faults[0]


def _description(fault: _Fault, root: type[Table]) -> str:
    """Return one line about a fault: its key and value, and a hint or the allowed values.

    `root` is the class of scenes.
    """
    value = shown(fault.value)
    if fault.rule == "conflict":
        if not fault.key:  # The keys are in different tables.
            return fault.message
        return f"{fault.key}: {fault.message}"
    if not fault.key:  # The scene itself has a wrong type.
        return f"a scene is a table of keys, not {value}"
    scene_keys = keys_of_scene(root, fault.generator)
    if fault.rule == "extra_forbidden":
        unknown = UnknownKey.of(fault.names, fault.value, fault.generator)
        advice = hint(unknown, scene_keys)
        return f"unknown key {fault.key} = {value}; {advice}"
    state = "is missing" if fault.rule == "missing" else f"= {value}"
    text = f"{fault.key} {state}; allowed: {_allowed_values(fault.names, scene_keys)}"
    if fault.refusal:
        return f"{text} ({fault.refusal})"
    return text


def _allowed_values(names: list[str], scene_keys: Mapping[str, str]) -> str:
    """Return the allowed values of a key in words.

    `names` are the keys of its location, from the outermost one. The innermost ones may be keys of
    a distribution, which are not in `scene_keys`. Then the words are about the key that has the
    distribution as its value.
    """
    known_names = list(names)
    while ".".join(known_names) not in scene_keys:
        known_names.pop()
    return scene_keys[".".join(known_names)]
