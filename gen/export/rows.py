"""Parquet files with the rows of a database. Each file is written completely or not at all."""

import json
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray
from pyarrow import parquet

from gen.database import Reader
from gen.database.reader import CHUNK_BYTES
from gen.runtime.files import atomic, inside, kind_of
from gen.runtime.terminal import RunProgress
from gen.schema import Column, Status

KEPT_BACK = frozenset(("status", "checksum", "rank", "host"))
"""Columns that are not exported: the status, because all exported rows are done; the checksum,
because it belongs to a row of the database's file; the rank and the host, which are private.
"""

ROWS = "rows.parquet"  # file with all columns that have one value a row
FIELDS = "fields"  # folder of the files with columns that have one field of nodes a row

# largest number of rows in memory at once, and in one row group of a file
TABLE_ROWS = 50_000
# Largest size of a field's file before compression [bytes]. An interruption loses one such file.
FILE_BYTES = 2**28
KEY = b"asperity"  # key of a file's metadata for the file's origin


class Piece(NamedTuple):
    """A Parquet file of an export, which may not be written yet."""

    name: str  # path of the file in the folder of the export
    schema: pa.Schema  # columns of the file, the first of which is `sample`
    rows: range  # rows of the database from which the done ones are in the file


class ExportedColumns(NamedTuple):
    """The exported columns of a database, by the shape of their values."""

    scalars: list[Column]  # columns with one value a row
    fields: list[Column]  # columns with one field of nx x ny nodes a row


@dataclass(frozen=True, eq=False)
class DoneRows:
    """The done rows of a database at one moment, which are the rows that are exported.

    Numbers of rows are those in the plan of the scene. The first row of a part of a database is
    not 0.
    """

    first: int  # number of the database's first row
    is_done: NDArray[np.bool_]  # whether each row is done, shape (rows of the database,)

    @classmethod
    def of(cls, reader: Reader) -> "DoneRows":
        """Read which rows of a database are done at this moment.

        Parameters
        ----------
        reader : Reader
            The database. Rows that a run completes later are not in the result.

        Returns
        -------
        DoneRows
            The done rows.
        """
        is_done = np.asarray(reader.column("status") == Status.DONE)
        return cls(first=reader.rows.start, is_done=is_done)

    @property
    def number(self) -> int:
        """Number of rows that are done."""
        return int(self.is_done.sum())

    @property
    def first_done(self) -> int:
        """Number of the first done row; at least one row has to be done."""
        return self.first + int(self.is_done.argmax())

    def within(self, start: int, stop: int) -> NDArray[np.bool_]:
        """Tell which of the rows from `start` to `stop` - 1 are done.

        Parameters
        ----------
        start : int
            Number of the first row.
        stop : int
            Number of the last row plus 1.

        Returns
        -------
        ndarray of bool, shape (stop - start,)
            True for rows that are done.
        """
        return self.is_done[start - self.first : stop - self.first]


def exported_columns(reader: Reader) -> ExportedColumns:
    """Return the exported columns of a database.

    Parameters
    ----------
    reader : Reader
        The database.

    Returns
    -------
    ExportedColumns
        Columns with one value a row, and columns with one field a row, in the order of the file.
    """
    columns = [column for column in reader.columns() if column.name not in KEPT_BACK]
    return ExportedColumns(
        scalars=[column for column in columns if not column.shape_of],
        fields=[column for column in columns if column.shape_of],
    )


