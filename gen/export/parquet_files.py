"""Columns of a database as files of Parquet, written whole or not at all, in chunks of rows."""

import json
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray
from pyarrow import parquet

from gen.database import Reader
from gen.database.reader import CHUNK_BYTES
from gen.runtime.errors import InputError
from gen.runtime.files import atomic, kind_of
from gen.schema import Column

Mask = NDArray[np.bool_]  # one truth value for each row of a file

KEPT_BACK = frozenset(("status", "rank", "host"))
"""Columns that are not exported: the status, since all exported rows are done, and the machine that
computed a row, which is private.
"""

TABLE_ROWS = 50_000  # number of rows that are in memory at once, and in one row group of a file
KEY = b"asperity"  # key of a file's metadata under which its origin stands
ROWS = "rows.parquet"  # file of all columns with one value a row
FIELDS = "fields"  # folder of the files of columns with one field a row

FILE_BYTES = 2**28  # most bytes of a field's file before compression: what an interruption loses


class Piece(NamedTuple):
    """A file of an export: its name in the folder, its columns, and the rows that may be in it."""

    name: str
    schema: pa.Schema
    rows: range


def scalars(reader: Reader) -> list[Column]:
    """Return the columns with one value a row, in the order of the database."""
    wanted = [column for column in reader.columns() if column.name not in KEPT_BACK]
    return [column for column in wanted if not column.shape_of]


def fields(reader: Reader) -> list[Column]:
    """Return the columns with one field of nx x ny nodes a row."""
    return [column for column in reader.columns() if column.shape_of]


def schema_of(reader: Reader, columns: list[Column]) -> pa.Schema:
    """Return Arrow's schema of columns beside `sample`; fields of nodes are lists with a shape."""
    words = {"unit": "1", "long_name": "index of the row in the scene"}
    found = [pa.field("sample", pa.int64(), nullable=False, metadata=words)]
    for column in columns:
        kind = pa.from_numpy_dtype(np.dtype(column.dtype))
        words = {"unit": column.unit, "long_name": column.long_name}
        if column.shape_of:
            nx, ny = reader.scene.grid.shape
            kind = pa.list_(kind, nx * ny)
            words["shape"] = json.dumps([nx, ny])
        found.append(pa.field(column.name, kind, nullable=False, metadata=words))
    return pa.schema(found)


def pieces(reader: Reader) -> list[Piece]:
    """List the files of an export: the table of all rows, and the files of fields."""
    found = [Piece(ROWS, schema_of(reader, scalars(reader)), reader.rows)]
    for column in fields(reader):
        schema = schema_of(reader, [column])
        step = max(1, FILE_BYTES // column.row_bytes(reader.scene.grid.shape))
        for first in range(reader.rows.start, reader.rows.stop, step):
            rows = range(first, min(first + step, reader.rows.stop))
            found.append(Piece(f"{FIELDS}/{column.name}-{first:010d}.parquet", schema, rows))
    return found


def write(
    piece: Piece, folder: Path, reader: Reader, done: Mask, advance: Callable[[int], None]
) -> None:
    """Write a file of an export with the rows that are done, unless it is there already."""
    path, before, names = folder / piece.name, reader.rows.start, piece.schema.names[1:]
    part = piece.rows
    number = int(done[part.start - before : part.stop - before].sum())
    origin = identity(reader) | {"rows": [part.start, part.stop], "done": number}
    if origin_of(path) == origin:
        advance(len(part))
        return
    schema = piece.schema.with_metadata({KEY: json.dumps(origin)})
    columns = [column for column in reader.columns() if column.name in names]
    widest = max(column.row_bytes(reader.scene.grid.shape) for column in columns)
    step = min(TABLE_ROWS, max(1, CHUNK_BYTES // widest))
    with (
        atomic(path, "parquet") as file,
        parquet.ParquetWriter(file, schema, compression="zstd") as writer,
    ):
        for first in range(part.start, part.stop, step):  # a few megabytes at a time
            last = min(first + step, part.stop)
            wanted = done[first - before : last - before]
            arrays = [pa.array(first + np.flatnonzero(wanted), type=pa.int64())]
            for field in list(schema)[1:]:
                values = reader.column(field.name, first, last)[wanted]
                flat = pa.array(np.ascontiguousarray(values).reshape(-1))
                listed = pa.types.is_fixed_size_list(field.type)
                size = field.type.list_size if listed else 0
                arrays.append(pa.FixedSizeListArray.from_arrays(flat, size) if listed else flat)
            writer.write_table(pa.Table.from_arrays(arrays, schema=schema))
            advance(len(arrays[0]))


def identity(reader: Reader) -> dict[str, object]:
    """Return the identity of a database: its scene, and the moment of its creation."""
    attributes = reader.attributes
    return {name: attributes[name] for name in ("scene_hash", "created", "physics")}


def origin_of(path: Path) -> dict[str, object]:
    """Return the origin that a Parquet file states, empty if it is no whole file of an export."""
    with suppress(OSError, KeyError, ValueError, pa.ArrowException):
        if path.is_file() and kind_of(path) == "parquet":
            return dict(json.loads((parquet.read_schema(path).metadata or {})[KEY]))
    return {}


def require_own_folder(folder: Path, reader: Reader) -> None:
    """Refuse a folder with other files than those of an export of this database."""
    if any(not path.name.startswith(".asperity") for path in folder.iterdir()):
        origin = origin_of(folder / ROWS)
        if not origin:
            raise InputError(f"{folder} is not empty and no export: give a new folder")
        if origin | identity(reader) != origin:
            raise InputError(f"{folder} holds the export of another database: give a new folder")
