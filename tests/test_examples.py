"""The examples and the gallery do what their users came for, and find the numbers of before."""

import csv
import importlib.util
import json
import re
import runpy
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from databases import database_of
from learnt_rows import surrogate_of
from small_populations import POPULATIONS

import asperity
import bem
import learn.cli
from gen.database import Reader
from gen.generation.sample import surface_numbered
from gen.runtime.user_code import TRUSTED
from gen.scene import Scene, load
from gen.schema import Status
from gen.statistics import NAMES
from gen.surface import generate
from learn import Surrogate

FOLDER = Path(__file__).parents[1] / "examples"
GALLERY = FOLDER / "gallery"

SCENE = "samples = 300\n[surface]\nnodes = 33\n"
AREA = "--target", "area"


def example(name):
    spec = importlib.util.spec_from_file_location(
        f"example_{name}", FOLDER / f"{name}.py"
    )
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.main


@pytest.fixture(scope="module")
def surrogate(tmp_path_factory):
    return str(
        surrogate_of(database_of(tmp_path_factory.mktemp("examples"), SCENE), *AREA)
    )


def test_every_example_is_short_and_tested():
    scripts = {path.stem for path in FOLDER.glob("*.py")}
    assert scripts == set(re.findall(r'example\("(\w+)"\)', Path(__file__).read_text()))
    assert all(len((FOLDER / f"{n}.py").read_text().splitlines()) <= 100 for n in scripts)


@pytest.mark.long
def test_the_notebook_prints_what_it_shows(tmp_path, monkeypatch, capsys):
    """Text as it stands there, numbers within 2 %; what commands print depends on the screen."""
    pyplot = pytest.importorskip("matplotlib.pyplot")
    pyplot.switch_backend("agg")
    monkeypatch.chdir(tmp_path)
    cells = json.loads((FOLDER / "tour.ipynb").read_text("utf-8"))["cells"]
    code = [cell for cell in cells if cell["cell_type"] == "code"]
    assert len(code) == 10
    names, number = {}, re.compile(r"-?\d+(?:\.\d+)?")
    for cell in code:
        source = "".join(cell["source"])
        exec(source, names)
        printed = capsys.readouterr().out
        if ".main(" in source:
            assert names["code"] == 0
            continue
        shown = "".join("".join(each.get("text", "")) for each in cell["outputs"])
        assert number.split(printed) == number.split(shown)
        found, stored = (
            list(map(float, number.findall(text))) for text in (printed, shown)
        )
        assert found == pytest.approx(stored, rel=0.02)
    pyplot.close("all")


def test_propagation_finds_the_mean_area_of_the_population(surrogate, tmp_path, capsys):
    asked = [surrogate, "--delta", "15", "--small", "--plot", str(tmp_path / "areas.png")]
    areas = example("propagation")([*asked, "--set", "hurst", "0.7"])
    scene = Scene.parse(SCENE, "test").with_parameters({"hurst": 0.7, "sigma0": 12.5})
    surfaces = [surface_numbered(scene, number) for number in range(20)]
    solved = [bem.solve(heights, 1000.0, 15.0).area_percent for heights in surfaces]
    assert areas.mean() == pytest.approx(np.mean(solved), rel=0.1)
    assert areas.mean() == pytest.approx(10.48, rel=0.03)
    assert (tmp_path / "areas.png").stat().st_size > 1000
    with pytest.raises(SystemExit, match="2"):
        example("propagation")([*asked, "--set", "sigma", "1"])
    assert "hurst, sigma0" in capsys.readouterr().err


@pytest.fixture(autouse=True)
def trust():
    """An example decides for its own process alone."""
    before = TRUSTED.get()
    yield
    TRUSTED.set(before)


