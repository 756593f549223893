"""Export of databases to open formats, which anybody can read without this program.

The columns become files of Parquet, written whole or not at all, in chunks of rows. A card in
Markdown and Croissant's JSON-LD for catalogues say what the dataset is.

Source: MLCommons, Croissant Format Specification 1.0, https://docs.mlcommons.org/croissant.
"""

import json
import math
import re
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import NamedTuple, Self

import mlcroissant as mlc
import numpy as np
import pyarrow as pa
import tomli_w
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup
from numpy.typing import NDArray
from pyarrow import parquet

from gen.database import Reader
from gen.database.reader import CHUNK_BYTES
from gen.runtime.errors import InputError
from gen.runtime.files import (
    atomic,
    digest,
    inside,
    kind_of,
    lock_folder,
    make_folder,
    write,
)
from gen.runtime.terminal import RunProgress, printable
from gen.schema import REASONS, Column, Status

DOI = re.compile(r"10\.\d{4,9}/\S+")  # without the address of its resolver (ISO 26324)
RESOLVER = re.compile(
    r"(https?://doi\.org/|doi:)", re.IGNORECASE
)  # what people put in front of it

LICENCE = re.compile(r"https?://\S+|[\w.+-]+( (AND|OR|WITH) [\w.+-]+)*", re.ASCII)
"""An address, or an SPDX expression without brackets (SPDX 2.3, annex D)."""

CARD_NAME = "README.md"  # name of the card in the folder of an export
SCENE_NAME = "scene.toml"  # name of the scene in the folder of an export
TEXTS = {"title", "creator", "licence"}  # keys of a scene with texts of anybody's

PATCHES = {
    "free": "a patch with free edges",
    "periodic": "a periodic patch",
    "mirror": "a patch that its mirror images surround",
}
"""Words for the boundaries of a patch."""

CROISSANT_NAME = "croissant.json"  # name of the description in the folder of an export
PARQUET = (
    "application/x-parquet"  # media type of Parquet files, as Croissant's loader knows it
)

KEPT_BACK = frozenset(("status", "checksum", "rank", "host"))
"""Columns that are not exported: the status, since all exported rows are done, the checksum, which
is that of a row of the database, and the machine that computed a row, which is private.
"""

TABLE_ROWS = (
    50_000  # number of rows that are in memory at once, and in one row group of a file
)
KEY = b"asperity"  # key of a file's metadata under which its origin stands
ROWS = "rows.parquet"  # file of all columns with one value a row
FIELDS = "fields"  # folder of the files of columns with one field a row

FILE_BYTES = (
    2**28
)  # most bytes of a field's file before compression: what an interruption loses


@dataclass(frozen=True)
class About:
    """Bibliographic data of a dataset; an empty text where nothing was given."""

    title: str
    creator: str = ""
    licence: str = ""  # an SPDX identifier as "CC-BY-4.0", or an address
    doi: str = ""  # without the address of its resolver

    @classmethod
    def of(cls, reader: Reader, title: str, creator: str, licence: str, doi: str) -> Self:
        """Return the options of a command, and where one is empty the attribute of the database."""
        scene, bare = reader.scene, RESOLVER.sub("", doi.strip(), count=1)
        if doi and not DOI.fullmatch(bare):
            raise InputError(f"--doi {doi}: give an identifier as 10.5281/zenodo.1234567")
        for option, text in (
            ("title", title),
            ("creator", creator),
            ("licence", licence),
        ):
            if not text.isprintable():
                raise InputError(f"--{option} {text!r}: give a text of one line")
        if licence and not LICENCE.fullmatch(licence):
            raise InputError(
                f"--licence {licence!r}: give an SPDX identifier as CC-BY-4.0, or an address that"
                " begins with https://"
            )
        stored = str(reader.attributes["title"]), scene.creator or "", scene.licence or ""
        given = zip((title, creator, licence), stored, strict=True)
        title, creator, licence = (own or printable(other) for own, other in given)
        return cls(title, creator, licence, bare)

    @property
    def address(self) -> str:
        """Address that the identifier resolves to, or an empty text."""
        return f"https://doi.org/{self.doi}" if self.doi else ""

    def citation(self, year: str) -> str:
        """Return how the dataset wants to be cited, or an empty text without a creator."""
        place = f" {self.address}" if self.address else ""
        return (
            f"{self.creator} ({year}). {self.title} [Data set].{place}"
            if self.creator
            else ""
        )


