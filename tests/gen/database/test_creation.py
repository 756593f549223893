"""Creation, extension and merging of databases, and what no command takes for one of them."""

import json
import resource
import signal

import crafted_databases as crafted
import h5py
import numpy as np
import pytest
from databases import (
    NO_ROOM,
    PHYSICS,
    block,
    database_of,
    deterministic_bytes,
    filled,
    raise_physics,
    run,
    small,
    without_checksums,
)

from gen import cli, database, schema
from gen.database import Reader, Writer, create, merge, open_or_create
from gen.runtime.errors import InputError
from gen.scene import ALL_COLUMNS, Scene, Store, columns_for, markdown_of_columns
from gen.schema import DRAWN_NAMES, PHYSICS_CHANGES, Status

KILLED_WHILE_EXTENDING = """
    import os, signal, sys
    from pathlib import Path
    from gen import database
    path = Path(sys.argv[1])
    with database.Reader(path) as reader:
        scene = reader.scene
    database.creation._merge_rows = lambda *_, **__: os.kill(os.getpid(), signal.SIGKILL)
    database.open_or_create(path, scene.model_copy(update={"samples": 15}))
"""


def test_more_samples_extend_the_file(path):
    scene = small(store=Store(heights=True))
    filled(path, scene, (2, 5, Status.DONE), (7, 8, Status.FAILED))
    with Reader(path) as reader:
        created = reader.attributes["created"]
    more = small(15, store=Store(heights=True))
    assert open_or_create(path, more) == "extended"
    with Writer(path, more) as writer:
        assert writer.pending() == [range(2), range(5, 7), range(8, 15)]
    wanted = block(scene, 2, 5)
    with Reader(path) as reader:
        assert reader.scene == more
        assert reader.attributes["samples"] == 15
        assert reader.attributes["created"] == created
        for column in reader.columns():
            if column.name in wanted:
                there = reader.column(column.name, 2, 5)
                np.testing.assert_array_equal(there, wanted[column.name])
            rest = reader.column(column.name, 10)
            np.testing.assert_array_equal(rest, np.full_like(rest, column.fill))
        assert reader.has_checksums
        assert not reader.damaged_rows().size
    assert list(path.parent.iterdir()) == [path]


def test_kill_while_extending_leaves_the_old_file(path):
    filled(path, small(), (0, 3, Status.DONE))
    before = path.read_bytes()
    assert run(KILLED_WHILE_EXTENDING, path).returncode == -signal.SIGKILL
    assert path.read_bytes() == before
    assert open_or_create(path, small(15)) == "extended"
    assert list(path.parent.iterdir()) == [path]


def test_creation_never_overwrites_what_appears_meanwhile(path, monkeypatch):
    monkeypatch.setattr(
        database.creation, "_merge_rows", lambda *_, **__: path.write_text("precious")
    )
    with pytest.raises(InputError, match="meanwhile"):
        create(path, small())
    assert path.read_text() == "precious"


def test_leftover_of_a_killed_creation_is_removed_and_the_users_files_stay(path):
    left = [
        path.with_name(f"some.h5.{name}.part") for name in ("0" * 16, "0123456789abcdef")
    ]
    for each, content in zip(left, (b"", b"\x89HDF\r\n\x1a\nhalf a file"), strict=True):
        each.write_bytes(content)
    precious = path.with_name("precious")
    own = [
        path.with_name(f"some.h5.{name}")
        for name in ("part", "1.part", f"{'1' * 16}.part", "bak")
    ]
    for each in (precious, *own):
        each.write_text("precious")
    link = path.with_name(f"some.h5.{'2' * 16}.part")
    link.symlink_to(precious)
    create(path, small())
    assert set(path.parent.iterdir()) == {path, precious, *own, link}
    assert {each.read_text() for each in (precious, *own, link)} == {"precious"}


def test_creation_without_room_leaves_nothing(path):
    action = "forbid_growth_beyond(200_000); create(path, Scene(samples=10_000))"
    result = run(NO_ROOM.format(action=action), path)
    assert "disk is full" in result.stdout
    assert "nothing was changed" in result.stdout
    assert (result.returncode, result.stderr) == (0, "")
    assert list(path.parent.iterdir()) == []


def test_creation_that_cannot_fit_does_not_start(path):
    with pytest.raises(InputError, match=r"need [\d,.]+ TB, [\d,.]+ [GT]B are free"):
        create(path, Scene(samples=10**9, store=Store(heights=True)))
    assert list(path.parent.iterdir()) == []


