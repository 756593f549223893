"""Hints for unknown keys of a scene: which key is meant, or which keys the table has."""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, get_args

from gen.distribution import TABLES, Table
from gen.generators import TAGS

if TYPE_CHECKING:
    from pydantic.fields import FieldInfo

TRUTH = "true or false"
"""Allowed values of a key that switches something on."""

NEAR = 0.7
"""Smallest similarity of a misspelt key to the one that is meant, as `difflib` computes it."""

WRITTEN_BY_RUNS = frozenset(("source", "found", "against_found"))
"""Keys that a run writes, not a user."""

RANGED = frozenset(("delta", "load"))
"""Tables in which `range` stands for one piece."""

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
"""Keys of scenes, in the order of their priority, by other names of the field in lower case."""

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
"""Hints by tables and names, for names that no single key replaces."""

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
"""Hints for names of physics that no key switches on."""


@dataclass(frozen=True)
class UnknownKey:
    """A key of a scene that its table does not have.

    Attributes
    ----------
    table : str
        Dotted name of the table; "" for the scene itself.
    name : str
        Name of the key in lower case, with underscores.
    value : object
        Value that the scene gives to it.
    generator : str
        Generator of the scene's surfaces, for a key of `[surface]`.
    """

    table: str
    name: str
    value: object
    generator: str

    @classmethod
    def of(cls, names: Sequence[str], value: object, generator: str) -> UnknownKey:
        """Make the record of a key.

        Parameters
        ----------
        names : sequence of str
            Keys of the tables around it, from the outermost one, and its name as it is written.
        value : object
            Its value.
        generator : str
            Generator of the scene's surfaces, for a key of `[surface]`.

        Returns
        -------
        UnknownKey
            The record, whose name is compared with the keys that scenes know.
        """
        *tables, name = names
        return cls(
            table=".".join(tables),
            name=name.lower().replace("-", "_"),
            value=value,
            generator=generator,
        )

    @property
    def meanings(self) -> tuple[str, ...]:
        """The name, and the keys that it is a synonym of."""
        return (self.name, *SYNONYMS.get(self.name, ()))


def hint(key: UnknownKey, scene_keys: Mapping[str, str]) -> str:
    """Say which key is probably meant by an unknown one, or which keys its table has.

    Parameters
    ----------
    key : UnknownKey
        A key that its table does not have.
    scene_keys : mapping of str to str
        The keys of a scene with the same generator, from `keys_of_scene`.

    Returns
    -------
    str
        End of a sentence.
    """
    keys = _keys_of_table(key.table, scene_keys)
    return (
        _explanation(key)
        or _hint_at_synonym(key, keys)
        or _hint_at_other_generator(key)
        or _hint_at_misspelling(key, keys)
        or _hint_at_other_table(key, scene_keys)
        or _list_of_keys(key.table, keys)
    )


def _explanation(key: UnknownKey) -> str:
    """Return why no single key stands for this name, or "" for a name that is not explained."""
    of_table = EXPLAINED.get(key.table, {})
    return NOT_MODELLED.get(key.name, "") or of_table.get(key.name, "")


def _hint_at_synonym(key: UnknownKey, keys: Sequence[str]) -> str:
    """Say which of the keys of the table the name is a synonym of; "" if it is of none."""
    for synonym in SYNONYMS.get(key.name, ()):
        if synonym in keys:
            return f"it is called {_with_table(key.table, synonym)} here"
    return ""


def _hint_at_other_generator(key: UnknownKey) -> str:
    """Say which other generator has a key of `[surface]`, or a synonym of it; "" if none has."""
    if key.table != "surface":
        return ""
    for generator, table in TAGS.items():
        for name in key.meanings:
            if name in table.model_fields and name not in WRITTEN_BY_RUNS:
                present = f"and this scene has '{key.generator}'"
                return f"{name} is a key of the generator '{generator}', {present}"
    return ""