def export(reader: Reader, folder: Path, about: About) -> tuple[int, int, int]:
    """Write the done rows of a database as Parquet, with a card and Croissant's description.

    The folder is new, empty, or an export of this database, which is continued or renewed. Return
    the numbers of rows written and left out, and the size of all files [bytes]. Raise InputError if
    the folder holds something else, there are no done rows, or the disk is full.
    """
    with lock_folder(folder):
        if any(not path.name.startswith(".asperity") for path in folder.iterdir()):
            origin = origin_of(folder / ROWS)
            if origin | identity(reader) != origin:
                other = "holds the export of another database"
                other = other if origin else "is not empty and no export"
                raise InputError(f"{folder} {other}: give a new folder")
        done = np.asarray(
            reader.column("status") == Status.DONE
        )  # a run may go on meanwhile
        if not done.any():
            raise InputError(f"{reader.path} has no done rows to export")
        files = pieces(reader)
        if len(files) > 1:
            make_folder(inside(folder, FIELDS))
        with RunProgress(sum(len(piece.rows) for piece in files), "rows") as progress:
            for piece in files:
                write_piece(piece, folder, reader, done, progress)
        write(inside(folder, SCENE_NAME), scene_text(reader))
        write(inside(folder, CARD_NAME), card(reader, about, done))
        write(inside(folder, CROISSANT_NAME), describe(reader, about, folder, files))
        size = sum(
            path.stat().st_size for path in folder.rglob("[!.]*") if path.is_file()
        )
        return int(done.sum()), int((~done).sum()), size


class Piece(NamedTuple):
    """A file of an export: its name in the folder, its columns, and the rows that may be in it."""

    name: str
    schema: pa.Schema
    rows: range


