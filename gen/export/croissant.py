"""Croissant's description of an export: JSON-LD that data catalogues and loaders read.

Source: MLCommons, Croissant Format Specification 1.0, https://docs.mlcommons.org/croissant.
"""

import hashlib
import json
from collections.abc import Iterable
from datetime import datetime
from pathlib import Path

import mlcroissant as mlc
import pyarrow as pa

from gen.database import Reader
from gen.export import files
from gen.export.about import About
from gen.export.files import Piece

NAME = "croissant.json"
"""Name of the description in the folder of an export."""

PARQUET = "application/x-parquet"
"""Media type of Parquet files, as Croissant's loader knows it."""


def describe(
    reader: Reader, about: About, words: str, folder: Path, pieces: Iterable[Piece]
) -> str:
    """Describe the files of an export.

    Parameters
    ----------
    reader : Reader
        Database.
    about : About
        Title, creator, licence and identifier.
    words : str
        Description of the dataset in a few sentences.
    folder : Path
        Folder of the export, whose Parquet files are written.
    pieces : iterable of Piece
        These files.

    Returns
    -------
    str
        The description as JSON.
    """
    rows, *fields = pieces
    distribution: list[mlc.FileObject | mlc.FileSet] = [_file(folder, rows)]
    records = [_record_set("rows", rows.schema, file_object=rows.name)]
    for name in dict.fromkeys(piece.schema.names[-1] for piece in fields):
        schema = next(piece.schema for piece in fields if piece.schema.names[-1] == name)
        pattern = f"{files.FIELDS}/{name}-*.parquet"
        distribution.append(
            mlc.FileSet(id=f"{name}-files", encoding_formats=[PARQUET], includes=[pattern])
        )
        records.append(_record_set(name, schema, file_set=f"{name}-files"))
    created = datetime.fromisoformat(str(reader.attributes["created"]))
    metadata = mlc.Metadata(
        name=about.title,
        description=words,
        creators=[mlc.Person(name=about.creator)] if about.creator else [],
        license=[about.licence] if about.licence else None,
        url=about.address or None,
        cite_as=about.citation(str(created.year)) or None,
        date_published=created,
        version="1.0.0",
        distribution=distribution,
        record_sets=records,
    )
    return json.dumps(metadata.to_json(), indent=1, ensure_ascii=False) + "\n"


def _file(folder: Path, piece: Piece) -> mlc.FileObject:
    """Describe a single file with its checksum."""
    path = folder / piece.name
    with path.open("rb") as file:
        checksum = hashlib.file_digest(file, "sha256").hexdigest()
    return mlc.FileObject(
        id=piece.name,
        name=piece.name,
        content_url=piece.name,
        content_size=f"{path.stat().st_size} B",
        encoding_formats=[PARQUET],
        sha256=checksum,
    )


def _record_set(name: str, schema: pa.Schema, **source: str) -> mlc.RecordSet:
    """Describe the rows of a file, or of several files of the same columns."""
    key = f"{name}/sample"
    columns = [_field(name, column, source) for column in schema]
    return mlc.RecordSet(id=name, name=name, key=[key], fields=columns)


def _field(record_set: str, column: pa.Field, source: dict[str, str]) -> mlc.Field:
    """Describe a column: its meaning with the unit, its type, and its place."""
    words = {key.decode(): value.decode() for key, value in column.metadata.items()}
    unit = "" if words["unit"] in {"1", ""} else f" [{words['unit']}]"
    shape = tuple(json.loads(words["shape"])) if "shape" in words else ()
    inner = column.type.value_type if shape else column.type
    kind = mlc.DataType.INTEGER if pa.types.is_integer(inner) else mlc.DataType.FLOAT
    array = {"is_array": True, "array_shape": ",".join(map(str, shape))} if shape else {}
    return mlc.Field(
        id=f"{record_set}/{column.name}",
        name=column.name,
        description=f"{words['long_name']}{unit}",
        data_types=[kind],
        source=mlc.Source(**source, extract=mlc.Extract(column=column.name)),
        **array,
    )
