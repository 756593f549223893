"""The reader: columns, ranges, and other programs that read the same file."""

import errno
import json
import os
import zlib
from pathlib import Path

import h5py
import numpy as np
import pytest
from databases import PHYSICS, block, database_of, filled, raise_physics, small

from gen import cli, database, schema
from gen.database import Reader, Writer, create, open_or_create
from gen.runtime.errors import InputError
from gen.scene import Scene, Store, stored_columns
from gen.schema import Reason, Status
from gen.surface import DisplacedSurface


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


def test_other_scene_is_refused_key_by_key(path):
    create(path, small(seed=1))
    before = path.read_bytes()
    other = Scene(samples=20, seed=2, surface=DisplacedSurface(nodes=9))
    with pytest.raises(InputError) as raised:
        open_or_create(path, other, force=True)
    assert "seed: 1 in the file, 2 asked for" in str(raised.value)
    assert "surface.nodes: 5 in the file, 9 asked for" in str(raised.value)
    with pytest.raises(InputError, match="seed"):
        Writer(path, other)
    assert path.read_bytes() == before


def test_other_layout_is_refused(path, monkeypatch):
    create(path, small())
    monkeypatch.setattr(database.reader, "SCHEMA", schema.SCHEMA + 1)
    for opening in (Reader, lambda old: open_or_create(old, small(), force=True)):
        with pytest.raises(InputError, match=r"layout 1, this version reads layout 2"):
            opening(path)


def test_a_scene_that_no_version_makes_any_more_says_how_the_database_is_made_anew(path):
    """As with `store.corrected_area_percent` of 1.0.0rc1."""
    create(path, small())
    with h5py.File(path, "r+") as file:
        scene = json.loads(file.attrs["scene"])
        scene["store"]["corrected_area_percent"] = True
        text = json.dumps(scene, sort_keys=True).encode()
        file.attrs.create("scene", text, dtype=h5py.string_dtype("utf-8", len(text)))
    known = "the closest known key is store.continuum_area_percent"
    with pytest.raises(
        InputError, match=rf"{known}: .* make the database anew: .* gen run SCENE"
    ):
        Reader(path)


@pytest.fixture
def of_lower_physics(path, monkeypatch):
    """A database that this version, which computes other results, is to continue."""
    create(path, small())
    raise_physics(monkeypatch)
    return path


def test_a_run_of_other_physics_is_refused(of_lower_physics):
    before = of_lower_physics.read_bytes()
    stored, computed = f"physics {PHYSICS}", f"physics {PHYSICS + 1}"
    words = rf"{stored}, this version computes {computed}; give another name .* gen run --force"
    with pytest.raises(InputError, match=words):
        open_or_create(of_lower_physics, small())
    assert of_lower_physics.read_bytes() == before


def test_a_writer_of_other_physics_is_refused(of_lower_physics):
    before = of_lower_physics.read_bytes()
    with pytest.raises(InputError, match="physics"):
        Writer(of_lower_physics, small())
    assert of_lower_physics.read_bytes() == before


def test_other_physics_can_be_forced_and_is_recorded(of_lower_physics):
    assert open_or_create(of_lower_physics, small(), force=True) == "resumed"
    with Writer(of_lower_physics, small(), force=True):
        pass
    with Reader(of_lower_physics) as reader:
        assert reader.attributes["physics"] == PHYSICS
        assert reader.attributes["physics_forced"] == PHYSICS + 1


LINES = (
    "info rows.h5",
    "check rows.h5",
    "plot rows.h5 -o new.png",
    "export rows.h5 -o new",
    "merge rows.h5 rows.h5 -o new.h5",
    "run rows.toml -o rows.h5",
    "run rows.toml -o new.h5",
)
"""Commands that read a database, or make one."""


def fails_after(opened, monkeypatch):
    """Let the system answer EIO to every read and write of a database, once some are opened.

    The memory of a process is a file in which nothing is at the places of a small file.
    """
    from gen.database import creation, reader, writer

    opening, count = reader.open_file, []

    def open_failing(*arguments, **settings):
        file = opening(*arguments, **settings)
        count.append(file)
        if len(count) > opened:
            memory = os.open("/proc/self/mem", os.O_RDWR)
            os.dup2(memory, file.id.get_vfd_handle())
            os.close(memory)
        return file

    for module in (creation, reader, writer):
        monkeypatch.setattr(module, "open_file", open_failing)
    return count


@pytest.mark.skipif(not Path("/proc/self/mem").exists(), reason="needs Linux")
@pytest.mark.parametrize("line", LINES)
def test_trouble_of_the_disk_is_not_called_damage(line, here, monkeypatch, refused):
    original = database_of(
        here, "samples = 9\n[surface]\nnodes = 9\n", "rows"
    ).read_bytes()
    opened = fails_after(0, monkeypatch)
    message = refused(cli, *line.split())
    assert opened
    assert os.strerror(errno.EIO) in message
    assert "damaged" not in message
    assert "restore" not in message
    assert (here / "rows.h5").read_bytes() == original


@pytest.mark.skipif(not Path("/proc/self/mem").exists(), reason="needs Linux")
@pytest.mark.parametrize("opened", [1, 2])
def test_trouble_while_a_database_is_made_is_one_line(opened, here, monkeypatch, capsys):
    (here / "rows.toml").write_text("samples = 9\n[surface]\nnodes = 9\n")
    fails_after(opened, monkeypatch)
    assert cli.main(["run", "rows.toml", "-o", "rows.h5"]) == 2
    assert os.strerror(errno.EIO) in capsys.readouterr().err.splitlines()[-1]
