"""All generators of rough surfaces, and those of maps and of functions of the user's."""

from typing import TYPE_CHECKING, Annotated, Union

from pydantic import Discriminator, Tag

from gen.generators.function import PythonSurface
from gen.generators.scans import ScanSurface
from gen.spectral import SpectralSurface
from gen.surface import DisplacedSurface, GeneratedSurface

__all__ = ["DisplacedSurface", "PythonSurface", "ScanSurface", "SpectralSurface"]

GENERATORS: tuple[type[GeneratedSurface], ...] = (
    DisplacedSurface,
    SpectralSurface,
    ScanSurface,
    PythonSurface,
)
"""Tables of surfaces; a new generator is a file of this folder and a line here. A scene that names
no generator has the first one, the paper's. Columns of parameters stand in this order."""

TAGS = {f"<{table.NAMES[0]}>": table for table in GENERATORS}
"""Tables of surfaces by the tags that locations of errors have."""


def tag_of(value: object) -> str:
    """Return the tag of the rules for a table of surfaces, the paper's if it names no generator."""
    own = value.get("generator") if isinstance(value, dict) else getattr(value, "generator", None)
    tags = (tag for tag, table in TAGS.items() if own in table.NAMES)
    return next(tags, next(iter(TAGS)))


if TYPE_CHECKING:
    Surface = GeneratedSurface
else:
    _TAGGED = tuple(Annotated[table, Tag(tag)] for tag, table in TAGS.items())
    Surface = Annotated[Union[_TAGGED], Discriminator(tag_of)]  # noqa: UP007
