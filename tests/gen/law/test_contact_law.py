"""Laws by the solver, on the command line: closure, conductance, populations, refusals."""

import re
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import user_functions
from strict import json_of

import bem
from bem.contact import mean_conductivity
from bem.derived.stiffness import patch_stiffness
from gen import cli
from gen.law import solver
from gen.law.bands import further_surface
from gen.maps.settings import Reading
from gen.material import Gas
from gen.surface import generate
from tests.bem.waves import random_waves

E_STAR = 210e3 / (1 - 0.3**2)
CONDUCTING = ["--conductivity", "50", "--conductivity", "20"]
GAS = ["--gas-conductivity", 0.026, "--jump-distance"]


def table(name, against="pressure_MPa"):
    rows = pd.read_csv(name)
    return rows[rows.against == against].reset_index(drop=True)


def contacts_of(name, boundary, **load):
    heights = np.load(name)
    return list(
        bem.ladder(heights, 100.0, modulus=210e3, poisson=0.3, boundary=boundary, **load)
    )


def test_a_law_is_that_of_a_piece_between_its_mirror_images(surfaces, run, capsys):
    """One command writes it in every format, with the command."""
    np.save("s0.npy", np.load("many/s0.npy") + np.linspace(0, 15, 20)[:, None])
    run("s0.npy", "--pressure", "0.001,10", "--json", "law.json")
    tilted = json_of("law.json")
    assert tilted["surfaces"] == ["s0.npy"]
    notes = tilted["notes"]
    assert any(note.startswith("warning: s0.npy: tilted by") for note in notes)
    assert any("fewer than 10 nodes touch" in note for note in notes)
    run("many/s0.npy", "--pressure", "1:100:5:log", *CONDUCTING, "-o", "law")
    wrote = [
        line.split()[1]
        for line in capsys.readouterr().out.splitlines()
        if "wrote" in line
    ]
    files = [
        "law.csv",
        "law.json",
        "law.h",
        "law-calculix.inp",
        "law-abaqus.inp",
        "law_4c.py",
    ]
    assert wrote == ["law.json", *files]
    command = json_of("law.json")["command"]
    assert re.match(r"python -m gen law many/s0.npy --pressure 1:100:5:log", command)
    found = table("law.csv")
    contacts = contacts_of("many/s0.npy", "mirror", pressures=np.geomspace(1, 100, 5))
    assert set(found.boundary) == {"mirror"}
    np.testing.assert_allclose(
        found.delta_um, [each.delta for each in contacts], rtol=1e-6
    )
    np.testing.assert_allclose(found.closure_um, found.delta_um)
    stiffness = [each.stiffness / 100**2 for each in contacts]
    np.testing.assert_allclose(found.stiffness_MPa_per_um, stiffness, rtol=1e-9)
    conductance = [1e-6 * each.conductance(50, 20) / (100e-3) ** 2 for each in contacts]
    np.testing.assert_allclose(found.conductance_W_per_mm2_K, conductance, rtol=1e-9)
    heights = np.load("many/s0.npy")
    rest = (
        heights.max() - heights.mean()
    )  # at no mean displacement the gap falls by the closure
    np.testing.assert_allclose(found.mean_gap_um + found.closure_um, rest, rtol=1e-6)