def _hint_at_other_table(key: UnknownKey, scene_keys: Mapping[str, str]) -> str:
    """Say which other table has a key of this name, or a synonym of it; "" if none has.

    The keys of `[store]` are names of quantities too, so that one of them is meant only by a value
    of true or false.
    """
    for candidate in scene_keys:
        table, _, name = candidate.rpartition(".")
        if name not in key.meanings or name in WRITTEN_BY_RUNS:
            continue
        if table != "store" or isinstance(key.value, bool):
            return f"it is a key of another table: {candidate}"
    return ""


def _list_of_keys(table: str, keys: Sequence[str]) -> str:
    """List the keys of a table, or of the scene itself if `table` is ""."""
    owner = "a scene"
    if table:
        owner = f"[{table}]"
    return f"the keys of {owner} are {_enumerated(sorted(keys), 'and')}"


def _keys_of_table(table: str, scene_keys: Mapping[str, str]) -> list[str]:
    """Return the names of the keys of a table that a user may write."""
    names = []
    for key in scene_keys:
        home, _, name = key.rpartition(".")
        if home == table and name not in WRITTEN_BY_RUNS:
            names.append(name)
    if table in RANGED:
        names.append("range")
    return names


def _with_table(table: str, name: str) -> str:
    """Write a key with its table; alone for a key of the scene itself, whose table is ""."""
    return f"{table}.{name}" if table else name


def _hint_at_misspelling(key: UnknownKey, keys: Sequence[str]) -> str:
    """Say which of the keys of the table the name is close to; "" if it is close to none.

    A name is close if most of its letters are those of the key in the same order, or if the words
    of one are among those of the other, as of hurst and hurst_exponent.
    """
    with_common_words = [name for name in keys if _share_all_words(key.name, name)]
    if with_common_words:
        matches = difflib.get_close_matches(key.name, with_common_words, n=1, cutoff=0.0)
    else:
        matches = difflib.get_close_matches(key.name, keys, n=1, cutoff=NEAR)
    if not matches:
        return ""
    return f"the closest known key is {_with_table(key.table, matches[0])}"


def _share_all_words(name: str, key: str) -> bool:
    """Return whether all words of a name are words of a key, or the reverse."""
    words = set(name.split("_"))
    words_of_key = set(key.split("_"))
    return words <= words_of_key or words >= words_of_key


def keys_of_scene(
    table: type[Table], generator: str = "", prefix: str = ""
) -> dict[str, str]:
    """Return every key of a scene with its allowed values in words.

    Parameters
    ----------
    table : type of Table
        The class of scenes, or of one of their tables.
    generator : str
        Generator whose table `[surface]` the scene has; "" for the first one, the default.
    prefix : str
        Beginning of the returned keys: the dotted name of a table and a dot; "" for a scene.

    Returns
    -------
    dict of str to str
        Allowed values by dotted keys without indices; a table comes before its keys.
    """
    surface = TAGS[generator or next(iter(TAGS))]
    single_values = {*TABLES.values(), *TAGS.values()} - {surface}
    keys = {}
    for name, field in table.model_fields.items():
        keys[prefix + name] = _allowed_in_words(name, field)
        for inner in _tables_in(field.annotation):
            if inner not in single_values:
                keys |= keys_of_scene(inner, generator, f"{prefix}{name}.")
    return keys


def _allowed_in_words(name: str, field: FieldInfo) -> str:
    """Return the allowed values of a key: its description, or what its type says."""
    if field.description is not None:
        return field.description
    values: Sequence[object] = get_args(field.annotation)
    if name == "generator":
        values = list(TAGS)
    names = [repr(value) for value in values if isinstance(value, str)]
    if not names:
        return TRUTH
    return _enumerated(names, "or")


def _enumerated(words: Sequence[str], conjunction: str) -> str:
    """Join one word or more by commas, and the last two by a conjunction."""
    *first_words, last = words
    if not first_words:
        return last
    return f"{', '.join(first_words)} {conjunction} {last}"


def _tables_in(annotation: Any) -> Iterator[type[Table]]:
    """Yield the classes of tables that an annotation names, also inside unions and tuples."""
    if isinstance(annotation, type) and issubclass(annotation, Table):
        yield annotation
    for inner in get_args(annotation):
        yield from _tables_in(inner)
