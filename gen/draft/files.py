"""Write a scene to a file that does not exist yet."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from gen.draft.writing import Key, document
from gen.runtime.errors import InputError
from gen.runtime.files import atomic
from gen.scene import Scene

SUFFIX = ".toml"
"""Suffix of scenes, by which folders of maps know that they are none."""


def require_new(path: Path) -> None:
    """Refuse a name that a scene cannot have, or that is taken.

    Parameters
    ----------
    path : Path
        File to make.

    Raises
    ------
    InputError
        If the name has another suffix, or there is such a file.
    """
    if path.suffix != SUFFIX:
        example = path.name.partition(".")[0] or "mine"
        raise InputError(
            f"--output {path}: give a name that ends in {SUFFIX}, as {example}{SUFFIX}"
        )
    if path.exists():
        raise InputError(
            f"--output {path}: is there already, and may hold changes of yours: give another name,"
            " or move it away"
        )


def write(path: Path, keys: Iterable[Key]) -> Scene:
    """Write a scene, never over another file, and return it as `gen run` reads it.

    Parameters
    ----------
    path : Path
        File to make.
    keys : iterable of Key
        Keys with their comments.

    Raises
    ------
    InputError
        If the file cannot be written, or another process has made it meanwhile.
    """
    text = document(keys)
    scene = Scene.parse(text, str(path))
    require_new(path)
    with atomic(path, replace=False) as file:
        file.write(text.encode())
    if path.read_bytes() != text.encode():
        require_new(path)
    return scene
