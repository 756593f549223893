"""Parquet files of an export: written whole or not at all, and kept if they are there already."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pyarrow as pa
from pyarrow import parquet

from gen.database import Reader
from gen.export import tables
from gen.export.tables import Mask
from gen.runtime.errors import InputError
from gen.runtime.files import atomic, kind_of

KEY = b"asperity"
"""Key of a file's metadata under which its origin stands."""

ROWS = "rows.parquet"
"""File of all columns with one value a row."""

FIELDS = "fields"
"""Folder of the files of columns with one field a row."""

FILE_BYTES = 2**28
"""Most bytes of a field's file before compression, so that an interrupted export loses little."""


class Piece(NamedTuple):
    """A file of an export.

    Attributes
    ----------
    name : str
        Name in the folder.
    schema : pyarrow.Schema
        Its columns.
    rows : range
        Rows of the scene that it may hold; those which are done are in it.
    """

    name: str
    schema: pa.Schema
    rows: range


def pieces(reader: Reader) -> list[Piece]:
    """List the files of an export.

    Parameters
    ----------
    reader : Reader
        Database.

    Returns
    -------
    list of Piece
        The table of all rows, and the files of fields.
    """
    found = [Piece(ROWS, tables.schema_of(reader, tables.scalars(reader)), reader.rows)]
    for column in tables.fields(reader):
        schema = tables.schema_of(reader, [column])
        step = max(1, FILE_BYTES // column.row_bytes(reader.scene.shape))
        for first in range(reader.rows.start, reader.rows.stop, step):
            rows = range(first, min(first + step, reader.rows.stop))
            found.append(Piece(f"{FIELDS}/{column.name}-{first:010d}.parquet", schema, rows))
    return found


def write(
    piece: Piece, folder: Path, reader: Reader, done: Mask, advance: Callable[[int], None]
) -> None:
    """Write a file of an export, unless it is there already.

    Parameters
    ----------
    piece : Piece
        The file.
    folder : Path
        Folder of the export.
    reader : Reader
        Database.
    done : ndarray of bool, shape (rows,)
        Rows of the file to export.
    advance : callable
        Called with the number of rows after each piece of them.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    path, first = folder / piece.name, reader.rows.start
    chosen = done[piece.rows.start - first : piece.rows.stop - first]
    origin = {**identity(reader), "rows": [piece.rows.start, piece.rows.stop]}
    origin["done"] = int(chosen.sum())
    if origin_of(path) == origin:
        advance(len(piece.rows))
        return
    schema = piece.schema.with_metadata({KEY: json.dumps(origin)})
    with (
        atomic(path, "parquet") as file,
        parquet.ParquetWriter(file, schema, compression="zstd") as writer,
    ):
        for table in tables.tables(reader, schema, piece.rows, done):
            writer.write_table(table)
            advance(table.num_rows)


def identity(reader: Reader) -> dict[str, object]:
    """Return the identity of a database: its scene, and the moment of its creation."""
    attributes = reader.attributes
    return {name: attributes[name] for name in ("scene_hash", "created", "physics")}


def origin_of(path: Path) -> dict[str, object] | None:
    """Return the entries of a Parquet file on its origin.

    Parameters
    ----------
    path : Path
        File, which need not exist.

    Returns
    -------
    dict, optional
        Identity of the database, rows and number of those done; None if it is no whole file of an
        export.
    """
    try:
        if not path.is_file() or kind_of(path) != "parquet":
            return None
        metadata = parquet.read_schema(path).metadata or {}
        origin = json.loads(metadata[KEY])
    except (OSError, KeyError, ValueError, pa.ArrowException):
        return None
    return origin if isinstance(origin, dict) else None


def require_own_folder(folder: Path, reader: Reader) -> None:
    """Refuse a folder with other files than those of an export of this database.

    Parameters
    ----------
    folder : Path
        Folder of the export, which need not exist.
    reader : Reader
        Database.

    Raises
    ------
    InputError
        If the folder holds something else.
    """
    if not folder.is_dir():
        return
    names = {path.name for path in folder.iterdir() if not path.name.startswith(".asperity")}
    if not names:
        return
    origin = origin_of(folder / ROWS)
    if origin is None:
        raise InputError(f"{folder} is not empty and no export: give a new folder")
    own = identity(reader)
    if {name: origin.get(name) for name in own} != own:
        raise InputError(f"{folder} holds the export of another database: give a new folder")