def test_merge_takes_the_best_of_every_row(tmp_path, monkeypatch):
    monkeypatch.setattr(database.reader, "CHUNK_BYTES", 3 * 8 * 25)
    store = Store(heights=True)
    one = filled(tmp_path / "one.h5", small(10, store=store), (0, 4, 1), (6, 8, 2))
    two = filled(
        tmp_path / "two.h5", small(15, store=store), (2, 7, 1), (8, 9, 2), (14, 15, 1)
    )
    target = tmp_path / "both.h5"
    assert merge(target, [one, two]) == (5, 8, 2)
    scene = small(15, store=store)
    wanted = block(scene, 0, 15)
    with Reader(target) as reader:
        assert reader.scene == scene
        statuses = [1, 1, 1, 1, 1, 1, 1, 2, 2, 0, 0, 0, 0, 0, 1]
        assert reader.column("status").tolist() == statuses
        for name in wanted.keys() - {"status", "reason"}:
            known = np.flatnonzero(statuses)
            np.testing.assert_array_equal(reader.column(name)[known], wanted[name][known])
        assert not reader.damaged_rows().size
    with Writer(target, scene) as writer:
        assert writer.pending() == [range(9, 14)]
    assert sorted(tmp_path.iterdir()) == sorted([one, two, target])


def test_merge_refuses_rows_that_differ_in_one_bit(tmp_path):
    scene = small()
    one = filled(tmp_path / "one.h5", scene, (0, 4, Status.DONE))
    two = filled(tmp_path / "two.h5", scene)
    values = block(scene, 0, 4)
    values["force"][2] = np.nextafter(values["force"][2], np.inf)
    with Writer(two, scene) as writer:
        writer.write_block(0, 4, values)
    with pytest.raises(
        InputError, match=r"row 2: force differs between .*one\.h5 and .*two\.h5"
    ):
        merge(tmp_path / "both.h5", [one, two])
    assert sorted(tmp_path.iterdir()) == [one, two]


def test_merge_names_the_database_in_which_a_row_is_damaged(tmp_path):
    scene = small()
    one, two = (
        filled(tmp_path / f"{name}.h5", scene, (0, 4, 1)) for name in ("one", "two")
    )
    with h5py.File(two, "r+") as file:
        file["force"][2] = 0.0
    with pytest.raises(
        InputError, match=r"row 2: force differs .* is damaged in .*two\.h5: .*--rep"
    ):
        merge(tmp_path / "both.h5", [one, two])


@pytest.mark.few(1)
@pytest.mark.parametrize("older", [("one",), ("one", "two")])
def test_files_without_checksums_are_read_continued_extended_and_merged(
    here, monkeypatch, older
):
    """Older versions made them; all other bytes are the same."""
    scene = "samples = {}\n[surface]\nnodes = 9\n"
    whole = deterministic_bytes(database_of(here, scene.format(12), "whole"))
    for name, rows in (("one", "0:5"), ("two", "5:12")):
        with monkeypatch.context() as patch:
            if name in older:
                without_checksums(patch)
            database_of(here, scene.format(12), name, "--rows", rows)
    del whole["checksum"]
    for line in (
        "run one.toml -o one.h5 --rows 0:7",
        "info one.h5",
        "check one.h5 --recompute 2",
        "merge one.h5 two.h5 -o merged.h5",
        "run whole.toml -o one.h5",
    ):
        assert cli.main(line.split()) == 0
    assert deterministic_bytes(here / "merged.h5") == whole
    assert deterministic_bytes(here / "one.h5") == whole


def test_merge_refuses_other_scenes_physics_and_targets(tmp_path, monkeypatch):
    one = filled(tmp_path / "one.h5", small(seed=1))
    two = filled(tmp_path / "two.h5", small(seed=2))
    target = tmp_path / "both.h5"
    with pytest.raises(
        InputError, match=r"different scenes, and are not merged:\n  seed: 1 in"
    ):
        merge(target, [one, two])
    with pytest.raises(InputError, match="nothing to merge"):
        merge(target, [])
    with pytest.raises(InputError, match="exists"):
        merge(two, [one])
    raise_physics(monkeypatch)
    three = filled(tmp_path / "three.h5", small(seed=1))
    with pytest.raises(
        InputError, match=rf"physics {PHYSICS} and of physics {PHYSICS + 1}"
    ):
        merge(target, [one, three])
    assert not target.exists()


def test_file_is_allocated_contiguous_and_opens_after_a_kill(path):
    create(path, small(store=Store(pressure=True)))
    with h5py.File(path) as file:
        for column in columns_for(small(store=Store(pressure=True))):
            dataset = file[column.path]
            assert dataset.chunks is None
            assert dataset.id.get_offset() is not None
    # Superblocks from version 3 on mark a file as open for writing, and a kill leaves the mark.
    assert path.read_bytes()[8] == 2


