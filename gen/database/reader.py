"""The reader: columns, attributes and what they amount to."""

import math
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gen.database.disk import chunks
from gen.database.layout import FLAGS, read_attributes
from gen.database.making import SIGNATURE
from gen.database.opening import OpenDatabase, checked, open_file
from gen.runtime.errors import InputError
from gen.runtime.input_file import require_file
from gen.schema import REASON, STATUS, Status


def is_database(path: Path) -> bool:
    """Whether a file is a database that can be read."""
    try:
        with require_file(path).open("rb") as file:
            if file.read(len(SIGNATURE)) != SIGNATURE:
                return False
        with Reader(path):
            return True
    except (OSError, InputError):
        return False


class Reader(OpenDatabase):
    """A database open for reading, also while a run writes it; a context manager.

    Parameters
    ----------
    path : the database

    Attributes
    ----------
    path : the database
    scene : the scene it was made with
    rows : those of the scene that it holds: all of them, or a part

    Raises
    ------
    InputError
        If the file is missing, cannot be read, or is not a database of this layout.
    """

    def __init__(self, path: Path) -> None:
        with ExitStack() as stack:
            file = stack.enter_context(open_file(path))
            super().__init__(path, checked(file, path), file)
            stack.pop_all()

    @property
    def attributes(self) -> dict[str, str | int]:
        """What the file says about itself: scene, versions, commit, numbers of layout, physics."""
        return read_attributes(self._file)

    @property
    def size_bytes(self) -> int:
        """Size of the file [bytes]."""
        return self.path.stat().st_size

    def column(self, name: str, start: int = 0, stop: int | None = None) -> NDArray[Any]:
        """Read one column.

        Parameters
        ----------
        name : name of the column
        start, stop : first row, and one past the last (None: to the end); what a part has of them

        Returns
        -------
        (stop - start,), or (stop - start, n, n) for a field, in the unit of `gen.schema`; pending
        and failed rows included: see the status

        Raises
        ------
        InputError
            If the file has no such column.
        """
        for column in self.columns():
            if column.name == name:
                values: NDArray[Any] = self._file[column.path][slice(*self._places(start, stop))]
                return values
        names = ", ".join(column.name for column in self.columns())
        raise InputError(f"{self.path} has no column {name!r}; it has {names}")

    def reasons(self) -> dict[int, int]:
        """Count the failed rows by the code of their reason (see `gen.schema.REASONS`)."""
        total = np.zeros(256, dtype=np.int64)
        for start, stop in chunks(len(self.rows), 1):
            failed = self._file[STATUS.path][start:stop] == Status.FAILED
            if failed.any():
                codes = self._file[REASON.path][start:stop][failed]
                total += np.bincount(codes, minlength=total.size)
        return {int(code): int(total[code]) for code in np.flatnonzero(total)}

    def ranges(self) -> dict[str, tuple[float, float]]:
        """Find the smallest and the largest value of every column of numbers over the done rows.

        Returns
        -------
        By name, in the column's unit, NaN without done rows; fields, codes and texts are left out
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
                values = self._file[column.path][start:stop][done]
                low, high = ranges[column.name]
                ranges[column.name] = (
                    float(np.fmin(low, np.fmin.reduce(values))),
                    float(np.fmax(high, np.fmax.reduce(values))),
                )
        return ranges
