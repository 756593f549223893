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


def test_every_value_and_unit_is_in_the_parquet_files(folder):
    table = pq.read_table(folder / "out" / "rows.parquet")
    with Reader(folder / "a.h5") as reader:
        assert table["sample"].to_pylist() == list(range(40))
        for column in rows_files.exported_columns(reader).scalars:
            assert np.array_equal(
                table[column.name].to_numpy(), reader.column(column.name)
            )
            metadata = table.schema.field(column.name).metadata
            assert metadata[b"unit"].decode() == column.unit
            assert metadata[b"long_name"].decode() == column.long_name
        for name in ("heights", "pressure"):
            (file,) = (folder / "out" / "fields").glob(f"{name}-*.parquet")
            values = np.array(pq.read_table(file)[name].to_pylist()).reshape(40, 9, 9)
            assert np.array_equal(values, reader.column(name))
        assert not {"host", "rank", "status"} & set(table.column_names)


@pytest.mark.filterwarnings(
    "ignore::DeprecationWarning"
)  # of the validator's own libraries
def test_croissant_is_valid_and_its_loader_reads_the_rows(folder):
    dataset = mlc.Dataset(str(folder / "out" / "croissant.json"))
    assert not dataset.metadata.ctx.issues.errors
    assert not dataset.metadata.ctx.issues.warnings
    assert dataset.metadata.name == "A trial: with a colon"
    rows = list(dataset.records("rows"))
    with Reader(folder / "a.h5") as reader:
        assert [row["rows/area_percent"] for row in rows] == list(
            reader.column("area_percent")
        )
        fields = list(dataset.records("pressure"))
        assert np.array_equal(
            [row["pressure/pressure"] for row in fields],
            reader.column("pressure").reshape(40, 81),
        )


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


def test_folders_with_something_else_are_left_alone(folder, tmp_path, refused):
    other = filled(tmp_path / "b.h5", small(4), (0, 4, Status.DONE))
    shutil.copytree(folder / "out", tmp_path / "out")
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "README.md").write_text("mine")
    for place, words in (
        ("out", "another database"),
        ("full", "not empty and no export"),
    ):
        before = contents(tmp_path / place)
        assert words in refused(cli, "export", other, "-o", tmp_path / place)
        assert contents(tmp_path / place) == before


def test_a_licence_that_nobody_can_look_up_and_a_folder_at_work_are_refused(
    folder, tmp_path, refused
):
    line = ["export", folder / "a.h5", "-o", tmp_path / "new"]
    said = refused(cli, *line, "--licence", "MIT or Apache-2.0")
    assert "'MIT or Apache-2.0': give an SPDX identifier" in said
    with lock_folder(tmp_path / "new"):
        assert "is being written by host" in refused(cli, *line)
    assert not (tmp_path / "new").exists()


HOSTILE = "T\n# x | <script>alert(1)</script> \x1b[31m ` *b* [y](javascript:z) \u202e \\"


def tokens(text):
    """The tokens of a text in Markdown with tables and raw HTML, those inside of others too."""
    for token in MarkdownIt("commonmark", {"html": True}).enable("table").parse(text):
        yield from (token, *(token.children or ()))


@pytest.mark.parametrize("title", ["", "My \\ title | <b>"])
def test_texts_of_a_database_are_shown_in_a_card_and_mark_nothing_up(tmp_path, title):
    """Also texts that the command would refuse as options."""
    texts = dict.fromkeys(("title", "creator", "licence"), HOSTILE)
    filled(tmp_path / "a.h5", small(3).model_copy(update=texts), (0, 3, Status.DONE))
    line = ["export", str(tmp_path / "a.h5"), "-o", str(tmp_path / "out")]
    assert cli.main([*line, "--title", title] if title else line) == 0
    text = (tmp_path / "out" / "README.md").read_text()
    assert all(letter.isprintable() for letter in text.replace("\n", ""))
    front, _, body = text.removeprefix("---\n").partition("\n---\n")
    shown, heading = printable(HOSTILE), title or printable(HOSTILE)
    assert f"pretty_name: {json.dumps(heading)}".replace("<", "\\u003c") in front
    assert len(front.splitlines()) == 2
    found = list(tokens(body))
    assert not {"html_block", "html_inline", "link_open", "em_open"} & {
        each.type for each in found
    }
    said = [
        "".join(part.content for part in each.children) for each in found if each.children
    ]
    assert said[0] == heading
    assert said[said.index("creator") + 1] == said[said.index("licence") + 1] == shown
    assert said[-1].startswith(f"{shown} (20")
    json.loads((tmp_path / "out" / "croissant.json").read_text())


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
