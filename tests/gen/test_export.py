"""A database as Parquet, card and Croissant: other programs read what the database holds."""

import json
import shutil

import h5py
import mlcroissant as mlc
import numpy as np
import pyarrow.parquet as pq
import pytest
from databases import block, database_of, filled, small
from markdown_it import MarkdownIt

from gen import cli, schema
from gen import export as exporting
from gen.database import Reader, Writer
from gen.export import rows as rows_files
from gen.runtime.files import lock_folder
from gen.runtime.terminal import printable
from gen.schema import Status

SCENE = """samples = 40
samples_per_surface = 4
title = "A trial: with a colon"
creator = "A. Founder"
licence = "CC-BY-4.0"
[surface]
nodes = 9
[store]
heights = true
pressure = true
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with a scene, its database and the database's export."""
    folder = tmp_path_factory.mktemp("export")
    database = str(database_of(folder, SCENE, "a"))
    line = [
        "export",
        database,
        "-o",
        str(folder / "out"),
        "--doi",
        "doi:10.5281/zenodo.12",
    ]
    assert cli.main(line) == 0
    return folder


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.fixture
def reader(folder):
    """The database that is exported."""
    with Reader(folder / "a.h5") as reader:
        yield reader


@pytest.fixture(scope="module")
def table(folder):
    """The table of all rows of the export."""
    return pq.read_table(folder / "out" / "rows.parquet")


def test_every_value_is_in_the_table_of_rows(table, reader):
    assert table["sample"].to_pylist() == list(range(40))
    for column in rows_files.exported_columns(reader).scalars:
        assert np.array_equal(table[column.name].to_numpy(), reader.column(column.name))


def test_every_column_of_the_table_has_its_unit_and_meaning(table, reader):
    for column in rows_files.exported_columns(reader).scalars:
        metadata = table.schema.field(column.name).metadata
        assert metadata[b"unit"].decode() == column.unit
        assert metadata[b"long_name"].decode() == column.long_name


@pytest.mark.parametrize("name", ["heights", "pressure"])
def test_every_field_is_in_files_of_its_own(folder, reader, name):
    (file,) = (folder / "out" / "fields").glob(f"{name}-*.parquet")
    values = np.array(pq.read_table(file)[name].to_pylist()).reshape(40, 9, 9)
    assert np.array_equal(values, reader.column(name))


def test_the_machine_that_computed_a_row_stays_private(table):
    assert not {"host", "rank", "status"} & set(table.column_names)


@pytest.fixture
def dataset(folder):
    """The export as the makers of Croissant validate and load it."""
    return mlc.Dataset(str(folder / "out" / "croissant.json"))


old_libraries = pytest.mark.filterwarnings("ignore::DeprecationWarning")
"""For warnings of the validator's own libraries."""


@old_libraries
def test_croissant_s_description_is_valid(dataset):
    assert not dataset.metadata.ctx.issues.errors
    assert not dataset.metadata.ctx.issues.warnings
    assert dataset.metadata.name == "A trial: with a colon"


@old_libraries
def test_croissant_s_loader_reads_the_rows(dataset, reader):
    areas = [row["rows/area_percent"] for row in dataset.records("rows")]
    assert areas == list(reader.column("area_percent"))


@old_libraries
def test_croissant_s_loader_reads_the_fields(dataset, reader):
    fields = [row["pressure/pressure"] for row in dataset.records("pressure")]
    assert np.array_equal(fields, reader.column("pressure").reshape(40, 81))


def test_the_scene_of_an_export_makes_the_same_rows(folder, tmp_path):
    scene = str(folder / "out" / "scene.toml")
    assert cli.main(["run", scene, "-o", str(tmp_path / "b.h5")]) == 0
    with Reader(folder / "a.h5") as one, Reader(tmp_path / "b.h5") as other:
        assert np.array_equal(one.column("force"), other.column("force"))
        assert one.scene == other.scene


