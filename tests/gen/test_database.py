import json
import os
import signal
import subprocess
import sys
import textwrap

import h5py
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gen import database, schema
from gen.database import Counts, Reader, Writer, create, lock, merge, open_or_create
from gen.runtime.errors import InputError
from gen.scene import Scene, Store, Surface
from gen.schema import Reason, Status, columns_for

KILLED_BEFORE_STATUS = """
    import os, signal, sys
    from pathlib import Path
    import numpy as np
    from gen.database import Reader, Writer
    path = Path(sys.argv[1])
    with Reader(path) as reader:
        scene = reader.scene
    writer = Writer(path, scene)
    names = [column.name for column in writer.columns()]
    block = {column.name: np.ones(4, column.dtype) for column in writer.columns()}
    writer.write_block(0, 4, block)
    flush = writer._flush
    def flush_and_die():
        flush()
        os.kill(os.getpid(), signal.SIGKILL)
    writer._flush = flush_and_die
    writer.write_block(4, 8, block)
"""

NO_ROOM = """
    import resource, signal, sys
    from pathlib import Path
    import numpy as np
    from gen.runtime.errors import InputError
    from gen.database import *
    from gen.scene import Scene
    def forbid_growth_beyond(size):
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))
    path = Path(sys.argv[1])
    try:
        {action}
    except InputError as error:
        print(error)
"""

KILLED_WHILE_EXTENDING = """
    import os, signal, sys
    from pathlib import Path
    from gen import database
    path = Path(sys.argv[1])
    with database.Reader(path) as reader:
        scene = reader.scene
    database.creation.fill = lambda *_, **__: os.kill(os.getpid(), signal.SIGKILL)
    database.open_or_create(path, scene.model_copy(update={"samples": 15}))
"""

MILLION = """
    import resource, sys
    from pathlib import Path
    from gen.database import Reader, Writer, create
    from gen.scene import Scene
    path, scene = Path(sys.argv[1]), Scene(samples=1_000_000)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    create(path, scene)
    with Writer(path, scene) as writer:
        assert writer.pending() == [(0, 1_000_000)]
    with Reader(path) as reader:
        assert reader.counts() == (1_000_000, 0, 0)
        assert set(map(str, reader.ranges()["force"])) == {"nan"}
    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
"""

PHYSICS = schema.PHYSICS  # before a test raises it


def run(script, *arguments, **options):
    """Run a script in a process of its own."""
    command = [sys.executable, "-c", textwrap.dedent(script), *map(str, arguments)]
    return subprocess.run(
        command, capture_output=True, text=True, timeout=60, check=False, **options
    )


def small(samples=10, **keys):
    return Scene(samples=samples, surface=Surface(nodes=5), **keys)


def block(scene, start, stop, status=Status.DONE):
    """Values that tell the row and the column; any scene's."""
    values = {}
    for number, column in enumerate(columns_for(scene)):
        rows = np.arange(start, stop) * 100.0 + number
        shape = column.shape(stop - start, scene.surface.nodes)
        field = np.broadcast_to(rows.reshape(-1, *[1] * (len(shape) - 1)), shape)
        values[column.name] = field.astype(column.dtype)
    values["status"] = np.full(stop - start, status, dtype="u1")
    values["reason"] = np.full(
        stop - start, Reason.NOT_CONVERGED if status == Status.FAILED else 0, dtype="u1"
    )
    return values


def filled(path, scene, *runs):
    """Create a database with finished rows: (start, stop, status)."""
    create(path, scene)
    with Writer(path, scene) as writer:
        for start, stop, status in runs:
            writer.write_block(start, stop, block(scene, start, stop, status))
    return path


def raise_physics(monkeypatch):
    """Have a version of the code that computes other results."""
    for module in (database.creation, database.layout, database.opening):
        monkeypatch.setattr(module, "PHYSICS", schema.PHYSICS + 1)


@pytest.fixture
def path(tmp_path):
    return tmp_path / "some.h5"


# --- creation and rows --------------------------------------------------------------------------


def test_new_file_has_every_column_pending(path):
    scene = small(store=Store(heights=True, mean_gap=True))
    assert open_or_create(path, scene) == ("created", 10)
    with Reader(path) as reader:
        assert reader.scene == scene
        assert reader.columns() == columns_for(scene)
        assert reader.counts() == Counts(pending=10, done=0, failed=0)
        for column in reader.columns():
            values = reader.column(column.name)
            assert values.shape == column.shape(10, 5)
            assert values.dtype == column.dtype
            np.testing.assert_array_equal(values, np.full_like(values, column.fill))
    assert list(path.parent.iterdir()) == [path]


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


