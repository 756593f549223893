"""Tables as files: CSV, under their names only once they are whole."""

import csv
from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path

from gen.errors import InputError


def write_table(path: Path, header: Iterable[str], rows: Iterable[Sequence[object]]) -> Path:
    """Write a table; its folder is made where there is none.

    Raises
    ------
    InputError
        If that is not possible.
    """
    unfinished = path.with_name(f".{path.name}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with unfinished.open("w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(header)
            writer.writerows(rows)
        unfinished.replace(path)
    except OSError as error:
        with suppress(OSError):
            unfinished.unlink(missing_ok=True)
        raise InputError(f"{path} cannot be written: {error.strerror or error}") from None
    return path
