"""Laws by the solver, on the command line: closure, conductance, populations, refusals."""

import re
from functools import partial
from itertools import product
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
CONDUCTIVITY = mean_conductivity(50, 20)
GAS = ["--gas-conductivity", 0.026, "--jump-distance"]
PLATES = Gas(0.026, 0.37)
OPTIONS_OF_GAS = ["--gas-conductivity", 0.026, "--jump-distance", 0.37]


def table(name, against="pressure_MPa"):
    rows = pd.read_csv(name)
    return rows[rows.against == against].reset_index(drop=True)


def contacts_of(name, boundary, **load):
    heights = np.load(name)
    return list(
        bem.ladder(heights, 100.0, modulus=210e3, poisson=0.3, boundary=boundary, **load)
    )


@pytest.fixture(scope="module")
def law(write):
    """The law of one surface by one command, in all formats."""
    return write(["many/s0.npy", "--pressure", "1:100:5:log", *CONDUCTING, "-o", "law"])


@pytest.fixture(scope="module")
def contacts(law):
    """The contacts of that surface between its mirror images."""
    pressures = np.geomspace(1, 100, 5)
    return contacts_of(law.folder / "many/s0.npy", "mirror", pressures=pressures)


def test_one_command_writes_a_law_in_every_format(law):
    lines = [line for line in law.printed.splitlines() if "wrote" in line]
    assert [line.split()[1] for line in lines] == [
        "law.csv",
        "law.json",
        "law.h",
        "law-calculix.inp",
        "law-abaqus.inp",
        "law_4c.py",
    ]


def test_a_law_has_the_command_that_made_it(law):
    command = law.document("law.json")["command"]
    assert re.match(r"python -m gen law many/s0.npy --pressure 1:100:5:log", command)


def test_a_law_is_that_of_a_piece_between_its_mirror_images(law, contacts):
    rows = law.table("law.csv")
    assert set(rows.boundary) == {"mirror"}
    deltas = [contact.delta for contact in contacts]
    np.testing.assert_allclose(rows.delta_um, deltas, rtol=1e-6)


def test_the_closure_of_a_patch_without_edges_is_delta(law):
    rows = law.table("law.csv")
    np.testing.assert_allclose(rows.closure_um, rows.delta_um)


def test_the_stiffness_is_that_of_the_contact_per_area(law, contacts):
    stiffness = [contact.stiffness / 100**2 for contact in contacts]
    rows = law.table("law.csv")
    np.testing.assert_allclose(rows.stiffness_MPa_per_um, stiffness, rtol=1e-9)


def test_the_conductance_is_that_of_the_contact_per_area(law, contacts):
    conductance = [
        1e-6 * contact.conductance(50, 20) / (100e-3) ** 2 for contact in contacts
    ]
    rows = law.table("law.csv")
    np.testing.assert_allclose(rows.conductance_W_per_mm2_K, conductance, rtol=1e-9)


def test_the_mean_gap_falls_by_the_closure_at_no_mean_displacement(law):
    heights = law.heights("many/s0.npy")
    rows = law.table("law.csv")
    at_rest = heights.max() - heights.mean()
    np.testing.assert_allclose(rows.mean_gap_um + rows.closure_um, at_rest, rtol=1e-6)


@pytest.fixture(scope="module")
def tilted(write):
    """The document of a law of a tilted map, at a pressure under which few nodes touch too."""

    def prepare():
        np.save("s0.npy", np.load("many/s0.npy") + np.linspace(0, 15, 20)[:, None])

    command = ["s0.npy", "--pressure", "0.001,10", "--json", "law.json"]
    return write(command, prepare=prepare).document("law.json")


def test_a_law_names_its_surface_by_its_file(tilted):
    assert tilted["surfaces"] == ["s0.npy"]


def test_notes_of_a_law_have_the_warnings_about_its_map(tilted):
    notes = tilted["notes"]
    assert any(note.startswith("warning: s0.npy: tilted by") for note in notes)


def test_notes_of_a_law_say_where_the_grid_decides(tilted):
    assert any("fewer than 10 nodes touch" in note for note in tilted["notes"])