@pytest.mark.few(1)
@pytest.mark.parametrize("name", POPULATIONS)
def test_examples_take_any_scene(name, populations, tmp_path, capsys):
    """Of any generator and load; the indices are of all that the scene draws, surface and load."""
    path = str(tmp_path / "learnt.surrogate")
    target = "mean_gap" if name == "spectral" else "area"
    line = ["fit", str(populations / f"{name}.h5"), "-o", path, "--target", target]
    assert learn.cli.main([*line, "--model", "kernel-ridge"]) == 0
    assert np.isfinite(example("propagation")([path, "--surfaces", "3", "--trust"])).all()
    indices = example("sobol")([path, "--samples", "4", "--trust"])
    drawn = {"force": 1, "scans": 0}.get(name, 2)
    assert indices["S1"].shape == indices["ST"].shape == (drawn + 2,)
    if name == "scans":
        with pytest.raises(SystemExit, match="2"):
            example("study")([path, "--small"])
        assert "draws none" in capsys.readouterr().err
    else:
        assert np.isfinite(example("study")([path, "--small", "--trust"])).all()


def test_the_area_of_the_study_grows_with_delta_and_with_the_hurst_exponent(
    surrogate, tmp_path
):
    asked = [
        surrogate,
        "--small",
        "--parameter",
        "hurst",
        "--csv",
        str(tmp_path / "study.csv"),
    ]
    areas = example("study")(asked)
    assert (np.diff(areas, axis=0) > 0).all()
    assert (np.diff(areas, axis=1) > 0).all()
    assert areas[1, 1] == pytest.approx(12.84, rel=0.03)
    table = np.loadtxt(tmp_path / "study.csv", delimiter=",", skiprows=1)
    np.testing.assert_allclose(table[:, 1:], areas, rtol=1e-5)


def test_identification_finds_delta(surrogate, tmp_path, capsys):
    heights = generate("diamond-square", 33, 0.65, 12.5, np.random.default_rng(11))
    np.save(tmp_path / "surface.npy", heights)
    contact = bem.solve(heights, 1000.0, 18.0)
    asked = [
        surrogate,
        str(tmp_path / "surface.npy"),
        "--side",
        "1000",
        "--small",
        "--area",
    ]
    delta, low, high = example("identification")([*asked, str(contact.area_percent)])
    assert delta == pytest.approx(17.76, rel=0.03)
    assert low <= delta <= high
    assert low <= 18.0 <= high
    with pytest.raises(SystemExit, match="2"):
        example("identification")([*asked, "99"])
    assert "--area 99" in capsys.readouterr().err


def test_sobol_finds_that_delta_decides_most(surrogate):
    """Of surfaces, and of what a scene draws, without any: hurst, sigma0, delta."""
    rows = Path(surrogate).with_name("rows.h5")
    scene = surrogate_of(rows, *AREA, "--features", "scene", name="scene")
    for path, total in ((surrogate, 0.94), (str(scene), 0.75)):
        indices = example("sobol")([path, "--small"])
        assert np.argmax(indices["ST"]) == 2
        assert indices["ST"][2] == pytest.approx(total, abs=0.05)


def test_the_sample_is_the_first_rows_of_the_papers_database(tmp_path):
    """Elsewhere it differs in the last bits, as processors' vector instructions do."""
    again = database_of(tmp_path, "samples = 200\n", "again", "--rows", "190:200")
    with Reader(FOLDER / "sample.h5") as sample, Reader(again) as made:
        assert (sample.column("status") == np.full(200, Status.DONE)).all()
        for name in ("delta", *NAMES, "area_percent", "force"):
            here, there = made.column(name), sample.column(name)[190:]
            np.testing.assert_allclose(here, there, rtol=1e-6, err_msg=name)


def test_the_sample_trains_a_surrogate(tmp_path):
    path = surrogate_of(Path(shutil.copy(FOLDER / "sample.h5", tmp_path)), *AREA)
    surface = np.asarray(
        generate("diamond-square", 129, 0.65, 12.5, np.random.default_rng(5))
    )
    answer = Surrogate.load(path).for_surface(surface, side=1000.0).predict([15.0])
    assert answer.area[0] == pytest.approx(
        bem.solve(surface, 1000.0, 15.0).area_percent, rel=0.3
    )


