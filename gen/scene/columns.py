"""The columns of a scene's database: common ones, parameters of surfaces, outputs of a user."""

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
"""Arguments of a user's generator. Its parameters cannot have these names."""

# end of a message about a name that a user cannot give
TAKEN = "is the name of something else; give a name of your own"


def columns_of_generators(
    generators: Sequence[type[GeneratedSurface]] = GENERATORS,
) -> tuple[Column, ...]:
    """Return the columns of generators: places of surfaces in larger ones, then parameters.

    Parameters
    ----------
    generators : sequence of type
        Subclasses of `GeneratedSurface`; by default all that exist.

    Returns
    -------
    tuple of Column
        One column for each name. Its meaning is in the words of the first generator that has the
        column, and its condition names all generators that have it.

    Raises
    ------
    ValueError
        If two generators have a column of one name with different units or types.
    """
    columns: dict[str, Column] = {}
    # For the name of each column, the names of the generators that have it, in Markdown.
    owners: dict[str, list[str]] = {}
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
    # Indices of places are the only whole numbers.
    places = [column for column in conditional if column.dtype == "i4"]
    parameters = [column for column in conditional if column.dtype != "i4"]
    return (*places, *parameters)


def _columns_of(table: type[GeneratedSurface]) -> Iterator[Column]:
    """Yield the columns of one generator: places of its surfaces, then parameters."""
    for name, meaning in table.PLACES.items():
        yield Column(name=name, dtype="i4", unit="1", long_name=meaning)
    for name, parameter in table.PARAMETERS.items():
        yield Column(
            name=DRAWN_NAMES.get(name, name),
            dtype="f8",
            unit=parameter.unit,
            long_name=parameter.long_name,
            paper_range=parameter.paper_range,
        )


def _condition(generators: Sequence[str]) -> str:
    """Return "the generator A" or "the generators A, B and C", for names in Markdown."""
    *first_names, last = generators
    if not first_names:
        return f"the generator {last}"
    return f"the generators {', '.join(first_names)} and {last}"


def _all_columns() -> tuple[Column, ...]:
    """Return `COLUMNS` with the columns of all generators inserted after the column "surface"."""
    place = [column.name for column in COLUMNS].index("surface") + 1
    return (*COLUMNS[:place], *columns_of_generators(), *COLUMNS[place:])


ALL_COLUMNS = _all_columns()
"""Every column that a database can have in the order of the file, apart from columns that users
define."""


def markdown_of_columns() -> list[str]:
    """Return the lines of a table in Markdown: `ALL_COLUMNS` with their units and meanings."""
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
"""Names that outputs of a user's function cannot have: those of columns, parameters, the group,
dimensions of tables, and the target that surrogates call the area."""


def columns_for(scene: Scene) -> tuple[Column, ...]:
    """Return the columns that computing a row of a scene fills: all but the checksum.

    Parameters
    ----------
    scene : Scene
        Scene of the database.

    Returns
    -------
    tuple of Column
        Columns of every database, optional columns of this scene, and columns of a user's
        generator and function, in the order of the file. `stored_columns` adds the checksum.
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
    # Results come first. Columns with a group, which are times, ranks and hosts, close the list.
    results_end = next(index for index, column in enumerate(common) if column.group)
    return (
        *common[:surface_end],
        *_columns_of_new_parameters(scene, names),
        *common[surface_end:results_end],
        *_columns_of_outputs(scene.store),
        *common[results_end:],
    )


def _optional_names(scene: Scene) -> set[str]:
    """Return the names of a scene's columns that not every database has.

    Columns of outputs of a user's function, and the checksum, are not among them.
    """
    names = set(parameter_columns(scene).values())
    names |= scene.surface.PLACES.keys()
    names |= {key for key, value in scene.store if value is True}  # quantities
    if scene.quantity != "delta":
        names.add("load")
    if scene.contact.hardness_limits is not None:
        for quantity in stored_quantities():
            if quantity.needs_hardness:
                names.add(quantity.name)
        if scene.contact.draws_hardness:
            names.add("hardness")
    if scene.contact.layer is not None:
        names |= scene.contact.layer.drawn.keys()
    return names


def _in_words_of(
    scene: Scene, column: Column, of_generator: Mapping[str, Column]
) -> Column:
    """Return a column of `ALL_COLUMNS` as a scene has it.

    The column "load" gets the unit and the name of the scene's quantity. A column of the generator
    gets the words of this generator, as other generators may describe it differently. All other
    columns stay as they are. `of_generator` are the columns of the generator by their names.
    """
    if column.name == "load":
        return replace(column, unit=scene.load_unit, long_name=scene.quantity)
    if column.name in of_generator:
        return replace(of_generator[column.name], optional=column.optional)
    return column


def _columns_of_new_parameters(scene: Scene, names: Sequence[str]) -> list[Column]:
    """Return columns of parameters whose names are not in `names`, the names of known columns.

    Only a user's generator has such parameters.
    """
    meaning = f"parameter of {scene.surface.generator}"
    return [
        Column(name=name, dtype="f8", unit="1", long_name=meaning)
        for name in parameter_columns(scene).values()
        if name not in names
    ]


def _columns_of_outputs(store: Store) -> list[Column]:
    """Return the columns of the outputs of a user's function; none if they are not known yet."""
    columns = []
    for name, unit in (store.outputs or {}).items():
        powers = None
        if store.powers is not None and name in store.powers:
            powers = Powers(*store.powers[name])
        columns.append(
            Column(
                name=name,
                dtype="f8",
                unit=unit,
                long_name=f"output of {store.function}",
                bounds=store.bounds(name),
                powers=powers,
                measured=True,
            )
        )
    return columns