@pytest.mark.long
def test_the_law_of_two_rough_bodies_is_that_of_their_sum(surfaces, run, capsys):
    first, second = np.load("many/s0.npy"), np.load("many/s1.npy")
    loads = ["--pressure", "1,10"]
    run("many/s0.npy", *loads, "--against", "many/s1.npy", "--csv", "pair.csv")
    said = capsys.readouterr()
    assert "body 2 (many/s1.npy), turned over (its x runs backwards)" in said.err
    np.save("sum.npy", first + second[::-1])
    run("sum.npy", *loads, "--csv", "sum.csv")
    pair, one = table("pair.csv"), table("sum.csv")
    for name in ("closure_um", "area_percent", "mean_gap_um", "stiffness_MPa_per_um"):
        np.testing.assert_allclose(pair[name], one[name], rtol=1e-6)
    run(
        "many",
        *loads,
        "--against",
        "many/s1.npy",
        "--turned",
        "none",
        "--csv",
        "folder.csv",
    )
    capsys.readouterr()
    run(
        "many/s0.npy",
        *loads,
        "--against",
        "many",
        "-o",
        "each",
        "--plot",
        "each.png",
        "--no-check",
    )
    for text in (capsys.readouterr().out, Path("each.h").read_text()):
        assert "many/s0.npy against many" in text
    pairs = []
    for seed in range(3):
        run("many/s0.npy", *loads, "--against", f"many/s{seed}.npy", "--csv", "pair.csv")
        pairs.append(table("pair.csv").closure_um)
    np.testing.assert_allclose(
        table("each.csv").closure_um, np.mean(pairs, axis=0), rtol=1e-6
    )
    assert (
        cli.main(["law", "quick", *loads, "--against", "many/s1.npy", "--side", "100"])
        == 2
    )
    assert "surface.against" in capsys.readouterr().err


def test_the_closure_of_bodies_that_yield_is_delta_too(surfaces, run):
    run("many/s0.npy", "--pressure", "10,100", "--hardness", "1000", "--csv", "law.csv")
    found = table("law.csv")
    heights = np.load("many/s0.npy")
    contacts = contacts_of(
        "many/s0.npy", "mirror", pressures=[10.0, 100.0], hardness=1000.0
    )
    rest = heights.max() - heights.mean()
    for contact, closure in zip(contacts, found.closure_um, strict=True):
        assert contact.yielded_percent > 0
        elastic_gap = (contact.gap - contact.yielded_depth).mean()
        assert elastic_gap == pytest.approx(rest - closure, rel=1e-5)


def test_a_free_patch_leaves_its_own_compliance_to_the_mesh(surfaces, run):
    run("many/s0.npy", "--boundary", "free", "--pressure", "1:30:4", "--csv", "law.csv")
    found = table("law.csv")
    contacts = contacts_of("many/s0.npy", "free", pressures=np.linspace(1, 30, 4))
    patch = patch_stiffness(contacts[0].problem)
    alone = [each.delta - each.force / patch for each in contacts]
    np.testing.assert_allclose(found.closure_um, alone, rtol=1e-6)
    assert (found.closure_um < 0.99 * found.delta_um).all()
    nominal = (20 / 19 * 100) ** 2
    stiffness = [each.interface_stiffness / nominal for each in contacts]
    np.testing.assert_allclose(found.stiffness_MPa_per_um, stiffness, rtol=1e-8)
    # The slope of the pressure over the closure is that stiffness.
    run(
        "many/s0.npy",
        "--boundary",
        "free",
        "--pressure",
        "29.99,30,30.01",
        "--csv",
        "near.csv",
    )
    near = table("near.csv")
    slope = np.diff(near.pressure_MPa)[[0, -1]] / np.diff(near.closure_um)[[0, -1]]
    assert near.stiffness_MPa_per_um[1] == pytest.approx(slope.mean(), rel=1e-2)


