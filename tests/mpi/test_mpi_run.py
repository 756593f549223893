"""The main job under mpiexec: the bytes of a serial run, also grown, merged, killed and resumed."""

import sys
from importlib.util import find_spec

import h5py
import numpy as np
import pytest
import user_functions
from databases import deterministic_bytes
from launch import launch, walk

from bench.made_maps import Faults, MadeMap, write_all
from gen import cli
from tests.like_maps import population

pytestmark = pytest.mark.mpi

ROWS = 75
YIELDING = """[surface]
nodes = 33
[contact]
hardness = [0.003, 0.1]
"""
SPECTRAL = """[surface]
generator = "spectral"
nodes = [32, 40]
side = [100.0, 160.0]
hurst = { normal = [0.7, 0.1], range = [0.4, 1.0] }
roll_off = { log_uniform = [40.0, 80.0] }
cut_off = [10.0, 20.0]
rms_slope = [0.05, 0.1]
stretch = { choice = [1.0, 1.5] }
[load]
quantity = "pressure/(E* slope_rms)"
range = { log_uniform = [0.01, 0.2] }
[contact]
boundary = "mirror"
hardness_ratio = [0.05, 0.5]
"""
DISPLACED = """[surface]
generator = "midpoint"
nodes = 33
hurst = { choice = [0.5, 0.6, 0.8], shares = [0.5, 0.25, 0.25] }
[load]
quantity = "delta/height_rms"
range = [0.1, 2.0]
"""
LIKE = """[surface]
generator = "like"
population = "p.json"
nodes = 32
scale = [0.8, 1.25]
[load]
quantity = "pressure/(E* slope_rms)"
range = [0.01, 0.1]
"""
SCANS = """[surface]
generator = "scans"
files = "maps"
nodes = 32
[surface.preparation]
level = "plane"
fill = true
[load]
quantity = "pressure/(E* slope_rms)"
range = [0.01, 0.05]
"""
ACCURATE = """[surface]
generator = "spectral"
nodes = 32
side = 100.0
roll_off = 50.0
cut_off = [25.0, 30.0]
rms_slope = 0.1
[load]
quantity = "pressure"
range = [0.01, 0.02]
[contact]
boundary = "periodic"
[accuracy]
continuum_area = 0.1
"""
MAPS = (
    MadeMap("ground", 0, (120, 90), 0.5, 20.0, faults=Faults(holes=2, tilt=(0.01, 0.0))),
    MadeMap("fractal", 0, (80, 80), 0.5, 20.0, format="gwy"),
)
SCENES = {
    "plain": "[surface]\nnodes = 33\n",
    "yielding": YIELDING,
    "displaced": DISPLACED,
    "spectral": SPECTRAL,
    "accurate": ACCURATE,
    "like": LIKE,
    "python": user_functions.SURFACE + user_functions.STORE,
}
if find_spec("SurfaceTopography"):  # which the environment of parallel HDF5 does not have
    SCENES["scans"] = SCANS
PRINTING = user_functions.MODULE.replace(
    "    x = np", "    print('a word')\n    x = np", 1
)


def text(name, rows=ROWS):
    return f"samples = {rows}\nsamples_per_surface = {1 if name == 'plain' else 2}\n{SCENES[name]}"


def run_here(folder, *arguments):
    """A command in this process and in the folder of its files."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.setattr(sys, "path", list(sys.path))
        try:
            return cli.main([str(argument) for argument in arguments])
        finally:
            sys.modules.pop("mine", None)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with the scenes, and the database of each from a serial run."""
    folder = tmp_path_factory.mktemp("serial")
    if "scans" in SCENES:
        write_all(folder / "maps", MAPS)
    (folder / "p.json").write_text(population(np.exp).text)
    (folder / "mine.py").write_text(user_functions.MODULE)
    for name in SCENES:
        (folder / f"{name}.toml").write_text(text(name))
        (folder / f"{name}-half.toml").write_text(text(name, ROWS // 2 + 1))
        assert run_here(folder, "run", f"{name}.toml", "--trust", "-o", f"{name}.h5") == 0
    return folder


@pytest.mark.parametrize(
    "ranks", [3, *(pytest.param(ranks, marks=pytest.mark.long) for ranks in (1, 2, 5, 8))]
)
def test_any_number_of_ranks_gives_the_same_bytes(folder, ranks):
    """Also of databases that are grown; on all ranks that work, and in one launch."""
    lines = [
        ["gen", "run", f"{name}{size}.toml", "--trust", "-o", f"{name}-{ranks}.h5"]
        for name in SCENES
        for size in ("-half", "")
    ]
    walked = walk(ranks, lines, folder)
    assert [[end.code for end in ends] for ends in walked] == len(lines) * [ranks * [0]]
    assert walked[1][0].output.count(f"{ROWS} rows done, 0 failed, 0 pending") == 1
    worked = set()
    for name in SCENES:
        made = folder / f"{name}-{ranks}.h5"
        assert deterministic_bytes(made) == deterministic_bytes(folder / f"{name}.h5"), (
            name
        )
        with h5py.File(made, "r") as file:
            worked |= set(file["runtime/rank"][:].tolist())
    assert worked <= (set(range(1, ranks)) or {0})
    assert len(worked) >= min(
        ranks - 1, 2
    )  # in a single run one worker may do all in its time


@pytest.mark.long
def test_a_function_may_print(folder, tmp_path):
    user_functions.write(tmp_path, text("python"), PRINTING)
    done = launch(3, "run", "mine.toml", "--trust", "-o", "a.h5", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "a word" in done.stdout
    assert f"runs mine:spots of {tmp_path / 'mine.py'}" in done.stderr
    assert f"{ROWS} rows done" in done.stdout
    made, expected = (
        deterministic_bytes(path) for path in (tmp_path / "a.h5", folder / "python.h5")
    )
    assert made == expected


@pytest.mark.long
def test_hybrid_features_are_those_of_one_process(folder):
    """Displacements of a database of pressures, and prepared maps, reach the workers."""
    pytest.importorskip("sklearn", reason="the extra 'learn' is not installed")
    for name in ("spectral", "scans"):
        made = []
        for ranks in (0, 3):
            line = ["fit", f"{name}.h5", "-o", f"{name}-{ranks}.surrogate"]
            line += ["--features", "hybrid", "--model", "kernel-ridge"]
            done = launch(ranks, *line, folder=folder, module="learn")
            assert done.returncode == 0, done.stderr
            kept = folder / f"{name}.h5.pressed.npz"
            made.append(kept.read_bytes())
            kept.unlink()
        assert made[0] == made[1]
