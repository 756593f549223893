"""What the files of a law say of it: its maps, their preparation, and where the grid decides."""

import hashlib
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from strict import json_of

from gen import cli
from gen.law.files import drawn_area
from gen.maps.settings import Reading
from gen.quantities import CONTINUUM
from tests.bem.waves import random_waves
from tests.maps import waves


def sha256(name):
    return hashlib.sha256(Path(name).read_bytes()).hexdigest()


def words(path):
    """The comments at the head of a file as one line."""
    head = Path(path).read_text().partition("#include")[0]
    return " ".join(
        "".join(head.replace("\n *", "").replace("\n**", "").split("\n#")).split()
    )


@pytest.mark.parametrize(
    "against", [[], ["--against", "many/s1.npy"]], ids=["one", "pair"]
)
def test_every_file_names_the_maps_their_hashes_and_each_step(surfaces, run, against):
    """A folder of maps and a map, prepared, alone and against a second body."""
    np.savetxt("other.txt", np.load("many/s2.npy"))
    steps = ["--level", "plane", "--despike", "6", "--invert"]
    ask = ["many", "other.txt", "--pressure", "1,10", *steps, *against]
    run(*ask, "-o", "law", "--no-check")
    maps = ["many/s0.npy", "many/s1.npy", "many/s2.npy", "other.txt"]
    done = ["read 20 x 20 nodes", "turned upside down", "despiked", "levelled by a plane"]
    sources = json_of("law.json")["sources"]
    assert [source["files"][0]["path"] for source in sources] == maps
    for source in sources:
        files = [file["path"] for file in source["files"]]
        assert files[1:] == against[1:]
        assert [file["sha256"] for file in source["files"]] == [
            sha256(file) for file in files
        ]
        for step in done:
            assert any(step in line for line in source["steps"])
    rows = pd.read_csv("law.csv")
    firsts = rows[rows.prepared.notna()]
    assert firsts.against.tolist() == ["delta_um", "pressure_MPa"]
    for row in firsts.itertuples():
        assert row.files.split("; ")[:: 1 + len(against) // 2] == maps
        assert row.sha256.split("; ") == [sha256(name) for name in row.files.split("; ")]
        assert all(row.prepared.count(step) >= len(maps) for step in done)
    for name in (
        "law.h",
        "law-calculix.inp",
        "law-calculix-soft.inp",
        "law-abaqus.inp",
        "law_4c.py",
    ):
        text = words(name)
        for path in maps:
            assert f"{path} (SHA-256 {sha256(path)})" in text, name
        assert all(text.count(step) >= len(maps) for step in done), name


def test_a_law_of_a_scene_names_its_file_and_the_maps_of_it(surfaces):
    scene = 'samples = 2\n[surface]\ngenerator = "scans"\nfiles = "many"\nnodes = 8\n'
    scene += 'reading.side = "100"\npreparation.level = "plane"\n'
    scene += '[load]\nquantity = "pressure"\nrange = [0.01, 0.1]\n'
    Path("scene.toml").write_text(scene)
    ask = [
        "law",
        "scene.toml",
        "--surfaces",
        "2",
        "--pressure",
        "0.01,0.1",
        "--json",
        "law.json",
    ]
    assert cli.main(ask) == 0
    (source,) = json_of("law.json")["sources"]
    files = {Path(file["path"]).name: file["sha256"] for file in source["files"]}
    assert files["scene.toml"] == sha256("scene.toml")
    assert files["s1.npy"] == sha256("many/s1.npy")
    assert source["steps"] == ['reading.side = "100"', 'preparation.level = "plane"']


@pytest.fixture
def unresolved(here):
    """Noise, which no grid resolves, and waves, which it does where enough nodes touch."""
    np.save("noise.npy", np.random.default_rng(1).normal(size=(32, 32)))
    np.save("waves.npy", 100 * random_waves(1, 4, 0.8, 1)(48))


@pytest.mark.parametrize(
    ("name", "pressures", "resolved"),
    [
        ("noise.npy", "50,500", ["no", "no"]),
        ("waves.npy", "0.001,0.002,500,2000", ["no", "no", "yes", "yes"]),
    ],
)
def test_the_area_of_the_grid_is_not_called_that_in_the_continuum(
    unresolved, run, make, name, pressures, resolved
):
    run(name, "--pressure", pressures, "--boundary", "periodic", "--csv", "law.csv")
    rows = pd.read_csv("law.csv")
    assert rows[rows.against == "pressure_MPa"].resolved.tolist() == resolved
    deltas = rows[rows.against == "delta_um"].resolved
    assert deltas.isna().tolist() == [True] + [False] * len(resolved), (
        "nothing touches at first"
    )
    order = {"e_star": 230e3, "boundary": "periodic", "reading": Reading(side="100")}
    law = make(name, pressure=pressures, grid_error=True, **order)
    curves = law.over_pressure
    panel = drawn_area(curves)
    known = np.array(resolved) == "yes"
    nodes, continuum = (
        curves.curves[each] for each in ("area_percent", CONTINUUM.in_laws)
    )
    drawn = np.where(known, continuum.value, nodes.value)
    np.testing.assert_array_equal(panel.curve.value, drawn)
    assert panel.curve.banded.tolist() == known.tolist()
    if known.any():
        assert panel.label == "area in the continuum [%]"
        np.testing.assert_array_equal(panel.of_nodes, ~known)
        assert law.band.startswith("the error of the grid")
    else:
        assert panel.label.startswith("area of the nodes in contact [%]")
        assert law.band == "none, one surface was solved"
    without = make(name, pressure=pressures, **order)
    assert drawn_area(without.over_pressure).label == "area of the nodes in contact [%]"
    assert without.over_pressure.resolved is None


def test_a_population_is_judged_on_its_first_surface(surfaces, run):
    for seed in range(3):
        np.save(f"many/s{seed}.npy", waves(20, seed))
    run("many", "--pressure", "0.01,100", "--csv", "law.csv", "--plot", "law.png")
    rows = pd.read_csv("law.csv")
    run("many/s0.npy", "--pressure", "0.01,100", "--csv", "one.csv")
    one = pd.read_csv("one.csv")
    both = [
        part[part.against == "pressure_MPa"].resolved.tolist() for part in (rows, one)
    ]
    assert both[0] == both[1]
    run("many", "--pressure", "0.01,100", "--csv", "law.csv", "--no-grid-error")
    assert "resolved" not in pd.read_csv("law.csv")
