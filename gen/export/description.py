"""Descriptions of an export: bibliographic data, a card in Markdown, and Croissant's JSON-LD.

Source: MLCommons, Croissant Format Specification 1.0, https://docs.mlcommons.org/croissant.
"""

import json
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any, Self

import mlcroissant as mlc
import pyarrow as pa
import tomli_w
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from gen.database import Reader
from gen.export.rows import FIELDS, ROWS, DoneRows, Piece, exported_columns
from gen.runtime.errors import InputError
from gen.runtime.files import digest
from gen.runtime.terminal import printable
from gen.schema import REASONS, Status

# digital object identifier (ISO 26324), without a resolver
DOI = re.compile(r"10\.\d{4,9}/\S+")
# beginnings with which an identifier is often written
RESOLVER = re.compile(r"(https?://doi\.org/|doi:)", re.IGNORECASE)

LICENCE = re.compile(r"https?://\S+|[\w.+-]+( (AND|OR|WITH) [\w.+-]+)*", re.ASCII)
"""An address, or an SPDX expression without brackets (SPDX 2.3, annex D)."""

# keys of a scene whose values are free texts of its author
TEXTS = {"title", "creator", "licence"}

PATCHES = {
    "free": "a patch with free edges",
    "periodic": "a periodic patch",
    "mirror": "a patch that its mirror images surround",
}
"""Words for the boundaries of a patch."""

# media type of Parquet files that Croissant's loader recognises
PARQUET = "application/x-parquet"


@dataclass(frozen=True)
class About:
    """Bibliographic data of a dataset. A text that is not known is empty."""

    title: str
    creator: str = ""
    licence: str = ""  # an SPDX identifier, for example "CC-BY-4.0", or an address
    doi: str = ""  # digital object identifier, without the address of a resolver

    @classmethod
    def of(cls, reader: Reader, title: str, creator: str, licence: str, doi: str) -> Self:
        """Check the options of a command, and take empty ones from the database.

        Parameters
        ----------
        reader : Reader
            The database.
        title : str
            Option with the title; if "", the title of the database.
        creator : str
            Option with the creator; if "", the creator in the scene of the database.
        licence : str
            Option with an SPDX identifier or an address; if "", the licence in the scene.
        doi : str
            Option with the digital object identifier, with or without the address of its resolver;
            "" if there is none.

        Returns
        -------
        About
            The data, in printable characters.

        Raises
        ------
        InputError
            If a text has a character that is not printable, as a line break, or the licence or the
            identifier has a wrong form.
        """
        identifier = RESOLVER.sub("", doi.strip(), count=1)
        if doi and not DOI.fullmatch(identifier):
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
        scene = reader.scene
        return cls(
            title=title or printable(str(reader.attributes["title"])),
            creator=creator or printable(scene.creator or ""),
            licence=licence or printable(scene.licence or ""),
            doi=identifier,
        )

    @property
    def address(self) -> str:
        """Address of the identifier's resolver with the identifier; "" without an identifier."""
        if not self.doi:
            return ""
        return f"https://doi.org/{self.doi}"

    def citation(self, year: str) -> str:
        """Return the citation of the dataset.

        Parameters
        ----------
        year : str
            Year in which the dataset was made.

        Returns
        -------
        str
            The citation in one line; "" without a creator.
        """
        if not self.creator:
            return ""
        citation = f"{self.creator} ({year}). {self.title} [Data set]."
        if self.address:
            citation += f" {self.address}"
        return citation


def summary(reader: Reader) -> str:
    """Describe the surfaces, the contact and the loads of a database in a few sentences.

    Parameters
    ----------
    reader : Reader
        The database.

    Returns
    -------
    str
        The sentences, in one line.
    """
    scene = reader.scene
    nx, ny = scene.grid.shape
    along_x, along_y = scene.grid.sides
    is_elastic = scene.contact.hardness_limits is None
    bodies = "elastic bodies" if is_elastic else "bodies that yield"
    if scene.contact.layer is not None:
        bodies += f" with a layer of {scene.contact.layer_text},"
    return (
        f"Contact of rough surfaces, solved by the boundary-element method: {bodies} pressed onto"
        f" {PATCHES[scene.contact.boundary]} of {nx} x {ny} nodes, {along_x:g} x {along_y:g} um,"
        f" with surfaces of the generator '{scene.surface.generator}' and loads given as"
        f" {scene.quantity} [{scene.load_unit}]. A row is one contact problem: the surface's"
        " parameters and roughness statistics, the load, the contact area and the force."
    )


def scene_text(reader: Reader) -> str:
    """Return the scene of a database as TOML.

    Parameters
    ----------
    reader : Reader
        The database.

    Returns
    -------
    str
        The scene. In the values of `TEXTS`, characters that are not printable become "?".
    """
    content = json.loads(reader.scene.text())
    for name in TEXTS & content.keys():
        content[name] = printable(content[name])
    # In TOML, keys of the scene itself have to come before its tables.
    keys = {key: value for key, value in content.items() if not isinstance(value, dict)}
    tables = {key: value for key, value in content.items() if isinstance(value, dict)}
    return tomli_w.dumps(keys | tables)


