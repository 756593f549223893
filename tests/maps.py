"""Maps read as a command reads them, whose messages name options."""

from pathlib import Path
from typing import Any

from bem.problem import Boundary
from gen.maps.read import Topography
from gen.maps.read import read as read_map
from gen.maps.settings import Reading


def read(
    path: Path, side: str = "", unit: str = "", *, boundary: Boundary = "free", **more: Any
) -> Topography:
    """Read a map by the options `--side`, `--unit` and more."""
    return read_map(path, Reading(side=side, unit=unit, **more), boundary)
