"""The columns of a scene's database: the common ones, and those of its generator and functions."""

from collections.abc import Iterator
from dataclasses import replace

from gen.generators import GENERATORS
from gen.runtime.errors import InputError
from gen.scene.scene import Scene
from gen.schema import (
    COLUMNS,
    DRAWN_NAMES,
    RUNTIME,
    Column,
)

ARGUMENTS = ("shape", "spacing", "rng")
"""Names that parameters of a user's generator cannot have, which is called with these."""

TAKEN = "is the name of something else; give a name of your own"


def _of_generators() -> Iterator[Column]:
    """Yield the columns of all generators: where surfaces were taken from, and parameters."""
    columns = {}
    owners: dict[str, list[str]] = {}
    for table in GENERATORS:
        known = table.PARAMETERS
        for name in (*table.PLACES, *known):
            owners.setdefault(name, []).extend(f"`{each}`" for each in table.NAMES)
        for name, words in table.PLACES.items():
            columns[name] = Column(name, "i4", "1", words)
        for name, (unit, words, span) in known.items():
            own = DRAWN_NAMES.get(name, name)
            columns[name] = Column(own, "f8", unit, words, paper_range=span)
    for name, column in sorted(columns.items(), key=lambda each: each[1].dtype != "i4"):
        *others, last = owners[name]
        several = f"the generators {', '.join(others)} and {last}"
        yield replace(column, optional=several if others else f"the generator {last}")


_PLACE = [column.name for column in COLUMNS].index("surface") + 1
ALL_COLUMNS = (*COLUMNS[:_PLACE], *_of_generators(), *COLUMNS[_PLACE:])
"""Every column that a database can have, in the order of the file."""

RESERVED = frozenset(
    (*(column.name for column in ALL_COLUMNS), *DRAWN_NAMES, RUNTIME, "sample", "x", "y", "area")
)
"""Names that outputs of a user's function cannot have: columns, dimensions, groups and targets."""


def columns_for(scene: Scene) -> tuple[Column, ...]:
    """Return a scene's columns in the file's order: common, asked for, the user's own."""
    parameters = parameter_columns(scene)
    asked_for = {parameters.get(name, name) for name in scene.optional_columns}
    chosen = [column for column in ALL_COLUMNS if not column.optional or column.name in asked_for]
    names = [column.name for column in chosen]
    if "load" in names:
        load = names.index("load")
        chosen[load] = replace(chosen[load], unit=scene.load_unit, long_name=scene.quantity)
    own = tuple(
        Column(name, "f8", "1", f"parameter of {scene.surface.generator}")
        for name in parameters.values()
        if name not in names
    )
    outputs = tuple(
        Column(
            name, "f8", unit, f"output of {scene.store.function}", bounds=scene.store.bounds(name)
        )
        for name, unit in (scene.store.outputs or {}).items()
    )
    place = names.index("surface") + 1
    last = next(index for index, column in enumerate(chosen) if column.group)
    return (*chosen[:place], *own, *chosen[place:last], *outputs, *chosen[last:])


def parameter_columns(scene: Scene) -> dict[str, str]:
    """Return the columns of the parameters of a scene's surfaces, by the parameters' names."""
    return {name: DRAWN_NAMES.get(name, name) for name in scene.drawn_parameters}


def require_own_names(scene: Scene) -> None:
    """Refuse parameters and outputs of a user's functions that have the names of other columns.

    Parameters of a user's generator may have the names that other generators' parameters have.
    """
    known = {name for table in GENERATORS for name in table.PARAMETERS}
    for name in scene.drawn_parameters:
        if name in RESERVED - known or name in ARGUMENTS:
            raise InputError(f"surface.parameters.{name}: {name} {TAKEN}, as own_{name}")
    for name in scene.store.outputs or ():
        if name in RESERVED or name in scene.drawn_parameters:
            raise InputError(f"store.outputs.{name}: {name} {TAKEN}, as own_{name}")
    outputs = scene.store.outputs
    for name in (*(scene.store.least or ()), *(scene.store.most or ())):
        if outputs is not None and name not in outputs:
            raise InputError(f"store: {name} has bounds; the outputs are {', '.join(outputs)}")


def row_bytes(scene: Scene) -> int:
    """Return the size of one row of a scene's database, all columns together [bytes]."""
    return sum(column.row_bytes(scene.shape) for column in columns_for(scene))


def markdown_table() -> str:
    """Write the table of columns of `docs/how-to/reading.md` and `gen/columns.md`, in Markdown."""
    lines = ["| Column | Unit | Meaning | Paper's range |", "|---|---|---|---|"]
    for column in ALL_COLUMNS:
        span = "{:g} to {:g}".format(*column.paper_range) if column.paper_range else ""
        shape = ", nx x ny per sample" if column.shape_of else ""
        condition = f" (with {column.optional})" if column.optional else ""
        meaning = f"{column.long_name}{shape}{condition}"
        lines.append(f"| `{column.path}` | {column.unit} | {meaning} | {span} |")
    return "\n".join(lines)
