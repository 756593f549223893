"""The columns of a scene's database: common ones, parameters of surfaces, a user's own outputs."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from gen.generators import GENERATORS
from gen.quantities import Powers, stored_quantities
from gen.runtime.errors import InputError
from gen.scene.scene import Scene
from gen.scene.tables import Store
from gen.schema import CHECKSUM, COLUMNS, DRAWN_NAMES, REASON, RUNTIME, Column
from gen.surface import GeneratedSurface

ARGUMENTS = ("shape", "spacing", "rng")
"""Arguments of a user's generator, which no parameter of it can be called."""

TAKEN = "is the name of something else; give a name of your own"


def columns_of_generators(
    generators: Sequence[type[GeneratedSurface]] = GENERATORS,
) -> tuple[Column, ...]:
    """Return the columns of generators: where surfaces were taken from, then parameters.

    Parameters
    ----------
    generators : sequence of type
        Tables of surfaces; all that exist by default.

    Returns
    -------
    tuple of Column
        A column for each name, with the words of the first generator that has it.

    Raises
    ------
    ValueError
        If two generators share a name, and state two units for it.
    """
    columns: dict[str, Column] = {}
    owners: dict[str, list[str]] = {}  # generators that have a column, by its name
    for table in generators:
        for column in _columns_of(table):
            first = columns.setdefault(column.name, column)
            if (column.unit, column.dtype) != (first.unit, first.dtype):
                raise ValueError(
                    f"the generators {owners[column.name][0]} and `{table.NAMES[0]}` share the"
                    f" parameter {column.name}, one in {first.unit!r}, the other in"
                    f" {column.unit!r}: give it one unit, or two names"
                )
            owners.setdefault(column.name, []).extend(f"`{name}`" for name in table.NAMES)
    conditional = [
        replace(column, optional=_condition(owners[name]))
        for name, column in columns.items()
    ]
    places = [column for column in conditional if column.dtype == "i4"]
    parameters = [column for column in conditional if column.dtype != "i4"]
    return (*places, *parameters)


def _columns_of(table: type[GeneratedSurface]) -> Iterator[Column]:
    """Yield the columns of one generator: where its surfaces were taken from, then parameters."""
    for name, words in table.PLACES.items():
        yield Column(name, "i4", "1", words)
    for name, parameter in table.PARAMETERS.items():
        yield Column(
            DRAWN_NAMES.get(name, name),
            "f8",
            parameter.unit,
            parameter.long_name,
            paper_range=parameter.paper_range,
        )


def _condition(generators: Sequence[str]) -> str:
    """Say which generators have a column; the names are in Markdown."""
    *first_names, last = generators
    if not first_names:
        return f"the generator {last}"
    return f"the generators {', '.join(first_names)} and {last}"


def _all_columns() -> tuple[Column, ...]:
    """Return the columns of all generators behind the column of the surface's index."""
    place = [column.name for column in COLUMNS].index("surface") + 1
    return (*COLUMNS[:place], *columns_of_generators(), *COLUMNS[place:])


ALL_COLUMNS = _all_columns()
"""Every column that a database can have, in the order of the file."""


def markdown_of_columns() -> list[str]:
    """Return the lines of a table of all columns, with their units and meanings, in Markdown."""
    lines = ["| Column | Unit | Meaning | Paper's range |", "|---|---|---|---|"]
    for column in ALL_COLUMNS:
        meaning = column.long_name
        if column.shape_of:
            meaning += ", nx x ny per sample"
        if column.optional and column.cost:
            meaning += f" (with {column.optional}, costs {column.cost})"
        elif column.optional:
            meaning += f" (with {column.optional})"
        span = ""
        if column.paper_range is not None:
            low, high = column.paper_range
            span = f"{low:g} to {high:g}"
        lines.append(f"| `{column.path}` | {column.unit} | {meaning} | {span} |")
    return lines


RESERVED = frozenset(
    (
        *(column.name for column in ALL_COLUMNS),
        *DRAWN_NAMES,
        RUNTIME,
        "sample",
        "x",
        "y",
        "area",
    )
)
"""Names that outputs of a user's function cannot have: columns, dimensions, groups and targets."""


def columns_for(scene: Scene) -> tuple[Column, ...]:
    """Return the columns that the rows of a scene are computed with.

    Parameters
    ----------
    scene : Scene
        Scene of the database.

    Returns
    -------
    tuple of Column
        Columns that every database has, those that the scene asks for, and those of a user's
        functions, in the order of the file. The file has the rows' checksums besides: see
        `stored_columns`.
    """
    optional = _optional_names(scene)
    of_generator = {column.name: column for column in _columns_of(type(scene.surface))}
    common = [
        _in_words_of(scene, column, of_generator)
        for column in ALL_COLUMNS
        if not column.optional or column.name in optional
    ]
    names = [column.name for column in common]
    surface_end = names.index("surface") + 1
    results_end = next(index for index, column in enumerate(common) if column.group)
    return (
        *common[:surface_end],
        *_columns_of_new_parameters(scene, names),
        *common[surface_end:results_end],
        *_columns_of_outputs(scene.store),
        *common[results_end:],
    )