def stored_columns(scene: Scene, *, checksums: bool = True) -> tuple[Column, ...]:
    """Return the columns of a scene's database, in the order of the file.

    Parameters
    ----------
    scene : Scene
        Scene of the database.
    checksums : bool
        Whether the database has a checksum for each row. New databases do, older ones do not.

    Returns
    -------
    tuple of Column
        The columns of `columns_for`. The checksum comes after the column "reason".
    """
    columns = columns_for(scene)
    if not checksums:
        return columns
    place = columns.index(REASON) + 1
    return (*columns[:place], CHECKSUM, *columns[place:])


def parameter_columns(scene: Scene) -> dict[str, str]:
    """Return the names of the columns of the parameters that a scene draws for its surfaces.

    Parameters
    ----------
    scene : Scene
        Scene of the database.

    Returns
    -------
    dict of str to str
        Names of the columns by the names of the parameters.
    """
    return {name: DRAWN_NAMES.get(name, name) for name in scene.surface.drawn()}


def require_distinct_names(scene: Scene) -> None:
    """Refuse names of a user's parameters and outputs that already mean something else.

    Parameters
    ----------
    scene : Scene
        Scene of the database. Outputs of its function are checked only if the scene names them.

    Raises
    ------
    InputError
        If a parameter or an output has the name of another column or of an argument, or if a bound
        is given for an output that does not exist. The message has the name.
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


NOT_AVERAGED = frozenset(("status", "reason", "surface"))
"""Columns of numbers that are codes or indices, so that they have no mean."""


def averaged_columns(scene: Scene) -> tuple[Column, ...]:
    """Return the columns of a scene whose means its table `[expect]` may have.

    Parameters
    ----------
    scene : Scene
        Scene of the database.

    Returns
    -------
    tuple of Column
        The deterministic columns of one number a row that are no codes or indices, in the order of
        the file. Outputs of a user's function are among them if they are known.
    """
    left_out = {*NOT_AVERAGED, *scene.surface.PLACES}
    return tuple(
        column
        for column in columns_for(scene)
        if column.deterministic and not column.shape_of and column.name not in left_out
    )


def require_expected_columns(scene: Scene) -> None:
    """Refuse means of columns that a scene does not have, or that have no mean.

    Parameters
    ----------
    scene : Scene
        Scene of the database. If the outputs of its function are not known yet, they may be any.

    Raises
    ------
    InputError
        If there is no such column. The message has its name, and those that may be given.
    """
    if scene.expect is None:
        return
    if scene.store.function is not None and scene.store.outputs is None:
        return
    names = [column.name for column in averaged_columns(scene)]
    for name in scene.expect:
        if name not in names:
            raise InputError(
                f"expect.{name}: rows of this scene have no such number; give one of"
                f" {', '.join(names)}"
            )


def row_bytes(scene: Scene) -> int:
    """Compute the size of one row of a scene's new database, with all columns.

    Parameters
    ----------
    scene : Scene
        Scene of the database.

    Returns
    -------
    int
        Size [bytes].
    """
    nodes = scene.grid.shape
    return sum(column.row_bytes(nodes) for column in stored_columns(scene))
