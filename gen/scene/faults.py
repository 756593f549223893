"""Messages about scenes: what breaks a rule, and what differs between two of them."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, get_args

from pydantic import ValidationError

from gen.distribution import TABLES, Table
from gen.generators import TAGS

if TYPE_CHECKING:
    from pydantic_core import ErrorDetails

    from gen.scene.scene import Scene

Location = tuple[int | str, ...]
TRUTH = "true or false"

NEAR = 0.7  # least share of common letters of a misspelt key and the one that is meant

WRITTEN = frozenset(
    ("source", "found", "against_found")
)  # keys that a run writes, not a user

RANGED = frozenset(("delta", "load"))  # tables in which `range` stands for one piece

SYNONYMS: dict[str, tuple[str, ...]] = {
    **dict.fromkeys(
        ("young", "youngs_modulus", "e", "elastic_modulus", "stiffness"), ("modulus",)
    ),
    **dict.fromkeys(("nu", "poissons_ratio"), ("poisson",)),
    **dict.fromkeys(
        ("yield", "yield_stress", "yield_strength", "h"), ("hardness", "hurst")
    ),
    **dict.fromkeys(("tol", "tolerance", "accuracy"), ("rtol",)),
    **dict.fromkeys(("rms", "sq", "rq", "height_rms", "sigma"), ("rms_height", "sigma0")),
    **dict.fromkeys(("sdq", "slope_rms", "slope"), ("rms_slope",)),
    **dict.fromkeys(("length", "width", "size", "l"), ("side",)),
    **dict.fromkeys(("n", "points", "pixels", "grid"), ("nodes", "samples")),
    **dict.fromkeys(("min", "max", "low", "high", "limits", "values"), ("range",)),
    **dict.fromkeys(("lambda_r", "lambda_l", "longest_wave"), ("roll_off",)),
    **dict.fromkeys(("lambda_s", "shortest_wave"), ("cut_off",)),
}
"""Names that the field has for keys, in lower case, and the keys in the order of their priority."""

EXPLAINED = {
    "contact": dict.fromkeys(
        ("e_star", "estar", "e*", "effective_modulus", "plane_strain_modulus"),
        "E* follows from contact.modulus and contact.poisson: modulus / (1 - poisson^2)",
    ),
    "load": {
        quantity: f"give quantity = '{quantity}' and range = [low, high]"
        for quantity in ("delta", "pressure", "force")
    },
}
"""What is said of names, by their tables, that no single key replaces."""

NOT_MODELLED = {
    **dict.fromkeys(
        ("friction", "mu", "friction_coefficient"),
        "friction is not modelled: contacts have none",
    ),
    **dict.fromkeys(
        ("adhesion", "work_of_adhesion", "surface_energy"),
        "adhesion is not modelled: contacts have none",
    ),
}
"""What is said of names for physics that no key switches on."""

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
    faults = _without_consequences(error.errors(include_url=False))
    # A key that is not known is the better news than a value that is not allowed.
    fault = min(faults, key=lambda fault: fault["type"] != "extra_forbidden")
    location, given, kind = fault["loc"], fault["input"], fault["type"]
    if kind == "union_tag_invalid":
        location, given = (*location, "generator"), given["generator"]
    tag = str(location[1]) if location[:1] == ("surface",) and len(location) > 1 else ""
    parts = (location[0], *location[2:]) if tag in TAGS else location
    key, value = dotted(parts), shown(given)
    known = _known_keys(root, tag if tag in TAGS else next(iter(TAGS)))
    if kind == "extra_forbidden":
        text = f"unknown key {key} = {value}; {_hint(parts, given, known, tag)}"
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


def _without_consequences(faults: list[ErrorDetails]) -> list[ErrorDetails]:
    """Leave out keys that are missing because another key of their table is misspelt."""
    misspelt = {
        fault["loc"][:-1] for fault in faults if fault["type"] == "extra_forbidden"
    }
    return [
        fault
        for fault in faults
        if fault["type"] != "missing" or fault["loc"][:-1] not in misspelt
    ]


def _hint(parts: Location, given: object, known: Mapping[str, str], tag: str) -> str:
    """Say which key is probably meant by an unknown one, or which keys its table has.

    `known` are the keys of a scene with the generator `tag`, as `_known_keys` returns them.
    """
    *path, last = (part for part in parts if isinstance(part, str))
    table, name = ".".join(path), last.lower().replace("-", "_")
    keys = _keys_of(table, known)
    if name in NOT_MODELLED:
        return NOT_MODELLED[name]
    if name in EXPLAINED.get(table, {}):
        return EXPLAINED[table][name]
    for synonym in SYNONYMS.get(name, ()):
        if synonym in keys:
            return f"it is called {_joined(table, synonym)} here"
    if table == "surface" and (hint := _hint_of_generators(name, tag)):
        return hint
    if nearest := _nearest(name, keys):
        return f"the closest known key is {_joined(table, nearest)}"
    return _hint_elsewhere(table, name, given, known)


def _hint_of_generators(name: str, tag: str) -> str:
    """Say which other generator has a key of this name, or a synonym of it; "" if none has."""
    for generator, table in TAGS.items():
        for each in (name, *SYNONYMS.get(name, ())):
            if each in table.model_fields and each not in WRITTEN:
                present = f"and this scene has '{tag}'"
                return f"{each} is a key of the generator '{generator}', {present}"
    return ""


def _hint_elsewhere(
    table: str, name: str, given: object, known: Mapping[str, str]
) -> str:
    """Say which other table has a key of this name, or a synonym of it, or list the table's keys.

    The keys of [store] are names of quantities too: one of them is meant by true or false alone.
    """
    names = (name, *SYNONYMS.get(name, ()))
    for key in known:
        home, _, last = key.rpartition(".")
        if (
            last in names
            and last not in WRITTEN
            and (home != "store" or isinstance(given, bool))
        ):
            return f"it is a key of another table: {key}"
    *others, final = sorted(_keys_of(table, known))
    owner = f"[{table}]" if table else "a scene"
    return f"the keys of {owner} are {', '.join(others)} and {final}"


def _keys_of(table: str, known: Mapping[str, str]) -> list[str]:
    """Return the names of the keys of a table that a user may write."""
    inside = (key.rpartition(".") for key in known)
    names = [name for home, _, name in inside if home == table and name not in WRITTEN]
    return [*names, "range"] if table in RANGED else names


def _joined(table: str, name: str) -> str:
    """Write a key with its table."""
    return f"{table}.{name}" if table else name


def _nearest(name: str, keys: Sequence[str]) -> str:
    """Return the key that a misspelt name is near to, or an empty text.

    A name is near if most of its letters are those of the key in the same order, or if the words of
    one are among those of the other, as of hurst and hurst_exponent.
    """
    words = set(name.split("_"))
    akin = [
        key
        for key in keys
        if words <= set(key.split("_")) or words >= set(key.split("_"))
    ]
    close = difflib.get_close_matches(
        name, akin or keys, n=1, cutoff=0.0 if akin else NEAR
    )
    return close[0] if close else ""


def _known_keys(table: type[Table], tag: str, prefix: str = "") -> dict[str, str]:
    """Return every key of a scene, dotted and without indices, with its allowed values in words."""
    foreign = {*TAGS.values(), *TABLES.values()} - {TAGS[tag]}
    known = {}
    for name, field in table.model_fields.items():
        words = field.description
        if words is None:  # its type says it: some names, or a truth value
            names = TAGS if name == "generator" else get_args(field.annotation)
            *others, last = [repr(each) for each in names if isinstance(each, str)] or [
                TRUTH
            ]
            words = f"{', '.join(others)} or {last}" if others else last
        known[prefix + name] = words
        inner = get_args(field.annotation)
        for kind in (
            field.annotation,
            *inner,
            *(each for arg in inner for each in get_args(arg)),
        ):
            if isinstance(kind, type) and issubclass(kind, Table) and kind not in foreign:
                known |= _known_keys(kind, tag, f"{prefix}{name}.")
    return known


def differences(
    in_file: Scene,
    asked_for: Scene,
    words: tuple[str, str] = ("in the file", "asked for"),
) -> list[str]:
    """List keys that change results and differ, as "seed: 1 in the file, 2 asked for".

    `words` say where the two values stand.
    """
    in_one, in_other = words
    old = dict(_leaves(in_file.relevant()))
    new = dict(_leaves(asked_for.relevant()))
    hashes = {("surface", "source"), ("store", "source")}
    return [
        f"{dotted(key)}: the source of the function's module has changed"
        if key in hashes and key in old and key in new
        else f"{dotted(key)}: {shown(old.get(key))} {in_one}, {shown(new.get(key))} {in_other}"
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
