"""The list of all generators of rough surfaces.

Three of them are files of this folder: windows of measured maps, surfaces like measured maps, and
functions that users write.
"""

from typing import TYPE_CHECKING, Annotated, Union

from pydantic import Field

from gen.generators.function import PythonSurface
from gen.generators.like import LikeSurface
from gen.generators.scans import ScanSurface
from gen.spectral import SpectralSurface
from gen.surface import DisplacedSurface, GeneratedSurface

GENERATORS: tuple[type[GeneratedSurface], ...] = (
    DisplacedSurface,
    SpectralSurface,
    ScanSurface,
    LikeSurface,
    PythonSurface,
)
"""Classes of the table `[surface]`. A new generator is a file of this folder and a line here.

A scene that names no generator uses the first one, that of the paper. The columns of parameters of
a database have the order of these classes."""

TAGS = {name: table for table in GENERATORS for name in table.NAMES}
"""Class of each generator by its name in scenes, which pydantic puts into locations of errors."""

if TYPE_CHECKING:
    Surface = GeneratedSurface
else:
    Surface = Annotated[Union[GENERATORS], Field(discriminator="generator")]  # noqa: UP007
