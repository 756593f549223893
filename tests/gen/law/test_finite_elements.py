"""Surface interactions of laws, as text and as CalculiX reads them."""

import shutil

import numpy as np
import pandas as pd
import pytest

from bench.calculix import QUANTITIES, pressed
from gen import cli
from gen.law import finite_elements
from gen.law.finite_elements import UNITS

STEEL = ["--young", "210e3", "--poisson", "0.3", "--hardness", "2000"]
CONDUCTIVITY = 50.0  # as in `bench.calculix`


@pytest.fixture(scope="module")
def law(tmp_path_factory):
    """A folder with the files of one law, and its table against pressure."""
    folder = tmp_path_factory.mktemp("law")
    x, y = np.meshgrid(*[np.arange(24) / 24 * 2 * np.pi] * 2)
    rng = np.random.default_rng(2)
    heights = sum(
        np.cos(i * x + j * y + rng.uniform(0, 7)) / (i * i + j * j)
        for i in range(4)
        for j in range(4)
        if i + j
    )
    np.save(folder / "surface.npy", 0.3 * heights)
    arguments = [f"{folder}/surface.npy", "--side", "100", "--pressure", "5:320:7:log", *STEEL]
    conducting = ["--conductivity", f"{CONDUCTIVITY:g}"]
    made = ["-o", f"{folder}/steel-on-steel"]
    assert cli.main(["law", *arguments, *conducting, *made]) == 0
    si = ["--units", "si", "--abaqus", f"{folder}/9.inp"]
    assert cli.main(["law", *arguments, *conducting, *si]) == 0
    assert cli.main(["law", *arguments, "--calculix", f"{folder}/plain.inp"]) == 0
    table = pd.read_csv(folder / "steel-on-steel.csv")
    return folder, table[table.against == "pressure_MPa"].reset_index(drop=True)


def read(path):
    """The blocks of numbers of an input file, by their keyword lines."""
    blocks, lines = {}, path.read_text(encoding="ascii").splitlines()
    assert all(len(line) <= 100 for line in lines)
    for line in lines:
        if line.startswith("**"):
            continue
        if line.startswith("*"):
            here = blocks.setdefault(line, [])
            continue
        assert all(len(number) <= 20 for number in line.split(","))
        here.append([float(number) for number in line.split(",")])
    return {name: np.array(rows) for name, rows in blocks.items()}


def test_calculix_has_pressure_and_closure_and_a_temperature_beside_conductances(law):
    folder, table = law
    blocks = read(folder / "steel-on-steel-calculix.inp")
    behaviour = blocks["*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=TABULAR"]
    assert blocks["*SURFACE INTERACTION, NAME=STEEL_ON_STEEL_CALCULIX"].size == 0
    assert behaviour[0].tolist() == [0, 0]
    assert behaviour.shape == (41, 2)
    assert (np.diff(behaviour, axis=0) > 0).all()
    assert behaviour[-1, 1] == 20.5, "the number of points, which CalculiX 2.20 looks for there"
    assert behaviour[19, 1] == pytest.approx(1e-3 * table.closure_um.iloc[-1], rel=1e-9)
    for pressure, closure in zip(table.pressure_MPa, 1e-3 * table.closure_um, strict=True):
        place = np.argmin(np.abs(behaviour[:, 1] - closure))
        np.testing.assert_allclose(behaviour[place], [pressure, closure], rtol=1e-9)
    slopes = np.diff(behaviour[:, 0]) / np.diff(behaviour[:, 1])
    np.testing.assert_allclose(slopes[19:], slopes[18], rtol=1e-5)
    conductance = blocks["*GAP CONDUCTANCE"]
    assert conductance.shape == (8, 3)
    np.testing.assert_allclose(conductance[1:, 0], 1e3 * table.conductance_W_per_mm2_K, rtol=1e-9)
    np.testing.assert_allclose(conductance[1:, 1], table.pressure_MPa)
    assert set(conductance[:, 2]) == {293.15}


