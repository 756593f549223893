"""Hints for unknown keys of a scene: the key that is probably meant, or all keys of the table."""

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
"""Allowed values of a key that is true or false."""

NEAR = 0.7
"""Smallest similarity of a misspelt name and a key, from 0 to 1, as `difflib` computes it."""

WRITTEN_BY_RUNS = frozenset(("source", "found", "against_found"))
"""Keys that a run writes and a user does not. Hints do not name them."""

RANGED = frozenset(("delta", "load"))
"""Tables with the key `range`, which a scene replaces by `pieces` when it is read."""

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
"""Keys of scenes by other names that the field has for them, in lower case. The first key that the
table has is the one that a hint names."""

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
"""Hints by table and name, for names that no single key replaces."""

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
"""Hints by name, for physics that the solver does not model."""


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
        Value of the key in the scene.
    generator : str
        Generator of the scene's surfaces for a key of `[surface]`, otherwise "".
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
            Keys of the tables around the key, from the outermost one, and then the key itself.
        value : object
            Value of the key in the scene.
        generator : str
            Generator of the scene's surfaces for a key of `[surface]`, otherwise "".

        Returns
        -------
        UnknownKey
            The record. Its name is in lower case, and dashes have become underscores.
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
    """Say which key a user probably meant by an unknown key, or which keys its table has.

    Parameters
    ----------
    key : UnknownKey
        A key that its table does not have.
    scene_keys : mapping of str to str
        The keys of a scene with the same generator, from `keys_of_scene`.

    Returns
    -------
    str
        A sentence without its full stop, which follows the unknown key and a semicolon.
    """
    keys = _keys_of_table(key.table, scene_keys)
    # The surest hint comes first; each function returns "" if it has none.
    return (
        _explanation(key)
        or _hint_at_synonym(key, keys)
        or _hint_at_other_generator(key)
        or _hint_at_misspelling(key, keys)
        or _hint_at_other_table(key, scene_keys)
        or _list_of_keys(key.table, keys)
    )


def _explanation(key: UnknownKey) -> str:
    """Return the hint of `NOT_MODELLED` or `EXPLAINED` for a name; "" if they have none."""
    hints_of_table = EXPLAINED.get(key.table, {})
    return NOT_MODELLED.get(key.name, "") or hints_of_table.get(key.name, "")


def _hint_at_synonym(key: UnknownKey, keys: Sequence[str]) -> str:
    """Say which key of its table the name is a synonym of; return "" if it is a synonym of none.

    `keys` are the keys of the table.
    """
    for synonym in SYNONYMS.get(key.name, ()):
        if synonym in keys:
            return f"it is called {_with_table(key.table, synonym)} here"
    return ""


def _hint_at_other_generator(key: UnknownKey) -> str:
    """Say which other generator has a key of `[surface]`, or its synonym; return "" if none has."""
    if key.table != "surface":
        return ""
    for generator, table in TAGS.items():
        for name in key.meanings:
            if name in table.model_fields and name not in WRITTEN_BY_RUNS:
                return (
                    f"{name} is a key of the generator '{generator}',"
                    f" and this scene has '{key.generator}'"
                )
    return ""


def _hint_at_other_table(key: UnknownKey, scene_keys: Mapping[str, str]) -> str:
    """Say which other table has a key of this name, or its synonym; return "" if none has.

    A key of `[store]` is named only if the unknown key is true or false, because keys of `[store]`
    are also names of quantities.
    """
    for candidate in scene_keys:
        table, _, name = candidate.rpartition(".")
        if name not in key.meanings or name in WRITTEN_BY_RUNS:
            continue
        if table != "store" or isinstance(key.value, bool):
            return f"it is a key of another table: {candidate}"
    return ""


def _list_of_keys(table: str, keys: Sequence[str]) -> str:
    """Return a sentence with the keys of a table, or of the scene itself if `table` is ""."""
    owner = "a scene"
    if table:
        owner = f"[{table}]"
    return f"the keys of {owner} are {_enumerated(sorted(keys), 'and')}"


def _keys_of_table(table: str, scene_keys: Mapping[str, str]) -> list[str]:
    """Return the names of the keys of a table, "" for the scene itself, that a user may write."""
    names = []
    for key in scene_keys:
        table_of_key, _, name = key.rpartition(".")
        if table_of_key == table and name not in WRITTEN_BY_RUNS:
            names.append(name)
    if table in RANGED:
        names.append("range")
    return names


def _with_table(table: str, name: str) -> str:
    """Return the dotted key of a name in a table; the name alone if `table` is ""."""
    if not table:
        return name
    return f"{table}.{name}"


def _hint_at_misspelling(key: UnknownKey, keys: Sequence[str]) -> str:
    """Say which key of its table the name is close to; return "" if it is close to none.

    `keys` are the keys of the table. A key is close if all words of the name are words of the key
    or the reverse, as for hurst and hurst_exponent, or else if most letters agree in their order.
    """
    with_common_words = [name for name in keys if _share_all_words(key.name, name)]
    if with_common_words:  # Take the most similar one, however similar it is.
        matches = difflib.get_close_matches(key.name, with_common_words, n=1, cutoff=0.0)
    else:
        matches = difflib.get_close_matches(key.name, keys, n=1, cutoff=NEAR)
    if not matches:
        return ""
    return f"the closest known key is {_with_table(key.table, matches[0])}"


def _share_all_words(name: str, key: str) -> bool:
    """Tell whether all words of a name are words of a key, or all words of the key of the name."""
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
        The class of scenes, or of a table inside a scene.
    generator : str
        Generator of the scene's table `[surface]`; "" for the first generator, which is the
        default.
    prefix : str
        Beginning of the returned keys: "" for a scene, otherwise the dotted name of the table and a
        dot.

    Returns
    -------
    dict of str to str
        Allowed values by dotted keys without indices. A table comes before its keys. The keys of
        distributions and of other generators are left out.
    """
    default_generator = next(iter(TAGS))
    surface = TAGS[generator or default_generator]
    left_out = {*TABLES.values(), *TAGS.values()} - {surface}
    keys = {}
    for name, field in table.model_fields.items():
        keys[prefix + name] = _allowed_in_words(name, field)
        for inner in _tables_in(field.annotation):
            if inner not in left_out:
                keys |= keys_of_scene(inner, generator, prefix=f"{prefix}{name}.")
    return keys


def _allowed_in_words(name: str, field: FieldInfo) -> str:
    """Return the allowed values of a key in words: its description, or the choices of its type.

    A key without both is true or false.
    """
    if field.description is not None:
        return field.description
    values: Sequence[object] = get_args(field.annotation)
    if name == "generator":  # The type of the field has only the names of one class.
        values = list(TAGS)
    choices = [repr(value) for value in values if isinstance(value, str)]
    if not choices:
        return TRUTH
    return _enumerated(choices, "or")


def _enumerated(words: Sequence[str], conjunction: str) -> str:
    """Join words by commas, and the last two by a conjunction; there is at least one word."""
    *first_words, last = words
    if not first_words:
        return last
    return f"{', '.join(first_words)} {conjunction} {last}"


def _tables_in(annotation: Any) -> Iterator[type[Table]]:
    """Yield the classes of tables in an annotation, also inside unions and tuples."""
    if isinstance(annotation, type) and issubclass(annotation, Table):
        yield annotation
    for inner in get_args(annotation):
        yield from _tables_in(inner)
