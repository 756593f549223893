"""The data card: a dataset described in Markdown, from its scene, ranges and versions."""

import json
import math
import re

import tomli_w
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from gen.database import Reader
from gen.export import files, tables
from gen.export.about import About
from gen.runtime.terminal import printable
from gen.schema import REASONS, Status

NAME = "README.md"
"""Name of the card in the folder of an export."""

SCENE = "scene.toml"
"""Name of the scene in the folder of an export."""

TEXTS = {"title", "creator", "licence"}
"""Keys of a scene with texts of anybody's."""

PATCHES = {
    "free": "a patch with free edges",
    "periodic": "a periodic patch",
    "mirror": "a patch that its mirror images surround",
}
"""Words for the boundaries of a patch."""


def words(reader: Reader) -> str:
    """Describe a dataset in a few sentences.

    Parameters
    ----------
    reader : Reader
        Database.

    Returns
    -------
    str
        Sentences on surfaces, contact and loads.
    """
    scene = reader.scene
    (nx, ny), (along, across) = scene.shape, scene.sides
    bodies = "elastic bodies" if scene.contact.hardness_limits is None else "bodies that yield"
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
    tables_last = dict(sorted(content.items(), key=lambda item: isinstance(item[1], dict)))
    return tomli_w.dumps(tables_last)


def card(reader: Reader, about: About, done: int) -> str:
    """Write the data card of an export.

    Parameters
    ----------
    reader : Reader
        Database.
    about : About
        Title, creator, licence and identifier.
    done : int
        Number of rows that are exported.

    Returns
    -------
    str
        The card in Markdown.
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
    environment.filters |= {"json": _quoted, "form": _limit}
    text = environment.get_template("card.md.jinja").render(_values(reader, about, done))
    return text.replace("\\\n", "")


def _values(reader: Reader, about: About, done: int) -> dict[str, object]:
    """Return the values that the template of the card names."""
    attributes, scene = reader.attributes, reader.scene
    counts = reader.counts()
    versions = json.loads(str(attributes["versions"]))
    failures = reader.reasons(Status.FAILED)
    return {
        "about": about,
        "words": Markup(words(reader)),
        "attributes": attributes,
        "versions": ", ".join(f"{name} {version}" for name, version in versions.items()),
        "done": done,
        "failed": counts.failed,
        "pending": counts.pending,
        "failures": {REASONS.get(code, str(code)): number for code, number in failures.items()},
        "rows_file": files.ROWS,
        "fields_folder": files.FIELDS,
        "fields": tables.fields(reader),
        "shape": " x ".join(map(str, scene.shape)),
        "nodes": scene.shape,
        "first": reader.rows.start + int(tables.done_rows(reader).argmax()),
        "columns": tables.scalars(reader),
        "ranges": {**dict.fromkeys(_names(reader), (math.nan, math.nan)), **reader.ranges()},
        "tiles": "tile" in _names(reader),
        "yields": scene.contact.hardness_limits is not None,
        "free": not scene.edgeless,
        "scene": Markup(scene_text(reader)),
        "citation": about.citation(str(attributes["created"])[:4]),
    }


def _quoted(text: str) -> Markup:
    """Write a text in YAML's quotes, which are those of JSON, without the sign that opens HTML."""
    return Markup(json.dumps(text).replace("<", "\\u003c"))


def _plain(value: object) -> object:
    """Write a text of a database so that Markdown shows its letters, in one line; no markup is."""
    if not isinstance(value, str) or isinstance(value, Markup):
        return value
    return re.sub(r"([\\`*|\[\]])", r"\\\1", printable(value)).replace("<", "&lt;")


def _names(reader: Reader) -> list[str]:
    """Return the names of the columns with one value a row."""
    return [column.name for column in tables.scalars(reader)]


def _limit(value: float) -> str:
    """Write a smallest or largest value; nothing where no row has one."""
    return "" if math.isnan(value) else f"{value:.6g}"
