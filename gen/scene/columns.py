"""The columns of a scene's database: the common ones, and those of its generator and functions."""

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


def generator_columns() -> tuple[Column, ...]:
    """Return the columns of all generators: where surfaces were taken from, and parameters."""
    places = {name: words for table in GENERATORS for name, words in table.PLACES.items()}
    drawn = {name: each for table in GENERATORS for name, each in table.known_parameters().items()}
    return (
        *(
            Column(name, "i4", "1", words, optional=_generators(name))
            for name, words in places.items()
        ),
        *(
            Column(
                DRAWN_NAMES.get(name, name),
                "f8",
                each.unit,
                each.long_name,
                paper_range=each.paper_range,
                optional=_generators(name),
            )
            for name, each in drawn.items()
        ),
    )


def _generators(name: str) -> str:
    """Name the generators that have a place or a parameter, in Markdown."""
    owners = (table for table in GENERATORS if name in {**table.PLACES, **table.known_parameters()})
    *others, last = (f"`{each}`" for table in owners for each in table.names())
    return f"the generators {', '.join(others)} and {last}" if others else f"the generator {last}"


_PLACE = [column.name for column in COLUMNS].index("surface") + 1
ALL_COLUMNS = (*COLUMNS[:_PLACE], *generator_columns(), *COLUMNS[_PLACE:])
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
    known = {name for table in GENERATORS for name in table.known_parameters()}
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
    """Write the table of columns that stands in `docs/how-to/reading.md`, in Markdown."""
    lines = ["| Column | Unit | Meaning | Paper's range |", "|---|---|---|---|"]
    for column in ALL_COLUMNS:
        span = "{:g} to {:g}".format(*column.paper_range) if column.paper_range else ""
        shape = ", nx x ny per sample" if column.shape_of else ""
        condition = f" (with {column.optional})" if column.optional else ""
        meaning = f"{column.long_name}{shape}{condition}"
        lines.append(f"| `{column.path}` | {column.unit} | {meaning} | {span} |")
    return "\n".join(lines)