def test_abaqus_is_told_that_the_second_column_is_a_pressure(law):
    folder, table = law
    blocks = read(folder / "9.inp")
    assert "*SURFACE INTERACTION, NAME=LAW_9" in blocks
    conductance = blocks["*GAP CONDUCTANCE, PRESSURE"]
    assert conductance[0].tolist() == [0, 0]
    np.testing.assert_allclose(conductance[1:, 0], 1e6 * table.conductance_W_per_mm2_K, rtol=1e-9)
    np.testing.assert_allclose(conductance[1:, 1], 1e6 * table.pressure_MPa, rtol=1e-9)
    behaviour = blocks["*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=TABULAR"]
    np.testing.assert_allclose(behaviour[1:, 1], 1e-6 * table.closure_um, rtol=1e-9)
    assert "m, N, s, Pa" in (folder / "9.inp").read_text()


def test_without_conductivities_there_is_the_closure_alone(law):
    assert not [name for name in read(law[0] / "plain.inp") if "CONDUCTANCE" in name]


def test_units_are_consistent():
    """N/mm2 over mm, mW over mm2 K; N/m2 over m, W over m2 K."""
    assert UNITS["mm"].pressure / UNITS["mm"].length == pytest.approx(1e3)
    assert UNITS["si"].pressure / UNITS["si"].length == pytest.approx(1e12)
    assert UNITS["si"].conductance == pytest.approx(1e6)


def test_full_contact_ends_the_tables(tmp_path, capsys):
    """No closure is left to rise, and the conductance is infinite."""
    np.save(tmp_path / "s.npy", np.random.default_rng(1).normal(size=(8, 8)))
    ask = [f"{tmp_path}/s.npy", "--side", "8", "--e-star", "1", "--conductivity", "1"]
    out = ["--calculix", f"{tmp_path}/law.inp", "--csv", f"{tmp_path}/law.csv"]
    assert cli.main(["law", *ask, "--pressure", "0.1,1,10,100", *out]) == 0
    table = pd.read_csv(tmp_path / "law.csv")
    assert np.isinf(table.conductance_W_per_mm2_K).any()
    pressures = read(tmp_path / "law.inp")["*GAP CONDUCTANCE"][:, 1]
    assert 1 < len(pressures) < 5
    assert cli.main(["law", *ask, "--pressure", "100", *out]) == 2
    assert "closes nowhere below full contact" in capsys.readouterr().err


@pytest.mark.skipif(shutil.which("ccx") is None, reason="no CalculiX: apt-get install calculix-ccx")
def test_calculix_presses_two_blocks_as_the_table_says(law):
    folder, table = law
    rows = table.iloc[1:6].to_dict("records")
    found = pressed(folder, rows)
    assert [row["pressure_MPa"] for row in found] == [row["pressure_MPa"] for row in rows]
    for row in found:
        for name in QUANTITIES:
            assert row[f"{name}_calculix"] == pytest.approx(row[name], rel=0.01)
    softer = [row | {"pressure_MPa": 2 * row["pressure_MPa"]} for row in rows]  # of another law
    assert min(abs(row["pressure_MPa_off"]) for row in pressed(folder, softer)) > 1


@pytest.mark.parametrize("points", [2, 3, 8, 19, 20, 21, 41, 200])
def test_calculix_gets_twenty_points_of_any_law(points):
    closures = np.linspace(0, 3e-3, points) ** 1.2
    pressures = 4e9 * closures**2.5
    loads, overclosures = finite_elements._for_calculix(pressures, closures)
    assert loads.size == overclosures.size == 41
    assert (np.diff(loads) > 0).all()
    assert (np.diff(overclosures) > 0).all()
    assert (loads[0], overclosures[0]) == (0, 0)
    assert overclosures[19] == pytest.approx(closures[-1])
    assert loads[19] == pytest.approx(pressures[-1])
    if points <= 20:
        assert np.isclose(overclosures[:20, None], closures, rtol=1e-12, atol=0).any(axis=0).all()
    else:
        assert np.isclose(overclosures[:20, None], closures, rtol=1e-12, atol=0).any(axis=1).all()