def test_the_second_loading_is_elastic_up_to_the_first_load(tmp_path):
    law = example("unloading")(["--small", "--plot", str(tmp_path / "laws.png")])
    load, new, again, _, yielded_again = law.T
    assert (
        again[load < 50] > new[load < 50]
    ).all()  # flattened asperities touch at lower loads
    assert not yielded_again[load < 40].any()
    assert again[-2] == pytest.approx(new[-2], abs=0.05)
    assert (new[2], again[2]) == pytest.approx((2.249, 2.675), rel=0.01)
    assert (tmp_path / "laws.png").stat().st_size > 1000


def test_a_texture_is_found_whose_gaps_are_the_wanted_ones(tmp_path):
    picture = tmp_path / "texture.png"
    gaps = example("texture")(["--nodes", "32", "--plot", str(picture)])
    assert np.abs(gaps["start"] / gaps["wanted"] - 1).max() > 1
    np.testing.assert_allclose(gaps["texture"], gaps["wanted"], rtol=1e-3)
    assert gaps["start"][0] == pytest.approx(1.2600, rel=1e-3)
    assert picture.stat().st_size > 1000


@pytest.mark.long
def test_laws_of_larger_windows_scatter_less(tmp_path):
    table, picture = tmp_path / "windows.csv", tmp_path / "windows.png"
    found = example("windows")(["--small", "--plot", str(picture), "--table", str(table)])
    assert (found[0, 1:] < found[-1, 1:]).all()
    assert found[-1, 1:] == pytest.approx([0.650, 0.529, 0.290, 0.233], rel=0.02)
    assert picture.stat().st_size > 1000
    names, *written = csv.reader(table.read_text().splitlines())
    assert names[:3] == ["roll-offs", "closure at 10 MPa", "closure at 100 MPa"]
    assert np.array(written, dtype=float) == pytest.approx(found, rel=1e-5)


def test_midpoint_displacement_has_a_smaller_exponent_than_it_is_asked_for(tmp_path):
    rows = example("hurst")(["--small", "--table", str(tmp_path / "hurst.csv")])
    with (tmp_path / "hurst.csv").open(encoding="utf-8") as file:
        assert [row["generator"] for row in csv.DictReader(file)] == [
            r["generator"] for r in rows
        ]
    exponents = {(row["generator"], row["asked_for"]): row["hurst"] for row in rows}
    assert exponents["diamond-square", 0.7] == pytest.approx(0.444, abs=0.02)
    for row in rows:
        off = row["hurst"] - row["asked_for"]
        assert (
            (abs(off) < 0.05) if row["generator"] == "spectral" else (-0.3 < off < 0.0)
        ), row


@pytest.mark.long
def test_the_served_solver_has_the_mean_area_of_the_solver(tmp_path, monkeypatch, capsys):
    """QMCPy's mean through a model that answers as the server does, against plain averaging."""
    import umbridge

    from asperity.serving.models import Configuration, SolverModel

    model = SolverModel(load("quick"), "quick")

    class Client:
        def __init__(self, address, name):
            self.get_input_sizes = lambda config: model.input_sizes

        def __call__(self, inputs, config):
            return model.evaluate(inputs, Configuration(**config))

    monkeypatch.setattr(umbridge, "HTTPModel", Client)
    arguments = ["http://127.0.0.1:1", "quick", "--tolerance", "0.2", "--nodes", "17"]
    mean = example("served")(arguments)
    assert mean == pytest.approx(10.41, abs=0.1)
    random = np.random.default_rng(1)
    points = random.uniform([0.5, 10.0, 5.0], [0.8, 15.0, 25.0], size=(300, 3)).tolist()
    client = Client("", "")
    areas = [client([[h, s], [d]], {"nodes": 17})[0][0] for h, s, d in points]
    assert mean == pytest.approx(
        np.mean(areas), abs=0.2 + 3 * np.std(areas) / np.sqrt(300)
    )
    with pytest.raises(SystemExit, match="2"):
        example("served")([*arguments, "--limits", "0.5:0.8"])
    assert "sizes [2, 1]" in capsys.readouterr().err


