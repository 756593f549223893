"""Functions of the user's in a scene: how they are named, and the names that they give."""

import re
from typing import Annotated, TypeVar

from pydantic import AfterValidator, Field

T = TypeVar("T")

FUNCTION = re.compile(r"[^\W\d]\w*(\.[^\W\d]\w*)*:[^\W\d]\w*")
"""A module's name and that of a function in it."""

NAMED = re.compile(r"[a-z][a-z0-9_]{0,39}")
"""Names of a user's parameters and outputs, which become columns."""

FUNCTION_WORDS = "text, 'module:function'"


def _function(text: str) -> str:
    """Refuse a text that does not name a function in a module."""
    if not FUNCTION.fullmatch(text):
        raise ValueError("as 'my_surfaces:waves', for the function waves of my_surfaces.py")
    return text


Function = Annotated[str, Field(max_length=200), AfterValidator(_function)]
Hash = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]


def named(values: dict[str, T]) -> dict[str, T]:
    """Refuse names that cannot be those of columns; sort the others, whose order means nothing."""
    for name in values:
        if not NAMED.fullmatch(name):
            raise ValueError(
                f"{name!r}: a name has up to 40 lower case letters, digits and underscores"
            )
    return dict(sorted(values.items()))
