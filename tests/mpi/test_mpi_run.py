"""The main job under mpiexec: the same bytes as serially, errors once, never a hang."""

from importlib.util import find_spec

import h5py
import pytest
from databases import deterministic_bytes, status
from launch import launch, mpiexec
from walk import walk

from bench.made_maps import Faults, MadeMap, write_all
from gen import cli

SMALL = "samples = 75\n{}\n[surface]\nnodes = 33\n"
EDGELESS = SMALL.format("samples_per_surface = 2") + (
    "[delta]\npieces = [{{ share = 1.0, range = [0.5, 4.0] }}]\n[contact]\n{}\n"
)
YIELDING = SMALL.format("samples_per_surface = 2") + "[contact]\nhardness = {}\n"
SCENES = {
    "one-a-surface": SMALL.format("samples_per_surface = 1"),
    "five-a-surface": SMALL.format("samples_per_surface = 5"),
    "one-hardness": YIELDING.format("0.02"),
    "any-hardness": YIELDING.format("[0.003, 0.1]"),
    "periodic": EDGELESS.format("boundary = 'periodic'"),
    "mirror": EDGELESS.format("boundary = 'mirror'"),
    "mirror-hardness": EDGELESS.format("boundary = 'mirror'\nhardness = 0.05"),
}
INSTRUMENTS = find_spec("SurfaceTopography") is not None
if INSTRUMENTS:  # which the environment of parallel HDF5 does not have
    SCENES["scans"] = (
        "samples = 75\nsamples_per_surface = 2\n[surface]\ngenerator = 'scans'\n"
        "files = 'maps'\nnodes = 32\n[surface.preparation]\nlevel = 'plane'\nfill = true\n"
        "[load]\nquantity = 'pressure/(E* slope_rms)'\nrange = [0.01, 0.05]\n"
    )
MAPS = (
    MadeMap("ground", 0, (120, 90), 0.5, 20.0, faults=Faults(holes=2, tilt=(0.01, 0.0))),
    MadeMap("fractal", 0, (80, 80), 0.5, 20.0, format="gwy"),
)

pytestmark = [
    pytest.mark.mpi,
    pytest.mark.skipif(mpiexec() is None, reason="no mpiexec: install the extra 'mpich'"),
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with the scenes, and the database of each from a serial run."""
    folder = tmp_path_factory.mktemp("serial")
    if INSTRUMENTS:
        write_all(folder / "maps", MAPS)
    for name, text in SCENES.items():
        (folder / f"{name}.toml").write_text(text)
        assert (
            cli.main(["run", str(folder / f"{name}.toml"), "-o", str(folder / f"{name}.h5")]) == 0
        )
    return folder


@pytest.fixture(scope="module", params=[1, 2, 3, 4, 5, 8])
def on_ranks(request, folder):
    """The number of ranks, and what the master says of the run of each scene in one launch."""
    ranks = request.param
    lines = [["gen", "run", f"{name}.toml", "-o", f"{name}-{ranks}.h5"] for name in SCENES]
    walked = walk(ranks, lines, folder)
    assert [[end.code for end in ends] for ends in walked] == len(SCENES) * [ranks * [0]]
    return ranks, {name: master.output for name, (master, *_) in zip(SCENES, walked, strict=True)}


@pytest.mark.parametrize("scene", SCENES)
def test_any_number_of_ranks_gives_the_same_bytes(folder, on_ranks, scene):
    ranks, said = on_ranks
    assert said[scene].count("75 rows done, 0 failed, 0 pending") == 1
    made = deterministic_bytes(folder / f"{scene}-{ranks}.h5")
    assert made == deterministic_bytes(folder / f"{scene}.h5")


@pytest.mark.parametrize("scene", SCENES)
def test_every_worker_worked(folder, on_ranks, scene):
    ranks, _ = on_ranks
    with h5py.File(folder / f"{scene}-{ranks}.h5", "r") as file:
        worked = set(file["runtime/rank"][:].tolist())
    assert worked <= (set(range(1, ranks)) or {0})
    assert len(worked) >= min(ranks - 1, 3)  # of many on few cores, some may come too late


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