LOADS = ["--pressure", "1,10"]


@pytest.fixture(scope="module")
def pairs(write):
    """Laws of two rough bodies: of two maps, of their sum, of a map against a folder."""

    def prepare():
        first, second = np.load("many/s0.npy"), np.load("many/s1.npy")
        np.save("sum.npy", first + second[::-1])

    commands = [
        [
            "many/s0.npy",
            *LOADS,
            "--against",
            f"many/s{seed}.npy",
            "--csv",
            f"pair{seed}.csv",
        ]
        for seed in range(3)
    ]
    folder = ["many/s0.npy", *LOADS, "--against", "many", "-o", "each", "--no-check"]
    return write(
        *commands,
        ["sum.npy", *LOADS, "--csv", "sum.csv"],
        [*folder, "--plot", "each.png"],
        prepare=prepare,
    )


def test_the_second_body_is_turned_over(pairs):
    assert "body 2 (many/s1.npy), turned over (its x runs backwards)" in pairs.warned


@pytest.mark.parametrize(
    "name", ["closure_um", "area_percent", "mean_gap_um", "stiffness_MPa_per_um"]
)
def test_the_law_of_two_rough_bodies_is_that_of_their_sum(pairs, name):
    pair = pairs.table("pair1.csv")
    np.testing.assert_allclose(pair[name], pairs.table("sum.csv")[name], rtol=1e-6)


def test_a_map_against_a_folder_is_a_population_of_pairs(pairs):
    closures = [pairs.table(f"pair{seed}.csv").closure_um for seed in range(3)]
    means = np.mean(closures, axis=0)
    np.testing.assert_allclose(pairs.table("each.csv").closure_um, means, rtol=1e-6)


def test_a_law_of_two_bodies_names_both(pairs):
    for text in (pairs.printed, pairs.text("each.h")):
        assert "many/s0.npy against many" in text


def test_every_map_of_a_folder_is_pressed_against_the_second_body(surfaces, run):
    against = ["--against", "many/s1.npy", "--turned", "none"]
    run("many", *LOADS, *against, "--json", "law.json")
    document = json_of("law.json")
    assert document["surfaces"] == ["many against many/s1.npy"]
    assert len(document["surface_names"]) == 3


def test_a_scene_names_the_second_body_itself(surfaces, capsys):
    command = ["law", "quick", *LOADS, "--against", "many/s1.npy"]
    assert cli.main(command) == 2
    assert "surface.against" in capsys.readouterr().err


def test_a_colon_in_the_name_of_a_file_makes_it_no_scene(surfaces, make):
    """Descriptions of scenes are notes of a law; those of files are not."""
    Path("many/s0.npy").rename("steel: s0.npy")
    law = make("steel: s0.npy", pressure="0.01", reading=Reading(side="100"))
    assert law.descriptions == ("steel: s0.npy",)
    assert not [note for note in law.notes if note.startswith("steel")]


def test_the_closure_of_bodies_that_yield_is_delta_too(surfaces, run):
    run("many/s0.npy", "--pressure", "10,100", "--hardness", "1000", "--csv", "law.csv")
    closures = table("law.csv").closure_um
    heights = np.load("many/s0.npy")
    contacts = contacts_of(
        "many/s0.npy", "mirror", pressures=[10.0, 100.0], hardness=1000.0
    )
    at_rest = heights.max() - heights.mean()
    for contact, closure in zip(contacts, closures, strict=True):
        assert contact.yielded_percent > 0
        elastic_gap = (contact.gap - contact.yielded_depth).mean()
        assert elastic_gap == pytest.approx(at_rest - closure, rel=1e-5)


@pytest.fixture(scope="module")
def free(write):
    """Laws of a free patch, at pressures apart and at neighbouring ones."""
    command = ["many/s0.npy", "--boundary", "free", "--pressure"]
    return write(
        [*command, "1:30:4", "--csv", "law.csv"],
        [*command, "29.99,30,30.01", "--csv", "near.csv"],
    )


@pytest.fixture(scope="module")
def free_contacts(free):
    """The contacts of that patch."""
    pressures = np.linspace(1, 30, 4)
    return contacts_of(free.folder / "many/s0.npy", "free", pressures=pressures)


