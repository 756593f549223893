"""What README.md and docs/ say is what the code does; what they tell a newcomer to do, done."""

import csv
import importlib
import re
import shlex
import shutil
import subprocess
import sys
import warnings
from importlib.util import find_spec
from pathlib import Path

import h5py
import pytest
from launch import launch
from pages import PAGES, ROOT, anchors, codes, commands, links, steps
from typer.main import get_command

from gen.scene import Scene

SURFACE = "docs/how-to/surface.md"
SCAN = "docs/how-to/scan.md"
SCENES = "docs/how-to/scenes.md"
INSTRUMENTS = "docs/how-to/instruments.md"
READING = "docs/how-to/reading.md"
PUBLISH = "docs/how-to/publish.md"


@pytest.mark.parametrize("page", PAGES)
def test_links_lead_somewhere(page):
    for link in links(page):
        target, _, heading = link.partition("#")
        path = ((ROOT / page).parent / target).resolve() if target else ROOT / page
        assert path.exists(), link
        if heading:
            assert heading in anchors(path.relative_to(ROOT).as_posix()), link


def test_the_scenes_shown_are_scenes():
    shown = [Scene.parse(text, "a page") for text in codes("toml")]
    assert [scene.samples for scene in shown] == [2000, 3000, 300, 200]
    assert shown[1].surface.generator == "scans"


def test_surfaces_loads_and_outputs_of_your_own_are_made_as_shown(tmp_path, monkeypatch):
    """The scene with its columns, and one with the function and the parameters of the comments."""
    from gen import cli
    from gen.database import Reader

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    *_, scene = codes("toml", SCENES)
    module, _ = codes("python", SCENES)  # the other one is a generator, which a test adds
    function, parameters = re.findall(r"# (generator = .*|parameters = .*)\n", module)
    Path("mine.py").write_text(module)
    Path("shown.toml").write_text(scene.replace("samples = 300", "samples = 6"))
    own = "\n".join([*function.split(", "), parameters])
    Path("own.toml").write_text(f"samples = 3\n[surface]\nnodes = 16\n{own}\n")
    for name in ("shown", "own"):
        assert cli.main(["run", f"{name}.toml", "-o", f"{name}.h5", "--trust"]) == 0
        assert cli.main(["check", f"{name}.h5", "--trust"]) == 0
    with Reader(Path("shown.h5")) as reader:
        assert reader.counts().done == 6
        assert (reader.column("spots") >= 1).all()
    sys.modules.pop("mine", None)


PROGRAMS = {"gen": "gen.cli", "learn": "learn.cli", "bench": "bench.__main__"}


def program(name):
    """The commands of a program, by name."""
    return get_command(importlib.import_module(PROGRAMS[name]).app).commands


@pytest.mark.parametrize("name", PROGRAMS)
def test_every_command_is_shown(name):
    shown = {words[1] for page in PAGES for words in commands(page) if words[0] == name}
    assert program(name).keys() == shown - {"--help", "--version"}


@pytest.mark.parametrize("page", PAGES)
def test_every_command_shown_is_understood(page):
    """Names, options and values of every command are those that the programs take."""
    for name, command, *arguments in commands(page):
        if command not in {"--help", "--version"} and "--help" not in arguments:
            with program(name)[command].make_context(command, list(arguments)):
                pass  # closed, as the option --trust counts until then


def test_python_shown_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    surface, contact = codes("python", SURFACE)
    (scan,) = codes("python", INSTRUMENTS)
    exec(surface, {})
    names: dict[str, object] = {}
    exec(contact, names)
    assert names["contact"].area_percent > 0
    pytest.importorskip("SurfaceTopography")
    exec(scan, {})
    assert (tmp_path / "scan.x3p").exists()


