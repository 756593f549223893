"""Parts: files as large as a job array's share of the rows, which every command understands."""

import contextlib
import io
import re
import shutil

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


MILLION = Scene(samples=10**6)


@pytest.fixture
def four_hundred_rows(path):
    create(path, MILLION, range(123_400, 123_800))
    return path


def test_a_part_is_as_large_as_its_rows(four_hundred_rows):
    assert four_hundred_rows.stat().st_size < 400 * row_bytes(MILLION) + 40_000


def test_pending_rows_of_a_part_have_their_numbers_in_the_plan(four_hundred_rows):
    with Writer(four_hundred_rows, MILLION) as writer:
        assert writer.pending() == [range(123_400, 123_800)]
        assert writer.pending(0, 123_500) == [range(123_400, 123_500)]
        assert writer.pending(0, 50) == writer.pending(10**6 - 1) == []


@pytest.fixture
def nineteen_rows(folder):
    assert run("60.toml", "part.h5", "--rows", "11:30") == 0
    return folder / "part.h5"


def test_a_part_has_the_bytes_of_the_whole(nineteen_rows):
    assert bytes_of(nineteen_rows) == bytes_of("60.h5", slice(11, 30))


def test_columns_of_a_part_are_read_by_the_rows_of_the_plan(nineteen_rows):
    with Reader(nineteen_rows) as reader:
        assert reader.rows == range(11, 30)
        assert reader.scene.samples == 60
        assert reader.column("surface", 0, 13).tolist() == [5, 6]
        assert reader.column("surface", 29).tolist() == [14]
        assert reader.column("surface", 40).size == 0
        assert reader.column("surface", 0, 3).size == 0


class Grown:
    """A part that runs of further rows have extended on both sides, up to the whole scene."""

    steps = (
        ("20:30", "created, 10 rows, 10 to do", range(20, 30)),
        ("22:25", "resumed, 10 rows, 0 to do", range(20, 30)),
        ("25:33", "extended, 13 rows, 3 to do", range(20, 33)),
        ("10:12", "extended, 23 rows, 2 to do", range(10, 33)),
        ("10:33", "resumed, 23 rows, 8 to do", range(10, 33)),
        ("0:60", "extended, 60 rows, 37 to do", range(60)),
    )

    def __init__(self, done, folder):
        self.path = folder / "part.h5"
        self.lines = []
        self.rows = []
        for rows, _, _ in self.steps:
            lines = io.StringIO()
            with contextlib.redirect_stderr(lines):
                assert run(str(done / "60.toml"), str(self.path), "--rows", rows) == 0
            self.lines.append(lines.getvalue())
            with Reader(self.path) as reader:
                self.rows.append(reader.rows)


@pytest.fixture(scope="module")
def grown(done, tmp_path_factory):
    return Grown(done, tmp_path_factory.mktemp("grown"))


def test_a_part_holds_all_rows_between_those_that_runs_have_asked_for(grown):
    assert grown.rows == [rows for _, _, rows in grown.steps]


def test_a_run_of_a_part_says_what_it_does(grown):
    for line, (_, words, _) in zip(grown.lines, grown.steps, strict=True):
        assert words in line


def test_a_part_that_has_grown_to_the_whole_is_a_whole_database(grown, done):
    assert bytes_of(grown.path) == bytes_of(done / "60.h5")
    with h5py.File(grown.path) as part, h5py.File(done / "60.h5") as whole:
        assert list(part.attrs) == list(whole.attrs)
        assert part.attrs["schema"] == 1


def test_a_run_of_fewer_samples_resumes_a_larger_part(grown, folder, capsys):
    shutil.copy(grown.path, "part.h5")
    assert run("90.toml", "part.h5", "--rows", "70:90") == 0
    assert run("60.toml", "part.h5", "--rows", "0:60") == 0
    assert "resumed, 90 rows, 0 to do" in capsys.readouterr().err