def pieces(reader: Reader) -> list[Piece]:
    """List the Parquet files of an export.

    Parameters
    ----------
    reader : Reader
        The database.

    Returns
    -------
    list of Piece
        The table of all rows, followed by the files of the fields. Each of these has a part of the
        rows of one field, with at most `FILE_BYTES` before compression but at least one row.
    """
    columns = exported_columns(reader)
    schema_of_table = _schema(reader, columns.scalars)
    files = [Piece(name=ROWS, schema=schema_of_table, rows=reader.rows)]
    for field in columns.fields:
        schema = _schema(reader, [field])
        rows_of_file = max(1, FILE_BYTES // field.row_bytes(reader.scene.grid.shape))
        for start in reader.rows[::rows_of_file]:
            stop = min(start + rows_of_file, reader.rows.stop)
            name = f"{FIELDS}/{field.name}-{start:010d}.parquet"
            files.append(Piece(name=name, schema=schema, rows=range(start, stop)))
    return files


def _schema(reader: Reader, columns: list[Column]) -> pa.Schema:
    """Return Arrow's schema of a file: the column `sample`, then the given columns.

    The metadata of each column are its unit and its meaning.
    """
    metadata = {"unit": "1", "long_name": "index of the row in the scene"}
    sample = pa.field("sample", pa.int64(), nullable=False, metadata=metadata)
    fields = [_arrow_field(column, reader.scene.grid.shape) for column in columns]
    return pa.schema([sample, *fields])


def _arrow_field(column: Column, nodes: tuple[int, int]) -> pa.Field:
    """Return Arrow's description of a column of a database on a grid of nodes (nx, ny).

    A column of fields has lists of nx ny numbers as its values, and the shape in its metadata.
    """
    nx, ny = nodes
    arrow_type = pa.from_numpy_dtype(np.dtype(column.dtype))
    metadata = {"unit": column.unit, "long_name": column.long_name}
    if column.shape_of:
        arrow_type = pa.list_(arrow_type, nx * ny)
        metadata["shape"] = json.dumps([nx, ny])
    return pa.field(column.name, arrow_type, nullable=False, metadata=metadata)


def write_piece(
    piece: Piece, folder: Path, reader: Reader, done: DoneRows, progress: RunProgress
) -> None:
    """Write a file of an export with the done rows, unless the folder has it already.

    A file that has another origin, for example fewer done rows, is replaced.

    Parameters
    ----------
    piece : Piece
        The file.
    folder : Path
        Folder of the export.
    reader : Reader
        The database.
    done : DoneRows
        The done rows of the database.
    progress : RunProgress
        Display of the progress. The rows of the file are added to it.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    path = inside(folder, piece.name)
    rows = piece.rows
    number = int(done.within(rows.start, rows.stop).sum())
    origin = identity(reader) | {"rows": [rows.start, rows.stop], "done": number}
    if origin_of(path) == origin:
        progress.advance(rows=len(rows))
        return
    schema = piece.schema.with_metadata({KEY: json.dumps(origin)})
    rows_at_once = _rows_at_once(piece, reader)
    with (
        atomic(path, "parquet") as file,
        parquet.ParquetWriter(file, schema, compression="zstd") as writer,
    ):
        for start in rows[::rows_at_once]:
            stop = min(start + rows_at_once, rows.stop)
            table = _table(schema, reader, done, start, stop)
            writer.write_table(table)
            progress.advance(rows=len(table))


def _rows_at_once(piece: Piece, reader: Reader) -> int:
    """Return how many rows of a file are held in memory at once.

    Each column then takes at most `CHUNK_BYTES`, unless one row is larger.
    """
    widest = max(
        column.row_bytes(reader.scene.grid.shape)
        for column in reader.columns()
        if column.name in piece.schema.names[1:]  # without `sample`
    )
    return min(TABLE_ROWS, max(1, CHUNK_BYTES // widest))


def _table(
    schema: pa.Schema, reader: Reader, done: DoneRows, start: int, stop: int
) -> pa.Table:
    """Read the done rows from `start` to `stop` - 1 as a table with the columns of a schema.

    The first column, `sample`, has the numbers of the rows in the plan of the scene.
    """
    is_done = done.within(start, stop)
    samples = start + np.flatnonzero(is_done)
    arrays = [pa.array(samples, type=pa.int64())]
    for field in list(schema)[1:]:
        values = reader.column(field.name, start, stop)[is_done]
        array = pa.array(np.ascontiguousarray(values).reshape(-1))
        # The numbers of all fields, one after the other, become a list for each row.
        if pa.types.is_fixed_size_list(field.type):
            array = pa.FixedSizeListArray.from_arrays(array, field.type.list_size)
        arrays.append(array)
    return pa.Table.from_arrays(arrays, schema=schema)


def identity(reader: Reader) -> dict[str, object]:
    """Return the attributes that distinguish a database from all other databases.

    Parameters
    ----------
    reader : Reader
        The database.

    Returns
    -------
    dict of str to object
        The values of the attributes `scene_hash`, `created` (when the database was made) and
        `physics`, by their names.
    """
    attributes = reader.attributes
    return {name: attributes[name] for name in ("scene_hash", "created", "physics")}


def origin_of(path: Path) -> dict[str, object]:
    """Return the origin that a Parquet file of an export has in its metadata.

    Parameters
    ----------
    path : Path
        Path of any file, which need not exist.

    Returns
    -------
    dict of str to object
        The attributes of `identity`; "rows", the first row and the last row plus 1 of the database
        that the file covers; and "done", the number of done rows in the file. The dictionary is
        empty if there is no complete file of an export at the path.
    """
    with suppress(OSError, KeyError, ValueError, pa.ArrowException):
        if path.is_file() and kind_of(path) == "parquet":
            metadata = parquet.read_schema(path).metadata or {}
            return dict(json.loads(metadata[KEY]))
    return {}
