"""Scenes: the TOML files that describe a database, read and checked in this one room."""

from gen.generators import DisplacedSurface, PythonSurface, ScanSurface
from gen.scene.columns import columns_for, row_bytes
from gen.scene.scene import Scene, differences, load, preset_names
from gen.scene.tables import Piece, Store, flags

__all__ = [
    "DisplacedSurface",
    "Piece",
    "PythonSurface",
    "ScanSurface",
    "Scene",
    "Store",
    "columns_for",
    "differences",
    "flags",
    "load",
    "preset_names",
    "row_bytes",
]