def test_a_population_has_means_deviations_surfaces_and_the_band_of_a_further_one(
    surfaces, run, capsys
):
    run("many", "--pressure", "5,50", *CONDUCTING, "--band", "0.8", "-o", "law")
    said = " ".join(capsys.readouterr().out.split())
    assert (
        "band: 80 % of further surfaces lie inside, at each load by itself; 3 surfaces"
        in said
    )
    assert "quantiles" not in said
    found = table("law.csv")
    laws = [
        contacts_of(f"many/s{seed}.npy", "mirror", pressures=[5.0, 50.0])
        for seed in range(3)
    ]
    k = mean_conductivity(50, 20)
    document = json_of("law.json")
    assert document["surface_names"] == [f"many/s{seed}.npy" for seed in range(3)]
    for name, value in (
        ("closure_um", lambda contact: contact.delta),
        ("area_percent", lambda contact: contact.area_percent),
        (
            "conductance_W_per_mm2_K",
            lambda contact: k * contact.stiffness / 100**2 / E_STAR,
        ),
    ):
        whole = np.array([[value(contact) for contact in contacts] for contacts in laws])
        np.testing.assert_allclose(found[name], whole.mean(axis=0), rtol=1e-6)
        np.testing.assert_allclose(
            found[f"{name}_std"], whole.std(axis=0, ddof=1), rtol=1e-5
        )
        columns = [found[f"{name}_surface_{number}"] for number in (1, 2, 3)]
        np.testing.assert_allclose(columns, whole, rtol=1e-6)
        curve = document["tables"][1]["curves"][name]
        np.testing.assert_allclose(curve["by_surface"], whole, rtol=1e-6)
        np.testing.assert_allclose(curve["std"], found[f"{name}_std"])
        band = further_surface(whole, 0.8, percent=name == "area_percent")
        np.testing.assert_allclose(found[f"{name}_low"], band.low, rtol=1e-5)
        np.testing.assert_allclose(found[f"{name}_high"], band.high, rtol=1e-5)


def test_a_band_of_few_surfaces_says_what_it_assumes(surfaces, run, capsys):
    """In print, JSON and the heads of all files; one of many enough assumes nothing."""
    words = "assumes that the logarithms of each quantity, and of areas the logits, are normal"
    run("many", "--pressure", "5,50", "-o", "law")
    assert words in capsys.readouterr().out
    for name in (
        "law.json",
        "law.h",
        "law-abaqus.inp",
        "law-calculix-soft.inp",
        "law_4c.py",
    ):
        text = Path(name).read_text(encoding="utf-8")
        assert words in re.sub(r"\s*(\*\*|#|\*)?\s+", " ", text), name
    run("many", "--pressure", "5,50", "--band", "0.5", "-o", "law")
    assert (
        words not in capsys.readouterr().out + Path("law-calculix-soft.inp").read_text()
    )


def test_one_surface_has_neither_deviation_nor_columns_of_surfaces(surfaces, run):
    run("many/s0.npy", "--pressure", "5,50", "--csv", "law.csv", "--json", "law.json")
    names = Path("law.csv").read_text().splitlines()[0].split(",")
    assert not [name for name in names if name.endswith("_std") or "_surface_" in name]
    assert {*json_of("law.json")["tables"][1]["curves"]["closure_um"]} == {
        "value",
        "low",
        "high",
        "slope",
    }


SCENE = """
samples = 6
samples_per_surface = 2
[surface]
nodes = 17
[contact]
modulus = 100.0
hardness = 5.0
"""


def test_a_scene_is_solved_without_edges_unless_told_otherwise(surfaces, capsys):
    Path("scene.toml").write_text(SCENE)
    ask = ["law", "scene.toml", "--surfaces", "2", "--pressure", "0.1,1", "--csv"]
    assert cli.main([*ask, "mirror.csv"]) == 0
    assert "E* = 100 MPa, hardness = 5 MPa" in capsys.readouterr().out
    assert cli.main([*ask, "free.csv", "--boundary", "free"]) == 0
    assert set(table("mirror.csv").boundary) == {"mirror"}
    assert "boundary" not in table("free.csv")
    assert (table("free.csv").closure_um < table("free.csv").delta_um).all()
    wide = ["--delta", "5:45:40", "--csv", "all.csv"]
    assert cli.main(["law", "scene.toml", "--surfaces", "2", *wide]) == 0
    deltas = table("all.csv", "delta_um").delta_um[1:]
    assert len(deltas) == 10, "at the others of 40 every node touches"
    np.testing.assert_allclose(deltas, np.linspace(5, 45, 40)[:10])
    assert table("all.csv").pressure_MPa.max() < 5
    capsys.readouterr()
    assert cli.main(["law", "scene.toml"]) == 2
    assert "give --delta or --pressure" in capsys.readouterr().err