PRESSED = """samples = 100
[surface]
generator = "spectral"
nodes = 32
side = 100.0
roll_off = 25.0
cut_off = 12.0
rms_slope = [0.15, 0.2]
[load]
quantity = "pressure"
range = [10.0, 400.0]
[contact]
boundary = "periodic"
modulus = 100e3
hardness = [1000.0, 8000.0]
"""


@pytest.mark.long
@pytest.mark.usefixtures("here")
def test_calibration_finds_the_hardness_of_a_surface_that_it_has_not_seen(capsys):
    Path("scene.toml").write_text(PRESSED)
    function = asperity.SceneFunction("scene.toml", ["area_percent"])
    pressures = np.array([50.0, 100.0, 200.0, 400.0])
    given = {"rms_slope": 0.17, "pressure": pressures, "surface": 5000}
    areas = function(**given, hardness=2500.0)[:, 0] * [1.05, 0.97, 1.0, 0.98]
    np.savetxt(
        "m.csv", np.c_[pressures, areas], "%g", ",", header="pressure,area_percent"
    )
    small = ["--surfaces", "15", "--hardnesses", "9"]
    median, low, high = example("calibration")(["scene.toml", "m.csv", *small])
    assert median == pytest.approx(2736, rel=0.03)
    assert low < 2500 < high < 1.5 * low
    assert low < median < high
    with pytest.raises(SystemExit, match="2"):
        example("calibration")(["quick", "m.csv"])
    assert "pressure, hardness wanted" in capsys.readouterr().err


@pytest.mark.few(2)
@pytest.mark.parametrize(
    ("table", "line"),
    [
        (
            "load,area\n1,2\n",
            "t.csv: has no column pressure, area_percent; it has 'load, area'",
        ),
        ("pressure,area_percent\n", "t.csv: has a header and no rows"),
        (
            "pressure,area_percent\n1\n",
            "t.csv, line 2: pressure, area_percent have to be finite",
        ),
        (None, "No such file"),
    ],
)
def test_input_that_an_example_cannot_use_is_told_in_one_line(tmp_path, table, line):
    if table is not None:
        (tmp_path / "t.csv").write_text(table)
    command = [sys.executable, FOLDER / "calibration.py", "quick", "t.csv"]
    ended = subprocess.run(
        command, cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert ended.returncode == 2
    assert ended.stderr.startswith("calibration.py: ")
    assert line in ended.stderr
    assert ended.stderr.count("\n") == 1


PICTURES = sorted(GALLERY.glob("plot_*.py"))


def test_every_example_of_the_gallery_is_short_and_pins_a_number():
    """An assertion with its tolerance in the script itself, so that a build of the manual fails."""
    for path in PICTURES:
        text = path.read_text("utf-8")
        assert len(text.splitlines()) <= 100, path
        assert re.search(r"assert_allclose\([^#]*\b[ar]tol=", text), path


@pytest.mark.long  # make docs runs the gallery too
@pytest.mark.parametrize("path", PICTURES, ids=lambda path: path.stem)
def test_an_example_finds_the_number_that_it_pins(path, monkeypatch):
    pyplot = pytest.importorskip("matplotlib.pyplot")
    monkeypatch.setenv("MPLBACKEND", "agg")
    pyplot.switch_backend("agg")
    monkeypatch.setattr(pyplot, "show", lambda: None)
    monkeypatch.chdir(GALLERY)
    before = sorted(path.name for path in FOLDER.iterdir())
    runpy.run_path(str(path))
    assert pyplot.get_fignums()
    pyplot.close("all")
    assert sorted(path.name for path in FOLDER.iterdir()) == before


def test_the_lines_for_users_of_other_codes_run(capsys):
    page = (FOLDER.parent / "docs" / "how-to" / "other-codes.md").read_text()
    lines = page.partition("```python\n")[2].partition("```")[0]
    names = {"heights": np.random.default_rng(0).random((8, 8)), "side": 1000.0}
    exec(lines, names)
    assert len(capsys.readouterr().out.splitlines()) == 3
    assert names["contact"].problem.force == pytest.approx(100 * 1000**2)
