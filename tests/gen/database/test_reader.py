"""The reader: columns, ranges, and other programs that read the same file."""

import numpy as np
import pytest
from small_databases import block, filled, run, small

from gen import database
from gen.database import Reader, Writer, create, lock
from gen.runtime.errors import InputError
from gen.scene import Store
from gen.scene.columns import columns_for
from gen.schema import Reason, Status


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


def test_a_name_may_be_a_text(path):
    filled(path, small(), (0, 10, Status.DONE))
    with Reader(str(path)) as reader:
        assert reader.counts().done == 10
        assert reader.path == path
