"""What README.md and docs/ say is what the code does; what they tell a newcomer to do, done."""

import csv
import importlib
import re
import shlex
import sys
import warnings
from importlib.util import find_spec
from pathlib import Path

import pytest
from databases import database_of
from launch import launch
from pages import PAGES, ROOT, anchors, codes, commands, links, steps
from typer.main import get_command

import learn.cli
from bench.answers import FIRST, lines
from bench.page import PUBLISHED, answer_table
from bench.report import PARTS
from gen import cli
from gen.database import Reader
from gen.generation.trial import doubts_before
from gen.scene import Scene

SURFACE = "docs/how-to/surface.md"
SCAN = "docs/how-to/scan.md"
SCENES = "docs/how-to/scenes.md"
INSTRUMENTS = "docs/how-to/instruments.md"
READING = "docs/how-to/reading.md"
PUBLISH = "docs/how-to/publish.md"
COMPARE = "docs/how-to/compare.md"


@pytest.mark.parametrize("page", PAGES)
def test_links_lead_somewhere(page):
    for link in links(page):
        target, _, heading = link.partition("#")
        path = ((ROOT / page).parent / target).resolve() if target else ROOT / page
        assert path.exists(), link
        if heading:
            assert heading in anchors(path.relative_to(ROOT).as_posix()), link


PATH = re.compile(
    r"(?<![\w./-])(?:\.ci|asperity|bem|bench|docs|examples|gen|learn|recipe|slurm|tests)/[\w./-]+\w"
)
"""A file or folder of a clone."""

NOT_THERE = {"docs/_build/html", "bench/reports/NAME.toml"}
"""What is made, or stands for several files."""


@pytest.mark.parametrize("page", [*PAGES, "CONTRIBUTING.md"])
def test_paths_that_a_page_names_are_there(page):
    quoted = re.findall(r"`([^`\n]+)`", (ROOT / page).read_text(encoding="utf-8"))
    named = {path for words in quoted for path in PATH.findall(words)} - NOT_THERE
    assert not [path for path in named if not (ROOT / path).exists()]


def test_the_scenes_shown_are_scenes():
    shown = [Scene.parse(text, "a page") for text in codes("toml")]
    samples = [scene.samples for scene in shown]
    assert samples == [2000, 1000, 2000, 2000, 5000, 3000, 3000, 300, 200]
    assert [shown[5].surface.generator, shown[6].surface.generator] == ["scans", "like"]


@pytest.mark.usefixtures("here")
def test_surfaces_loads_and_outputs_of_your_own_are_made_as_shown(monkeypatch):
    """The scene with its columns, and one with the function and the parameters of the comments."""
    monkeypatch.setattr(sys, "path", list(sys.path))
    *_, scene = codes("toml", SCENES)
    # The first one reads a population, the last one is a generator, which a test adds.
    _, module, _ = codes("python", SCENES)
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


def test_the_first_scene_with_a_pressure_has_a_material_and_is_not_doubted():
    scene = next(each for each in codes("toml", SCENES) if 'quantity = "pressure' in each)
    assert "modulus = 210e3" in scene
    assert "poisson = 0.3" in scene
    assert 'quantity = "pressure"' in scene
    assert doubts_before(Scene.parse(scene, SCENES), 2000) == []


PROGRAMS = {"gen": "gen.cli", "learn": "learn.cli", "bench": "bench.commands"}


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


def test_python_shown_runs(here):
    surface, contact = codes("python", SURFACE)
    (scan,) = codes("python", INSTRUMENTS)
    exec(surface, {})
    names: dict[str, object] = {}
    exec(contact, names)
    assert names["contact"].area_percent > 0
    pytest.importorskip("SurfaceTopography")
    exec(scan, {})
    assert (here / "scan.x3p").exists()


def test_the_scan_has_the_law_that_is_stated(here, capsys):
    """The page's scan, at the pressure of its text: as shown, with the spikes, and elastic."""
    pytest.importorskip("SurfaceTopography")
    section = PAGES[SCAN]
    (rough,) = codes("python", SCAN)
    exec(rough, {})
    contact, law = re.findall(r"asperity gen (.*)", section.replace("\\\n", ""))
    assert cli.main(shlex.split(contact.replace("1:200:12:log", "100"))) == 0
    said = capsys.readouterr().out
    assert "despiked: 20 nodes" in said
    assert "filled 673 nodes (1.03 %)" in said
    assert (here / "scan.png").stat().st_size > 50_000

    def at_100_megapascals(changed: str) -> dict[str, float]:
        command = changed.replace("1:1000:16:log", "100").replace(
            "-o ground", "--csv law.csv"
        )
        assert cli.main(shlex.split(command)) == 0
        with (here / "law.csv").open(newline="") as file:
            row = list(csv.DictReader(file))[-1]
        return {
            name: float(row[name])
            for name in ("pressure_MPa", "closure_um", "area_percent")
        }

    stated = {"pressure_MPa": 100.0, "closure_um": 1.38, "area_percent": 5.1}
    assert "closed by 1.38 um, and 5.1 % of it" in section
    assert at_100_megapascals(law) == pytest.approx(stated, rel=0.005)
    assert "closure is 10.5 um" in section
    spiky = at_100_megapascals(law.replace("--despike 7", ""))
    assert spiky["closure_um"] == pytest.approx(10.5, rel=0.005)
    assert "only 0.70 % are in contact" in section
    elastic = at_100_megapascals(law.replace("--hardness 2000", ""))
    assert elastic["area_percent"] == pytest.approx(0.70, abs=0.005)


