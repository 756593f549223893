"""The main job under mpiexec: the same bytes as serially, errors once, never a hang."""

import pytest
from databases import deterministic_bytes, status
from launch import launch, mpiexec

SMALL = "samples = 75\n{}\n[surface]\nnodes = 33\n"

pytestmark = [
    pytest.mark.mpi,
    pytest.mark.skipif(mpiexec() is None, reason="no mpiexec: install the extra 'mpich'"),
]


@pytest.fixture(scope="module", params=[1, 5], ids=["one-a-surface", "five-a-surface"])
def serial(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp("serial")
    (folder / "small.toml").write_text(SMALL.format(f"samples_per_surface = {request.param}"))
    done = launch(0, "run", "small.toml", "-o", "serial.h5", folder=folder)
    assert done.returncode == 0, done.stderr
    return folder


@pytest.mark.parametrize("ranks", [1, 2, 3, 4, 5, 8])
def test_any_number_of_ranks_gives_the_same_bytes(serial, ranks):
    done = launch(ranks, "run", "small.toml", "-o", f"{ranks}.h5", folder=serial)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("75 rows done, 0 failed, 0 pending") == 1
    assert deterministic_bytes(serial / f"{ranks}.h5") == deterministic_bytes(serial / "serial.h5")


@pytest.mark.parametrize("hardness", ["0.02", "[0.003, 0.1]"])
def test_bodies_that_yield_have_the_same_bytes_on_any_number_of_ranks(tmp_path, hardness):
    scene = SMALL.format("samples_per_surface = 2") + f"[contact]\nhardness = {hardness}\n"
    (tmp_path / "yielding.toml").write_text(scene)
    bytes_by_ranks = []
    for ranks in (0, 1, 2, 3):
        done = launch(ranks, "run", "yielding.toml", "-o", f"{ranks}.h5", folder=tmp_path)
        assert done.returncode == 0, done.stderr
        assert done.stdout.count("75 rows done, 0 failed, 0 pending") == 1
        bytes_by_ranks.append(deterministic_bytes(tmp_path / f"{ranks}.h5"))
    assert all(each == bytes_by_ranks[0] for each in bytes_by_ranks)


def test_every_worker_worked(serial):
    import h5py

    done = launch(4, "run", "small.toml", "-o", "shared.h5", folder=serial)
    assert done.returncode == 0, done.stderr
    with h5py.File(serial / "shared.h5", "r") as file:
        assert set(file["runtime/rank"][:]) == {1, 2, 3}


@pytest.mark.parametrize(
    ("arguments", "word"),
    [(["run", "quik", "-o", "x.h5"], "quik"), (["run", "small.toml", "-o", "no/x.h5"], "no")],
)
def test_bad_input_ends_the_launcher_with_code_2_and_one_line(tmp_path, arguments, word):
    (tmp_path / "small.toml").write_text(SMALL.format(""))
    done = launch(3, *arguments, folder=tmp_path)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1, done.stderr
    assert word in done.stderr


def test_a_bug_in_a_worker_ends_all_ranks(tmp_path):
    (tmp_path / "small.toml").write_text(SMALL.format(""))
    (tmp_path / "buggy.py").write_text(
        "import sys\n"
        "import bem\n"
        "from gen import cli\n"
        "bem.solve = None\n"
        "sys.exit(cli.main(['run', 'small.toml', '-o', 'x.h5']))\n"
    )
    done = launch(3, folder=tmp_path, module="buggy")
    assert done.returncode not in {0, 2}
    assert "TypeError" in done.stderr
    assert not (status(tmp_path / "x.h5") == 1).any()