def test_the_card_names_creator_columns_ranges_and_files(folder):
    text = (folder / "out" / "README.md").read_text()
    for words in (
        "A. Founder",
        "CC-BY-4.0",
        "https://doi.org/10.5281/zenodo.12",
        "40 exported",
    ):
        assert words in text
    for column in (
        "`area_percent` | % | effective contact area |",
        "fields/heights-*.parquet",
    ):
        assert column in text
    assert not [line for line in text.splitlines() if line.endswith("\\")]


def test_only_done_rows_are_exported_and_the_others_counted(tmp_path, capsys):
    scene = small(12)
    runs = (0, 3, Status.DONE), (3, 5, Status.FAILED), (8, 10, Status.DONE)
    path = filled(tmp_path / "a.h5", scene, *runs)
    assert cli.main(["export", str(path), "-o", str(tmp_path / "out")]) == 0
    assert "5 rows; 7 failed or pending" in capsys.readouterr().out
    table = pq.read_table(tmp_path / "out" / "rows.parquet")
    assert table["sample"].to_pylist() == [0, 1, 2, 8, 9]
    text = (tmp_path / "out" / "README.md").read_text()
    assert "2 failed and left out, 5 not computed yet" in text
    assert f"2: {schema.REASONS[schema.Reason.NOT_CONVERGED]}" in text


def test_an_interrupted_export_goes_on_and_keeps_whole_files(
    folder, tmp_path, monkeypatch
):
    monkeypatch.setattr(rows_files, "FILE_BYTES", 9 * 9 * 8 * 10)
    path, out = folder / "a.h5", tmp_path / "out"
    write, calls = exporting.write_piece, []

    def interrupted(piece, *arguments):
        calls.append(piece.name)
        if len(calls) == 4:
            raise KeyboardInterrupt
        write(piece, *arguments)

    monkeypatch.setattr(exporting, "write_piece", interrupted)
    assert cli.main(["export", str(path), "-o", str(out)]) == 130
    kept = {name: (out / name).stat().st_ino for name in calls[:3]}
    assert not (out / "croissant.json").exists()
    monkeypatch.setattr(exporting, "write_piece", write)
    assert cli.main(["export", str(path), "-o", str(out)]) == 0
    assert {name: (out / name).stat().st_ino for name in kept} == kept
    assert cli.main(["export", str(path), "-o", str(tmp_path / "whole")]) == 0
    assert contents(out) == contents(tmp_path / "whole")
    assert len(list((out / "fields").iterdir())) == 8


def test_an_export_of_a_database_that_has_grown_is_renewed(tmp_path):
    scene = small(12)
    path = filled(tmp_path / "a.h5", scene, (0, 3, Status.DONE))
    line = ["export", str(path), "-o", str(tmp_path / "out")]
    assert cli.main(line) == 0
    with Writer(path, scene) as writer:
        writer.write_block(3, 9, block(scene, 3, 9))
    assert cli.main(line) == 0
    assert pq.read_table(tmp_path / "out" / "rows.parquet").num_rows == 9


@pytest.mark.parametrize(
    ("place", "words"), [("out", "another database"), ("full", "not empty and no export")]
)
def test_folders_with_something_else_are_left_alone(
    folder, tmp_path, refused, place, words
):
    other = filled(tmp_path / "b.h5", small(4), (0, 4, Status.DONE))
    shutil.copytree(folder / "out", tmp_path / "out")
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "README.md").write_text("mine")
    before = contents(tmp_path / place)
    assert words in refused(cli, "export", other, "-o", tmp_path / place)
    assert contents(tmp_path / place) == before


def test_a_licence_that_nobody_can_look_up_is_refused(folder, tmp_path, refused):
    line = ["export", folder / "a.h5", "-o", tmp_path / "new"]
    message = refused(cli, *line, "--licence", "MIT or Apache-2.0")
    assert "'MIT or Apache-2.0': give an SPDX identifier" in message
    assert not (tmp_path / "new").exists()


