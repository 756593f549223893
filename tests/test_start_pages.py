"""What README.md and the four start pages tell a newcomer to do, done in one empty folder."""

import importlib
import re
import shlex
import shutil
import subprocess
from pathlib import Path

import h5py
import pytest
from launch import launch, mpiexec
from pages import codes, steps

pytest.importorskip("sklearn")
pytest.importorskip("matplotlib")
PROGRAMS = {"gen": "gen.cli", "learn": "learn.cli", "bench": "bench.__main__"}

NOT_OURS = re.compile(
    r"^(python -m venv|pip install|module load|make |mpirun|\. |\w+/ )|gen run paper|mpiexec -n 9"
)
"""Lines that install, take longer than a test may, or are a map of folders."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("walk")


def walk(page, folder, monkeypatch):
    """Do what a page shows, in its order."""
    monkeypatch.chdir(folder)
    for kind, step in steps(page):
        if kind == "python":
            exec(step, {})
        elif not NOT_OURS.search(step) and (words := shlex.split(step, comments=True)):
            run(words)


def run(words):
    """Run a command of ours inside this process, or one that starts several."""
    if words[0] == "mpiexec":
        arguments = words[words.index("asperity") + 1 :]
        done = launch(int(words[2]), *arguments, folder=Path.cwd(), module="asperity")
        assert done.returncode == 0, done.stderr
    elif words[1] in PROGRAMS:
        assert importlib.import_module(PROGRAMS[words[1]]).main(words[2:]) == 0, words
    else:
        assert words in [["asperity", "--help"], ["asperity", "--version"]]
        assert launch(0, words[1], folder=Path.cwd(), module="asperity").returncode == 0


def test_the_readme(folder, monkeypatch, capfd):
    pytest.importorskip("SurfaceTopography")
    monkeypatch.chdir(folder)
    (scan,) = codes("python", "docs/how-to/scan.md")  # the page that the README names for it
    exec(scan, {})
    walk("README.md", folder, monkeypatch)
    made = ("surface.npy", "quick.png", "first.surrogate", "law.h", "law-calculix.inp", "ground.h")
    for name in made:
        assert (folder / name).stat().st_size > 500
    area, delta, gap = map(
        float, re.findall(r"^([\d.]+) ([\d.]+) ([\d.]+)$", capfd.readouterr().out, re.M)[0]
    )
    assert 2.5 <= area < 10  # load / hardness is 2.5 %
    assert min(delta, gap) > 0


@pytest.mark.long
def test_the_tribologist(folder, monkeypatch, capfd):
    walk("docs/start/tribologist.md", folder, monkeypatch)
    said = capfd.readouterr().out
    for line in ("effective contact area", "displacement Delta", "mean gap", "residual"):
        assert re.search(rf"^{line}", said, re.M), f"{line} is explained, and not printed"
    assert len((folder / "law.csv").read_text().splitlines()) == 11


@pytest.mark.long
def test_the_finite_element_engineer(folder, monkeypatch):
    walk("docs/start/finite-elements.md", folder, monkeypatch)
    text = (folder / "joint-calculix.inp").read_text()
    assert "*SURFACE INTERACTION, NAME=JOINT_CALCULIX" in text
    suffixes = {".inp", ".h", ".csv", ".json", ".png"}
    assert {path.suffix for path in folder.glob("joint*")} == suffixes
    assert "stiffness_MPa_per_um" in (folder / "joint.csv").read_text()
    if shutil.which("ccx"):
        shutil.copy(Path(__file__).parents[1] / "bench/two-blocks.inp", folder)
        subprocess.run(["ccx", "two-blocks"], cwd=folder, check=True, timeout=60)
        force = -float((folder / "two-blocks.dat").read_text().split()[-1])  # N on 1 mm2
        assert 1 < force < 100, "a pressure of the table"


@pytest.mark.long
def test_the_data_person(folder, monkeypatch, capfd):
    pytest.importorskip("h5netcdf")
    walk("docs/start/data.md", folder, monkeypatch)
    assert "256" in capfd.readouterr().out


@pytest.mark.long
@pytest.mark.mpi
@pytest.mark.skipif(mpiexec() is None, reason="no mpiexec")
def test_the_user_of_a_cluster(folder, monkeypatch):
    (scene,) = codes("toml", "docs/start/cluster.md")
    (folder / "mine.toml").write_text(scene)
    walk("docs/start/cluster.md", folder, monkeypatch)
    with h5py.File(folder / "mine.h5") as file:
        assert (file["status"][:] == 1).all()