def test_a_long_law_shows_progress(surfaces, run, monkeypatch, capsys):
    run("many/s0.npy", "--pressure", "1,10")
    assert "contacts (" not in capsys.readouterr().err
    monkeypatch.setattr(solver, "LONG", 6 * 20**2)
    run("many", "--pressure", "1,10")
    told = capsys.readouterr().err
    for name in ("pressure", "Delta"):  # the table asked for, and the other one
        assert told.count(f"6 of 6 contacts over {name} (100.0 %)") == 1


@pytest.mark.parametrize("boundary", ["periodic", "mirror"])
@pytest.mark.parametrize("surface", ["diamond-square", "midpoint", "spectral", "python"])
def test_a_scene_has_the_patch_of_the_boundary_asked_for(
    here, monkeypatch, surface, boundary
):
    """A scene of free patches is then the one that names that boundary itself."""
    waves = (
        "roll_off = 500.0\ncut_off = 200.0\nrms_height = 5.0\n"
        if surface == "spectral"
        else ""
    )
    table = f'[surface]\ngenerator = "{surface}"\nnodes = 17\n{waves}'
    table = user_functions.SURFACE if surface == "python" else table
    for name, contact in (("free", ""), ("own", f'[contact]\nboundary = "{boundary}"\n')):
        ask = [
            "law",
            "mine.toml",
            "--surfaces",
            "2",
            "--pressure",
            "0.001,0.01",
            "--trust",
        ]
        with user_functions.inside(here, monkeypatch, f"samples = 4\n{table}{contact}"):
            assert cli.main([*ask, "--boundary", boundary, "--csv", f"{name}.csv"]) == 0
    free, own = (pd.read_csv(f"{name}.csv", dtype=str) for name in ("free", "own"))
    pd.testing.assert_frame_equal(free.drop(columns="sha256"), own.drop(columns="sha256"))


def test_a_law_replaces_no_file_that_its_scene_names(surfaces, monkeypatch, capsys):
    np.savetxt("many/m.txt", np.load("many/s0.npy"))
    scans = '[surface]\ngenerator = "scans"\nfiles = "many"\nnodes = 8\nreading.side = "100"\n'
    scans += '[load]\nquantity = "pressure"\nrange = [0.01, 0.1]\n'
    for table, target in ((scans, "many/m.txt"), (user_functions.SURFACE, "mine.py")):
        with user_functions.inside(surfaces, monkeypatch, f"samples = 2\n{table}"):
            assert cli.main(["run", "mine.toml", "-o", f"{target}.h5"]) == 0
            for scene in ("mine.toml", f"{target}.h5"):
                ask = ["law", scene, "--pressure", "0.1", "--surfaces", "2", "--trust"]
                assert cli.main([*ask, "--json", target]) == 2
                assert f"{target}: is an input: not replaced" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["many/s0.npy", "many"])
def test_loads_that_are_not_solved_are_named_and_cost_no_others(
    surfaces, run, capsys, monkeypatch, name
):
    """Of one surface and of a population; the other numbers are those of these loads alone."""
    with monkeypatch.context() as few:
        few.setattr(solver, "solve_loads", partial(solver.solve_loads, max_iterations=3))
        run(name, "--pressure", "1:3000:9:log", "--csv", "few.csv")
        lines = [
            line for line in capsys.readouterr().out.splitlines() if "not solved" in line
        ]
        few.setattr(solver, "solve_loads", partial(solver.solve_loads, max_iterations=1))
        run(name, "--pressure", "500:600:3", ends=2)
        assert re.search(r"s0.npy: 600 MPa: residual .* after", capsys.readouterr().err)
    one = table("few.csv")
    lost = [
        p for p in np.geomspace(1, 3000, 9) if not np.isclose(p, one.pressure_MPa).any()
    ]
    assert 0 < len(lost) < 9
    for each in lost:
        assert any(f"{each:.6g} MPa: residual" in line for line in lines)
    assert all(
        line.startswith("warning: not solved") and "left out" in line for line in lines
    )
    run(name, "--pressure", ",".join(map(str, one.pressure_MPa)), "--csv", "alone.csv")
    for column in ("closure_um", "area_percent"):
        np.testing.assert_allclose(one[column], table("alone.csv")[column], rtol=1e-4)


