"""The life of a database on the command line: shares, merging, extension, retries, a full disk."""

import resource
import shutil
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
from databases import deterministic_bytes, status
from launch import command, environment

from gen import cli, database
from gen.database import Reader, writer
from gen.generation.run import Block, Delivery, Target, in_parallel
from gen.generation.sample import compute_rows
from gen.runtime import farm
from gen.runtime.errors import InputError
from gen.scene import DisplacedSurface, Scene
from gen.schema import PHYSICS, PHYSICS_CHANGES

SAMPLE = Path(__file__).resolve().parents[3] / "examples" / "sample.h5"
SCENE = "samples = {}\nsamples_per_surface = 2\n{}\n[surface]\nnodes = 17\n"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.toml").write_text(SCENE.format(40, ""))
    (tmp_path / "more.toml").write_text(SCENE.format(70, 'title = "more"'))
    return tmp_path


def run(*arguments):
    return cli.main(["run", *arguments])


@pytest.mark.parametrize("block_rows", [1, 3, 7, 1000])
@pytest.mark.parametrize("m", [1, 5])
def test_the_size_of_blocks_changes_no_byte(folder, monkeypatch, block_rows, m):
    (folder / "m.toml").write_text(SCENE.replace("surface = 2", f"surface = {m}").format(23, ""))
    assert run("m.toml", "-o", "usual.h5") == 0
    monkeypatch.setattr("gen.generation.run.BLOCK_ROWS", block_rows)
    assert run("m.toml", "-o", "other.h5") == 0
    assert deterministic_bytes(folder / "other.h5") == deterministic_bytes(folder / "usual.h5")


@pytest.mark.long
@pytest.mark.parametrize("hardness", ["hardness = 0.02", "hardness_ratio = [0.003, 0.1]"])
def test_a_database_of_bodies_that_yield_lives_as_any_other(folder, capsys, hardness):
    for samples in (11, 20):
        text = SCENE.format(samples, "") + f"[contact]\n{hardness}\n"
        (folder / f"{samples}.toml").write_text(text)
    assert run("20.toml", "-o", "whole.h5") == 0
    assert run("11.toml", "-o", "grown.h5") == 0
    assert run("20.toml", "-o", "grown.h5") == 0
    assert run("20.toml", "-o", "part0.h5", "--rows", "0:7") == 0
    assert run("20.toml", "-o", "part1.h5", "--rows", "7:20") == 0
    assert cli.main(["merge", "part0.h5", "part1.h5", "-o", "merged.h5"]) == 0
    whole = deterministic_bytes(folder / "whole.h5")
    assert ("hardness" in whole) == hardness.endswith("]")
    assert deterministic_bytes(folder / "grown.h5") == whole
    assert deterministic_bytes(folder / "merged.h5") == whole
    assert cli.main(["check", "part1.h5", "--recompute", "20"]) == 0
    capsys.readouterr()
    assert cli.main(["info", "whole.h5"]) == 0
    told = capsys.readouterr().out
    assert "20 done, 0 failed" in told
    assert "yielded_percent" in told
    assert cli.main(["plot", "whole.h5", "-o", "whole.png"]) == 0
    assert cli.main(["run", "20.toml", "-o", "new.h5", "--dry-run"]) == 0
    assert "  hardness  " in capsys.readouterr().out
    assert run("scene.toml", "-o", "whole.h5") == 2
    assert "hardness" in capsys.readouterr().err


def test_the_shipped_sample_is_resumed_and_extended_and_keeps_its_bytes(folder, capsys):
    """Files made before scenes knew a hardness go on and keep their bytes."""
    shutil.copy(SAMPLE, "sample.h5")
    before = deterministic_bytes(folder / "sample.h5")
    for samples in (200, 203):
        (folder / f"{samples}.toml").write_text(f"samples = {samples}")
    content = (folder / "sample.h5").read_bytes()
    assert run("200.toml", "-o", "sample.h5") == 0
    assert (folder / "sample.h5").read_bytes() == content
    assert "200 rows done, 0 failed, 0 pending" in capsys.readouterr().out
    assert run("203.toml", "-o", "sample.h5") == 0
    after = deterministic_bytes(folder / "sample.h5")
    assert after.keys() == before.keys()
    for name, values in before.items():
        assert after[name].startswith(values), name
    assert cli.main(["check", "sample.h5", "--recompute", "0"]) == 0


