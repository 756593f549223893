"""Files that a page shows, as written or compressed beside that name, and texts of this package."""

import lzma
import tomllib
import zlib
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any
from zipfile import BadZipFile

from gen.runtime.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

COMPRESSED = ".xz"  # added to the names of large tables in the repository; `unxz` gives them back


def content_of(path: Path) -> bytes:
    """Read a file, or the compressed one that stands beside where it would be."""
    packed = _packed(path)
    try:
        if packed.exists() and not path.exists():
            return lzma.decompress(packed.read_bytes())
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}") from None
    except lzma.LZMAError as error:
        raise InputError(f"{packed} cannot be read: {error}") from None


def kept_arrays(path: Path, *names: str) -> "dict[str, NDArray[Any]]":
    """Read the arrays that a command has kept for its next run; the given names are among them.

    Raises
    ------
    InputError
        If the file cannot be read, or was not made by that command.
    """
    import numpy as np

    try:
        with np.load(BytesIO(content_of(path)), allow_pickle=False) as kept:
            arrays: dict[str, NDArray[Any]] = dict(kept)
    except (ValueError, TypeError, BadZipFile, EOFError, zlib.error):
        arrays = {}
    if not arrays or not arrays.keys() >= set(names):
        raise InputError(f"{path} is not what this command keeps there: remove it")
    return arrays


def read_toml(name: str) -> dict[str, Any]:
    """Read a TOML file of this package, by its path from `bench` on without the ending."""
    path = Path(__file__).parent / f"{name}.toml"
    return tomllib.loads(path.read_text(encoding="utf-8"))


def is_there(path: Path) -> bool:
    """Say whether a file, or the compressed one, is there."""
    return path.is_file() or _packed(path).is_file()


def named(folder: Path, name: str) -> list[Path]:
    """List the files of a name, in which a * stands for several that are there, compressed or not.

    Compressed ones have the names that they have without that.
    """
    if "*" not in name:
        return [folder / name]
    packed = (path.with_suffix("") for path in folder.glob(name + COMPRESSED))
    return sorted({*folder.glob(name), *packed})


def _packed(path: Path) -> Path:
    return path.with_name(path.name + COMPRESSED)