def test_a_free_patch_leaves_its_own_compliance_to_the_mesh(free, free_contacts):
    rows = free.table("law.csv")
    patch = patch_stiffness(free_contacts[0].problem)
    alone = [contact.delta - contact.force / patch for contact in free_contacts]
    np.testing.assert_allclose(rows.closure_um, alone, rtol=1e-6)
    assert (rows.closure_um < 0.99 * rows.delta_um).all()


def test_the_stiffness_of_a_free_patch_is_that_of_the_interface(free, free_contacts):
    nominal = (20 / 19 * 100) ** 2
    stiffness = [contact.interface_stiffness / nominal for contact in free_contacts]
    rows = free.table("law.csv")
    np.testing.assert_allclose(rows.stiffness_MPa_per_um, stiffness, rtol=1e-8)


def test_the_stiffness_is_the_slope_of_the_pressure_over_the_closure(free):
    near = free.table("near.csv")
    slope = np.diff(near.pressure_MPa)[[0, -1]] / np.diff(near.closure_um)[[0, -1]]
    assert near.stiffness_MPa_per_um[1] == pytest.approx(slope.mean(), rel=1e-2)


@pytest.fixture(scope="module")
def population(write):
    """The law of three surfaces."""
    return write(
        ["many", "--pressure", "5,50", *CONDUCTING, "--band", "0.8", "-o", "law"]
    )


QUANTITIES = {
    "closure_um": lambda contact: contact.delta,
    "area_percent": lambda contact: contact.area_percent,
    "conductance_W_per_mm2_K": lambda contact: (
        CONDUCTIVITY * contact.stiffness / 100**2 / E_STAR
    ),
}


@pytest.fixture(scope="module")
def of_surfaces(population):
    """The same quantities of each surface by itself, (surfaces, loads)."""
    laws = [
        contacts_of(
            population.folder / f"many/s{seed}.npy", "mirror", pressures=[5.0, 50.0]
        )
        for seed in range(3)
    ]
    return {
        name: np.array([[read(contact) for contact in contacts] for contacts in laws])
        for name, read in QUANTITIES.items()
    }


@pytest.mark.parametrize("name", QUANTITIES)
def test_a_population_has_means_over_its_surfaces(population, of_surfaces, name):
    means = of_surfaces[name].mean(axis=0)
    np.testing.assert_allclose(population.table("law.csv")[name], means, rtol=1e-6)


@pytest.mark.parametrize("name", QUANTITIES)
def test_a_population_has_standard_deviations(population, of_surfaces, name):
    deviations = of_surfaces[name].std(axis=0, ddof=1)
    rows = population.table("law.csv")
    np.testing.assert_allclose(rows[f"{name}_std"], deviations, rtol=1e-5)
    curve = population.document("law.json")["tables"][1]["curves"][name]
    np.testing.assert_allclose(curve["std"], rows[f"{name}_std"])


@pytest.mark.parametrize("name", QUANTITIES)
def test_a_population_has_each_of_its_surfaces(population, of_surfaces, name):
    rows = population.table("law.csv")
    columns = [rows[f"{name}_surface_{number}"] for number in (1, 2, 3)]
    np.testing.assert_allclose(columns, of_surfaces[name], rtol=1e-6)
    curve = population.document("law.json")["tables"][1]["curves"][name]
    np.testing.assert_allclose(curve["by_surface"], of_surfaces[name], rtol=1e-6)


@pytest.mark.parametrize("name", QUANTITIES)
def test_a_population_has_the_band_of_a_further_surface(population, of_surfaces, name):
    band = further_surface(of_surfaces[name], 0.8, percent=name == "area_percent")
    rows = population.table("law.csv")
    np.testing.assert_allclose(rows[f"{name}_low"], band.low, rtol=1e-5)
    np.testing.assert_allclose(rows[f"{name}_high"], band.high, rtol=1e-5)


def test_a_population_says_what_its_band_is(population):
    words = (
        "band: 80 % of further surfaces lie inside, at each load by itself; 3 surfaces"
    )
    printed = " ".join(population.printed.split())
    assert words in printed
    assert "quantiles" not in printed


