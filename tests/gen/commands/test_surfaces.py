"""Commands about surfaces: what they refuse before anything is computed, and their files."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from maps import waves

import bem
from gen import cli
from gen.commands.descriptions import units_of_descriptions


@pytest.fixture
def maps(here):
    """Two maps, a.npy and b.npy, of 24 x 24 nodes."""
    for name, seed in (("a", 1), ("b", 2)):
        np.save(f"{name}.npy", waves(24, seed))
    return here


CONTACT = ("contact", "a.npy", "--side", "100")
DESCRIBE = ("describe", "a.npy", "--side", "100")


@pytest.mark.usefixtures("maps")
@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--flattened", "c.npy"], "--flattened needs --hardness"),
        (
            ["--flattened", "c.txt", "--hardness", "1", "--e-star", "9"],
            "--flattened c.txt: give a name that ends in .npy",
        ),
        (["--csv", "a.npy"], "--csv a.npy: is an input: not replaced"),
        (["--csv", "c.csv", "--json", "c.csv"], "--json c.csv: is what --csv writes too"),
        (["--conductivity=1"] * 3, "--conductivity was given 3 times"),
    ],
)
def test_files_and_numbers_are_refused_before_the_solve(options, message, refused):
    assert message in refused(cli, *CONTACT, "--delta", "0.1", *options)
    assert not Path("c.csv").exists()


@pytest.mark.usefixtures("maps")
def test_a_gas_needs_both_of_its_numbers(refused):
    line = ("law", "a.npy", "--side", "100", "--pressure", "0:1:3")
    message = refused(cli, *line, "--jump-distance", "0.4")
    assert "--gas-conductivity is missing" in message


@pytest.mark.usefixtures("maps")
@pytest.mark.parametrize("command", [(*CONTACT, "--delta", "0.1"), DESCRIBE])
def test_the_json_of_one_map_has_the_cells_of_its_table(command):
    assert cli.main([*command, "--csv", "c.csv", "--json", "c.json"]) == 0
    with Path("c.csv").open(newline="") as file:
        (cells,) = csv.DictReader(file)
    (row,) = json.loads(Path("c.json").read_text())["rows"]
    assert list(row) == ["surface", *cells]
    assert row["surface"] == "a.npy"


@pytest.mark.usefixtures("maps")
def test_several_maps_have_a_row_for_each_load_and_its_summary():
    line = ("contact", "a.npy", "b.npy", "--side", "100", "--delta", "0.1,0.2")
    assert cli.main([*line, "--csv", "c.csv"]) == 0
    with Path("c.csv").open(newline="") as file:
        rows = [(row["row"], row["given_delta_um"]) for row in csv.DictReader(file)]
    assert rows == [
        *[("surface", "0.1"), ("surface", "0.2")] * 2,
        *[("mean", "0.1"), ("standard deviation", "0.1")],
        *[("mean", "0.2"), ("standard deviation", "0.2")],
    ]


@pytest.mark.usefixtures("maps")
def test_heights_are_not_written_if_a_load_was_not_solved(capsys):
    bodies = ("--e-star", "1000", "--hardness", "5", "--flattened", "c.npy")
    loads = ("--delta", "0.001,0.3", "--max-iterations", "2")
    assert cli.main([*CONTACT, *loads, *bodies]) == 2
    assert "not written, as not every load was solved" in capsys.readouterr().err
    assert not Path("c.npy").exists()


@pytest.mark.usefixtures("maps")
def test_the_unit_of_every_number_of_a_description_is_known():
    assert cli.main([*DESCRIBE, "--depth", "0.1", "--json", "c.json"]) == 0
    (row,) = json.loads(Path("c.json").read_text())["rows"]
    words = {"surface", "prepared", "warnings", "law", "units", "boundary"}
    counted = {"nodes_x", "nodes_y", "side_x_um", "side_y_um"}
    assert row.keys() - words - counted <= units_of_descriptions().keys()


LAYER = ("--layer-thickness", "5", "--layer-young", "3")
ON_STEEL = (*LAYER, "--young", "2e5", "--boundary", "periodic")


@pytest.mark.usefixtures("maps")
@pytest.mark.parametrize(
    ("options", "message"),
    [
        ((*ON_STEEL, "--far-field", "compliant"), "--far-field: leave it out with"),
        ((*ON_STEEL, "--kernel", "concentrated-force"), "--kernel: leave it out"),
        ((*ON_STEEL, "--conductivity", "1"), "on half-spaces only"),
        (
            (*ON_STEEL, "--young", "2e5", "--friction", "0.3"),
            "--friction: leave it out with --layer-thickness",
        ),
    ],
)
def test_what_does_not_go_with_a_layer_is_refused(options, message, refused):
    assert message in refused(cli, *CONTACT, "--pressure", "0.1", *options)


@pytest.mark.usefixtures("maps")
@pytest.mark.parametrize("base", ["elastic", "rigid"])
def test_a_contact_on_a_layer_has_its_numbers_in_the_table(base, capsys):
    below = ("--young", "2e5", "--poisson", "0.3") if base == "elastic" else ()
    line = (*CONTACT, "--pressure", "0.1", *LAYER, *below, "--layer-base", base)
    assert cli.main([*line, "--boundary", "mirror", "--csv", "c.csv"]) == 0
    with Path("c.csv").open(newline="") as file:
        (cells,) = csv.DictReader(file)
    body = bem.Layered(5.0, 3.0, 0.0, bem.HalfSpace(2e5, 0.3) if below else "rigid")
    contact = bem.solve(
        np.load("a.npy"), 100.0, pressure=0.1, body=body, boundary="mirror"
    )
    assert float(cells["delta_um"]) == pytest.approx(contact.delta, rel=1e-5)
    assert float(cells["modulus_MPa"]) == 3.0
    assert float(cells["layer_thickness_um"]) == 5.0
    assert cells["base"] == base
    assert ("base_young_MPa" in cells) == (base == "elastic")
    assert "layer's Young's modulus" in capsys.readouterr().out
