"""Creation, extension and merging of databases, and what no command takes for one of them."""

import json
import resource
import shutil
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


FIELDS = Store(heights=True)


class Extended:
    """A database of 10 rows, some of them finished, that was extended to 15."""

    def __init__(self, path):
        self.path = path
        self.scene = small(15, store=FIELDS)
        filled(path, small(store=FIELDS), (2, 5, Status.DONE), (7, 8, Status.FAILED))
        with Reader(path) as reader:
            self.created = reader.attributes["created"]
        self.action = open_or_create(path, self.scene)


@pytest.fixture(scope="module")
def extended(tmp_path_factory):
    return Extended(tmp_path_factory.mktemp("extended") / "some.h5")


def test_more_samples_extend_the_file(extended):
    assert extended.action == "extended"
    with Reader(extended.path) as reader:
        assert reader.scene == extended.scene
        assert reader.attributes["samples"] == 15
    assert list(extended.path.parent.iterdir()) == [extended.path]


def test_an_extension_keeps_the_time_of_creation(extended):
    with Reader(extended.path) as reader:
        assert reader.attributes["created"] == extended.created


def test_an_extension_keeps_finished_rows_with_their_checksums(extended):
    expected = block(extended.scene, 2, 5)
    with Reader(extended.path) as reader:
        for name, values in expected.items():
            np.testing.assert_array_equal(reader.column(name, 2, 5), values)
        assert reader.has_checksums
        assert not reader.damaged_rows().size


def test_new_rows_of_an_extension_are_pending_and_empty(extended):
    with Writer(extended.path, extended.scene) as writer:
        assert writer.pending() == [range(2), range(5, 7), range(8, 15)]
        for column in writer.columns():
            values = writer.column(column.name, 10)
            np.testing.assert_array_equal(values, np.full_like(values, column.fill))


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


MERGED_STATUSES = [1, 1, 1, 1, 1, 1, 1, 2, 2, 0, 0, 0, 0, 0, 1]


class Merged:
    """Two databases of one scene, and what a merge makes of them in chunks of few rows."""

    def __init__(self, folder):
        one = filled(folder / "one.h5", small(10, store=FIELDS), (0, 4, 1), (6, 8, 2))
        self.scene = small(15, store=FIELDS)
        two = filled(folder / "two.h5", self.scene, (2, 7, 1), (8, 9, 2), (14, 15, 1))
        self.sources = [one, two]
        self.path = folder / "both.h5"
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(database.reader, "CHUNK_BYTES", 3 * 8 * 25)
            self.counts = merge(self.path, self.sources)


@pytest.fixture(scope="module")
def merged(tmp_path_factory):
    return Merged(tmp_path_factory.mktemp("merged"))


def test_merge_takes_the_best_status_of_every_row(merged):
    assert merged.counts == (5, 8, 2)
    with Reader(merged.path) as reader:
        assert reader.column("status").tolist() == MERGED_STATUSES


def test_merge_takes_the_values_of_finished_rows_with_their_checksums(merged):
    expected = block(merged.scene, 0, 15)
    finished = np.flatnonzero(MERGED_STATUSES)
    with Reader(merged.path) as reader:
        for name in expected.keys() - {"status", "reason"}:
            np.testing.assert_array_equal(
                reader.column(name)[finished], expected[name][finished]
            )
        assert not reader.damaged_rows().size


def test_a_merged_database_is_of_the_larger_scene_and_can_be_continued(merged):
    with Reader(merged.path) as reader:
        assert reader.scene == merged.scene
    with Writer(merged.path, merged.scene) as writer:
        assert writer.pending() == [range(9, 14)]


def test_merge_leaves_its_sources_and_no_other_file(merged):
    files = sorted(merged.path.parent.iterdir())
    assert files == sorted([*merged.sources, merged.path])


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


NINE_NODES = "samples = 12\n[surface]\nnodes = 9\n"


@pytest.fixture(scope="module", params=[("one",), ("one", "two")])
def shares(request, tmp_path_factory):
    """A whole database and two shares of it, some of which an older version has made."""
    folder = tmp_path_factory.mktemp("shares")
    database_of(folder, NINE_NODES, "whole")
    for name, rows in (("one", "0:5"), ("two", "5:12")):
        with pytest.MonkeyPatch.context() as patch:
            if name in request.param:
                without_checksums(patch)
            database_of(folder, NINE_NODES, name, "--rows", rows)
    return folder


@pytest.fixture
def older(shares, here):
    """The current folder, with copies of the shares that a test may change."""
    for path in shares.iterdir():
        shutil.copy(path, here)
    return here


def bytes_without_checksums(path):
    columns = deterministic_bytes(path)
    columns.pop("checksum", None)
    return columns


@pytest.mark.usefixtures("older")
@pytest.mark.parametrize("line", ["info one.h5", "check one.h5 --recompute 2"])
def test_files_without_checksums_are_read(line):
    assert cli.main(line.split()) == 0