def test_creation_never_overwrites(path):
    path.write_text("precious")
    with pytest.raises(InputError, match="exists"):
        create(path, small())
    assert path.read_text() == "precious"


def test_creation_never_overwrites_what_appears_meanwhile(path, monkeypatch):
    monkeypatch.setattr(database.creation, "fill", lambda *_, **__: path.write_text("precious"))
    with pytest.raises(InputError, match="meanwhile"):
        create(path, small())
    assert path.read_text() == "precious"


def test_leftover_of_a_killed_creation_is_removed_and_the_users_files_stay(path):
    left = [path.with_name(f"some.h5.{name}.part") for name in ("0" * 16, "0123456789abcdef")]
    for each, content in zip(left, (b"", b"\x89HDF\r\n\x1a\nhalf a file"), strict=True):
        each.write_bytes(content)
    precious = path.with_name("precious")
    own = [
        path.with_name(f"some.h5.{name}") for name in ("part", "1.part", f"{'1' * 16}.part", "bak")
    ]
    for each in (precious, *own):
        each.write_text("precious")
    link = path.with_name(f"some.h5.{'2' * 16}.part")
    link.symlink_to(precious)
    create(path, small())
    assert set(path.parent.iterdir()) == {path, precious, *own, link}
    assert {each.read_text() for each in (precious, *own, link)} == {"precious"}


def test_written_rows_come_back(path):
    scene = small(store=Store(heights=True, perimeter=True))
    filled(path, scene, (2, 5, Status.DONE), (7, 8, Status.FAILED))
    wanted = block(scene, 2, 5)
    with Reader(path) as reader:
        for column in reader.columns():
            np.testing.assert_array_equal(reader.column(column.name, 2, 5), wanted[column.name])
        assert reader.counts() == (6, 3, 1)
        assert reader.reasons() == {Reason.NOT_CONVERGED: 1}
        assert reader.size_bytes == path.stat().st_size


def test_ranges_are_those_of_done_rows(path, monkeypatch):
    monkeypatch.setattr(database.disk, "CHUNK_BYTES", 24)
    scene = small()
    filled(path, scene, (2, 5, Status.DONE), (7, 8, Status.FAILED), (9, 10, Status.DONE))
    force = block(scene, 0, 10)["force"]
    with Reader(path) as reader:
        ranges = reader.ranges()
    assert ranges["force"] == (force[2], force[9])
    assert not {"status", "reason", "host"} & ranges.keys()


def test_ranges_pass_over_undefined_values(path):
    scene = small()
    create(path, scene)
    values = block(scene, 0, 3)
    values["force"] = np.array([np.nan, 2.0, 1.0])
    values["residual"][:] = np.nan
    with Writer(path, scene) as writer:
        writer.write_block(0, 3, values)
    with Reader(path) as reader:
        ranges = reader.ranges()
    assert ranges["force"] == (1.0, 2.0)
    assert np.isnan(ranges["residual"]).all()


def test_status_is_written_after_all_else_is_flushed(path, monkeypatch):
    scene = small()
    create(path, scene)
    seen = []
    write, flush = database.disk.write_rows, h5py.File.flush
    monkeypatch.setattr(
        database.writer,
        "write_rows",
        lambda dataset, *rest: (seen.append(dataset.name), write(dataset, *rest)),
    )
    monkeypatch.setattr(h5py.File, "flush", lambda file: (seen.append("flush"), flush(file)))
    with Writer(path, scene) as writer:
        writer.write_block(0, 3, block(scene, 0, 3))
    assert seen[-3:] == ["flush", "/status", "flush"]
    others = {f"/{column.path}" for column in columns_for(scene)} - {"/status"}
    assert len(seen) == len(others) + 3
    assert set(seen[:-3]) == others


def test_kill_between_columns_and_status_leaves_rows_pending(path):
    scene = small()
    create(path, scene)
    assert run(KILLED_BEFORE_STATUS, path).returncode == -signal.SIGKILL
    with Reader(path) as reader:
        assert reader.counts() == (6, 4, 0)
        assert (reader.column("force", 0, 4) == 1.0).all()
    assert open_or_create(path, scene) == ("resumed", 10)
    with Writer(path, scene) as writer:
        assert writer.pending() == [(4, 10)]