def test_the_scan_has_the_law_that_is_stated(tmp_path, monkeypatch, capsys):
    """The page's scan, at the pressure of its text: as shown, with the spikes, and elastic."""
    pytest.importorskip("SurfaceTopography")
    pytest.importorskip("matplotlib")
    from gen import cli

    monkeypatch.chdir(tmp_path)
    section = PAGES[SCAN]
    (rough,) = codes("python", SCAN)
    exec(rough, {})
    contact, law = re.findall(r"python -m gen (.*)", section.replace("\\\n", ""))
    assert cli.main(shlex.split(contact.replace("1:200:12:log", "100"))) == 0
    said = capsys.readouterr().out
    assert "despiked: 20 nodes" in said
    assert "filled 673 nodes (1.03 %)" in said
    assert (tmp_path / "scan.png").stat().st_size > 50_000

    def at_100_megapascals(changed: str) -> dict[str, float]:
        command = changed.replace("1:1000:16:log", "100").replace("-o ground", "--csv law.csv")
        assert cli.main(shlex.split(command)) == 0
        with (tmp_path / "law.csv").open(newline="") as file:
            row = list(csv.DictReader(file))[-1]
        return {name: float(row[name]) for name in ("pressure_MPa", "closure_um", "area_percent")}

    stated = {"pressure_MPa": 100.0, "closure_um": 1.38, "area_percent": 5.1}
    assert "closed by 1.38 um, and 5.1 % of it" in section
    assert at_100_megapascals(law) == pytest.approx(stated, rel=0.005)
    assert "closure is 10.5 um" in section
    spiky = at_100_megapascals(law.replace("--despike 7", ""))
    assert spiky["closure_um"] == pytest.approx(10.5, rel=0.005)
    assert "only 0.70 % are in contact" in section
    elastic = at_100_megapascals(law.replace("--hardness 2000", ""))
    assert elastic["area_percent"] == pytest.approx(0.70, abs=0.005)


def test_reading_with_xarray_as_shown(tmp_path, monkeypatch):
    pytest.importorskip("h5netcdf")
    from gen import cli
    from gen.database import Reader

    monkeypatch.chdir(tmp_path)
    store = "[store]\nheights = true\npressure = true\n"
    for name, kept in (("quick", ""), ("stored", store)):
        Path(f"{name}.toml").write_text(f"samples = 9\n[surface]\nnodes = 9\n{kept}")
        assert cli.main(["run", f"{name}.toml", "-o", f"{name}.h5"]) == 0
    with Reader(Path("stored.h5")) as reader:
        heights = reader.column("heights")
    rows, whole, in_pieces = codes("python", READING)
    shown: dict = {}
    exec(rows, shown)
    assert len(shown["done"]) == shown["rows"]["area_percent"].notna().sum() == 9
    exec(whole, shown)
    assert len(shown["rows"]) == 9
    assert (shown["first"] == heights[0]).all()
    if find_spec("dask"):
        exec(in_pieces, shown)
        assert list(shown["highest"].values) == list(heights.max(axis=(1, 2)))


def test_a_database_is_published_and_read_as_shown(tmp_path, monkeypatch, capsys):
    pytest.importorskip("mlcroissant")
    from gen import cli
    from gen.database import Reader

    monkeypatch.chdir(tmp_path)
    Path("few.toml").write_text("samples = 9\n[surface]\nnodes = 9\n")
    assert cli.main(["run", "few.toml", "-o", "quick.h5"]) == 0
    (export,) = re.findall(r"python -m gen (export .*\\\n.*)", PAGES[PUBLISH])
    assert cli.main(shlex.split(export.replace("\\\n", ""))) == 0
    capsys.readouterr()
    shown: dict = {}
    table, croissant = codes("python", PUBLISH)
    exec(table, shown)
    with warnings.catch_warnings(action="ignore"):  # of the loader's own libraries
        exec(croissant, shown)
    with Reader(Path("quick.h5")) as reader:
        areas = reader.column("area_percent")
    assert float(capsys.readouterr().out) == areas[0]
    assert list(shown["rows"]["area_percent"]) == list(areas)


NOT_OURS = re.compile(
    r"^(python -m venv|pip install|module load|make |mpirun|\. |\w+/ )|gen run paper|mpiexec -n 9"
)
"""Lines that install, take longer than a test may, or are a map of folders."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("walk")


def walk(page, folder, monkeypatch):
    """Do what a page shows, in its order."""
    pytest.importorskip("sklearn")
    pytest.importorskip("matplotlib")
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
    suffixes = {".inp", ".h", ".csv", ".json", ".py", ".png"}
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
def test_the_user_of_a_cluster(folder, monkeypatch):
    (scene,) = codes("toml", "docs/start/cluster.md")
    (folder / "mine.toml").write_text(scene)
    walk("docs/start/cluster.md", folder, monkeypatch)
    with h5py.File(folder / "mine.h5") as file:
        assert (file["status"][:] == 1).all()
