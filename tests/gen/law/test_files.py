"""What the files of a law say of it: its maps, their preparation, and where the grid decides."""

import hashlib
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from strict import json_of

from gen import cli
from gen.law.files import cells, drawn_area
from gen.maps.settings import Reading
from gen.quantities import CONTINUUM
from tests.bem.waves import random_waves

MAPS = ["many/s0.npy", "many/s1.npy", "many/s2.npy", "other.txt"]
STEPS = ["read 20 x 20 nodes", "turned upside down", "despiked", "levelled by a plane"]


def sha256(name):
    return hashlib.sha256(Path(name).read_bytes()).hexdigest()


def words(text):
    """The comments at the head of a file as one line."""
    head = text.partition("#include")[0]
    return " ".join(
        "".join(head.replace("\n *", "").replace("\n**", "").split("\n#")).split()
    )


@pytest.fixture(
    scope="module", params=[[], ["--against", "many/s1.npy"]], ids=["one", "pair"]
)
def prepared(request, write):
    """A law of a folder of maps and a map, prepared, alone and against a second body.

    Also the file of the second body, if there is one.
    """

    def prepare():
        np.savetxt("other.txt", np.load("many/s2.npy"))

    options = ["--level", "plane", "--despike", "6", "--invert", *request.param]
    command = ["many", "other.txt", "--pressure", "1,10", *options]
    law = write([*command, "-o", "law", "--no-check"], prepare=prepare)
    return law, request.param[1:]


def test_json_has_the_maps_of_each_surface_with_their_hashes(prepared):
    law, second = prepared
    sources = law.document("law.json")["sources"]
    assert [source["files"][0]["path"] for source in sources] == MAPS
    for source in sources:
        assert [file["path"] for file in source["files"][1:]] == second
        for file in source["files"]:
            assert file["sha256"] == sha256(law.folder / file["path"])


def test_json_has_each_step_of_the_preparation(prepared):
    law, _ = prepared
    for source in law.document("law.json")["sources"]:
        for step in STEPS:
            assert any(step in line for line in source["steps"])


def test_the_first_row_of_each_table_has_the_maps_and_the_steps(prepared):
    law, second = prepared
    rows = pd.read_csv(law.folder / "law.csv")
    firsts = rows[rows.prepared.notna()]
    assert firsts.against.tolist() == ["delta_um", "pressure_MPa"]
    for row in firsts.itertuples():
        names = row.files.split("; ")
        assert names[:: 1 + len(second)] == MAPS
        assert row.sha256.split("; ") == [sha256(law.folder / name) for name in names]
        for step in STEPS:
            assert row.prepared.count(step) >= len(MAPS)


@pytest.mark.parametrize(
    "name",
    ["law.h", "law-calculix.inp", "law-calculix-soft.inp", "law-abaqus.inp", "law_4c.py"],
)
def test_files_of_programs_have_the_maps_and_the_steps(prepared, name):
    law, _ = prepared
    text = words(law.text(name))
    for path in MAPS:
        assert f"{path} (SHA-256 {sha256(law.folder / path)})" in text
    for step in STEPS:
        assert text.count(step) >= len(MAPS)


@pytest.fixture
def of_scene(surfaces):
    """The source of a law of a scene of scans."""
    scene = 'samples = 2\n[surface]\ngenerator = "scans"\nfiles = "many"\nnodes = 8\n'
    scene += 'reading.side = "100"\npreparation.level = "plane"\n'
    scene += '[load]\nquantity = "pressure"\nrange = [0.01, 0.1]\n'
    Path("scene.toml").write_text(scene)
    command = ["law", "scene.toml", "--surfaces", "2", "--pressure", "0.01,0.1"]
    assert cli.main([*command, "--json", "law.json"]) == 0
    (source,) = json_of("law.json")["sources"]
    return source


def test_a_law_of_a_scene_names_its_file_and_the_maps_of_it(of_scene):
    files = {Path(file["path"]).name: file["sha256"] for file in of_scene["files"]}
    assert files["scene.toml"] == sha256("scene.toml")
    assert files["s1.npy"] == sha256("many/s1.npy")


def test_a_law_of_a_scene_has_the_steps_that_the_scene_states(of_scene):
    assert of_scene["steps"] == ['reading.side = "100"', 'preparation.level = "plane"']