def test_reading_with_xarray_as_shown(here):
    pytest.importorskip("h5netcdf")
    store = "[store]\nheights = true\npressure = true\n"
    for name, kept in (("quick", ""), ("stored", store)):
        database_of(here, f"samples = 9\n[surface]\nnodes = 9\n{kept}", name)
    with Reader(Path("stored.h5")) as reader:
        heights = reader.column("heights")
    rows, whole, in_pieces, checksum = codes("python", READING)
    shown: dict = {}
    exec(rows, shown)
    assert len(shown["done"]) == shown["rows"]["area_percent"].notna().sum() == 9
    exec(whole, shown)
    assert len(shown["rows"]) == 9
    assert (shown["first"] == heights[0]).all()
    if find_spec("dask"):
        exec(in_pieces, shown)
        assert list(shown["highest"].values) == list(heights.max(axis=(1, 2)))
    exec(checksum, shown)
    assert shown["whole"]


def test_a_model_of_ones_own_repeats_a_score_of_a_comparison(here):
    database_of(
        here, "samples = 60\nsamples_per_surface = 2\n[surface]\nnodes = 9\n", "paper"
    )
    asked = ["compare", "paper.h5", "-o", "comparison", "--model", "decision-tree"]
    assert learn.cli.main(asked) == 0
    shown: dict = {}
    (script,) = codes("python", COMPARE)
    assert len(script.strip().splitlines()) <= 25
    exec(script, shown)
    assert shown["r2"] == pytest.approx(
        shown["scores"].loc["decision-tree", "r2"], rel=1e-9
    )


def test_a_database_is_published_and_read_as_shown(here, capsys):
    pytest.importorskip("mlcroissant")
    database_of(here, "samples = 9\n[surface]\nnodes = 9\n", "quick")
    (export,) = re.findall(r"asperity gen (export .*\\\n.*)", PAGES[PUBLISH])
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


def walk(page, folder, monkeypatch, section=""):
    """Do what a page, or a section of it, shows, in its order."""
    pytest.importorskip("sklearn")
    pytest.importorskip("matplotlib")
    monkeypatch.chdir(folder)
    for kind, step in steps(page, section):
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


@pytest.mark.long
def test_the_readme(folder, monkeypatch, capfd):
    pytest.importorskip("SurfaceTopography")
    monkeypatch.chdir(folder)
    (scan,) = codes(
        "python", "docs/how-to/scan.md"
    )  # the page that the README names for it
    exec(scan, {})
    walk("README.md", folder, monkeypatch)
    made = (
        "surface.npy",
        "quick.png",
        "first.surrogate",
        "law.h",
        "law-calculix.inp",
        "ground.h",
    )
    for name in made:
        assert (folder / name).stat().st_size > 500
    area, delta, gap = map(
        float,
        re.findall(r"^([\d.]+) ([\d.]+) ([\d.]+)$", capfd.readouterr().out, re.M)[0],
    )
    assert 2.5 <= area < 10  # load / hardness is 2.5 %
    assert min(delta, gap) > 0


WALKS = {
    "tribologist": ["law.csv"],
    "finite-elements": ["joint.csv", "joint.h", "joint-calculix.inp", "joint_4c.py"],
    "data": ["quick.h5"],
    "cluster": ["mine.h5"],
}
"""The pages of first hours, and what each of them makes."""


@pytest.mark.long
@pytest.mark.mpi
@pytest.mark.parametrize("name", WALKS)
def test_a_first_hour(name, folder, monkeypatch):
    page = f"docs/start/{name}.md"
    for scene in codes("toml", page):
        (folder / "mine.toml").write_text(scene)
    walk(page, folder, monkeypatch)
    assert all((folder / made).stat().st_size > 500 for made in WALKS[name])


OWN_SURROGATE = "docs/how-to/own-surrogate.md"


@pytest.mark.long
@pytest.mark.mpi
def test_the_way_from_a_map_to_a_surrogate_of_its_kind(folder, monkeypatch, capsys):
    """Every command runs as written, and the surrogate's law is that of the solver."""
    section = "From a map to a surrogate of its kind"
    walk(OWN_SURROGATE, folder, monkeypatch, section)
    output = capsys.readouterr().out
    assert "verdict: of its kind" in output
    assert "the features of a surrogate of these surfaces reach the map's" in output
    areas = [_areas_over_pressure(folder / name) for name in ("like.csv", "truth.csv")]
    assert areas[0] == pytest.approx(areas[1], rel=0.02)


def _areas_over_pressure(path):
    """Return the areas [%] of a law's table at the pressures that were asked for."""
    with path.open(newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["against"] == "pressure_MPa"]
    return [float(row["area_percent"]) for row in rows if float(row["pressure_MPa"]) > 19]


def test_the_readme_has_the_answers_that_the_page_begins_with():
    table = answer_table(lines(PARTS, PUBLISHED, FIRST))
    assert table in PAGES["README.md"], f"the table of README.md has to be:\n{table}"