@pytest.mark.parametrize(
    "hardness", [[], ["--hardness", "20e3"]], ids=["elastic", "yielding"]
)
@pytest.mark.parametrize("ratio", [15, 60])
@pytest.mark.parametrize("files", [["-o", "law"], ["--calculix", "law-calculix.inp"]])
def test_a_table_that_was_not_asked_for_costs_none_that_was(
    here, run, capsys, ratio, hardness, files
):
    """Surfaces so unlike that one is pressed flat where the other one just touches."""
    Path("pair").mkdir()
    for seed, (name, height) in enumerate({"fine": 0.05, "rough": 0.05 * ratio}.items()):
        heights = generate("diamond-square", 33, 0.8, height, np.random.default_rng(seed))
        np.save(f"pair/{name}.npy", heights)
    run("pair", "--pressure", "20:300:6:log", *hardness, *files, "--csv", "law.csv")
    assert "full contact from" in capsys.readouterr().out
    pressures, deltas = table("law.csv"), table("law.csv", "delta_um")
    np.testing.assert_allclose(pressures.pressure_MPa, np.geomspace(20, 300, 6))
    assert len(deltas) > 1, "it is shortened, not empty"
    assert (deltas.area_percent < 100).all()
    assert Path("law-calculix.inp").exists()
    for seed in ("fine", "rough"):
        run(
            f"pair/{seed}.npy",
            "--pressure",
            "20:300:6:log",
            *hardness,
            "--csv",
            f"{seed}.csv",
        )
    alone = [table(f"{name}.csv").closure_um for name in ("fine", "rough")]
    np.testing.assert_allclose(pressures.closure_um, np.mean(alone, axis=0), rtol=1e-5)


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["none.npy", "--pressure", "1"], "none.npy: is neither a file nor a folder"),
        (["many/s0.npy", "--delta", "1,1e39"], "give numbers from 1e-38 to 1e+38 um"),
        (
            ["many/s0.npy", "--pressure", "1e7"],
            "full contact from 1e+07 MPa on: no law is left",
        ),
        (["many/s0.npy", "--pressure", "1", "--band", "1"], "--band 1: give a share"),
        (["many/s0.npy", "--pressure", "1", "--calculix", "."], ".: is a folder"),
        (
            ["many/s0.npy", "--pressure", "1", "--jump-distance", 1],
            "--gas-conductivity is missing",
        ),
        (
            ["many/s0.npy", "--pressure", "1", *GAS, 0],
            "must be between 1e-38 and 1e+38 um",
        ),
        (["many/s0.npy", "--pressure", "1", "--conductivity", "1e308"], "1e+38 W/(m K)"),
        (
            ["many", "--delta", "1e4", "--hardness", "1"],
            "every node yields: the pressure is the",
        ),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(surfaces, run, capsys, arguments, word):
    before = Path("many/s0.npy").read_bytes()
    run(*arguments, ends=2)
    assert word in capsys.readouterr().err.splitlines()[-1]
    assert Path("many/s0.npy").read_bytes() == before
    assert not Path("law.csv").exists()


def test_a_flat_surface_has_no_law(surfaces, capsys):
    np.save("flat.npy", np.zeros((9, 9)))
    assert (
        cli.main(["law", "flat.npy", "--side", "9", "--pressure", "1:10:3", "-o", "flat"])
        == 2
    )
    assert "flat.npy: is flat" in capsys.readouterr().err
    assert [path.name for path in Path().glob("flat*")] == ["flat.npy"]