def test_shares_merge_into_what_one_run_makes(folder):
    assert run("scene.toml", "-o", "whole.h5") == 0
    for number, rows in enumerate(["0:13", "13:30", "29:40"]):
        assert run("scene.toml", "-o", f"part{number}.h5", "--rows", rows) == 0
    assert cli.main(["merge", "part0.h5", "part1.h5", "part2.h5", "-o", "merged.h5"]) == 0
    assert deterministic_bytes(folder / "merged.h5") == deterministic_bytes(folder / "whole.h5")


def test_a_share_does_its_rows_only(folder):
    assert run("scene.toml", "-o", "part.h5", "--rows", "11:15") == 0
    assert status(folder / "part.h5").tolist() == [1, 1, 1, 1]
    with Reader(folder / "part.h5") as reader:
        assert reader.rows == range(11, 15)
    assert run("scene.toml", "-o", "whole.h5") == 0
    assert run("scene.toml", "-o", "whole.h5", "--rows", "11:15") == 0
    assert status(folder / "whole.h5").size == 40


def test_extending_inside_a_surface_does_no_finished_row_again(folder, capsys):
    for samples in (11, 20):
        text = SCENE.replace("surface = 2", "surface = 5").format(samples, "")
        (folder / f"{samples}.toml").write_text(text)
    assert run("20.toml", "-o", "whole.h5") == 0
    assert run("11.toml", "-o", "grown.h5") == 0
    with h5py.File("grown.h5") as file:
        times = file["runtime/solve_seconds"][:]
    assert run("20.toml", "-o", "grown.h5") == 0
    assert "9 to do" in capsys.readouterr().err
    with h5py.File("grown.h5") as file:
        np.testing.assert_array_equal(file["runtime/solve_seconds"][:11], times)
    assert deterministic_bytes(folder / "grown.h5") == deterministic_bytes(folder / "whole.h5")


def test_a_smaller_scene_stops_at_its_own_rows(folder, capsys):
    assert run("more.toml", "-o", "rows.h5", "--rows", "0:5") == 0
    assert run("scene.toml", "-o", "rows.h5") == 0
    np.testing.assert_array_equal(np.flatnonzero(status(folder / "rows.h5")), range(40))


def test_retrying_a_share_leaves_other_failures(folder):
    assert run("scene.toml", "-o", "rows.h5") == 0
    with h5py.File("rows.h5", "r+") as file:
        file["status"][[5, 30]] = 2
        file["reason"][[5, 30]] = 1
    assert run("scene.toml", "-o", "rows.h5", "--retry-failed", "--rows", "0:10") == 0
    assert status(folder / "rows.h5")[5] == 1
    assert status(folder / "rows.h5")[30] == 2


def test_retrying_computes_failed_rows_again(folder, capsys):
    assert run("scene.toml", "-o", "rows.h5") == 0
    whole = deterministic_bytes(folder / "rows.h5")
    with h5py.File("rows.h5", "r+") as file:
        file["status"][5:7] = 2
        file["reason"][5:7] = 1
        file["force"][5:7] = np.nan
    assert run("scene.toml", "-o", "rows.h5") == 0
    assert status(folder / "rows.h5")[5] == 2, "failed rows stay failed unless asked"
    capsys.readouterr()
    assert run("scene.toml", "-o", "rows.h5", "--retry-failed") == 0
    assert "2 to do, 2 failed ones among them" in capsys.readouterr().err
    assert deterministic_bytes(folder / "rows.h5") == whole


