"""The reader: columns, ranges, checksums, and other programs that read the same file."""

import zlib

import h5py
import numpy as np
import pytest
from databases import block, filled, small

from gen.database import Reader, Writer, create
from gen.runtime.errors import InputError
from gen.scene import Store, stored_columns
from gen.schema import Reason, Status


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


@pytest.mark.parametrize("store", [Store(), Store(heights=True, perimeter=True)])
def test_a_checksum_is_that_of_a_rows_bytes_in_the_order_of_the_names(path, store):
    """As somebody would compute it who knows the file alone."""
    filled(path, small(store=store), (0, 3, Status.DONE), (3, 4, Status.FAILED))
    with h5py.File(path) as file:
        names = sorted(name for name, each in file.items() if "long_name" in each.attrs)
        names.remove("checksum")
        for row in range(4):
            data = b"".join(file[name][row].tobytes() for name in names)
            assert file["checksum"][row] == zlib.crc32(data)


@pytest.fixture
def finished(path):
    """A database with fields, whose rows 0 to 3 are done and 6 and 7 failed."""
    scene = small(store=Store(heights=True))
    return filled(path, scene, (0, 4, Status.DONE), (6, 8, Status.FAILED))


def test_rows_are_not_damaged_as_they_were_written(finished):
    with Reader(finished) as reader:
        assert reader.damage() == ""


def test_any_changed_column_of_a_finished_row_is_damage(finished):
    with Reader(finished) as reader:
        guarded = [column.name for column in reader.columns() if column.deterministic]
    for name in guarded:
        with h5py.File(finished, "r+") as file:
            values = file[name][:]
            for row in (3, 7, 9):  # the last one is pending
                changed = 7
                if name == "status":
                    changed = {1: 2, 2: 1}.get(values[row], 0)
                file[name][row] = changed
        with Reader(finished) as reader:
            assert reader.damaged_rows().tolist() == [3, 7], name
            assert reader.damaged_rows(4, 9).tolist() == [7], name
        with h5py.File(finished, "r+") as file:
            file[name][:] = values


def test_unknown_column_names_those_there_are(path):
    create(path, small())
    with (
        Reader(path) as reader,
        pytest.raises(InputError, match=r"'heights'; it has status, .*"),
    ):
        reader.column("heights")


@pytest.fixture(scope="module")
def with_heights(tmp_path_factory):
    """A database with fields, some rows of which are done."""
    path = tmp_path_factory.mktemp("heights") / "some.h5"
    return filled(path, small(store=Store(heights=True)), (0, 3, Status.DONE))


@pytest.fixture
def xarray():
    pytest.importorskip("h5netcdf")
    return pytest.importorskip("xarray")


def test_xarray_reads_values_and_dimensions(with_heights, xarray):
    with xarray.open_dataset(with_heights, engine="h5netcdf") as results:
        assert results.sizes == {"sample": 10, "x": 5, "y": 5}
        assert results.heights.dims == ("sample", "x", "y")
        assert results.force.dims == ("sample",)
        assert results.attrs["samples"] == 10
        force = block(small(store=Store(heights=True)), 0, 3)["force"]
        np.testing.assert_array_equal(results.force[:3], force)


def test_xarray_reads_the_meanings_of_codes(with_heights, xarray):
    with xarray.open_dataset(with_heights, engine="h5netcdf") as results:
        assert results.status.flag_meanings == "pending done failed"
        assert list(results.reason.flag_values) == list(Reason)
        assert len(results.reason.flag_meanings.split()) == len(Reason)


def test_xarray_reads_all_columns_with_units_and_meanings(with_heights, xarray):
    columns = stored_columns(small(store=Store(heights=True)))
    common = [column for column in columns if not column.group]
    with xarray.open_dataset(with_heights, engine="h5netcdf") as results:
        assert list(results.variables) == [column.name for column in common]
        for column in common:
            assert results[column.name].attrs["units"] == column.unit
            assert results[column.name].attrs["long_name"] == column.long_name


def test_xarray_reads_the_group_of_times(with_heights, xarray):
    columns = stored_columns(small(store=Store(heights=True)))
    times = [column.name for column in columns if column.group]
    with xarray.open_dataset(with_heights, engine="h5netcdf", group="runtime") as runtime:
        assert list(runtime.variables) == times
        assert runtime.surface_seconds.attrs["units"] == "s"