@pytest.mark.parametrize("rows", [["--rows", "0:7"], []])
def test_files_without_checksums_are_continued_and_extended(older, rows):
    assert cli.main(["run", "one.toml", "-o", "one.h5", *rows]) == 0
    assert cli.main(["run", "whole.toml", "-o", "one.h5"]) == 0
    assert "checksum" not in deterministic_bytes(older / "one.h5")
    expected = bytes_without_checksums(older / "whole.h5")
    assert deterministic_bytes(older / "one.h5") == expected


def test_files_without_checksums_are_merged(older):
    assert cli.main(["merge", "one.h5", "two.h5", "-o", "merged.h5"]) == 0
    expected = bytes_without_checksums(older / "whole.h5")
    assert deterministic_bytes(older / "merged.h5") == expected


def test_merge_refuses_other_scenes(tmp_path):
    one = filled(tmp_path / "one.h5", small(seed=1))
    two = filled(tmp_path / "two.h5", small(seed=2))
    with pytest.raises(
        InputError, match=r"different scenes, and are not merged:\n  seed: 1 in"
    ):
        merge(tmp_path / "both.h5", [one, two])
    assert not (tmp_path / "both.h5").exists()


def test_merge_needs_a_database(tmp_path):
    with pytest.raises(InputError, match="nothing to merge"):
        merge(tmp_path / "both.h5", [])
    assert not (tmp_path / "both.h5").exists()


def test_merge_replaces_no_file(tmp_path):
    one = filled(tmp_path / "one.h5", small())
    two = filled(tmp_path / "two.h5", small(15))
    before = two.read_bytes()
    with pytest.raises(InputError, match="exists"):
        merge(two, [one])
    assert two.read_bytes() == before


def test_merge_refuses_other_physics(tmp_path, monkeypatch):
    one = filled(tmp_path / "one.h5", small())
    raise_physics(monkeypatch)
    two = filled(tmp_path / "two.h5", small())
    words = rf"physics {PHYSICS} and of physics {PHYSICS + 1}"
    with pytest.raises(InputError, match=words):
        merge(tmp_path / "both.h5", [one, two])
    assert not (tmp_path / "both.h5").exists()


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


class OlderNames:
    """A whole database, and a share in which a drawn parameter has the column's older name.

    The columns of drawn heights and slopes had the names of the parameters.
    """

    def __init__(self, folder, parameter, column):
        self.folder = folder
        self.parameter = parameter
        self.column = column
        scene = SPECTRAL.replace("RMS", parameter)
        database_of(folder, scene.replace("8", "12", 1), "whole")
        database_of(folder, scene, "old", "--rows", "0:5")
        with h5py.File(folder / "old.h5", "r+") as file:
            file.move(column, parameter)

    def require_whole(self, path):
        """Compare all columns of a database with those of the whole one."""
        with Reader(path) as reader, Reader(self.folder / "whole.h5") as whole:
            for column in whole.columns():
                if column.deterministic:
                    np.testing.assert_array_equal(
                        reader.column(column.name), whole.column(column.name)
                    )


@pytest.fixture(scope="module", params=DRAWN_NAMES.items(), ids=lambda names: names[0])
def named_before(request, tmp_path_factory):
    return OlderNames(tmp_path_factory.mktemp("names"), *request.param)


@pytest.fixture
def old(named_before, here):
    """A copy, in the current folder, of the file with older names."""
    for name in ("old.toml", "whole.toml", "whole.h5"):
        (here / name).symlink_to(named_before.folder / name)
    return shutil.copy(named_before.folder / "old.h5", here / "old.h5")


def test_a_column_with_an_older_name_is_read_by_both_names(named_before, old):
    with Reader(old) as reader:
        values = reader.column(named_before.column)
        np.testing.assert_array_equal(reader.column(named_before.parameter), values)


def test_a_column_with_an_older_name_has_a_range(named_before, old):
    with Reader(old) as reader:
        smallest, largest = reader.ranges()[named_before.column]
    assert 0.5 <= smallest <= largest <= 2.0


@pytest.mark.usefixtures("old")
@pytest.mark.parametrize("line", ["info old.h5", "check old.h5 --recompute 2"])
def test_commands_read_files_with_older_names(line):
    assert cli.main(line.split()) == 0


def test_files_with_older_names_are_continued_and_extended(named_before, old):
    assert cli.main(["run", "old.toml", "-o", "old.h5"]) == 0
    assert cli.main(["run", "whole.toml", "-o", "old.h5"]) == 0
    named_before.require_whole(old)


def test_files_with_older_names_are_merged(named_before, old):
    assert cli.main(["merge", "old.h5", "whole.h5", "-o", "merged.h5"]) == 0
    named_before.require_whole(old.with_name("merged.h5"))


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
