"""Tables as files: CSV, under their names only once they are whole."""

import csv
from collections.abc import Iterable, Sequence
from io import StringIO
from pathlib import Path

from gen.runtime.output import make_folder, write


def write_table(path: Path, header: Iterable[str], rows: Iterable[Sequence[object]]) -> Path:
    """Write a table; its folder is made where there is none.

    Raises
    ------
    InputError
        If that is not possible.
    """
    text = StringIO(newline="")
    writer = csv.writer(text)
    writer.writerow(header)
    writer.writerows(rows)
    make_folder(path.parent)
    write(path, text.getvalue())
    return path