def broken_blocks():
    scene = small()
    whole = block(scene, 0, 3)
    yield 0, 3, {name: whole[name] for name in whole if name != "force"}, "force"
    yield 0, 3, whole | {"weight": np.ones(3)}, "weight"
    yield 0, 3, whole | {"force": np.ones(4)}, "force"
    yield 0, 3, whole | {"rank": np.ones(3)}, "rank"
    yield 0, 3, whole | {"status": np.zeros(3, dtype="u1")}, "finished"
    yield 8, 11, whole, "8 to 11"


@pytest.mark.parametrize(("start", "stop", "columns", "message"), [*broken_blocks()])
def test_broken_block_writes_nothing(path, start, stop, columns, message):
    scene = small()
    create(path, scene)
    before = path.read_bytes()
    with Writer(path, scene) as writer, pytest.raises(ValueError, match=message):
        writer.write_block(start, stop, columns)
    assert path.read_bytes() == before


def test_retry_makes_failed_rows_pending(path):
    scene = small()
    filled(path, scene, (0, 3, Status.FAILED), (3, 5, Status.DONE), (9, 10, Status.FAILED))
    with Writer(path, scene) as writer:
        assert writer.retry_failed() == 4
        assert writer.counts() == (8, 2, 0)
        assert writer.pending() == [(0, 3), (5, 10)]
        assert writer.retry_failed() == 0


@pytest.fixture(scope="module")
def twenty_rows(tmp_path_factory):
    scene = small(20)
    path = tmp_path_factory.mktemp("pending") / "twenty.h5"
    create(path, scene)
    with Writer(path, scene) as writer:
        yield writer


@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    statuses=st.lists(st.integers(0, 2), min_size=20, max_size=20),
    first=st.integers(0, 20),
    last=st.none() | st.integers(0, 25),
    chunk=st.integers(1, 21),
)
def test_pending_is_what_a_plain_loop_finds(twenty_rows, statuses, first, last, chunk):
    twenty_rows._status[:] = statuses
    wanted = []
    for row in range(first, min(20 if last is None else last, 20)):
        if statuses[row] == Status.PENDING:
            if wanted and wanted[-1][1] == row:
                wanted[-1] = (wanted[-1][0], row + 1)
            else:
                wanted.append((row, row + 1))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(database.disk, "CHUNK_BYTES", chunk)
        assert twenty_rows.pending(first, last) == wanted
        tally = [statuses.count(status) for status in Status]
        assert list(twenty_rows.counts()) == tally


# --- readers ------------------------------------------------------------------------------------


def test_reading_while_another_process_writes(path):
    scene = small()
    create(path, scene)
    script = """
        import sys
        from pathlib import Path
        from gen.database import Reader
        with Reader(Path(sys.argv[1])) as reader:
            print(*reader.counts(), reader.column("force", 0, 1)[0])
    """
    with lock(path), Writer(path, scene) as writer:
        writer.write_block(0, 3, block(scene, 0, 3))
        other = run(script, path)
        with Reader(path) as reader:
            assert reader.counts() == (7, 3, 0)
    assert other.stdout.split() == ["7", "3", "0", str(block(scene, 0, 1)["force"][0])]


def test_reader_changes_nothing(path):
    scene = small()
    filled(path, scene, (0, 3, Status.DONE))
    before = path.read_bytes()
    path.chmod(0o444)
    with Reader(path) as reader:
        reader.ranges()
    assert path.read_bytes() == before


def test_unknown_column_names_those_there_are(path):
    create(path, small())
    with Reader(path) as reader, pytest.raises(InputError, match=r"'heights'; it has status, .*"):
        reader.column("heights")


def test_data_frame_in_three_lines(path):
    pandas = pytest.importorskip("pandas")
    filled(path, small(), (0, 3, Status.DONE))
    with Reader(path) as reader:
        frame = pandas.DataFrame({c.name: reader.column(c.name) for c in reader.columns()})
    done = frame[frame.status == Status.DONE]
    assert len(done) == 3
    assert done.force.notna().all()


