"""Scenes: the TOML files that describe a database, read and checked in this one room."""

from gen.generators import DisplacedSurface, PythonSurface, ScanSurface
from gen.scene.faults import differences
from gen.scene.scene import (
    ALL_COLUMNS,
    Scene,
    columns_for,
    load,
    parameter_columns,
    preset_names,
    require_own_names,
    row_bytes,
)
from gen.scene.tables import Piece, Store

__all__ = [
    "ALL_COLUMNS",
    "DisplacedSurface",
    "Piece",
    "PythonSurface",
    "ScanSurface",
    "Scene",
    "Store",
    "columns_for",
    "differences",
    "load",
    "parameter_columns",
    "preset_names",
    "require_own_names",
    "row_bytes",
]