def test_a_population_names_its_surfaces(population):
    names = population.document("law.json")["surface_names"]
    assert names == [f"many/s{seed}.npy" for seed in range(3)]


ASSUMES = (
    "assumes that the logarithms of each quantity, and of areas the logits, are normal"
)


def test_a_band_of_few_surfaces_says_what_it_assumes(surfaces, run, capsys):
    """In print, in JSON and in the heads of all files."""
    run("many", "--pressure", "5,50", "-o", "law")
    assert ASSUMES in capsys.readouterr().out
    for name in (
        "law.json",
        "law.h",
        "law-abaqus.inp",
        "law-calculix-soft.inp",
        "law_4c.py",
    ):
        text = Path(name).read_text(encoding="utf-8")
        assert ASSUMES in re.sub(r"\s*(\*\*|#|\*)?\s+", " ", text), name


def test_a_band_of_enough_surfaces_assumes_nothing(surfaces, run, capsys):
    run("many", "--pressure", "5,50", "--band", "0.5", "-o", "law", "--no-check")
    texts = capsys.readouterr().out + Path("law-calculix-soft.inp").read_text()
    assert ASSUMES not in texts


@pytest.fixture(scope="module")
def single(write):
    """The law of one surface, as CSV and as JSON."""
    loads = ["--pressure", "5,50"]
    return write(["many/s0.npy", *loads, "--csv", "law.csv", "--json", "law.json"])


def test_one_surface_has_neither_deviation_nor_columns_of_surfaces(single):
    names = single.text("law.csv").splitlines()[0].split(",")
    assert not [name for name in names if name.endswith("_std") or "_surface_" in name]


def test_a_curve_of_one_surface_has_no_deviation_in_json(single):
    curves = single.document("law.json")["tables"][1]["curves"]
    assert {*curves["closure_um"]} == {"value", "low", "high", "slope"}


SCENE = """
samples = 6
samples_per_surface = 2
[surface]
nodes = 17
[contact]
modulus = 100.0
hardness = 5.0
"""


@pytest.fixture
def scene(surfaces):
    """A scene in the working directory."""
    Path("scene.toml").write_text(SCENE)
    return ["law", "scene.toml", "--surfaces", "2"]


def test_a_scene_is_solved_without_edges(scene):
    assert cli.main([*scene, "--pressure", "0.1,1", "--csv", "law.csv"]) == 0
    assert set(table("law.csv").boundary) == {"mirror"}


def test_a_scene_gives_the_material_of_its_law(scene, capsys):
    assert cli.main([*scene, "--pressure", "0.1,1"]) == 0
    assert "E* = 100 MPa, hardness = 5 MPa" in capsys.readouterr().out


def test_a_scene_is_solved_with_free_patches_if_told_so(scene):
    loads = ["--pressure", "0.1,1", "--boundary", "free"]
    assert cli.main([*scene, *loads, "--csv", "free.csv"]) == 0
    rows = table("free.csv")
    assert "boundary" not in rows
    assert (rows.closure_um < rows.delta_um).all()


def test_a_table_against_delta_ends_where_every_node_touches(scene):
    assert cli.main([*scene, "--delta", "5:45:40", "--csv", "all.csv"]) == 0
    deltas = table("all.csv", "delta_um").delta_um[1:]
    assert len(deltas) == 10, "at the others of 40 every node touches"
    np.testing.assert_allclose(deltas, np.linspace(5, 45, 40)[:10])
    assert table("all.csv").pressure_MPa.max() < 5


def test_a_law_by_the_solver_needs_loads(scene, capsys):
    assert cli.main(scene) == 2
    assert "give --delta or --pressure" in capsys.readouterr().err


def test_a_short_law_shows_no_progress(surfaces, run, capsys):
    run("many/s0.npy", "--pressure", "1,10")
    assert "contacts (" not in capsys.readouterr().err