def columns_of(reader: Reader) -> tuple[list[Column], list[Column]]:
    """Return the columns with one value a row, and those with one field of nx x ny nodes a row."""
    wanted = [column for column in reader.columns() if column.name not in KEPT_BACK]
    fields = [column for column in wanted if column.shape_of]
    return [column for column in wanted if not column.shape_of], fields


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
    scalars, fields = columns_of(reader)
    found = [Piece(ROWS, schema_of(reader, scalars), reader.rows)]
    for column in fields:
        schema = schema_of(reader, [column])
        step = max(1, FILE_BYTES // column.row_bytes(reader.scene.grid.shape))
        for first in range(reader.rows.start, reader.rows.stop, step):
            rows = range(first, min(first + step, reader.rows.stop))
            found.append(
                Piece(f"{FIELDS}/{column.name}-{first:010d}.parquet", schema, rows)
            )
    return found


def write_piece(
    piece: Piece,
    folder: Path,
    reader: Reader,
    done: NDArray[np.bool_],
    progress: RunProgress,
) -> None:
    """Write a file of an export with the rows that are done, unless it is there already."""
    path, before, names = (
        inside(folder, piece.name),
        reader.rows.start,
        piece.schema.names[1:],
    )
    part = piece.rows
    number = int(done[part.start - before : part.stop - before].sum())
    origin = identity(reader) | {"rows": [part.start, part.stop], "done": number}
    if origin_of(path) == origin:
        progress.advance(len(part), 0)
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
                arrays.append(
                    pa.FixedSizeListArray.from_arrays(flat, size) if listed else flat
                )
            writer.write_table(pa.Table.from_arrays(arrays, schema=schema))
            progress.advance(len(arrays[0]), 0)


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


def words(reader: Reader) -> str:
    """Describe surfaces, contact and loads of a dataset in a few sentences."""
    scene = reader.scene
    (nx, ny), (along, across) = scene.grid.shape, scene.grid.sides
    bodies = (
        "elastic bodies" if scene.contact.hardness_limits is None else "bodies that yield"
    )
    return (
        f"Contact of rough surfaces, solved by the boundary-element method: {bodies} pressed onto"
        f" {PATCHES[scene.contact.boundary]} of {nx} x {ny} nodes, {along:g} x {across:g} um, with"
        f" surfaces of the generator '{scene.surface.generator}' and loads given as"
        f" {scene.quantity} [{scene.load_unit}]. A row is one contact problem: the surface's"
        " parameters and roughness statistics, the load, the contact area and the force."
    )


def scene_text(reader: Reader) -> str:
    """Return the scene of a database as TOML."""
    content = json.loads(reader.scene.text())
    content |= {name: printable(content[name]) for name in TEXTS & content.keys()}
    tables_last = dict(
        sorted(content.items(), key=lambda item: isinstance(item[1], dict))
    )
    return tomli_w.dumps(tables_last)


def card(reader: Reader, about: About, done: NDArray[np.bool_]) -> str:
    """Write the data card of an export, in Markdown; `done` tells the rows that are in it."""
    environment = Environment(
        loader=PackageLoader("gen.export", "."),
        autoescape=False,
        finalize=_plain,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    filters = environment.filters  # YAML's texts are quoted as JSON's, < is escaped
    filters["json"] = lambda text: Markup(json.dumps(text).replace("<", "\\u003c"))
    filters["form"] = lambda of, at: (
        "" if not of or math.isnan(of[at]) else f"{of[at]:.6g}"
    )
    attributes, (columns, fields) = reader.attributes, columns_of(reader)
    failures = reader.reasons(Status.FAILED)
    text = environment.get_template("card.md.jinja").render(
        about=about,
        words=Markup(words(reader)),
        attributes=attributes,
        versions=json.loads(str(attributes["versions"])),
        done=int(done.sum()),
        counts=reader.counts(),
        failures={
            REASONS.get(code, str(code)): number for code, number in failures.items()
        },
        rows_file=ROWS,
        fields_folder=FIELDS,
        fields=fields,
        nodes=reader.scene.grid.shape,
        first=reader.rows.start + int(done.argmax()),
        columns=columns,
        names=[column.name for column in columns],
        ranges=reader.ranges(),
        settings=reader.scene.contact,
        scene=Markup(scene_text(reader)),
        citation=about.citation(str(attributes["created"])[:4]),
    )
    return text.replace("\\\n", "")


def _plain(value: object) -> object:
    """Write a text of a database so that Markdown shows its letters, in one line; no markup is."""
    if not isinstance(value, str) or isinstance(value, Markup):
        return value
    return re.sub(r"([\\`*|\[\]])", r"\\\1", printable(value)).replace("<", "&lt;")


def describe(reader: Reader, about: About, folder: Path, pieces: Iterable[Piece]) -> str:
    """Describe the files of an export, which are written, as JSON."""
    rows, *others = pieces
    path = folder / rows.name
    described = mlc.FileObject(
        id=rows.name,
        name=rows.name,
        content_url=rows.name,
        content_size=f"{path.stat().st_size} B",
        encoding_formats=[PARQUET],
        sha256=digest(path),
    )
    distribution: list[mlc.FileObject | mlc.FileSet] = [described]
    records = [_record_set("rows", rows.schema, file_object=rows.name)]
    for name in dict.fromkeys(piece.schema.names[-1] for piece in others):
        schema = next(piece.schema for piece in others if piece.schema.names[-1] == name)
        pattern = f"{FIELDS}/{name}-*.parquet"
        distribution.append(
            mlc.FileSet(
                id=f"{name}-files", encoding_formats=[PARQUET], includes=[pattern]
            )
        )
        records.append(_record_set(name, schema, file_set=f"{name}-files"))
    created = datetime.fromisoformat(str(reader.attributes["created"]))
    metadata = mlc.Metadata(
        name=about.title,
        description=words(reader),
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


def _record_set(name: str, schema: pa.Schema, **source: str) -> mlc.RecordSet:
    """Describe the rows of a file, or of several files of the same columns."""
    columns = []
    for column in schema:
        words = {key.decode(): value.decode() for key, value in column.metadata.items()}
        unit = "" if words["unit"] in {"1", ""} else f" [{words['unit']}]"
        shape = json.loads(words.get("shape", "[]"))
        inner = column.type.value_type if shape else column.type
        kind = mlc.DataType.INTEGER if pa.types.is_integer(inner) else mlc.DataType.FLOAT
        array = (
            {"is_array": True, "array_shape": ",".join(map(str, shape))} if shape else {}
        )
        described = mlc.Field(
            id=f"{name}/{column.name}",
            name=column.name,
            description=f"{words['long_name']}{unit}",
            data_types=[kind],
            source=mlc.Source(**source, extract=mlc.Extract(column=column.name)),
            **array,
        )
        columns.append(described)
    return mlc.RecordSet(id=name, name=name, key=[f"{name}/sample"], fields=columns)