def test_xarray_reads_both_groups_with_units(path):
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("h5netcdf")
    scene = small(store=Store(heights=True))
    filled(path, scene, (0, 3, Status.DONE))
    columns = columns_for(scene)
    with xarray.open_dataset(path, engine="h5netcdf") as results:
        assert list(results.variables) == [c.name for c in columns if not c.group]
        assert results.sizes == {"sample": 10, "x": 5, "y": 5}
        assert results.heights.dims == ("sample", "x", "y")
        assert results.force.dims == ("sample",)
        assert results.status.flag_meanings == "pending done failed"
        assert list(results.reason.flag_values) == list(Reason)
        assert len(results.reason.flag_meanings.split()) == len(Reason)
        assert results.attrs["samples"] == 10
        np.testing.assert_array_equal(results.force[:3], block(scene, 0, 3)["force"])
        for column in columns:
            if not column.group:
                assert results[column.name].attrs["units"] == column.unit
                assert results[column.name].attrs["long_name"] == column.long_name
    with xarray.open_dataset(path, engine="h5netcdf", group="runtime") as runtime:
        assert list(runtime.variables) == [c.name for c in columns if c.group]
        assert runtime.surface_seconds.dims == ("sample",)
        assert runtime.surface_seconds.attrs["units"] == "s"
        assert runtime.surface_seconds.dtype == "f8"


# --- what is refused ----------------------------------------------------------------------------