def test_a_long_law_shows_progress(surfaces, run, monkeypatch, capsys):
    monkeypatch.setattr(solver, "LONG", 6 * 20**2)
    run("many", "--pressure", "1,10")
    lines = capsys.readouterr().err
    for name in ("pressure", "Delta"):  # the table asked for, and the other one
        assert lines.count(f"6 of 6 contacts over {name} (100.0 %)") == 1


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
    if surface == "python":
        table = user_functions.SURFACE
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


SCANS = """
samples = 2
[surface]
generator = "scans"
files = "many"
nodes = 8
reading.side = "100"
[load]
quantity = "pressure"
range = [0.01, 0.1]
"""


@pytest.mark.parametrize(
    ("scene", "target"),
    [(SCANS, "many/m.txt"), (f"samples = 2\n{user_functions.SURFACE}", "mine.py")],
    ids=["maps", "module"],
)
def test_a_law_replaces_no_file_that_its_scene_names(
    surfaces, monkeypatch, capsys, scene, target
):
    """Of a scene, and of a database that was made of it."""
    np.savetxt("many/m.txt", np.load("many/s0.npy"))
    with user_functions.inside(surfaces, monkeypatch, scene):
        assert cli.main(["run", "mine.toml", "-o", f"{target}.h5"]) == 0
        for source in ("mine.toml", f"{target}.h5"):
            command = ["law", source, "--pressure", "0.1", "--surfaces", "2", "--trust"]
            assert cli.main([*command, "--json", target]) == 2
            assert f"{target}: is an input: not replaced" in capsys.readouterr().err


PRESSURES = np.geomspace(1, 3000, 9)


@pytest.fixture(scope="module", params=["many/s0.npy", "many"])
def few(request, write):
    """The law of a surface, or of a population, by a solver that gives up early."""
    impatient = partial(solver.solve_loads, max_iterations=3)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(solver, "solve_loads", impatient)
        law = write([request.param, "--pressure", "1:3000:9:log", "--csv", "few.csv"])
    return request.param, law


def test_loads_that_are_not_solved_are_named(few):
    _, law = few
    lines = [line for line in law.printed.splitlines() if "not solved" in line]
    solved = law.table("few.csv").pressure_MPa
    lost = [load for load in PRESSURES if not np.isclose(load, solved).any()]
    assert 0 < len(lost) < 9
    for load in lost:
        assert any(f"{load:.6g} MPa: residual" in line for line in lines)
    for line in lines:
        assert line.startswith("warning: not solved")
        assert "left out" in line


@pytest.mark.parametrize("column", ["closure_um", "area_percent"])
def test_loads_that_are_not_solved_cost_no_others(few, write, column):
    """The other numbers are those of a law at these loads alone."""
    name, law = few
    rows = law.table("few.csv")
    loads = ",".join(map(str, rows.pressure_MPa))
    alone = write([name, "--pressure", loads, "--csv", "alone.csv"]).table("alone.csv")
    np.testing.assert_allclose(rows[column], alone[column], rtol=1e-4)


@pytest.mark.parametrize("name", ["many/s0.npy", "many"])
def test_a_law_of_which_no_load_is_solved_is_refused(
    surfaces, run, capsys, monkeypatch, name
):
    hasty = partial(solver.solve_loads, max_iterations=1)
    monkeypatch.setattr(solver, "solve_loads", hasty)
    run(name, "--pressure", "500:600:3", ends=2)
    assert re.search(r"s0.npy: 600 MPa: residual .* after", capsys.readouterr().err)


LONG = pytest.mark.long


@pytest.fixture(
    scope="module",
    params=[
        pytest.param((ratio, hardness, files), marks=marks)
        for (ratio, hardness, files), marks in zip(
            product(
                [15, 60],
                [[], ["--hardness", "20e3"]],
                [["-o", "law"], ["--calculix", "law-calculix.inp"]],
            ),
            # each ratio, each body and each choice of files twice in the suite that people run
            [(), LONG, LONG, (), LONG, (), (), LONG],
            strict=True,
        )
    ],
    ids=str,
)
def unlike(request, write):
    """Laws of two surfaces so unlike that one is pressed flat where the other one just touches.

    That of both is the first one; the others are those of each by itself.
    """
    ratio, hardness, files = request.param

    def prepare():
        Path("pair").mkdir()
        for seed, (name, height) in enumerate(
            {"fine": 0.05, "rough": 0.05 * ratio}.items()
        ):
            random = np.random.default_rng(seed)
            np.save(
                f"pair/{name}.npy", generate("diamond-square", 33, 0.8, height, random)
            )

    loads = ["--pressure", "20:300:6:log", *hardness]
    return write(
        ["pair", *loads, *files, "--csv", "law.csv"],
        ["pair/fine.npy", *loads, "--csv", "fine.csv"],
        ["pair/rough.npy", *loads, "--csv", "rough.csv"],
        prepare=prepare,
    )


