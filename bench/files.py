"""Files of reports: tables, this package's texts, and what is compressed in the repository."""

import csv
import lzma
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from io import StringIO
from pathlib import Path
from typing import Any

from gen.runtime.errors import InputError
from gen.runtime.files import make_folder, write

Row = dict[str, Any]
"""Values of one line of a table by the names of its columns, which are the same in all lines."""

HOME = Path(__file__).parent  # of the texts of this package
ENOUGH = 7  # significant digits of measured numbers, far beyond what repeats
COMPRESSED = (
    ".xz"  # added to the names of large tables in the repository; `unxz` gives them back
)


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


def read_toml(name: str) -> dict[str, Any]:
    """Read a TOML file of this package, by its path from `bench` on without the ending."""
    path = HOME / f"{name}.toml"
    return tomllib.loads(path.read_text(encoding="utf-8"))


def write_rows(path: Path, rows: Iterable[Mapping[str, Any]]) -> Path:
    """Write rows under the names of their columns (CSV), numbers with `ENOUGH` significant digits.

    The folder is made where there is none; None is written as nothing.
    """
    rows = list(rows)

    def rounded(value: Any) -> Any:
        return float(f"{value:.{ENOUGH}g}") if isinstance(value, float) else value

    lines = StringIO(newline="")
    writer = csv.writer(lines)
    writer.writerow(rows[0])
    writer.writerows(map(rounded, row.values()) for row in rows)
    make_folder(path.parent)
    write(path, lines.getvalue())
    return path


def read_table(path: Path) -> tuple[list[str], list[dict[str, str]]]:
    """Read the names of the columns of a table, and its rows by these names."""
    try:
        reader = csv.DictReader(
            StringIO(content_of(path).decode(), newline=""), restval=""
        )
        return list(reader.fieldnames or ()), list(reader)
    except (InputError, ValueError, csv.Error) as error:
        raise InputError(f"{path}: cannot be read as a table ({error})") from None


def markdown(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table as lines of Markdown."""
    lines = (f"| {' | '.join(cells)} |" for cells in rows)
    return "\n".join([f"| {' | '.join(header)} |", f"|{'---|' * len(header)}", *lines])
