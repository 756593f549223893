"""The table `[accuracy]` of a scene: errors that rows are to have, and the grid that gives them.

A user asks for relative errors. A trial before the first row finds the nodes and the tolerance of
the solver (`gen.generation.accuracy`); both then stand in the scene that the database records.
"""

from collections.abc import Iterable
from typing import Annotated, Any, Self

from pydantic import Field, Strict, model_validator

from gen.distribution import Number, Table, conflict
from gen.generators import TAGS
from gen.quantities import CONTINUUM, stored_quantities
from gen.surface import MOST_NODES

AREA = "continuum_area"
"""Key of `[accuracy]` for the area in the continuum, which `bem.accuracy` calls "area".

All other keys are names of answers there, and names of columns.
"""

FINEST_NODES = 2048
"""Nodes along the longer side of the finest grid that is tried, if the scene gives none."""

LONGEST_SIDE = 1e300
"""Length of a side whose product with `FINEST_NODES` is not yet infinite [um]."""

SHARE = "a share above 0 and below 1: 0.01 is one per cent"

Share = Annotated[Number, Field(gt=1e-14, lt=1)]
Count = Annotated[int, Field(ge=2, le=MOST_NODES + 1)]
Pair = Annotated[tuple[Count, Count], Strict(False)]


class ErrorRecord(Table):
    """The largest relative error of an answer in a trial, by its causes [1]."""

    total: float = Field(description="a share")
    grid: float = Field(description="a share")
    waves: float = Field(description="a share")
    solver: float = Field(description="a share")


class TriedGrid(Table):
    """A grid that a trial has tried."""

    nodes: Pair = Field(description="nodes along x and y")
    contacts: int = Field(description="the number of contacts that were judged")
    beyond: int = Field(
        description="the number of these beyond an error that is asked for"
    )

    @property
    def in_words(self) -> str:
        """The grid and its numbers in words."""
        nx, ny = self.nodes
        return f"{nx} x {ny} nodes: {self.beyond} of {self.contacts} contacts beyond"


class FoundGrid(Table):
    """The grid that a trial has found for the rows, and the errors on it."""

    nodes: Pair = Field(description="nodes along x and y, which a run finds")
    errors: dict[str, ErrorRecord] = Field(
        description="the errors of the trial by the keys of [accuracy]"
    )
    tried: Annotated[tuple[TriedGrid, ...], Strict(False)] = Field(
        description="the grids of the trial in their order"
    )


class Accuracy(Table):
    """Largest relative errors of answers, which 95 % of all rows keep."""

    continuum_area: Share | None = Field(default=None, description=SHARE)
    mean_gap: Share | None = Field(default=None, description=SHARE)
    stiffness: Share | None = Field(default=None, description=SHARE)
    delta: Share | None = Field(default=None, description=SHARE)
    force: Share | None = Field(default=None, description=SHARE)
    # None in the user's scene; a run writes it when it begins.
    found: FoundGrid | None = Field(
        default=None, description="the grid that a run has found, and the trial"
    )

    @model_validator(mode="after")
    def _require_an_error(self) -> Self:
        """Refuse a table that asks for no error."""
        if not self.asked:
            keys = [key for key in type(self).model_fields if key != "found"]
            raise conflict(
                f"it asks for nothing: give at least one of {', '.join(keys)}, as {AREA} = 0.01"
            )
        return self

    @property
    def asked(self) -> dict[str, float]:
        """Largest relative errors by the keys that ask for them [1]."""
        return {key: error for key, error in self if key != "found" and error is not None}

    def report(self, rtol: float) -> list[str]:
        """Return lines about the errors that are asked for, the grid, and the trial that found it.

        Parameters
        ----------
        rtol : float
            Tolerance of the solver on this grid [Delta].

        Returns
        -------
        list of str
            The lines; empty if no trial has found a grid.
        """
        if self.found is None:
            return []
        nx, ny = self.found.nodes
        requests = [
            f"{key} within {_percent(error)}" for key, error in self.asked.items()
        ]
        lines = [
            f"{', '.join(requests)} in 95 % of rows: {nx} x {ny} nodes, rtol {rtol:.3g}"
        ]
        for key, error in self.found.errors.items():
            lines.append(
                f"{key} of the trial to {_percent(error.total)}: grid {_percent(error.grid)},"
                f" waves {_percent(error.waves)}, solver {_percent(error.solver)}"
            )
        lines += [tried.in_words for tried in self.found.tried]
        return lines


def _percent(share: float) -> str:
    """Write a share in per cent, with up to three digits."""
    return f"{100 * share:.3g} %"


def completed_for_accuracy(content: dict[str, Any]) -> dict[str, Any]:
    """Fill in the defaults of a scene that depend on its table `[accuracy]`.

    The columns whose errors are asked for are stored. Surfaces that are the same on any grid get a
    finest grid of `FINEST_NODES`, with square cells, if the scene gives no nodes.

    Parameters
    ----------
    content : dict
        Content of a scene that has the key `accuracy`. Its values may be wrong: pydantic has not
        checked them.

    Returns
    -------
    dict
        The content with these defaults.
    """
    completed = dict(content)
    accuracy = content["accuracy"]
    store = content.get("store", {})
    if isinstance(accuracy, dict) and isinstance(store, dict):
        completed["store"] = {**store, **dict.fromkeys(_asked_columns(accuracy), True)}
    surface = content.get("surface")
    if isinstance(surface, dict) and "nodes" not in surface:
        generator = TAGS.get(str(surface.get("generator")))
        if generator is not None and generator.ON_ANY_GRID:
            completed["surface"] = {**surface, "nodes": _finest_nodes(surface)}
    return completed


def _asked_columns(accuracy: Iterable[str]) -> list[str]:
    """Return the columns of keys of `[accuracy]`, apart from those that every database has."""
    columns = {CONTINUUM.name if key == AREA else key for key in accuracy}
    return [
        quantity.name
        for quantity in stored_quantities()
        if quantity.stored == "asked" and quantity.name in columns
    ]


def answer_of(key: str) -> str:
    """Return the name in `bem.answers.ANSWERS` of the answer whose error a key asks for.

    Parameters
    ----------
    key : str
        A key of `[accuracy]`.

    Returns
    -------
    str
        The name.
    """
    return "area" if key == AREA else key


def _finest_nodes(surface: dict[str, Any]) -> int | tuple[int, int]:
    """Return the nodes of the finest grid of a table [surface] that gives none.

    The cells of a patch with two sides are nearly square: its shorter side has fewer nodes.
    """
    sides = surface.get("side")
    if not isinstance(sides, list | tuple) or len(sides) != 2:
        return FINEST_NODES
    if not all(
        isinstance(side, int | float) and 0 < side < LONGEST_SIDE for side in sides
    ):
        return FINEST_NODES  # pydantic refuses sides that are no lengths
    nodes = [max(2, round(FINEST_NODES * side / max(sides))) for side in sides]
    return nodes[0], nodes[1]