@pytest.mark.few(2)
def test_a_table_that_was_not_asked_for_is_shortened_but_not_empty(unlike):
    assert "full contact from" in unlike.printed
    deltas = unlike.table("law.csv", "delta_um")
    assert len(deltas) > 1
    assert (deltas.area_percent < 100).all()


def test_a_table_that_was_not_asked_for_costs_none_that_was(unlike):
    pressures = unlike.table("law.csv")
    np.testing.assert_allclose(pressures.pressure_MPa, np.geomspace(20, 300, 6))
    alone = [unlike.table(f"{name}.csv").closure_um for name in ("fine", "rough")]
    np.testing.assert_allclose(pressures.closure_um, np.mean(alone, axis=0), rtol=1e-5)
    assert (unlike.folder / "law-calculix.inp").exists()


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


@pytest.mark.parametrize("setting", ["--prepare", "--level plane", "--side 5"])
def test_a_scene_refuses_settings_for_files(here, refused, setting):
    """Its surfaces are made as the scene says."""
    command = ["paper", "--pressure", "1", *setting.split(), "-o", "law"]
    line = refused(cli, "law", *command)
    assert f"{setting.split()[0]}: goes with files" in line
    assert "paper" in line


def test_a_flat_surface_has_no_law(surfaces, capsys):
    np.save("flat.npy", np.zeros((9, 9)))
    assert (
        cli.main(["law", "flat.npy", "--side", "9", "--pressure", "1:10:3", "-o", "flat"])
        == 2
    )
    assert "flat.npy: is flat" in capsys.readouterr().err
    assert [path.name for path in Path().glob("flat*")] == ["flat.npy"]


@pytest.fixture(scope="module")
def waved(write):
    """Laws of waves without edges, with the error of the grid and without, and at light loads."""

    def prepare():
        np.save("waves.npy", 100 * random_waves(1, 4, 0.8, 1)(48))

    command = ["waves.npy", "--boundary", "periodic", "--pressure", "50,500,2000"]
    light = ["waves.npy", "--pressure", "0.001,0.002,500,2000", "--csv", "light.csv"]
    return write(
        [*command, "--csv", "law.csv", "--json", "law.json"],
        [*command, "--csv", "without.csv", "--no-grid-error"],
        light,
        prepare=prepare,
    )


def test_the_area_in_the_continuum_has_the_error_of_the_grid(waved):
    rows = waved.table("law.csv")
    name = waved.folder / "waves.npy"
    contacts = contacts_of(name, "periodic", pressures=[50, 500, 2000])
    for row, contact in zip(rows.itertuples(), contacts, strict=True):
        error = contact.grid_error().area_percent
        area = contact.continuum_area_percent
        assert row.continuum_area_percent == pytest.approx(area, rel=1e-6)
        assert row.continuum_area_percent_high - area == pytest.approx(error, rel=0.01)
        assert row.continuum_area_percent_low < area


def test_the_area_in_the_continuum_is_in_json(waved):
    curves = waved.document("law.json")["tables"][1]["curves"]
    assert "continuum_area_percent" in curves


def test_the_error_of_the_grid_may_be_left_out(waved):
    columns = waved.table("without.csv").columns
    assert not [name for name in columns if "continuum" in name]


def test_loads_are_named_whose_area_is_that_of_the_grid(waved):
    (note,) = (line for line in waved.printed.splitlines() if "of the grid at" in line)
    resolved = waved.table("light.csv").continuum_area_percent_high.notna().tolist()
    assert resolved == [False, False, True, True]
    assert note.startswith(
        "waves.npy: the area is that of the grid at 2 of 4 loads, up to 0.002 M"
    )


