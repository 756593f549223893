"""Files that a command will write: refused before the work, not after it."""

import zipfile
from collections.abc import Iterable
from pathlib import Path

from gen.errors import InputError

BEGINNING = 4096
"""Bytes by which a text is told from anything else."""


def check_surrogate(path: Path) -> None:
    """Refuse a surrogate's place that cannot be written or holds something else.

    Raises
    ------
    InputError
        Also for a database or a scan: a slip of the tongue may not cost one.
    """
    _check_place(path, "--output")
    if path.exists() and path.stat().st_size and not _is_surrogate(path):
        raise InputError(f"--output {path}: holds something else than a surrogate: not replaced")


def check_text(path: Path | None, option: str, inputs: Iterable[Path | str]) -> None:
    """Refuse a table's or header's place that cannot be written, or that is one of the inputs.

    Parameters
    ----------
    path : None if nothing is to be written
    option : its name in messages
    inputs : what may not be replaced

    Raises
    ------
    InputError
        Also where the file that is there is no text.
    """
    if path is None:
        return
    _check_place(path, option)
    if not path.exists():
        return
    given = [Path(each) for each in inputs]
    inside = any(each.is_dir() and path.resolve().parent == each.resolve() for each in given)
    same = any(each.is_file() and each.samefile(path) for each in given)
    with path.open("rb") as file:
        binary = b"\0" in file.read(BEGINNING)
    if same or binary or (inside and path.suffix.lower() != ".csv"):
        raise InputError(f"{option} {path}: is an input or no text: not replaced")


def _check_place(path: Path, option: str) -> None:
    if path.is_dir() or not path.absolute().parent.is_dir():
        raise InputError(f"{option} {path}: give a file in a folder that exists")


def _is_surrogate(path: Path) -> bool:
    try:
        with zipfile.ZipFile(path) as archive:
            return "schema.json" in archive.namelist()
    except (OSError, zipfile.BadZipFile):
        return False