def test_file_says_where_it_comes_from(path):
    scene = small(title="A title")
    create(path, scene)
    with Reader(path) as reader:
        attributes = reader.attributes
    assert Scene.from_text(attributes["scene"]) == scene
    assert attributes["scene_hash"] == scene.fingerprint()
    assert attributes["samples"] == 10
    assert attributes["title"] == "A title"
    assert attributes["schema"] == schema.SCHEMA
    assert attributes["physics"] == schema.PHYSICS
    versions = json.loads(attributes["versions"])
    assert {"python", "numpy", "scipy", "pyfftw", "h5py", "hdf5"} <= versions.keys()
    assert len(attributes["git_commit"]) in {0, 40}


SPECTRAL = """
samples = 8
[surface]
generator = "spectral"
nodes = 16
roll_off = 500.0
cut_off = 200.0
RMS = [0.5, 2.0]
[load]
quantity = "delta/height_rms"
range = [0.5, 1.0]
"""


@pytest.fixture(scope="module")
def paths(tmp_path_factory):
    return crafted.prepare(tmp_path_factory.mktemp("crafted"))


@pytest.mark.parametrize(
    "command", [name for name in crafted.COMMANDS if name[:3] == "gen"]
)
def test_every_command_refuses_what_gen_cannot_have_laid_out(
    paths, command, monkeypatch, capsys
):
    monkeypatch.chdir(paths["huge"].parent)
    names = list(crafted.CRAFTED) if command in {"gen run", "gen info"} else crafted.KINDS
    crafted.refuse(cli.main, command, names, capsys)


@pytest.mark.parametrize("command", [["run", "quick", "-o"], ["info"]])
def test_files_of_other_programs_are_no_databases(here, refused, command):
    with h5py.File("foreign.h5", "w") as file:
        file["temperature"] = np.arange(2000.0)
    before = (here / "foreign.h5").read_bytes()
    assert "foreign.h5" in refused(cli, *command, "foreign.h5")
    assert (here / "foreign.h5").read_bytes() == before


def writer(path):
    return Writer(path, Scene.parse(crafted.SCENE, "scene"))


@pytest.mark.parametrize("opening", [Reader, writer])
def test_refusing_asks_for_no_memory(paths, opening):
    with pytest.raises(InputError):  # HDF5's own memory, once
        opening(paths["soft-link"])
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(InputError):
        opening(paths["huge"])
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 20_000  # kB


@pytest.mark.few(1)
@pytest.mark.parametrize(("older", "drawn"), DRAWN_NAMES.items())
def test_files_with_older_names_are_read_continued_extended_and_merged(
    here, older, drawn
):
    """The columns of drawn heights and slopes had the names of the parameters."""
    scene = SPECTRAL.replace("RMS", older)

    def columns(name):
        with Reader(here / name) as reader:
            wanted = [each.name for each in reader.columns() if each.deterministic]
            np.testing.assert_array_equal(reader.column(older), reader.column(drawn))
            low, high = reader.ranges()[drawn]
            assert 0.5 <= low <= high <= 2.0
            return {each: reader.column(each) for each in wanted}

    database_of(here, scene.replace("8", "12", 1), "whole")
    database_of(here, scene, "old", "--rows", "0:5")
    with h5py.File("old.h5", "r+") as file:
        file.move(drawn, older)
    columns("old.h5")
    for line in (
        "run old.toml -o old.h5",
        "info old.h5",
        "check old.h5 --recompute 2",
        "merge old.h5 whole.h5 -o merged.h5",
        "run whole.toml -o old.h5",
    ):
        assert cli.main(line.split()) == 0
    whole = columns("whole.h5")
    for name in ("merged.h5", "old.h5"):
        again = columns(name)
        assert again.keys() == whole.keys()
        for column, values in whole.items():
            np.testing.assert_array_equal(again[column], values, err_msg=column)


def test_every_column_is_a_type_of_numpy_and_explained():
    for column in ALL_COLUMNS:
        assert np.array(column.fill, dtype=column.dtype).shape == ()
        assert column.long_name
        assert column.unit or column.dtype[0] == "S"


def test_every_physics_number_says_what_it_changed():
    assert list(PHYSICS_CHANGES) == list(range(11, PHYSICS + 1))
    for change in PHYSICS_CHANGES.values():
        assert change.isprintable()
        assert 20 < len(change) < 200


def test_table_has_every_column_and_table_1s_ranges():
    lines = markdown_of_columns()
    assert len(lines) == len(ALL_COLUMNS) + 2
    assert all(line.count("|") == 5 for line in lines)
    assert "| `area_percent` | % | effective contact area | 0.01 to 16.56 |" in lines
    assert "| `runtime/rank` | 1 | MPI rank that computed the sample |  |" in lines
