"""The parts that a page is made of: what each runs, and what it shows."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from bench.page.content import Content

RECORD = "part.json"
"""File in a part's folder that says how it was made; there once the part is finished."""

Shown = Callable[[Path], Sequence[Content]]


@dataclass(frozen=True)
class Part:
    """A report of its own in a folder of its own.

    Attributes
    ----------
    name : of the folder
    chapter : under which it stands
    title : of its section
    quick, full : arguments of the Python interpreter, with {folder}, {database}, {comparison},
        {cost} and {fine} for what a run fills in; no arguments: not part of that run
    show : lists what the folder holds
    minutes : that `quick` and `full` take, about, on two processors
    """

    name: str
    chapter: str
    title: str
    quick: str
    full: str
    show: Shown
    minutes: tuple[float, float] = (0.0, 0.0)