def test_info_says_how_results_have_changed_since(folder, capsys):
    assert run("scene.toml", "-o", "old.h5") == 0
    assert cli.main(["info", "old.h5"]) == 0
    assert "an earlier solver" not in capsys.readouterr().out
    for physics in (4, 9, 10):
        with h5py.File("old.h5", "r+") as file:
            file.attrs.modify("physics", physics)
        assert cli.main(["info", "old.h5"]) == 0
        lines = [line.strip() for line in capsys.readouterr().out.splitlines()]
        said = f"made by an earlier solver (physics {physics}, this version computes {PHYSICS})"
        start = lines.index(said) + 1
        expected = [f"since physics {number}, {PHYSICS_CHANGES[number]}" for number in (11,)]
        assert lines[start : start + len(expected)] == expected


def test_a_dry_run_writes_nothing(folder, capsys):
    before = sorted(folder.iterdir())
    assert run("paper", "-o", "paper.h5", "--dry-run") == 0
    assert "15878 samples on 15878 surfaces of 129 x 129 nodes" in capsys.readouterr().out
    assert sorted(folder.iterdir()) == before


def test_an_estimate_measures(folder, capsys):
    assert cli.main(["estimate", "scene.toml", "--ranks", "5"]) == 0
    text = capsys.readouterr().out
    assert "on 4 workers" in text
    assert "mean of 32 measured" in text


def limited(size):
    return lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))


def test_a_file_that_may_not_grow_is_one_line_and_the_next_run_succeeds(folder):
    """A limit on file size, which the kernel reports as it does a full disk."""
    full = subprocess.run(
        command(0, "run", "scene.toml", "-o", "rows.h5"),
        env=environment() | {"PYTHONDONTWRITEBYTECODE": "1"},
        preexec_fn=limited(8000),
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )
    assert full.returncode == 2
    assert full.stderr.count("\n") == 1
    assert "disk is full" in full.stderr
    assert sorted(path.name for path in folder.iterdir()) == ["more.toml", "scene.toml"]
    assert run("scene.toml", "-o", "rows.h5") == 0
    assert (status(folder / "rows.h5") == 1).all()


def test_a_run_says_that_the_units_of_its_material_slipped(tmp_path, capsys):
    text = (
        "[contact]\nmodulus = 210.0\nhardness = 2000.0\n[load]\nquantity = 'delta'\nrange = 0.1\n"
    )
    (tmp_path / "s.toml").write_text("samples = 1\nsurface.nodes = 17\n" + text)
    for ask in (
        ["run", str(tmp_path / "s.toml"), "-o", str(tmp_path / "s.h5"), "--dry-run"],
        ["estimate", str(tmp_path / "s.toml")],
        ["run", str(tmp_path / "s.toml"), "-o", str(tmp_path / "s.h5")],
    ):
        assert cli.main(ask) == 0
        told = capsys.readouterr()
        assert "is the modulus in GPa?" in told.out + told.err


ALONE, MANY = farm.World(), farm.World(0, 9)

MOUNTS = r"""
22 1 8:1 / / rw,relatime shared:1 - ext4 /dev/sda1 rw
31 22 0:50 / /home rw,relatime shared:2 master:1 - nfs4 server:/home rw
32 31 0:51 / /home/on\040lustre rw - lustre 10.0.0.1@tcp:/scratch rw
33 22 0:52 / /homely rw - tmpfs tmpfs rw
"""


@pytest.fixture
def mounts(tmp_path, monkeypatch):
    (tmp_path / "mountinfo").write_text(MOUNTS.strip())
    monkeypatch.setattr(writer, "MOUNTS", tmp_path / "mountinfo")


@pytest.mark.parametrize(
    ("path", "answer"),
    [
        ("/x.h5", True),
        ("/home/x.h5", False),
        ("/home/on lustre/x.h5", True),
        ("/homely/x.h5", True),
    ],
)
def test_network_file_systems_are_known_by_their_mounts(mounts, path, answer):
    assert database.coherent(Path(path)) is answer


def test_without_a_list_of_mounts_the_answer_is_yes(tmp_path, monkeypatch):
    monkeypatch.setattr(writer, "MOUNTS", tmp_path / "missing")
    assert database.coherent(Path("/home/x.h5"))


