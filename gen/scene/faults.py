"""Messages about a scene that breaks a rule: the key, its value, and the allowed values."""

import difflib
from collections.abc import Iterator
from typing import Any, get_args

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from gen.scene.distribution import TABLES
from gen.scene.surface import TAGS
from gen.scene.table import Table
from gen.scene.words import Location, dotted, shown


def first_fault(error: ValidationError, root: type[Table]) -> str:
    """Describe the first fault of a scene, and say how many more there are.

    Parameters
    ----------
    error : ValidationError
        All faults.
    root : type of Table
        The table that the locations of faults begin at.

    Returns
    -------
    str
        One line.
    """
    faults = error.errors(include_url=False)
    # A misspelt key makes another one look missing: the misspelt one is the better news.
    fault = min(faults, key=lambda fault: fault["type"] != "extra_forbidden")
    text = _described(fault, root)
    if fault["type"] == "value_error":
        text += f" ({fault['ctx']['error']})"
    return text if len(faults) == 1 else f"{text} (and {len(faults) - 1} more)"


def _described(fault: ErrorDetails, root: type[Table]) -> str:
    """Describe one fault of a scene."""
    location, value = fault["loc"], shown(fault["input"])
    key = dotted(tuple(part for part in location if part not in TAGS))
    if fault["type"] == "extra_forbidden":
        return _unknown(location, key, value, root)
    if fault["type"] == "missing":
        return f"{key} is missing; allowed: {_allowed(location, root)}"
    if fault["type"] == "conflict":
        return f"{key}: {fault['msg']}".removeprefix(": ")
    if not key:
        return f"a scene is a table of keys, not {value}"
    return f"{key} = {value}; allowed: {_allowed(location, root)}"


def _unknown(location: Location, key: str, value: str, root: type[Table]) -> str:
    """Describe a key that no table has, or only the table of another generator."""
    tags = [part for part in location if part in TAGS]
    owners = [name for name, table in TAGS.items() if location[-1] in table.model_fields]
    if len(location) == 3 and tags and owners:
        there = " or ".join(f"'{name}'" for owner in owners for name in _generators(TAGS[owner]))
        return f"unknown key {key} = {value} of this generator; it is one of {there}"
    known = dict(_known_keys(root, str(tags[0]) if tags else "<displaced>"))
    # Of keys with the same last name the one in the same table is meant.
    nearest = sorted(known, key=lambda name: name.startswith(f"{location[0]}."))
    names = {known_key.rpartition(".")[2]: known_key for known_key in nearest}
    closest = names[difflib.get_close_matches(str(location[-1]), names, n=1, cutoff=0.0)[0]]
    return f"unknown key {key} = {value}; the closest known key is {closest}"


def _generators(table: type[Table]) -> tuple[str, ...]:
    """Return the names of the generators that a table of surfaces describes."""
    return get_args(table.model_fields["generator"].annotation)


def _allowed(location: Location, root: type[Table]) -> str:
    """Return the allowed values, in words, of the key that a location belongs to."""
    tags = [str(part) for part in location if part in TAGS]
    known = dict(_known_keys(root, tags[0] if tags else "<displaced>"))
    names = [part for part in location if isinstance(part, str) and part not in TAGS]
    while dotted(tuple(names)) not in known:  # inside a value that is not a table of keys
        names.pop()
    return known[dotted(tuple(names))]


def _known_keys(table: type[Table], tag: str, prefix: str = "") -> Iterator[tuple[str, str]]:
    """Yield every key of a scene, dotted and without indices, with its allowed values in words."""
    for name, field in table.model_fields.items():
        yield prefix + name, field.description or ""
        for kind in _tables(field.annotation, tag):
            yield from _known_keys(kind, tag, f"{prefix}{name}.")


def _tables(annotation: Any, tag: str) -> Iterator[type[Table]]:
    """Yield the tables of keys that a value may be; of surfaces only those with a tag."""
    kinds = [annotation, *(kind for arg in get_args(annotation) for kind in (arg, *get_args(arg)))]
    others = {*TAGS.values(), *TABLES.values()} - {TAGS[tag]}
    for kind in kinds:
        if isinstance(kind, type) and issubclass(kind, Table) and kind not in others:
            yield kind