def test_cells_have_each_number_of_a_table_by_its_column(surfaces, make):
    law = make("many", pressure="1,10", e_star=230e3, reading=Reading(side="100"))
    rows = cells(law.over_pressure)
    closure = law.over_pressure.curves["closure_um"]
    assert [row["pressure_MPa"] for row in rows] == [1.0, 10.0]
    assert [row["closure_um"] for row in rows] == closure.value.tolist()
    assert [row["closure_um_low"] for row in rows] == closure.low.tolist()
    assert [row["closure_um_std"] for row in rows] == closure.std.tolist()


def test_cells_are_empty_where_there_is_no_number(surfaces, make):
    law = make("many/s0.npy", pressure="1", e_star=230e3, reading=Reading(side="100"))
    (row,) = cells(law.over_pressure)
    assert row["closure_um_low"] == row["closure_um_std"] == ""


NOISE = "noise.npy"
WAVES = "waves.npy"


@pytest.fixture
def unresolved(here):
    """Noise, which no grid resolves, and waves, which it does where enough nodes touch."""
    np.save(NOISE, np.random.default_rng(1).normal(size=(32, 32)))
    np.save(WAVES, 100 * random_waves(1, 4, 0.8, 1)(48))


RESOLVED = pytest.mark.parametrize(
    ("name", "pressures", "resolved"),
    [
        (NOISE, "50,500", [False, False]),
        (WAVES, "0.001,0.002,500,2000", [False, False, True, True]),
    ],
)
PERIODIC = {"e_star": 230e3, "boundary": "periodic", "reading": Reading(side="100")}


@RESOLVED
def test_csv_says_at_which_loads_the_grid_resolves_the_contact(
    unresolved, run, name, pressures, resolved
):
    run(name, "--pressure", pressures, "--boundary", "periodic", "--csv", "law.csv")
    rows = pd.read_csv("law.csv")
    answers = ["yes" if load else "no" for load in resolved]
    assert rows[rows.against == "pressure_MPa"].resolved.tolist() == answers
    deltas = rows[rows.against == "delta_um"].resolved
    assert deltas.isna().tolist() == [True] + [False] * len(resolved), (
        "nothing touches at first"
    )


@RESOLVED
def test_the_area_that_is_drawn_is_that_in_the_continuum_only_where_it_is_resolved(
    unresolved, make, name, pressures, resolved
):
    law = make(name, pressure=pressures, grid_error=True, **PERIODIC)
    curves = law.over_pressure.curves
    panel = drawn_area(law.over_pressure)
    area = np.where(
        resolved, curves[CONTINUUM.in_laws].value, curves["area_percent"].value
    )
    np.testing.assert_array_equal(panel.curve.value, area)
    assert panel.curve.banded.tolist() == resolved


def test_the_area_of_the_nodes_is_marked_beside_that_in_the_continuum(unresolved, make):
    law = make(WAVES, pressure="0.001,0.002,500,2000", grid_error=True, **PERIODIC)
    panel = drawn_area(law.over_pressure)
    assert panel.label == "area in the continuum [%]"
    np.testing.assert_array_equal(panel.of_nodes, [True, True, False, False])
    assert law.band.startswith("the error of the grid")


def test_the_area_of_the_grid_is_not_called_that_in_the_continuum(unresolved, make):
    law = make(NOISE, pressure="50,500", grid_error=True, **PERIODIC)
    label = drawn_area(law.over_pressure).label
    assert label.startswith("area of the nodes in contact [%]")
    assert law.band == "none, one surface was solved"


def test_without_the_error_of_the_grid_no_area_is_judged(unresolved, make):
    law = make(NOISE, pressure="50,500", **PERIODIC)
    assert drawn_area(law.over_pressure).label == "area of the nodes in contact [%]"
    assert law.over_pressure.resolved is None


@pytest.fixture(scope="module")
def judged(write):
    """Laws of a population with the error of the grid and without, and of its first surface."""
    loads = ["--pressure", "0.01,100", "--csv"]
    return write(
        ["many", *loads, "many.csv", "--plot", "law.png"],
        ["many/s0.npy", *loads, "one.csv"],
        ["many", *loads, "without.csv", "--no-grid-error"],
    )


def test_a_population_is_judged_on_its_first_surface(judged):
    of_all = judged.table("many.csv").resolved.tolist()
    assert of_all == judged.table("one.csv").resolved.tolist()


def test_csv_has_no_judgement_without_the_error_of_the_grid(judged):
    assert "resolved" not in judged.table("without.csv")