def _optional_names(scene: Scene) -> set[str]:
    """Return the names of the columns that a scene has besides those of every database."""
    names = set(parameter_columns(scene).values())
    names |= scene.surface.PLACES.keys()
    names |= {key for key, value in scene.store if value is True}
    if scene.quantity != "delta":
        names.add("load")
    if scene.contact.hardness_limits is not None:
        for quantity in stored_quantities():
            if quantity.needs_hardness:
                names.add(quantity.name)
        if scene.contact.draws_hardness:
            names.add("hardness")
    return names


def _in_words_of(
    scene: Scene, column: Column, of_generator: Mapping[str, Column]
) -> Column:
    """Return a column with the unit of a scene's load, or the words of its generator.

    Generators may share a parameter and describe it in words of their own: `of_generator` has the
    columns of the scene's generator by their names.
    """
    if column.name == "load":
        return replace(column, unit=scene.load_unit, long_name=scene.quantity)
    if column.name in of_generator:
        return replace(of_generator[column.name], optional=column.optional)
    return column


def _columns_of_new_parameters(scene: Scene, names: Sequence[str]) -> list[Column]:
    """Return columns of the parameters of a user's generator, which have none among `names`."""
    words = f"parameter of {scene.surface.generator}"
    return [
        Column(name, "f8", "1", words)
        for name in parameter_columns(scene).values()
        if name not in names
    ]


def _columns_of_outputs(store: Store) -> list[Column]:
    """Return the columns of the outputs of a user's function."""
    columns = []
    for name, unit in (store.outputs or {}).items():
        powers = None
        if store.powers is not None and name in store.powers:
            powers = Powers(*store.powers[name])
        columns.append(
            Column(
                name,
                "f8",
                unit,
                f"output of {store.function}",
                bounds=store.bounds(name),
                powers=powers,
                measured=True,
            )
        )
    return columns


def stored_columns(scene: Scene, *, checksums: bool = True) -> tuple[Column, ...]:
    """Return the columns of a scene's database in the file's order.

    Parameters
    ----------
    scene : Scene
        Scene of the database.
    checksums : bool
        Whether the database has a checksum for each row: new ones do, older ones do not.

    Returns
    -------
    tuple of Column
        Those of `columns_for`, with the checksum behind the reason.
    """
    columns = columns_for(scene)
    if not checksums:
        return columns
    place = columns.index(REASON) + 1
    return (*columns[:place], CHECKSUM, *columns[place:])


def parameter_columns(scene: Scene) -> dict[str, str]:
    """Name the columns of the parameters that a scene draws for its surfaces.

    Parameters
    ----------
    scene : Scene
        Scene of the database.

    Returns
    -------
    dict of str to str
        Names of columns by those of the parameters.
    """
    return {name: DRAWN_NAMES.get(name, name) for name in scene.surface.drawn()}


def require_distinct_names(scene: Scene) -> None:
    """Refuse a user's parameters and outputs that have the names of other columns.

    Parameters
    ----------
    scene : Scene
        Scene of the database, with the outputs of its function if these are known.

    Raises
    ------
    InputError
        If a parameter or an output has the name of another column or of an argument, or a bound is
        that of no output; the message names it.
    """
    common_parameters = {name for table in GENERATORS for name in table.PARAMETERS}
    for name in scene.surface.drawn():
        if name in RESERVED - common_parameters or name in ARGUMENTS:
            raise InputError(f"surface.parameters.{name}: {name} {TAKEN}, as own_{name}")
    outputs = scene.store.outputs
    if outputs is None:
        return
    for name in outputs:
        if name in RESERVED or name in scene.drawn_parameters:
            raise InputError(f"store.outputs.{name}: {name} {TAKEN}, as own_{name}")
    for name in (*(scene.store.least or ()), *(scene.store.most or ())):
        if name not in outputs:
            raise InputError(
                f"store: {name} has bounds; the outputs are {', '.join(outputs)}"
            )


def row_bytes(scene: Scene) -> int:
    """Compute the size of one row of a scene's new database, all columns together.

    Parameters
    ----------
    scene : Scene
        Scene of the database.

    Returns
    -------
    int
        Size [bytes].
    """
    grid = scene.grid.shape
    return sum(column.row_bytes(grid) for column in stored_columns(scene))
