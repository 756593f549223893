"""Messages about scenes: what breaks a rule, and what differs between two of them."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterator
from typing import TYPE_CHECKING, get_args

from pydantic import ValidationError

from gen.distribution import TABLES, Table
from gen.generators import TAGS

if TYPE_CHECKING:
    from gen.scene.scene import Scene

Location = tuple[int | str, ...]
TRUTH = "true or false"

DOTTED = re.compile(r"(?:\.[^=.,\n]*+){100}")
"""A key of TOML that would keep its parser busy, as the time grows with the square of its dots."""


def dotted(location: Location) -> str:
    """Write a location as a dotted key, for example "delta.pieces[0].share"."""
    parts = (f"[{part}]" if isinstance(part, int) else f".{part}" for part in location)
    return "".join(parts).removeprefix(".")


def shown(value: object) -> str:
    """Write a value for a message: short, and in TOML's notation."""
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return str(value).lower()
    try:
        text = repr(value)
    except ValueError:  # Python refuses to write out whole numbers of over 4,300 digits
        text = "a number of thousands of digits"
    return text if len(text) <= 80 else f"{text[:76]} ..."


def first_fault(error: ValidationError, root: type[Table]) -> str:
    """Describe the first fault of a scene in one line, and say how many more there are."""
    faults = error.errors(include_url=False)
    # A misspelt key makes another one look missing: the misspelt one is the better news.
    fault = min(faults, key=lambda fault: fault["type"] != "extra_forbidden")
    location, given, kind = fault["loc"], fault["input"], fault["type"]
    if kind == "union_tag_invalid":
        location, given = (*location, "generator"), given["generator"]
    tag = str(location[1]) if location[:1] == ("surface",) and len(location) > 1 else ""
    parts = (location[0], *location[2:]) if tag in TAGS else location
    key, value = dotted(parts), shown(given)
    known = _known_keys(root, tag if tag in TAGS else next(iter(TAGS)))
    if kind == "extra_forbidden":
        # Of keys with the same last name the one in the same table is meant.
        nearest = sorted(known, key=lambda name: name.startswith(f"{location[0]}."))
        names = {name.rpartition(".")[2]: name for name in nearest}
        (closest,) = difflib.get_close_matches(str(location[-1]), names, n=1, cutoff=0.0)
        text = f"unknown key {key} = {value}; the closest known key is {names[closest]}"
    elif kind == "conflict":
        text = f"{key}: {fault['msg']}".removeprefix(": ")
    elif not key:
        text = f"a scene is a table of keys, not {value}"
    else:
        path = [part for part in parts if isinstance(part, str)]
        while dotted((*path,)) not in known:  # inside a value that is not a table of keys
            path.pop()
        said = "is missing" if kind == "missing" else f"= {value}"
        text = f"{key} {said}; allowed: {known[dotted((*path,))]}"
    if kind == "value_error":
        text += f" ({fault['ctx']['error']})"
    return text if len(faults) == 1 else f"{text} (and {len(faults) - 1} more)"


def _known_keys(table: type[Table], tag: str, prefix: str = "") -> dict[str, str]:
    """Return every key of a scene, dotted and without indices, with its allowed values in words."""
    foreign = {*TAGS.values(), *TABLES.values()} - {TAGS[tag]}
    known = {}
    for name, field in table.model_fields.items():
        words = field.description
        if words is None:  # its type says it: some names, or a truth value
            names = TAGS if name == "generator" else get_args(field.annotation)
            *others, last = [repr(each) for each in names if isinstance(each, str)] or [TRUTH]
            words = f"{', '.join(others)} or {last}" if others else last
        known[prefix + name] = words
        inner = get_args(field.annotation)
        for kind in (field.annotation, *inner, *(each for arg in inner for each in get_args(arg))):
            if isinstance(kind, type) and issubclass(kind, Table) and kind not in foreign:
                known |= _known_keys(kind, tag, f"{prefix}{name}.")
    return known


def differences(in_file: Scene, asked_for: Scene) -> list[str]:
    """List keys that change results and differ, as "seed: 1 in the file, 2 asked for"."""
    old = dict(_leaves(in_file.relevant()))
    new = dict(_leaves(asked_for.relevant()))
    hashes = {("surface", "source"), ("store", "source")}
    return [
        f"{dotted(key)}: the source of the function's module has changed"
        if key in hashes and key in old and key in new
        else f"{dotted(key)}: {shown(old.get(key))} in the file, {shown(new.get(key))} asked for"
        for key in old | new
        if old.get(key) != new.get(key)
    ]


def _leaves(value: object, location: Location = ()) -> Iterator[tuple[Location, object]]:
    """Yield every single value of nested tables and arrays with its location."""
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from _leaves(inner, (*location, name))
    elif isinstance(value, tuple):
        for index, inner in enumerate(value):
            yield from _leaves(inner, (*location, index))
    else:
        yield location, value
