"""Windows of maps on three ranks: killed and resumed, extended, merged, checked, learnt from."""

import signal
import subprocess
import time

import numpy as np
import pytest
from databases import deterministic_bytes, status
from launch import TIMEOUT, command, environment, launch, mpiexec

from bench.made_maps import Faults, MadeMap, measured
from gen import cli

pytestmark = [
    pytest.mark.mpi,
    pytest.mark.skipif(mpiexec() is None, reason="no mpiexec: install the extra 'mpich'"),
]

MAPS = (
    MadeMap("honed", 0, (100, 90), 0.5, 20.0, faults=Faults(holes=2, tilt=(0.01, 0.0))),
    MadeMap("sandblasted", 0, (100, 90), 0.5, 20.0),
)
SCENE = """samples = {}
[surface]
generator = "scans"
files = "maps"
nodes = 24
[surface.reading]
side = "99,89"
[surface.preparation]
level = "plane"
fill = true
[load]
quantity = "pressure/(E* slope_rms)"
range = [0.01, 0.05]
"""
ROWS = 360


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with maps, a scene, and the database of an undisturbed serial run."""
    folder = tmp_path_factory.mktemp("scans")
    (folder / "maps").mkdir()
    for made in MAPS:  # plain arrays: the environments of these tests have no reader of instruments
        np.save(folder / "maps" / f"{made.name}.npy", measured(made))
    for name, rows in (("scene", ROWS), ("few", ROWS // 3)):
        (folder / f"{name}.toml").write_text(SCENE.format(rows))
    assert cli.main(["run", str(folder / "scene.toml"), "-o", str(folder / "whole.h5")]) == 0
    return folder


def test_a_killed_run_goes_on_with_the_same_bytes(folder):
    run = subprocess.Popen(
        command(3, "run", "scene.toml", "-o", "killed.h5"),
        cwd=folder,
        env=environment(),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    limit = time.monotonic() + TIMEOUT
    path = folder / "killed.h5"
    while time.monotonic() < limit and run.poll() is None:
        if path.exists() and (status(path) == 1).any():
            break
        time.sleep(0.01)
    run.send_signal(signal.SIGKILL)
    run.wait(TIMEOUT)
    while (again := launch(3, "run", "scene.toml", "-o", path, folder=folder)).returncode == 2:
        assert time.monotonic() < limit, again.stderr  # the last rank still holds the file
        time.sleep(0.2)
    assert again.returncode == 0, again.stderr
    assert deterministic_bytes(path) == deterministic_bytes(folder / "whole.h5")
    assert len(list(folder.glob("*.maps"))) == 1, "all runs share the prepared maps"


def test_an_extended_run_has_the_same_bytes(folder):
    for scene in ("few", "scene"):
        done = launch(3, "run", f"{scene}.toml", "-o", "grown.h5", folder=folder)
        assert done.returncode == 0, done.stderr
    assert deterministic_bytes(folder / "grown.h5") == deterministic_bytes(folder / "whole.h5")


def test_parts_merge_into_the_same_bytes(folder):
    cut = 161
    for part, rows in (("a", f"0:{cut}"), ("b", f"{cut}:{ROWS}")):
        line = ["run", "scene.toml", "-o", f"{part}.h5", "--rows", rows]
        done = launch(3, *line, folder=folder)
        assert done.returncode == 0, done.stderr
    done = launch(0, "merge", "a.h5", "b.h5", "-o", "merged.h5", folder=folder)
    assert done.returncode == 0, done.stderr
    assert deterministic_bytes(folder / "merged.h5") == deterministic_bytes(folder / "whole.h5")
    checked = launch(0, "check", "merged.h5", "--recompute", "20", folder=folder)
    assert checked.returncode == 0, checked.stderr


def test_a_missing_map_ends_all_ranks_with_one_line(folder, tmp_path):
    (tmp_path / "scene.toml").write_text(SCENE.format(9))
    done = launch(3, "run", "scene.toml", "-o", "x.h5", folder=tmp_path)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1, done.stderr
    assert "there is no file or folder" in done.stderr


def test_hybrid_features_come_from_the_prepared_maps(folder):
    pytest.importorskip("sklearn", reason="the extra 'learn' is not installed")
    line = ["fit", "whole.h5", "-o", "a.surrogate", "--features", "hybrid"]
    done = launch(3, *line, folder=folder, module="learn")
    assert done.returncode == 0, done.stderr