def test_a_smaller_scene_stops_at_its_own_rows(folder):
    assert run("90.toml", "part.h5", "--rows", "0:5") == run("60.toml", "part.h5") == 0
    with Reader(folder / "part.h5") as reader:
        assert reader.rows == range(60)


@pytest.fixture(scope="module")
def computed_parts(done, tmp_path_factory):
    """Three parts of 60 rows, the first two of which overlap, and a gap before the last one."""
    folder = tmp_path_factory.mktemp("parts")
    parts = []
    for number, rows in enumerate(["0:13", "9:30", "45:60"]):
        parts.append(folder / f"part{number}.h5")
        assert run(str(done / "60.toml"), str(parts[-1]), "--rows", rows) == 0
    return parts


def test_parts_merge_where_they_overlap_and_leave_gaps_pending(computed_parts, folder):
    assert merge(folder / "some.h5", computed_parts) == (15, 45, 0)
    assert status(folder / "some.h5").tolist() == 30 * [1] + 15 * [0] + 15 * [1]
    with h5py.File("some.h5") as file:
        assert np.isnan(file["force"][30:45]).all()
        assert file.attrs["schema"] == 1


def test_parts_without_the_first_rows_merge(computed_parts, folder):
    assert merge(folder / "gap.h5", computed_parts[1:]) == (24, 36, 0)


def test_parts_and_a_whole_database_with_pending_rows_merge(
    computed_parts, folder, monkeypatch
):
    create(folder / "old.h5", Scene.parse(SCENE.format(60), "60.toml"))
    assert run("60.toml", "old.h5", "--rows", "28:47") == 0
    # Chunks of so few rows that some of them lie in no part.
    monkeypatch.setattr("gen.database.reader.CHUNK_BYTES", 320)
    parts = [str(part) for part in computed_parts]
    assert cli.main(["merge", *parts, "old.h5", "-o", "merged.h5"]) == 0
    assert bytes_of("merged.h5") == bytes_of("60.h5")


@pytest.fixture(scope="module")
def last_rows(done, tmp_path_factory):
    path = tmp_path_factory.mktemp("last") / "part.h5"
    assert run(str(done / "60.toml"), str(path), "--rows", "21:60") == 0
    return path


def test_check_reads_a_part(last_rows, capsys):
    assert cli.main(["check", str(last_rows), "--recompute", "5"]) == 0
    words = "39 rows done, 0 failed, 0 pending; 5 of them computed again"
    assert words in capsys.readouterr().out


def test_check_names_rows_of_a_part_by_their_numbers_in_the_plan(last_rows, here, capsys):
    shutil.copy(last_rows, "part.h5")
    with h5py.File("part.h5", "r+") as file:
        file["force"][3] *= -1
    assert cli.main(["check", "part.h5", "--recompute", "0"]) == 1
    assert "row 24: force is negative" in capsys.readouterr().out


def test_info_says_that_a_database_is_a_part(last_rows, capsys):
    assert cli.main(["info", str(last_rows)]) == 0
    assert re.search(r"39 rows: 21 to 59 of 60, a part", capsys.readouterr().out)


def test_plot_draws_a_part(last_rows, here):
    assert cli.main(["plot", str(last_rows), "-o", "part.png"]) == 0
    assert (here / "part.png").exists()


def test_learn_reads_the_rows_of_a_part(last_rows):
    assert read(last_rows).rows.tolist() == list(range(21, 60))


@pytest.mark.parametrize("numbers", [(50, 11), (5, 2**62)])
def test_a_part_that_says_it_holds_other_rows_is_refused(folder, numbers):
    create(folder / "part.h5", Scene.parse(SCENE.format(60), "60.toml"), range(50, 60))
    with h5py.File("part.h5", "r+") as file:
        file.attrs["first_row"], file.attrs["rows"] = numbers
    with pytest.raises(InputError, match="is damaged"):
        Reader(folder / "part.h5")