def test_the_area_in_the_continuum_has_the_error_of_the_grid(
    run, tmp_path, monkeypatch, capsys
):
    """And the loads are named whose area is that of the grid."""
    monkeypatch.chdir(tmp_path)
    np.save("waves.npy", 100 * random_waves(1, 4, 0.8, 1)(48))
    loads = ["--pressure", "50,500,2000", "--boundary", "periodic"]
    run("waves.npy", *loads, "--csv", "law.csv", "--json", "law.json")
    found = table("law.csv")
    contacts = contacts_of("waves.npy", "periodic", pressures=[50, 500, 2000])
    for row, contact in zip(found.itertuples(), contacts, strict=True):
        error = contact.grid_error()
        area = contact.continuum_area_percent
        assert row.continuum_area_percent == pytest.approx(area, rel=1e-6)
        assert row.continuum_area_percent_high - area == pytest.approx(
            error.area_percent, rel=0.01
        )
        assert row.continuum_area_percent_low < area
    assert "continuum_area_percent" in json_of("law.json")["tables"][1]["curves"]
    run("waves.npy", *loads, "--csv", "law.csv", "--no-grid-error")
    assert not [name for name in table("law.csv").columns if "continuum" in name]
    capsys.readouterr()
    run("waves.npy", "--pressure", "0.001,0.002,500,2000", "--csv", "law.csv")
    (note,) = (
        line for line in capsys.readouterr().out.splitlines() if "of the grid at" in line
    )
    known = table("law.csv").continuum_area_percent_high.notna().tolist()
    assert known == [False, False, True, True]
    assert note.startswith(
        "waves.npy: the area is that of the grid at 2 of 4 loads, up to 0.002 M"
    )


def test_a_gas_in_the_gap_is_a_part_of_the_conductance(surfaces, run, make):
    """It conducts before first touch, and finite elements get what spots and gas conduct."""
    k, jump = 0.026, 0.37
    plates = Gas(k, jump)
    assert plates.conductance(np.full((4, 4), 2.0)) == k / (2.0 + jump), "parallel plates"
    assert plates.conductance(np.array([[0.0, 2.0]])) == k / (2.0 + jump) / 2
    asked = ["--gas-conductivity", k, "--jump-distance", jump]
    loads = ["--pressure", "1:1000:5:log"]
    run("many/s0.npy", *loads, *CONDUCTING, "--csv", "spots.csv")
    run(
        "many/s0.npy",
        *loads,
        *CONDUCTING,
        *asked,
        "-o",
        "law",
        "--plot",
        "law.png",
        "--no-check",
    )
    run("many/s0.npy", *loads, *asked, "--csv", "gas.csv", "--abaqus", "gas.inp")
    found, alone, spots = table("law.csv"), table("gas.csv"), table("spots.csv")
    contacts = contacts_of("many/s0.npy", "mirror", pressures=np.geomspace(1, 1000, 5))
    open_gaps = [np.where(each.pressure > 0, 0.0, each.gap) for each in contacts]
    gas = [(k / (each + jump) * (each > 0)).mean() for each in open_gaps]
    for each in (found, alone):
        np.testing.assert_allclose(each.gas_conductance_W_per_mm2_K, gas, rtol=1e-9)
    same = found[spots.columns.intersection(found.columns)]
    pd.testing.assert_frame_equal(same, spots[same.columns])
    whole = found.conductance_W_per_mm2_K + found.gas_conductance_W_per_mm2_K
    np.testing.assert_allclose(found.joint_conductance_W_per_mm2_K, whole, rtol=1e-12)
    assert "joint_conductance_W_per_mm2_K" not in alone
    heights = np.load("many/s0.npy")
    rest = plates.conductance(heights.max() - heights)
    for path, conductances in (("law-abaqus.inp", whole), ("gas.inp", gas)):
        text = Path(path).read_text()
        assert (
            f"Gas in the gap: conductivity {k:g} W/(m K), jump distance {jump:g} um"
            in text
        )
        numbers = np.fromstring(
            text.partition("PRESSURE\n")[2].replace("\n", ","), sep=","
        )
        rows = dict(zip(numbers[1::2], numbers[::2] / 1e3, strict=True))
        at = [0.0, *(float(f"{load:.10g}") for load in found.pressure_MPa)]
        known = [rows[load] for load in at]
        np.testing.assert_allclose(known, [rest, *conductances], rtol=1e-9)
    assert json_of("law.json")["gas_jump_distance_um"] == jump
    assert "asperity_law_joint_conductance_at_pressure(" in Path("law.h").read_text()
    order = {"e_star": E_STAR, "gas": plates, "reading": Reading(side="100")}
    many = make("many", pressure="1,10", conductivities=(50.0, 20.0), **order)
    assert all(
        curves.curves["joint_conductance_W_per_mm2_K"].banded[1:].all()
        for curves in (many.over_delta, many.over_pressure)
    )


