"""The list of all generators of rough surfaces, and two of them: windows of maps, and functions."""

from typing import TYPE_CHECKING, Annotated, Union

from pydantic import Field

from gen.generators.function import PythonSurface
from gen.generators.scans import ScanSurface
from gen.spectral import SpectralSurface
from gen.surface import DisplacedSurface, GeneratedSurface

GENERATORS: tuple[type[GeneratedSurface], ...] = (
    DisplacedSurface,
    SpectralSurface,
    ScanSurface,
    PythonSurface,
)
"""Classes of the table `[surface]`. A new generator is a file of this folder and a line here.

A scene that names no generator has the first one, the paper's. Columns of parameters stand in this
order."""

TAGS = {name: table for table in GENERATORS for name in table.NAMES}
"""Classes by the names of their generators, which pydantic puts into the locations of errors."""

if TYPE_CHECKING:
    Surface = GeneratedSurface
else:
    Surface = Annotated[Union[GENERATORS], Field(discriminator="generator")]  # noqa: UP007
