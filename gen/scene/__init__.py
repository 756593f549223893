"""Scenes: the TOML files that describe a database, read and checked in this one room."""

from gen.scene.load import Piece
from gen.scene.loading import load, preset_names
from gen.scene.scene import Scene, differences
from gen.scene.store import Store, flags
from gen.scene.surface import DisplacedSurface, PythonSurface, ScanSurface, SpectralSurface

__all__ = [
    "DisplacedSurface",
    "Piece",
    "PythonSurface",
    "ScanSurface",
    "Scene",
    "SpectralSurface",
    "Store",
    "differences",
    "flags",
    "load",
    "preset_names",
]
