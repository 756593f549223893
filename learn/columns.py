"""The columns of a database by their role in learning: inputs, targets, places."""

from gen.scene import Scene
from gen.schema import Column, columns_for, parameter_columns, statistics_columns

INPUTS: tuple[str, ...] = ("delta", *(column.name for column in statistics_columns()))
"""The 23 inputs: Delta and the 22 statistics, in the order of the paper's Table 1."""

TARGETS: dict[str, str] = {"area": "area_percent", "force": "force"}
"""Short names of the two targets that every database has, and their columns."""

WHOLE_TARGETS = ("contact_nodes", "contact_spots")
"""Results that are whole numbers, and are learnt like real numbers."""

NO_TARGETS = frozenset({*INPUTS, "load", "hardness", "residual"})
"""Columns of floating numbers that are no results: inputs, and how well a row was solved."""

MAP, TILE = "map", "tile"
"""Columns of the map and of its tile that a surface was cut out of."""


def short_name(column: str) -> str:
    """Return the name of a target's column in folders and on the command line.

    Parameters
    ----------
    column : str
        The column.
    """
    return next((short for short, name in TARGETS.items() if name == column), column)


def results(scene: Scene) -> dict[str, Column]:
    """Return the columns of a scene's database that can be learnt, by their names.

    Parameters
    ----------
    scene : Scene
        The scene of the database.

    Returns
    -------
    dict of str to Column
        Area and force first, then the other results in the order of the file.
    """
    given = NO_TARGETS | drawn_names(scene)
    found = {
        column.name: column
        for column in columns_for(scene)
        if column.name in WHOLE_TARGETS
        or (
            column.dtype == "f8"
            and not (column.group or column.shape_of)
            and column.name not in given
        )
    }
    return {name: found[name] for name in TARGETS.values()} | found


def drawn_names(scene: Scene) -> set[str]:
    """Return the columns of a scene's database that hold parameters of the surfaces."""
    return set(parameter_columns(scene).values())