@pytest.fixture(scope="module")
def gas(write):
    """Laws of the spots alone, of the gas alone, and of both."""
    command = ["many/s0.npy", "--pressure", "1:1000:5:log"]
    both = [*command, *CONDUCTING, *OPTIONS_OF_GAS, "-o", "law", "--plot", "law.png"]
    return write(
        [*command, *CONDUCTING, "--csv", "spots.csv"],
        [*both, "--no-check"],
        [*command, *OPTIONS_OF_GAS, "--csv", "gas.csv", "--abaqus", "gas.inp"],
    )


@pytest.mark.parametrize("name", ["law.csv", "gas.csv"])
def test_a_gas_conducts_where_the_gap_is_open(gas, name):
    pressures = np.geomspace(1, 1000, 5)
    contacts = contacts_of(gas.folder / "many/s0.npy", "mirror", pressures=pressures)
    conductances = []
    for contact in contacts:
        gap = np.where(contact.pressure > 0, 0.0, contact.gap)
        conducting = PLATES.conductivity / (gap + PLATES.jump_distance)
        conductances.append((conducting * (gap > 0)).mean())
    rows = gas.table(name)
    np.testing.assert_allclose(rows.gas_conductance_W_per_mm2_K, conductances, rtol=1e-9)


def test_a_gas_leaves_all_other_quantities_as_they_are(gas):
    both, spots = gas.table("law.csv"), gas.table("spots.csv")
    same = both[spots.columns.intersection(both.columns)]
    pd.testing.assert_frame_equal(same, spots[same.columns])


def test_the_joint_conductance_is_that_of_spots_and_gas(gas):
    rows = gas.table("law.csv")
    both = rows.conductance_W_per_mm2_K + rows.gas_conductance_W_per_mm2_K
    np.testing.assert_allclose(rows.joint_conductance_W_per_mm2_K, both, rtol=1e-12)


def test_a_gas_without_conducting_spots_has_no_joint_conductance(gas):
    assert "joint_conductance_W_per_mm2_K" not in gas.table("gas.csv")


@pytest.mark.parametrize(
    ("path", "csv", "column"),
    [
        ("law-abaqus.inp", "law.csv", "joint_conductance_W_per_mm2_K"),
        ("gas.inp", "gas.csv", "gas_conductance_W_per_mm2_K"),
    ],
)
def test_finite_elements_get_what_spots_and_gas_conduct(gas, path, csv, column):
    """From first touch on, where the gas conducts alone."""
    text = gas.text(path)
    about = "Gas in the gap: conductivity 0.026 W/(m K), jump distance 0.37 um"
    assert about in text
    numbers = np.fromstring(text.partition("PRESSURE\n")[2].replace("\n", ","), sep=",")
    by_pressure = dict(zip(numbers[1::2], numbers[::2] / 1e3, strict=True))
    rows = gas.table(csv)
    pressures = [0.0, *(float(f"{load:.10g}") for load in rows.pressure_MPa)]
    heights = gas.heights("many/s0.npy")
    at_rest = PLATES.conductance(heights.max() - heights)
    conductances = [by_pressure[pressure] for pressure in pressures]
    np.testing.assert_allclose(conductances, [at_rest, *rows[column]], rtol=1e-9)


def test_documents_of_a_law_have_its_gas(gas):
    document = gas.document("law.json")
    assert document["gas_conductivity_W_per_m_K"] == PLATES.conductivity
    assert document["gas_jump_distance_um"] == PLATES.jump_distance
    assert "asperity_law_joint_conductance_at_pressure(" in gas.text("law.h")


def test_the_joint_conductance_of_a_population_has_a_band(surfaces, make):
    order = {"e_star": E_STAR, "gas": PLATES, "reading": Reading(side="100")}
    law = make("many", pressure="1,10", conductivities=(50.0, 20.0), **order)
    for table_of_law in (law.over_delta, law.over_pressure):
        curve = table_of_law.curves["joint_conductance_W_per_mm2_K"]
        assert curve.banded[1:].all()