@pytest.mark.parametrize(
    ("choice", "path", "world", "has_mpi", "answer"),
    [
        ("auto", "/x.h5", MANY, True, True),
        ("auto", "/x.h5", MANY, False, False),
        ("auto", "/x.h5", ALONE, True, False),
        ("auto", "/home/x.h5", MANY, True, False),
        ("single", "/x.h5", MANY, True, False),
        ("parallel", "/x.h5", MANY, True, True),
        ("parallel", "/home/x.h5", MANY, True, True),
    ],
)
def test_who_writes(mounts, monkeypatch, choice, path, world, has_mpi, answer):
    monkeypatch.setattr(database, "parallel_hdf5", lambda: has_mpi)
    assert in_parallel(choice, Path(path), world) is answer


@pytest.mark.parametrize(
    ("world", "has_mpi", "words"), [(MANY, False, "no MPI"), (ALONE, True, "one process")]
)
def test_a_parallel_writer_that_cannot_be_is_refused(monkeypatch, world, has_mpi, words):
    monkeypatch.setattr(database, "parallel_hdf5", lambda: has_mpi)
    with pytest.raises(InputError, match=words) as caught:
        in_parallel("parallel", Path("x.h5"), world)
    assert "\n" not in str(caught.value)


def test_rows_through_the_master_are_counted_and_written(tmp_path):
    scene = Scene(samples=10, surface=DisplacedSurface(nodes=5))
    path = tmp_path / "some.h5"
    database.create(path, scene)

    def compute(block: Block):
        rows = compute_rows(scene, *block)
        rows["status"][1], rows["status"][2] = 2, 0  # one that fails, one that takes too long
        return rows

    with Delivery(Target(path, scene, parallel=False), ALONE, compute) as delivered:
        tally = delivered.take((4, 8), delivered.work((4, 8)))
    assert tally.overdue == 1
    assert tally.failed >= 1
    with database.Reader(path) as reader:
        finished = reader.column("status") != 0
    assert finished.tolist() == [False] * 4 + [True, True, False, True] + [False] * 2


def test_workers_that_write_tell_the_master_counts_and_troubles(tmp_path, monkeypatch):
    scene = Scene(samples=10, surface=DisplacedSurface(nodes=5))
    path = tmp_path / "some.h5"
    database.create(path, scene)

    def alone(path, scene, communicator, *, force):  # a writer of one process, of any HDF5
        return database.Writer(path, scene, force=force)

    monkeypatch.setattr(database, "ParallelWriter", alone)
    target = Target(path, scene, parallel=True)
    with Delivery(target, ALONE, lambda block: compute_rows(scene, *block)) as delivered:
        tally = delivered.work((0, 4))
        assert delivered.take((0, 4), tally) == tally
        path.rename(tmp_path / "away.h5")
        troubled = delivered.work((4, 8))
        with pytest.raises(InputError, match="moved or deleted"):
            delivered.take((4, 8), troubled)
    with database.Reader(tmp_path / "away.h5") as reader:
        assert reader.counts().pending == 6


def test_a_file_that_cannot_be_opened_is_refused(tmp_path):
    target = Target(tmp_path / "missing.h5", Scene(samples=1), parallel=False)
    with pytest.raises(InputError, match="does not exist"):
        Delivery(target, ALONE, lambda block: {})


def test_a_worker_of_the_single_writer_loads_neither_hdf5_nor_a_progress_bar():
    code = (
        "import sys; from pathlib import Path\n"
        "import gen.generation.run; from gen.runtime import farm\n"
        "from gen.scene import Scene; from gen.generation.run import Target, Delivery\n"
        "target = Target(Path('missing.h5'), Scene(samples=1), parallel=False)\n"
        "world = farm.World(1, 3)\n"
        "with Delivery(target, world, lambda block: {}) as delivered:\n"
        "    assert delivered.work((0, 1)) == {}\n"
        "print(sorted({'h5py', 'rich', 'typer', 'mpi4py'} & sys.modules.keys()))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=300
    )
    assert done.stdout == "[]\n", done.stderr
