"""Parts: files as large as a job array's share of the rows, which every command understands."""

import re

import h5py
import numpy as np
import pytest
from databases import database_of, deterministic_bytes, status
from learnt_rows import read

from gen import cli
from gen.database import Reader, Writer, create, merge
from gen.runtime.errors import InputError
from gen.scene import Scene, row_bytes

SCENE = "samples = {}\nsamples_per_surface = 2\n[surface]\nnodes = 17\n"


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """A whole database, made before the tests, whose rows all others have to show."""
    folder = tmp_path_factory.mktemp("done")
    for samples in (60, 90):
        database_of(folder, SCENE.format(samples), str(samples))
    return folder


@pytest.fixture
def folder(done, here):
    for each in done.iterdir():
        (here / each.name).symlink_to(each)
    return here


def run(scene, output, *options):
    return cli.main(["run", scene, "-o", output, *options])


def bytes_of(path, rows=slice(None)):
    names = list(deterministic_bytes(path))
    with h5py.File(path) as file:
        return {name: file[name][rows].tobytes() for name in names}


def test_a_part_is_as_large_as_its_rows(folder):
    scene = Scene(samples=10**6)
    create(folder / "part.h5", scene, range(123_400, 123_800))
    assert (folder / "part.h5").stat().st_size < 400 * row_bytes(scene) + 40_000
    with Writer(folder / "part.h5", scene) as writer:
        assert writer.pending() == [range(123_400, 123_800)]
        assert writer.pending(0, 123_500) == [range(123_400, 123_500)]
        assert writer.pending(0, 50) == writer.pending(10**6 - 1) == []


def test_a_part_has_the_bytes_of_the_whole(folder):
    assert run("60.toml", "part.h5", "--rows", "11:30") == 0
    assert bytes_of("part.h5") == bytes_of("60.h5", slice(11, 30))
    with Reader(folder / "part.h5") as reader:
        assert reader.rows == range(11, 30)
        assert reader.scene.samples == 60
        assert reader.column("surface", 0, 13).tolist() == [5, 6]
        assert reader.column("surface", 29).tolist() == [14]
        assert (
            reader.column("surface", 40).size == reader.column("surface", 0, 3).size == 0
        )


def test_a_part_is_resumed_and_extended_on_both_sides_up_to_the_whole(folder, capsys):
    steps = [
        ("20:30", "created, 10 rows, 10 to do", range(20, 30)),
        ("22:25", "resumed, 10 rows, 0 to do", range(20, 30)),
        ("25:33", "extended, 13 rows, 3 to do", range(20, 33)),
        ("10:12", "extended, 23 rows, 2 to do", range(10, 33)),
        ("10:33", "resumed, 23 rows, 8 to do", range(10, 33)),
        ("0:60", "extended, 60 rows, 37 to do", range(60)),
    ]
    for rows, said, held in steps:
        assert run("60.toml", "part.h5", "--rows", rows) == 0
        assert said in capsys.readouterr().err
        with Reader(folder / "part.h5") as reader:
            assert reader.rows == held
    assert bytes_of("part.h5") == bytes_of("60.h5")
    with h5py.File("part.h5") as part, h5py.File("60.h5") as whole:
        assert list(part.attrs) == list(whole.attrs)
        assert part.attrs["schema"] == 1
    assert run("90.toml", "part.h5", "--rows", "70:90") == 0
    assert run("60.toml", "part.h5", "--rows", "0:60") == 0
    assert "resumed, 90 rows, 0 to do" in capsys.readouterr().err


def test_a_smaller_scene_stops_at_its_own_rows(folder):
    assert run("90.toml", "part.h5", "--rows", "0:5") == run("60.toml", "part.h5") == 0
    with Reader(folder / "part.h5") as reader:
        assert reader.rows == range(60)


def test_parts_merge_whatever_they_overlap(folder, monkeypatch):
    for number, rows in enumerate(["0:13", "9:30", "45:60"]):
        assert run("60.toml", f"part{number}.h5", "--rows", rows) == 0
    parts = [folder / f"part{number}.h5" for number in range(3)]
    assert merge(folder / "some.h5", parts) == (15, 45, 0)
    assert status(folder / "some.h5").tolist() == 30 * [1] + 15 * [0] + 15 * [1]
    with h5py.File("some.h5") as file:
        assert np.isnan(file["force"][30:45]).all()
        assert file.attrs["schema"] == 1
    # An old share: as large as the whole, with the rows of others pending.
    create(folder / "old.h5", Scene.parse(SCENE.format(60), "60.toml"))
    assert run("60.toml", "old.h5", "--rows", "28:47") == 0
    monkeypatch.setattr(
        "gen.database.reader.CHUNK_BYTES", 320
    )  # chunks that lie in no file
    assert cli.main(["merge", *map(str, parts), "old.h5", "-o", "merged.h5"]) == 0
    assert bytes_of("merged.h5") == bytes_of("60.h5")
    assert merge(folder / "gap.h5", parts[1:]) == (24, 36, 0)


def test_check_info_plot_and_learn_read_a_part(folder, capsys):
    assert run("60.toml", "part.h5", "--rows", "21:60") == 0
    assert cli.main(["check", "part.h5", "--recompute", "5"]) == 0
    assert (
        "39 rows done, 0 failed, 0 pending; 5 of them computed again"
        in capsys.readouterr().out
    )
    assert cli.main(["info", "part.h5"]) == 0
    assert re.search(r"39 rows: 21 to 59 of 60, a part", capsys.readouterr().out)
    assert cli.main(["plot", "part.h5", "-o", "part.png"]) == 0
    rows = read(folder / "part.h5").rows
    assert rows.tolist() == list(range(21, 60))
    with h5py.File("part.h5", "r+") as file:
        file["force"][3] *= -1
    assert cli.main(["check", "part.h5", "--recompute", "0"]) == 1
    assert "row 24: force is negative" in capsys.readouterr().out


@pytest.mark.parametrize("numbers", [(50, 11), (5, 2**62)])
def test_a_part_that_says_it_holds_other_rows_is_refused(folder, numbers):
    create(folder / "part.h5", Scene.parse(SCENE.format(60), "60.toml"), range(50, 60))
    with h5py.File("part.h5", "r+") as file:
        file.attrs["first_row"], file.attrs["rows"] = numbers
    with pytest.raises(InputError, match="is damaged"):
        Reader(folder / "part.h5")