def card(reader: Reader, about: About, done: DoneRows) -> str:
    """Return the data card of an export, in Markdown.

    Parameters
    ----------
    reader : Reader
        The database.
    about : About
        Bibliographic data.
    done : DoneRows
        The exported rows, at least one.

    Returns
    -------
    str
        The card. Markup in texts of the database is escaped, so that readers see the letters.
    """
    attributes = reader.attributes
    columns = exported_columns(reader)
    failures = {
        REASONS.get(code, str(code)): number
        for code, number in reader.reasons(Status.FAILED).items()
    }
    template = _environment().get_template("card.md.jinja")
    text = template.render(
        about=about,
        summary=Markup(summary(reader)),
        attributes=attributes,
        versions=json.loads(str(attributes["versions"])),
        done=done.number,
        counts=reader.counts(),
        failures=failures,
        rows_file=ROWS,
        fields_folder=FIELDS,
        fields=columns.fields,
        nodes=reader.scene.grid.shape,
        first=done.first_done,
        columns=columns.scalars,
        names=[column.name for column in columns.scalars],
        ranges=reader.ranges(),
        settings=reader.scene.contact,
        scene=Markup(scene_text(reader)),
        citation=about.citation(str(attributes["created"])[:4]),
    )
    # In the template, a backslash at the end of a line joins it to the next line.
    return text.replace("\\\n", "")


def _environment() -> Environment:
    """Return Jinja's environment for the card, with the filters `json` and `number`.

    `_plain` is applied to every value that the template inserts.
    """
    environment = Environment(
        loader=PackageLoader("gen.export", "."),
        autoescape=False,
        finalize=_plain,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters["json"] = _json
    environment.filters["number"] = _number
    return environment


def _json(text: str) -> Markup:
    """Return a text as a literal of JSON, which is one of YAML too, for the head of the card.

    "<" is escaped, because it may begin a tag of HTML.
    """
    return Markup(json.dumps(text).replace("<", "\\u003c"))


def _number(value: float) -> str:
    """Write a number with at most 6 significant digits; return "" for NaN."""
    if math.isnan(value):
        return ""
    return f"{value:.6g}"


def _plain(value: object) -> object:
    """Write a text in one line, and escape it so that Markdown shows its letters as they are.

    A value that is no text, or a text of the type `Markup`, is returned unchanged.
    """
    if not isinstance(value, str) or isinstance(value, Markup):
        return value
    return re.sub(r"([\\`*|\[\]])", r"\\\1", printable(value)).replace("<", "&lt;")


def croissant(reader: Reader, about: About, folder: Path, pieces: Sequence[Piece]) -> str:
    """Return Croissant's description of an export, in JSON.

    Parameters
    ----------
    reader : Reader
        The database.
    about : About
        Bibliographic data.
    folder : Path
        Folder of the export. The file of the table of all rows exists already.
    pieces : sequence of Piece
        The Parquet files of the export: the table of all rows, then the files of the fields.

    Returns
    -------
    str
        The description. It has the size and the SHA-256 of the table of all rows, but not of the
        files of the fields.
    """
    table = pieces[0]
    distribution: list[mlc.FileObject | mlc.FileSet] = [_table_file(folder / table.name)]
    records = [_record_set("rows", table.schema, file_object=table.name)]
    # A file of a field has the columns `sample` and the field. The files of a field share a schema.
    field_schemas = {piece.schema.names[-1]: piece.schema for piece in pieces[1:]}
    for name, schema in field_schemas.items():
        file_set = mlc.FileSet(
            id=f"{name}-files",
            encoding_formats=[PARQUET],
            includes=[f"{FIELDS}/{name}-*.parquet"],
        )
        distribution.append(file_set)
        records.append(_record_set(name, schema, file_set=f"{name}-files"))
    created = datetime.fromisoformat(str(reader.attributes["created"]))
    metadata = mlc.Metadata(
        name=about.title,
        description=summary(reader),
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


def _table_file(path: Path) -> mlc.FileObject:
    """Describe the file of the table of all rows by its size and SHA-256."""
    return mlc.FileObject(
        id=path.name,
        name=path.name,
        content_url=path.name,
        content_size=f"{path.stat().st_size} B",
        encoding_formats=[PARQUET],
        sha256=digest(path),
    )


def _record_set(name: str, schema: pa.Schema, **source: str) -> mlc.RecordSet:
    """Describe the rows of one file, or of a set of files with one schema.

    `source` is one keyword of `mlcroissant.Source`: `file_object` or `file_set`, with the
    identifier of the file or of the set.
    """
    fields = [_field(name, column, source) for column in schema]
    return mlc.RecordSet(id=name, name=name, key=[f"{name}/sample"], fields=fields)


def _field(record_set: str, column: pa.Field, source: dict[str, str]) -> mlc.Field:
    """Describe a column of a record set; `source` is that of `_record_set`."""
    metadata = {key.decode(): text.decode() for key, text in column.metadata.items()}
    description = metadata["long_name"]
    if metadata["unit"] not in {"1", ""}:
        description += f" [{metadata['unit']}]"
    type_of_number = column.type
    array: dict[str, Any] = {}  # keywords for a column of fields
    if "shape" in metadata:
        type_of_number = column.type.value_type
        shape = json.loads(metadata["shape"])
        array = {"is_array": True, "array_shape": ",".join(map(str, shape))}
    is_whole = pa.types.is_integer(type_of_number)
    return mlc.Field(
        id=f"{record_set}/{column.name}",
        name=column.name,
        description=description,
        data_types=[mlc.DataType.INTEGER if is_whole else mlc.DataType.FLOAT],
        source=mlc.Source(**source, extract=mlc.Extract(column=column.name)),
        **array,
    )
