"""Files of the reports: tables (CSV), which may be compressed, and TOML files of this package.

The repository keeps large tables compressed (.csv.xz). Functions that read a table take the path of
the uncompressed file (.csv), and read the compressed file if only that one exists.
"""

import csv
import lzma
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from io import StringIO
from pathlib import Path
from typing import Any, NamedTuple

from gen.runtime.errors import InputError
from gen.runtime.files import make_folder, write

Row = dict[str, Any]
"""One row of a table: its values by the names of the columns, which are equal in all rows."""

HOME = Path(__file__).parent
"""Folder of this package, which has its TOML files."""

SIGNIFICANT_DIGITS = 7
"""Significant digits of the floats in a written table. Two measurements agree in fewer digits."""

COMPRESSED = ".xz"
"""Suffix that is added to the name of a compressed file. The program `unxz` decompresses it."""


class CsvTable(NamedTuple):
    """The content of a CSV file, as text."""

    columns: list[str]  # names of the columns, in the order of the file
    rows: list[dict[str, str]]  # cells by the names of their columns


def content_of(path: Path) -> bytes:
    """Read a file, or its compressed form if only that exists.

    Parameters
    ----------
    path : Path
        The uncompressed file, which need not exist.

    Returns
    -------
    bytes
        The uncompressed content.

    Raises
    ------
    InputError
        If neither file can be read.
    """
    compressed = _compressed(path)
    try:
        if compressed.exists() and not path.exists():
            return lzma.decompress(compressed.read_bytes())
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}") from None
    except lzma.LZMAError as error:
        raise InputError(f"{compressed} cannot be read: {error}") from None


def is_there(path: Path) -> bool:
    """Return whether a file exists, as it is or compressed.

    Parameters
    ----------
    path : Path
        The uncompressed file.

    Returns
    -------
    bool
        True if the file or its compressed form exists.
    """
    return path.is_file() or _compressed(path).is_file()


def named(folder: Path, name: str) -> list[Path]:
    """List the files of a folder that a name with `*` matches.

    Parameters
    ----------
    folder : Path
        The folder that the name is relative to.
    name : str
        Name of a file. A `*` in it matches any characters, as in `Path.glob`.

    Returns
    -------
    list of Path
        The files that exist as they are or compressed, sorted. A compressed file is listed by the
        path of its uncompressed form. A name without `*` gives one path, even if there is no file.
    """
    if "*" not in name:
        return [folder / name]
    compressed = (path.with_suffix("") for path in folder.glob(name + COMPRESSED))
    return sorted({*folder.glob(name), *compressed})


def _compressed(path: Path) -> Path:
    """Return the path of the compressed form of a file."""
    return path.with_name(path.name + COMPRESSED)


def read_toml(name: str) -> dict[str, Any]:
    """Read a TOML file of this package.

    Parameters
    ----------
    name : str
        Path of the file relative to the folder `bench`, without the ending `.toml`.

    Returns
    -------
    dict
        Values by their keys.
    """
    path = HOME / f"{name}.toml"
    return tomllib.loads(path.read_text(encoding="utf-8"))


def write_rows(path: Path, rows: Iterable[Mapping[str, Any]]) -> Path:
    """Write rows as a CSV file, with the names of the columns as its first line.

    Floats are rounded to `SIGNIFICANT_DIGITS`. None becomes an empty cell. The folder is made if
    it does not exist.

    Parameters
    ----------
    path : Path
        The file to write.
    rows : iterable of mappings
        One row or more, all with the same columns in the same order. The header is that of the
        first row.

    Returns
    -------
    Path
        The written file.
    """
    rows = list(rows)  # an iterator could be read only once
    lines = StringIO(newline="")
    writer = csv.writer(lines)
    writer.writerow(rows[0])
    writer.writerows(map(_rounded, row.values()) for row in rows)
    make_folder(path.parent)
    write(path, lines.getvalue())
    return path


def _rounded(value: Any) -> Any:
    """Round a float to `SIGNIFICANT_DIGITS`; return any other value unchanged."""
    if isinstance(value, float):
        return float(f"{value:.{SIGNIFICANT_DIGITS}g}")
    return value


def read_table(path: Path) -> CsvTable:
    """Read a CSV file whose first line has the names of the columns.

    Parameters
    ----------
    path : Path
        The uncompressed file, which need not exist.

    Returns
    -------
    CsvTable
        Names of the columns and rows of text. Cells that a short line lacks are empty.

    Raises
    ------
    InputError
        If the file cannot be read, or is not a CSV file of text.
    """
    try:
        text = content_of(path).decode()
        reader = csv.DictReader(StringIO(text, newline=""), restval="")
        columns = list(reader.fieldnames or ())
        return CsvTable(columns, list(reader))
    except (InputError, ValueError, csv.Error) as error:
        raise InputError(f"{path}: cannot be read as a table ({error})") from None


def markdown(
    header: Sequence[str], rows: Iterable[Sequence[str]], right: Sequence[bool] = ()
) -> str:
    """Format a table as Markdown.

    Parameters
    ----------
    header : sequence of str
        Titles of the columns.
    rows : iterable of sequences of str
        Cells of the rows, in the order of the columns.
    right : sequence of bool, optional
        Whether the cells of each column are aligned at the right; by default none are.

    Returns
    -------
    str
        One line for the header, one for the rule below it, and one for each row.
    """
    rules = ["---"] * len(header)
    for place, is_right in enumerate(right):
        if is_right:
            rules[place] = "---:"
    lines = [f"| {' | '.join(header)} |", f"|{'|'.join(rules)}|"]
    lines += [f"| {' | '.join(cells)} |" for cells in rows]
    return "\n".join(lines)
