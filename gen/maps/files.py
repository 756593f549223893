"""Files of measured maps: found by names, folders and patterns, known by their content."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Sequence
from pathlib import Path

from gen.runtime.errors import InputError

OTHERS = {
    *(".toml", ".md", ".rst", ".pdf", ".html", ".json", ".yaml", ".yml", ".log", ".lock"),
    *(".png", ".jpg", ".jpeg", ".svg", ".py", ".xlsx", ".docx", ".surrogate", ".maps"),
}
"""Suffixes of files that stand in folders of maps and hold none."""

WILD = re.compile(r"[*?\[]")
"""Wildcards of a pattern."""

MOST = 100_000
"""Largest number of files of a scene."""


def map_files(patterns: Sequence[str], folder: Path) -> list[Path]:
    """Find the files that a scene names.

    Raises InputError if a pattern leads to no file, or to too many.
    """
    found: dict[Path, None] = {}
    for pattern in patterns:
        here = _matching(pattern, folder)
        if not here:
            raise InputError(f"files {pattern!r}: {_absence(pattern, folder)}")
        found |= dict.fromkeys(path.resolve() for path in here)
    if len(found) > MOST:
        raise InputError(f"files: {len(found)} files, {MOST} at most are allowed; name fewer")
    return list(found)


def _matching(pattern: str, folder: Path) -> list[Path]:
    """Return the files that one name, folder or pattern leads to, sorted by their paths."""
    try:
        path = folder / Path(pattern).expanduser()
        if path.is_file():
            return [path]
        if path.is_dir():
            return sorted(each for each in path.iterdir() if each.is_file() and _may_hold_map(each))
        if not WILD.search(pattern):
            return []
        own = Path(pattern).expanduser()
        start, rest = (
            (Path(own.anchor), own.relative_to(own.anchor)) if own.anchor else (folder, own)
        )
        return sorted(each for each in start.glob(str(rest)) if each.is_file())
    except (OSError, ValueError, RuntimeError, NotImplementedError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"files {pattern!r}: {reason}") from None


def _may_hold_map(path: Path) -> bool:
    """Tell whether the name of a file in a folder is that of a map."""
    return not path.name.startswith(".") and path.suffix.lower() not in OTHERS


def _absence(pattern: str, folder: Path) -> str:
    """Say why a pattern leads to no file."""
    path = folder / Path(pattern).expanduser()
    if path.is_dir():
        return f"the folder {path} holds no map"
    if WILD.search(pattern):
        return f"no file in {folder} is called so; give a file, a folder or a pattern as 'a/*.x3p'"
    return f"there is no file or folder {str(path)!r}"


def digest(path: Path) -> str:
    """Compute the SHA-256 of a file's content, in hexadecimal digits.

    Raises InputError if the file cannot be read.
    """
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}") from None


def digests(paths: Iterable[Path]) -> list[str]:
    """Compute the SHA-256 of files, and refuse two of one content: their tiles would share
    nodes.

    Raises InputError if a file cannot be read, or repeats another one.
    """
    found: dict[str, Path] = {}
    for path in paths:
        sha256 = digest(path)
        if sha256 in found:
            raise InputError(
                f"{path} and {found[sha256]} are the same map: leave one out, or a surrogate would"
                " be tested on nodes that it was trained on"
            )
        found[sha256] = path
    return list(found)


def located(recorded: Path, sha256: str, beside: Path | None) -> Path:
    """Find a map of a database again: where it was, or in the folder of the database.

    Raises InputError if neither file is there, or both have another content.
    """
    places = [recorded, *([] if beside is None else [beside / recorded.name])]
    present = [path for path in places if path.is_file()]
    for path in present:
        if digest(path) == sha256:
            return path
    if present:
        raise InputError(
            f"{present[0]}: is not the map that the database was made of: its SHA-256 was"
            f" {sha256[:12]}...; a changed map is another scene"
        )
    raise InputError(
        f"{recorded}: the map is gone that the database was made of; put it back there or beside"
        f" the database (SHA-256 {sha256[:12]}...)"
    )