def bad_file(path, kind):
    """Put something at the path that is no database."""
    if kind == "folder":
        path.mkdir()
    elif kind == "text":
        path.write_text("hurst,delta\n0.8,10\n")
    elif kind == "empty":
        path.write_bytes(b"")
    elif kind == "foreign":
        with h5py.File(path, "w") as file:
            file["force"] = np.ones(3)
    elif kind == "cut off":
        create(path, small())
        with path.open("r+b") as file:
            file.truncate(path.stat().st_size // 2)
    elif kind == "damaged":
        create(path, small())
        with h5py.File(path, "r+") as file:
            del file["force"]
    elif kind == "spoilt":
        create(path, small())
        content = path.read_bytes()
        path.write_bytes(content.replace(b"samples_per_surface", b"\xff" * 19))


BAD_FILES = {
    "folder": "is a folder",
    "text": "is not a database",
    "empty": "is empty",
    "foreign": "HDF5 but not a database",
    "cut off": "is cut off",
    "damaged": "no column 'force'",
    "spoilt": "is damaged",
}


@pytest.mark.parametrize("kind", BAD_FILES)
def test_bad_file_is_named_in_one_line_and_left_alone(path, kind):
    bad_file(path, kind)
    before = None if path.is_dir() else path.read_bytes()
    for opening in (
        lambda: Reader(path),
        lambda: Writer(path, small()),
        lambda: open_or_create(path, small(20), force=True),
        lambda: merge(path.with_name("target.h5"), [path]),
    ):
        with pytest.raises(InputError, match=BAD_FILES[kind]) as raised:
            opening()
        assert str(path) in str(raised.value)
        assert "\n" not in str(raised.value)
    assert path.is_dir() or path.read_bytes() == before
    assert not path.with_name("target.h5").exists()


def test_missing_file(path):
    for opening in (Reader, lambda missing: Writer(missing, small())):
        with pytest.raises(InputError, match="does not exist"):
            opening(path)


def test_missing_folder(tmp_path):
    path = tmp_path / "nowhere" / "some.h5"
    with pytest.raises(InputError, match="does not exist"):
        create(path, small())


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read and write everything")
def test_forbidden_file(path):
    create(path, small())
    path.chmod(0)
    with pytest.raises(InputError, match="Permission denied"):
        Reader(path)


def test_other_scene_is_refused_key_by_key(path):
    create(path, small(seed=1))
    before = path.read_bytes()
    other = Scene(samples=20, seed=2, surface=Surface(nodes=9))
    with pytest.raises(InputError) as raised:
        open_or_create(path, other, force=True)
    assert "seed: 1 in the file, 2 asked for" in str(raised.value)
    assert "surface.nodes: 5 in the file, 9 asked for" in str(raised.value)
    with pytest.raises(InputError, match="seed"):
        Writer(path, other)
    assert path.read_bytes() == before


def test_title_does_not_make_another_scene(path):
    create(path, small(title="one"))
    assert open_or_create(path, small(title="two")) == ("resumed", 10)


def test_other_layout_is_refused(path, monkeypatch):
    create(path, small())
    monkeypatch.setattr(database.opening, "SCHEMA", schema.SCHEMA + 1)
    for opening in (Reader, lambda old: open_or_create(old, small(), force=True)):
        with pytest.raises(InputError, match=r"layout 1, this version reads layout 2"):
            opening(path)


def test_other_physics_is_refused_unless_forced(path, monkeypatch):
    create(path, small())
    before = path.read_bytes()
    raise_physics(monkeypatch)
    now, later = f"physics {PHYSICS}", f"physics {PHYSICS + 1}"
    with pytest.raises(InputError, match=f"{now}, this version computes {later}"):
        open_or_create(path, small())
    with pytest.raises(InputError, match="physics"):
        Writer(path, small())
    assert path.read_bytes() == before
    assert open_or_create(path, small(), force=True) == ("resumed", 10)
    with Writer(path, small(), force=True):
        pass
    with Reader(path) as reader:
        assert reader.attributes["physics"] == PHYSICS
        assert reader.attributes["physics_forced"] == PHYSICS + 1


# --- more and fewer samples ---------------------------------------------------------------------


def test_more_samples_extend_the_file(path):
    scene = small(store=Store(heights=True))
    filled(path, scene, (2, 5, Status.DONE), (7, 8, Status.FAILED))
    with Reader(path) as reader:
        created = reader.attributes["created"]
    more = small(15, store=Store(heights=True))
    assert open_or_create(path, more) == ("extended", 15)
    with Writer(path, more) as writer:
        assert writer.pending() == [(0, 2), (5, 7), (8, 15)]
    wanted = block(scene, 2, 5)
    with Reader(path) as reader:
        assert reader.scene == more
        assert reader.attributes["samples"] == 15
        assert reader.attributes["created"] == created
        for column in reader.columns():
            np.testing.assert_array_equal(reader.column(column.name, 2, 5), wanted[column.name])
            rest = reader.column(column.name, 10)
            np.testing.assert_array_equal(rest, np.full_like(rest, column.fill))
    assert list(path.parent.iterdir()) == [path]


def test_extended_file_is_the_same_as_a_large_one(path, tmp_path):
    runs = (0, 6, Status.DONE), (6, 8, Status.FAILED)
    filled(path, small(10), *runs)
    open_or_create(path, small(30))
    large = filled(tmp_path / "large.h5", small(30), *runs)
    with Reader(path) as one, Reader(large) as other:
        for column in one.columns():
            assert one.column(column.name).tobytes() == other.column(column.name).tobytes()


def test_failed_extension_leaves_the_old_file(path, monkeypatch):
    filled(path, small(), (0, 3, Status.DONE))
    before = path.read_bytes()

    def interrupt(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(database.creation, "fill", interrupt)
    with pytest.raises(KeyboardInterrupt):
        open_or_create(path, small(15))
    assert path.read_bytes() == before
    assert list(path.parent.iterdir()) == [path]


def test_kill_while_extending_leaves_the_old_file(path):
    filled(path, small(), (0, 3, Status.DONE))
    before = path.read_bytes()
    assert run(KILLED_WHILE_EXTENDING, path).returncode == -signal.SIGKILL
    assert path.read_bytes() == before
    assert open_or_create(path, small(15)) == ("extended", 15)
    assert list(path.parent.iterdir()) == [path]


def test_extension_keeps_a_link(path, tmp_path):
    link = tmp_path / "link.h5"
    link.symlink_to(path)
    filled(path, small(), (0, 3, Status.DONE))
    assert open_or_create(link, small(15)) == ("extended", 15)
    assert link.is_symlink()
    with Reader(path) as reader:
        assert reader.counts() == (12, 3, 0)


def test_fewer_samples_keep_the_larger_file(path):
    filled(path, small(10), (0, 3, Status.DONE))
    before = path.read_bytes()
    assert open_or_create(path, small(5)) == ("resumed", 10)
    assert path.read_bytes() == before
    with Writer(path, small(5)) as writer:
        assert writer.scene.samples == 10
        assert writer.pending(last=5) == [(3, 5)]


# --- merging ------------------------------------------------------------------------------------


def test_merge_takes_the_best_of_every_row(tmp_path, monkeypatch):
    monkeypatch.setattr(database.disk, "CHUNK_BYTES", 3 * 8 * 25)
    store = Store(heights=True)
    one = filled(tmp_path / "one.h5", small(10, store=store), (0, 4, 1), (6, 8, 2))
    two = filled(tmp_path / "two.h5", small(15, store=store), (2, 7, 1), (8, 9, 2), (14, 15, 1))
    target = tmp_path / "both.h5"
    assert merge(target, [one, two]) == (5, 8, 2)
    scene = small(15, store=store)
    wanted = block(scene, 0, 15)
    with Reader(target) as reader:
        assert reader.scene == scene
        statuses = [1, 1, 1, 1, 1, 1, 1, 2, 2, 0, 0, 0, 0, 0, 1]
        assert reader.column("status").tolist() == statuses
        for column in reader.columns()[2:]:
            known = np.flatnonzero(statuses)
            values = reader.column(column.name)[known]
            np.testing.assert_array_equal(values, wanted[column.name][known])
    with Writer(target, scene) as writer:
        assert writer.pending() == [(9, 14)]
    assert sorted(tmp_path.iterdir()) == sorted([one, two, target])


def test_merge_does_not_mind_other_times_and_hosts(tmp_path):
    scene = small()
    one = filled(tmp_path / "one.h5", scene, (0, 4, Status.DONE))
    two = filled(tmp_path / "two.h5", scene)
    values = block(scene, 0, 4)
    values["solve_seconds"] += 1.0
    values["host"][:] = b"elsewhere"
    with Writer(two, scene) as writer:
        writer.write_block(0, 4, values)
    assert merge(tmp_path / "both.h5", [one, two]) == (6, 4, 0)


def test_merge_refuses_rows_that_differ_in_one_bit(tmp_path):
    scene = small()
    one = filled(tmp_path / "one.h5", scene, (0, 4, Status.DONE))
    two = filled(tmp_path / "two.h5", scene)
    values = block(scene, 0, 4)
    values["force"][2] = np.nextafter(values["force"][2], np.inf)
    with Writer(two, scene) as writer:
        writer.write_block(0, 4, values)
    with pytest.raises(InputError, match=r"row 2: force differs between .*one\.h5 and .*two\.h5"):
        merge(tmp_path / "both.h5", [one, two])
    assert sorted(tmp_path.iterdir()) == [one, two]


def test_merge_refuses_other_scenes_physics_and_targets(tmp_path, monkeypatch):
    one = filled(tmp_path / "one.h5", small(seed=1))
    two = filled(tmp_path / "two.h5", small(seed=2))
    target = tmp_path / "both.h5"
    with pytest.raises(InputError, match=r"different scenes .seed: 1"):
        merge(target, [one, two])
    with pytest.raises(InputError, match="nothing to merge"):
        merge(target, [])
    with pytest.raises(InputError, match="exists"):
        merge(two, [one])
    raise_physics(monkeypatch)
    three = filled(tmp_path / "three.h5", small(seed=1))
    with pytest.raises(InputError, match=rf"physics {PHYSICS}, .* of physics {PHYSICS + 1}"):
        merge(target, [one, three])
    assert not target.exists()


# --- disks --------------------------------------------------------------------------------------


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


def test_writing_without_room_says_how_many_rows_are_safe(path):
    scene = Scene(samples=10_000)
    filled(path, scene, (0, 100, Status.DONE))
    action = """
        with Writer(path, Scene(samples=10_000)) as writer:
            block = {c.name: np.ones(50, c.dtype) for c in writer.columns()}
            forbid_growth_beyond(200_000)
            writer.write_block(9_000, 9_050, block)"""
    result = run(NO_ROOM.format(action=action), path)
    assert "disk is full" in result.stdout
    assert "100 rows are done and safe" in result.stdout
    assert (result.returncode, result.stderr) == (0, "")
    with Reader(path) as reader:
        assert reader.counts() == (9_900, 100, 0)


def test_extension_without_room_leaves_the_old_file(path):
    filled(path, Scene(samples=100), (0, 100, Status.DONE))
    action = "forbid_growth_beyond(200_000); open_or_create(path, Scene(samples=10_000))"
    result = run(NO_ROOM.format(action=action), path)
    assert "disk is full" in result.stdout
    assert (result.returncode, result.stderr) == (0, "")
    with Reader(path) as reader:
        assert reader.counts() == (0, 100, 0)
    assert list(path.parent.iterdir()) == [path]


def test_a_million_rows_take_little_memory(path):
    result = run(MILLION, path)
    assert result.stderr == ""
    assert int(result.stdout) < 150_000  # kB; one column alone has 8 MB, the file 310 MB
