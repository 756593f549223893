"""The reader of databases: columns, attributes, counts and ranges."""

import math
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gen.database.disk import chunks
from gen.database.inspection import stored_path
from gen.database.layout import FLAGS, read_attributes
from gen.database.making import SIGNATURE
from gen.database.opening import OpenDatabase, checked, open_file
from gen.runtime.errors import InputError
from gen.runtime.files import require_file
from gen.schema import DRAWN_NAMES, REASON, STATUS, Reason, Status


def is_database(path: Path) -> bool:
    """Tell whether a file is a readable database.

    Parameters
    ----------
    path : Path
        File, which need not exist.
    """
    try:
        with require_file(path).open("rb") as file:
            if file.read(len(SIGNATURE)) != SIGNATURE:
                return False
        with Reader(path):
            return True
    except (OSError, InputError):
        return False


class Reader(OpenDatabase):
    """A database open for reading, even while a run writes it; a context manager.

    Parameters
    ----------
    path : Path or str
        Database.

    Attributes
    ----------
    path : Path
        Database.
    scene : Scene
        Scene that it was made with.
    rows : range
        Rows of the scene that it holds; fewer than all in a part.

    Raises
    ------
    InputError
        If the file is missing, cannot be read, or is not a database of this layout.
    """

    def __init__(self, path: Path | str) -> None:
        path = Path(path)
        with ExitStack() as stack:
            file = stack.enter_context(open_file(path))
            super().__init__(path, checked(file, path), file)
            stack.pop_all()

    @property
    def attributes(self) -> dict[str, str | int]:
        """Attributes of the file: scene, versions, commit, layout number, physics number."""
        return read_attributes(self._file)

    @property
    def size_bytes(self) -> int:
        """Size of the file [bytes]."""
        return self.path.stat().st_size

    def column(self, name: str, start: int = 0, stop: int | None = None) -> NDArray[Any]:
        """Read one column.

        Parameters
        ----------
        name : str
            Name of the column.
        start, stop : int, optional
            First row and one past the last, all rows by default; a part returns those it has.

        Returns
        -------
        ndarray, shape (stop - start,) or (stop - start, nx, ny)
            Numbers, texts or fields in the unit of `gen.schema`, pending and failed rows included.

        Raises
        ------
        InputError
            If the file has no such column.
        """
        for column in self.columns():
            if column.name in {name, DRAWN_NAMES.get(name)}:
                dataset = self._file[stored_path(self._file, column)]
                values: NDArray[Any] = dataset[slice(*self._places(start, stop))]
                return values
        names = ", ".join(column.name for column in self.columns())
        raise InputError(f"{self.path} has no column {name!r}; it has {names}")

    def reasons(self, status: Status = Status.FAILED) -> dict[int, int]:
        """Count the failed rows, or the done rows that lack statistics, by their reason.

        Parameters
        ----------
        status : Status
            `Status.FAILED` or `Status.DONE`.

        Returns
        -------
        dict of int
            Number of rows by the code of their reason, a key of `gen.schema.REASONS`.
        """
        total = np.zeros(256, dtype=np.int64)
        for start, stop in chunks(len(self.rows), 1):
            chosen = self._file[STATUS.path][start:stop] == status
            if chosen.any():
                codes = self._file[REASON.path][start:stop][chosen]
                total += np.bincount(codes, minlength=total.size)
        if status == Status.DONE:
            total[Reason.NONE] = 0
        return {int(code): int(total[code]) for code in np.flatnonzero(total)}

    def ranges(self) -> dict[str, tuple[float, float]]:
        """Find the range of every column of numbers over the done rows.

        Returns
        -------
        dict of (float, float)
            Smallest and largest value by the column's name and in its unit, NaN without done rows;
            fields, codes and texts are omitted.
        """
        wanted = [
            column
            for column in self.columns()
            if not column.shape_of and column.dtype[0] != "S" and column not in FLAGS
        ]
        ranges = {column.name: (math.nan, math.nan) for column in wanted}
        for start, stop in chunks(len(self.rows), 8):
            done = self._file[STATUS.path][start:stop] == Status.DONE
            if not done.any():
                continue
            for column in wanted:
                values = self._file[stored_path(self._file, column)][start:stop][done]
                low, high = ranges[column.name]
                ranges[column.name] = (
                    float(np.fmin(low, np.fmin.reduce(values))),
                    float(np.fmax(high, np.fmax.reduce(values))),
                )
        return ranges