@pytest.fixture(scope="module")
def flowing(write):
    """A law with hydraulic apertures."""
    loads = ["--pressure", "1:4000:5:log", *CONDUCTING]
    return write(["many/s0.npy", *loads, "--flow", "-o", "law", "--no-check"])


APERTURES = ["hydraulic_aperture_x_um", "hydraulic_aperture_y_um"]


@pytest.mark.parametrize("axis", [0, 1])
def test_hydraulic_apertures_are_those_of_the_flow_through_the_gap(flowing, axis):
    pressures = np.geomspace(1, 4000, 5)
    contacts = contacts_of(flowing.folder / "many/s0.npy", "mirror", pressures=pressures)
    apertures = [contact.flow(axis).aperture for contact in contacts]
    rows = flowing.table("law.csv")
    np.testing.assert_allclose(rows[APERTURES[axis]], apertures, rtol=1e-6)


@pytest.mark.parametrize("name", APERTURES)
def test_hydraulic_apertures_fall_from_first_touch_to_none(flowing, name):
    apertures = flowing.table("law.csv")[name]
    at_rest = flowing.table("law.csv", "delta_um")[name].iloc[0]
    assert (np.diff([at_rest, *apertures]) <= 0).all()
    assert at_rest > apertures.iloc[0]
    assert apertures.iloc[-1] == 0


@pytest.mark.parametrize("name", APERTURES)
def test_hydraulic_apertures_are_functions_of_the_header(flowing, name):
    function = f"asperity_law_{name.removesuffix('_um')}_at_pressure("
    assert function in flowing.text("law.h")


def test_hydraulic_apertures_of_a_population_have_a_band(surfaces, make):
    order = {"e_star": E_STAR, "reading": Reading(side="100"), "flow": True}
    law = make("many", pressure="1,10", **order)
    assert law.over_delta.curves["hydraulic_aperture_x_um"].banded.all()


@pytest.fixture(scope="module")
def further(write):
    """Laws with further quantities, and without."""
    command = ["many/s0.npy", "--pressure", "1,10,100"]
    also = ["--also", "largest_spot_area,perimeter", "--also", "yielded_percent"]
    return write(
        [*command, "--csv", "plain.csv"],
        [*command, *also, "--hardness", "2000", "-o", "further"],
        [*command, "--hardness", "2000", "--csv", "bare.csv"],
    )


FURTHER = ["yielded_percent", "perimeter_um", "largest_spot_um2"]


def test_further_quantities_are_in_a_table_in_the_order_of_all_quantities(further):
    columns = further.table("further.csv").columns
    assert [name for name in columns if name in FURTHER] == FURTHER


def test_a_law_has_further_quantities_only_where_they_are_asked_for(further):
    assert not {*FURTHER} & {*further.table("plain.csv")}


def test_further_quantities_leave_the_others_as_they_are(further):
    rows, bare = further.table("further.csv"), further.table("bare.csv")
    pd.testing.assert_frame_equal(rows[list(bare)], bare)


@pytest.mark.parametrize(
    ("column", "read"),
    [
        ("largest_spot_um2", lambda contact: contact.spots.areas[0]),
        ("perimeter_um", lambda contact: contact.perimeter),
    ],
)
def test_further_quantities_are_those_of_the_contacts(further, column, read):
    contacts = contacts_of(
        further.folder / "many/s0.npy", "mirror", pressures=[1, 10, 100], hardness=2000
    )
    values = [read(contact) for contact in contacts]
    rows = further.table("further.csv")
    np.testing.assert_allclose(rows[column], values, rtol=1e-6)


def test_further_quantities_are_functions_of_the_header(further):
    header = further.text("further.h")
    assert "further_largest_spot_at_pressure(double pressure)" in header
    assert "largest_spot: area of the largest spot of contact [um2]" in header


def test_elastic_bodies_have_no_quantity_of_those_that_yield(surfaces, run, capsys):
    run("many/s0.npy", "--pressure", "1,10", "--also", "yielded_percent", ends=2)
    assert "--also yielded_percent: elastic bodies have none" in capsys.readouterr().err