def test_a_folder_at_work_is_refused(folder, tmp_path, refused):
    line = ["export", folder / "a.h5", "-o", tmp_path / "new"]
    with lock_folder(tmp_path / "new"):
        assert "is being written by host" in refused(cli, *line)
    assert not (tmp_path / "new").exists()


HOSTILE = "T\n# x | <script>alert(1)</script> \x1b[31m ` *b* [y](javascript:z) \u202e \\"


class HostileCard:
    """The card of a database with hostile texts, also such as the command refuses as options."""

    def __init__(self, folder, title):
        texts = dict.fromkeys(("title", "creator", "licence"), HOSTILE)
        scene = small(3).model_copy(update=texts)
        filled(folder / "a.h5", scene, (0, 3, Status.DONE))
        line = ["export", str(folder / "a.h5"), "-o", str(folder / "out")]
        assert cli.main([*line, "--title", title] if title else line) == 0
        self.folder = folder / "out"
        self.title = title or printable(HOSTILE)
        self.text = (self.folder / "README.md").read_text()
        self.front, _, body = self.text.removeprefix("---\n").partition("\n---\n")
        markdown = MarkdownIt("commonmark", {"html": True}).enable("table")
        self.tokens = markdown.parse(body)

    def kinds(self):
        """Kinds of all tokens of the Markdown, with raw HTML, and of those inside of others."""
        inner = [child for token in self.tokens for child in token.children or ()]
        return {token.type for token in (*self.tokens, *inner)}

    def lines(self):
        """Texts of headings, paragraphs and cells as a browser shows them."""
        return [
            "".join(part.content for part in token.children)
            for token in self.tokens
            if token.children
        ]


@pytest.fixture(scope="module", params=["", "My \\ title | <b>"])
def hostile(request, tmp_path_factory):
    return HostileCard(tmp_path_factory.mktemp("hostile"), request.param)


def test_letters_of_a_card_are_printable(hostile):
    assert all(letter.isprintable() for letter in hostile.text.replace("\n", ""))


def test_the_title_is_one_text_of_a_card_s_front_matter(hostile):
    quoted = json.dumps(hostile.title).replace("<", "\\u003c")
    assert f"pretty_name: {quoted}" in hostile.front
    assert len(hostile.front.splitlines()) == 2


def test_texts_of_a_database_mark_nothing_up_in_a_card(hostile):
    markup = {"html_block", "html_inline", "link_open", "em_open"}
    assert not markup & hostile.kinds()


def test_texts_of_a_database_are_shown_in_a_card(hostile):
    lines, shown = hostile.lines(), printable(HOSTILE)
    assert lines[0] == hostile.title
    assert lines[lines.index("creator") + 1] == shown
    assert lines[lines.index("licence") + 1] == shown
    assert lines[-1].startswith(f"{shown} (20")


def test_hostile_texts_leave_the_description_for_machines_readable(hostile):
    json.loads((hostile.folder / "croissant.json").read_text())


def test_letters_that_utf_8_cannot_hold_become_question_marks(tmp_path):
    """As a stranger's database may have them, of any writer's."""
    filled(tmp_path / "a.h5", small(3), (0, 3, Status.DONE))
    with h5py.File(tmp_path / "a.h5", "r+") as file:
        content = json.loads(file.attrs["scene"]) | {
            "creator": "a \udcff b",
            "title": "\ud800",
        }
        text = json.dumps(content).encode()
        file.attrs.create("scene", text, dtype=h5py.string_dtype("utf-8", len(text)))
    assert cli.main(["export", str(tmp_path / "a.h5"), "-o", str(tmp_path / "out")]) == 0
    assert "| creator | a ? b |" in (tmp_path / "out" / "README.md").read_text()
    assert "a ? b" in (tmp_path / "out" / "scene.toml").read_text()
