"""Surfaces from files and folders, read and prepared by the options that `gen contact` has."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from bem.problem import Boundary
from gen.maps.prepare import prepare, surface_warnings
from gen.maps.read import OWN_SUFFIXES, Topography, read
from gen.maps.settings import Reading
from gen.runtime.errors import InputError
from gen.runtime.files import require_file
from gen.runtime.terminal import to_type
from gen.schema import statistics_columns

INSTRUMENTS = {
    *(".x3p", ".sur", ".al3d", ".opd", ".opdx", ".plu", ".plux", ".gwy", ".nc", ".di", ".ibw"),
    *(".spm", ".mi", ".zon", ".zag", ".top", ".frt", ".os3d", ".sdf", ".bcrf", ".bcr", ".h5"),
    *(".mat", ".xyz", ".vk4", ".vk6", ".vk7", ".jpk", ".gsf", ".nid", ".ezd", ".mnt", ".stp"),
    *(".nms", ".pts", ".prn"),
}
"""Suffixes of files in a folder that are read as surfaces."""


def files_in(paths: Sequence[Path]) -> tuple[list[Path], int]:
    """Return the files, with those of folders that can hold surfaces, and the number left out."""
    files: list[Path] = []
    others = 0
    for path in paths:
        if not path.is_dir():
            if not path.is_file():
                raise InputError(f"{path}: is neither a file nor a folder")
            if path.suffix.lower() == ".h5" and _is_database(path):
                raise InputError(
                    f"{path}: is a database; {to_type('learn fit')} makes a surrogate of it, which"
                    " predicts for surfaces"
                )
            files.append(path)
            continue
        inside = [each for each in sorted(path.iterdir()) if each.is_file()]
        inside = [each for each in inside if not each.name.startswith(".")]
        wanted = [
            each for each in inside if each.suffix.lower() in (OWN_SUFFIXES - {""}) | INSTRUMENTS
        ]
        if not wanted:
            raise InputError(f"{path}: holds no surface")
        others += len(inside) - len(wanted)
        files += wanted
    return files, others


def _is_database(path: Path) -> bool:
    from gen.database import is_database  # which needs HDF5, as surfaces do not

    return is_database(path)


def read_surface(
    path: Path, reading: Reading, boundary: Boundary = "free"
) -> tuple[Topography, list[str]]:
    """Read and prepare a surface as a patch of a boundary; return it with the warnings about it."""
    try:
        topography = prepare(read(path, reading, boundary), reading)
    except InputError as error:
        named = "" if str(error).startswith(("--", str(path))) else f"{path}: "
        raise InputError(f"{named}{error}") from None
    with np.errstate(over="ignore"):  # of slopes that are too steep for a square: warned of
        return topography, surface_warnings(topography)


def is_table(path: Path) -> bool:
    """Return True if a file has rows of statistics, by the names in its first line."""
    if path.suffix.lower() not in {".csv", ".txt"}:
        return False
    try:
        with require_file(path).open(encoding="utf-8-sig", errors="replace") as file:
            names = {name.strip() for name in file.readline().split(",")}
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}") from None
    return bool(names & {column.name for column in statistics_columns()})