def test_hydraulic_apertures_fall_from_first_touch_to_none(surfaces, run, make):
    run(
        "many/s0.npy",
        "--pressure",
        "1:4000:5:log",
        *CONDUCTING,
        "--flow",
        "-o",
        "law",
        "--no-check",
    )
    found = table("law.csv")
    contacts = contacts_of("many/s0.npy", "mirror", pressures=np.geomspace(1, 4000, 5))
    for axis, name in enumerate(("hydraulic_aperture_x_um", "hydraulic_aperture_y_um")):
        expected = [each.flow(axis).aperture for each in contacts]
        np.testing.assert_allclose(found[name], expected, rtol=1e-6)
        assert (np.diff(found[name]) <= 0).all()
        assert found[name].iloc[-1] == 0
        assert f"asperity_law_{name[:-3]}_at_pressure(" in Path("law.h").read_text()
        assert table("law.csv", "delta_um")[name].iloc[0] > found[name].iloc[0]
    many = make(
        "many", pressure="1,10", e_star=E_STAR, reading=Reading(side="100"), flow=True
    )
    assert many.over_delta.curves["hydraulic_aperture_x_um"].banded.all()


def test_further_quantities_are_in_a_law_where_they_are_asked_for(surfaces, run):
    """In the table and the C header; without the option the files are the same but for that."""
    loads = ["many/s0.npy", "--pressure", "1,10,100"]
    run(*loads, "-o", "plain")
    run(
        *loads,
        "--also",
        "largest_spot_area,perimeter",
        "--also",
        "yielded_percent",
        "--hardness",
        "2000",
        "-o",
        "further",
    )
    run(*loads, "--hardness", "2000", "-o", "bare")
    rows, bare = table("further.csv"), table("bare.csv")
    further = ["largest_spot_um2", "perimeter_um", "yielded_percent"]
    assert [name for name in rows if name in further] == [
        "yielded_percent",
        *further[1::-1],
    ]
    pd.testing.assert_frame_equal(rows[list(bare)], bare)
    contacts = contacts_of("many/s0.npy", "mirror", pressures=[1, 10, 100], hardness=2000)
    areas = [contact.spots.areas[0] for contact in contacts]
    np.testing.assert_allclose(rows.largest_spot_um2, areas, rtol=1e-6)
    edges = [contact.perimeter for contact in contacts]
    np.testing.assert_allclose(rows.perimeter_um, edges, rtol=1e-6)
    header = Path("further.h").read_text()
    assert "further_largest_spot_at_pressure(double pressure)" in header
    assert "largest_spot: area of the largest spot of contact [um2]" in header
    assert not {*further} & {*table("plain.csv")}


def test_elastic_bodies_have_no_quantity_of_those_that_yield(surfaces, run, capsys):
    run("many/s0.npy", "--pressure", "1,10", "--also", "yielded_percent", ends=2)
    assert "--also yielded_percent: elastic bodies have none" in capsys.readouterr().err
