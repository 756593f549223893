"""Laws for programs: as CalculiX reads them, and as 4C calls them."""

import ast
import importlib
import re
import shutil
import subprocess
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from strict import json_of, rows_of

import bem
from bench.calculix import QUANTITIES, pressed
from gen import cli
from gen.law import finite_elements, solver
from gen.law.finite_elements import beyond_in_words, in_words, outwards
from gen.law.lines import Deviation
from gen.runtime.errors import InputError
from gen.surface import generate
from tests.bem.waves import random_waves
from tests.maps import waves

STEEL = ["--young", "210e3", "--poisson", "0.3", "--hardness", "2000"]
TABLE = "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=TABULAR"
CONDUCTIVITY = 50.0  # as in `bench.calculix`


@pytest.fixture(scope="module")
def law(tmp_path_factory):
    """A folder with the files of one law, and its table against pressure."""
    folder = tmp_path_factory.mktemp("law")
    np.save(folder / "surface.npy", waves(24, 2))
    ask = [
        "law",
        f"{folder}/surface.npy",
        "--side",
        "100",
        "--pressure",
        "5:320:7:log",
        *STEEL,
    ]
    conducting = ["--conductivity", f"{CONDUCTIVITY:g}"]
    assert cli.main([*ask, *conducting, "-o", f"{folder}/joint"]) == 0
    assert (
        cli.main([*ask, *conducting, "--units", "si", "--abaqus", f"{folder}/9.inp"]) == 0
    )
    assert cli.main([*ask, "--calculix", f"{folder}/plain.inp"]) == 0
    table = pd.read_csv(folder / "joint.csv")
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


@pytest.mark.long
def test_calculix_has_pressure_and_closure_and_a_temperature_beside_conductances(law):
    folder, table = law
    assert not [name for name in read(folder / "plain.inp") if "CONDUCTANCE" in name]
    blocks = read(folder / "joint-calculix.inp")
    behaviour = blocks[TABLE]
    assert blocks["*SURFACE INTERACTION, NAME=JOINT_CALCULIX"].size == 0
    assert behaviour[0].tolist() == [0, 0]
    assert behaviour.shape == (41, 2)
    assert (np.diff(behaviour, axis=0) > 0).all()
    assert behaviour[-1, 1] == 20.5, (
        "the number of points, which CalculiX 2.20 looks for there"
    )
    assert behaviour[19, 1] == 10, "the last point that it reads"
    assert behaviour[18, 1] == pytest.approx(1e-3 * table.closure_um.iloc[-1], rel=1e-9)
    for pressure, closure in zip(
        table.pressure_MPa, 1e-3 * table.closure_um, strict=True
    ):
        place = np.argmin(np.abs(behaviour[:, 1] - closure))
        np.testing.assert_allclose(behaviour[place], [pressure, closure], rtol=1e-9)
    slopes = np.diff(behaviour[:, 0]) / np.diff(behaviour[:, 1])
    np.testing.assert_allclose(slopes[18:], slopes[17], rtol=1e-5)
    first = behaviour[:, 1] < 0.999e-3 * table.closure_um[0]
    np.testing.assert_allclose(slopes[: first.sum()], slopes[0], rtol=1e-5)
    conductance = blocks["*GAP CONDUCTANCE"]
    assert len(conductance) <= 20
    assert set(conductance[:, 2]) == {293.15}
    rows = np.column_stack([1e3 * table.conductance_W_per_mm2_K, table.pressure_MPa])
    assert_has_rows(conductance[:, :2], rows)


def assert_has_rows(block, rows):
    """Rows of a law are among those of a file, which begins at no pressure."""
    assert block[0, 1] == 0
    for row in np.asarray(rows):
        np.testing.assert_allclose(
            block[np.abs(block[:, 1] - row[1]).argmin()], row, rtol=1e-9
        )


def test_calculix_is_told_that_its_other_kind_of_contact_passes_no_heat(law):
    folder, _ = law
    advice = "Take TYPE=SURFACE TO SURFACE in *CONTACT PAIR, for which this table is made"
    heat = ": with TYPE=NODE TO SURFACE CalculiX passes no heat, and says nothing of it."
    assert f"{advice}{heat}" in said(folder / "joint-calculix.inp")
    assert f"{advice}." in said(folder / "plain.inp")
    assert advice not in said(folder / "joint-abaqus.inp")


def test_abaqus_is_told_that_the_second_column_is_a_pressure_and_where_nothing_was_computed(
    law,
):
    folder, table = law
    text = said(folder / "joint-abaqus.inp")
    assert "From 0 to the first pressure, 5 MPa, nothing was computed" in text
    assert "The law ends at 320 MPa: beyond, the pressure follows the last slope." in text
    assert "Beyond its last point the conductance stays the last one." in text
    blocks = read(folder / "9.inp")
    assert "*SURFACE INTERACTION, NAME=LAW_9" in blocks
    conductance = blocks["*GAP CONDUCTANCE, PRESSURE"]
    assert conductance[0].tolist() == [0, 0]
    loads = 1e6 * table.pressure_MPa
    assert_has_rows(
        conductance, np.column_stack([1e6 * table.conductance_W_per_mm2_K, loads])
    )
    assert_has_rows(blocks[TABLE], np.column_stack([loads, 1e-6 * table.closure_um]))
    assert "m, N, s, Pa" in (folder / "9.inp").read_text()


def test_a_law_fits_into_the_room_that_calculix_has(tmp_path):
    """It has room for 20 points and overwrites other numbers with the rest; Abaqus takes all."""
    np.save(tmp_path / "s.npy", np.random.default_rng(1).normal(size=(8, 8)))
    ask = [
        f"{tmp_path}/s.npy",
        "--side",
        "8",
        "--e-star",
        "1",
        "--conductivity",
        "1",
        "--no-check",
    ]
    assert (
        cli.main(["law", *ask, "--pressure", "0.01:1:40:log", "-o", f"{tmp_path}/law"])
        == 0
    )
    every = read(tmp_path / "law-abaqus.inp")
    some = read(tmp_path / "law-calculix.inp")
    assert len(every["*GAP CONDUCTANCE, PRESSURE"]) > 40
    assert some[TABLE].shape == (41, 2)
    assert some["*GAP CONDUCTANCE"].shape == (20, 3)
    ends = some["*GAP CONDUCTANCE"][[0, -1], :2]
    np.testing.assert_array_equal(ends, every["*GAP CONDUCTANCE, PRESSURE"][[0, -1]])


@pytest.mark.parametrize("program", ["calculix", "abaqus"])
def test_a_population_has_a_soft_and_a_stiff_side(tmp_path, program, capsys):
    (tmp_path / "many").mkdir()
    for seed in range(3):
        np.save(tmp_path / f"many/{seed}.npy", waves(24, seed))
    ask = [
        f"{tmp_path}/many",
        "--side",
        "100",
        "--e-star",
        "230e3",
        "--conductivity",
        "1",
    ]
    ask += ["--pressure", "20,60,200", "--band", "0.8", "--csv", f"{tmp_path}/law.csv"]
    assert cli.main(["law", *ask, f"--{program}", f"{tmp_path}/joint.inp"]) == 0
    wrote = capsys.readouterr().out
    table = pd.read_csv(tmp_path / "law.csv")
    table = table[table.against == "pressure_MPa"]
    for side, closure, conductance in (("soft", "high", "low"), ("stiff", "low", "high")):
        path = tmp_path / f"joint-{side}.inp"
        assert f"wrote {path}" in wrote
        columns = f"its {closure} closures and {conductance} conductances"
        ends = f"The {side} side of the band: {columns}"
        assert ends in said(path)
        words = "Band: 80 % of further surfaces lie inside, at each load by itself; 3 surfaces,"
        assert words in said(path)
        blocks = read(path)
        behaviour = blocks[TABLE]
        for number in 1e-3 * table[f"closure_um_{closure}"]:
            assert np.isclose(behaviour[:, 1], number, rtol=1e-9, atol=0).any()
        (kept,) = [rows for name, rows in blocks.items() if "CONDUCTANCE" in name]
        ends = 1e3 * table[f"conductance_W_per_mm2_K_{conductance}"]
        assert_has_rows(kept[:, :2], np.column_stack([ends, table.pressure_MPa]))


def test_a_side_that_turns_back_is_drawn_outwards():
    turning = np.array([3.0, 2.0, 4.0, 1.0, 5.0])
    assert outwards(turning, "high").tolist() == [3, 3, 4, 4, 5]
    assert outwards(turning, "low").tolist() == [1, 1, 1, 1, 5]
    assert outwards(turning, "value") is turning


def test_a_side_of_two_surfaces_is_nowhere_inside_the_band(tmp_path):
    """Also between its points, where the table of a program is straight."""
    heights = [
        rough * np.random.default_rng(1).normal(size=(8, 8)) for rough in (0.3, 1.0)
    ]
    heights[1][0, 0] = 9.0
    for number, each in enumerate(heights):
        np.save(tmp_path / f"{number}.npy", each)
    ask = [f"{tmp_path}/0.npy", f"{tmp_path}/1.npy", "--side", "8", "--e-star", "1"]
    ask += ["--pressure", "0.001:1:12:log", "--csv", f"{tmp_path}/law.csv"]
    assert cli.main(["law", *ask, "--abaqus", f"{tmp_path}/joint.inp"]) == 0
    table = pd.read_csv(tmp_path / "law.csv")
    table = table[table.against == "pressure_MPa"]
    assert (table.closure_um_high.diff() < 0).any()
    for side, end, sign in (("soft", "high", 1), ("stiff", "low", -1)):
        path = tmp_path / f"joint-{side}.inp"
        behaviour = read(path)[TABLE]
        closures = 1e3 * np.interp(table.pressure_MPa, behaviour[:, 0], behaviour[:, 1])
        assert (sign * (closures - table[f"closure_um_{end}"]) >= -1e-6 * closures).all()
    assert "drawn outwards" in said(tmp_path / "joint-soft.inp")


def said(path):
    """The comment of an input file as one line."""
    lines = path.read_text().splitlines()
    return " ".join(
        " ".join(line.strip("* ") for line in lines if line.startswith("**")).split()
    )


VALUES = {"closure_um", "area_percent", "mean_gap_um", "conductance_W_per_mm2_K"}


def wavy(nodes, height):
    x = np.arange(nodes) / nodes * 2 * np.pi
    return height * np.cos(x)[:, None] * np.cos(x)


@pytest.mark.parametrize(
    ("heights", "loads"),
    [
        (wavy(16, 0.05), ["3000:9000:7", "--e-star", "230e3", "--boundary", "periodic"]),
        pytest.param(
            wavy(16, 0.05),
            ["500:9000:9", "--e-star", "230e3", "--hardness", "10e3"],
            marks=pytest.mark.long,
        ),
        (
            np.random.default_rng(1).normal(size=(2, 8, 8)),
            ["0.1,1,10,100", "--e-star", "1"],
        ),
    ],
)
def test_every_file_ends_at_full_contact_and_says_so(tmp_path, capsys, heights, loads):
    """Every number is finite; arguments rise, and nothing else turns back or is empty."""
    for number, each in enumerate(np.atleast_3d(heights.T).T):
        np.save(tmp_path / f"{number}.npy", each)
    names = [str(path) for path in tmp_path.glob("*.npy")]
    ask = ["law", *names, "--side", "8", "--pressure", *loads, "--conductivity", "1"]
    assert cli.main([*ask, "-o", f"{tmp_path}/law"]) == 0
    note = "full contact from"
    assert note in capsys.readouterr().out
    assert note in " ".join(json_of(tmp_path / "law.json")["notes"])
    assert note in (tmp_path / "law.h").read_text()
    assert all(note in said(path) for path in tmp_path.glob("*.inp"))
    assert_finite_and_rising(tmp_path)


def assert_finite_and_rising(folder):
    """Read the files of a law as strictly as can be."""
    rows = rows_of(folder / "law.csv")
    assert all(any(row[name] for row in rows) for name in rows[0])
    for argument in ("delta_um", "pressure_MPa"):
        part = [row for row in rows if row["against"] == argument]
        assert max(float(row["area_percent"]) for row in part) < 100
        assert (np.diff([float(row[argument]) for row in part]) > 0).all()
        for name in VALUES & {name for name in part[0] if part[0][name]}:
            sign = -1 if name == "mean_gap_um" else 1
            assert (sign * np.diff([float(row[name]) for row in part]) >= 0).all()
    json_of(folder / "law.json")
    for path in folder.glob("*.inp"):
        pressing, conducting = (block for block in read(path).values() if block.size)
        assert np.isfinite(pressing).all()
        assert (np.diff(pressing, axis=0) > 0).all()
        assert np.isfinite(conducting).all()
        assert (np.diff(conducting[:, 1]) > 0).all()
        assert (np.diff(conducting[:, 0]) >= 0).all()
    header = (folder / "law.h").read_text().partition("#include")[2]
    for array in header.split("static const double ")[1:]:
        if (
            "_low_" not in array and "_high_" not in array
        ):  # which have no ends without a band
            assert " nan" not in array.lower()


@pytest.mark.parametrize(
    "seeds",
    [
        range(1),
        *(
            pytest.param(range(k, k + 11), marks=pytest.mark.long)
            for k in range(1, 67, 11)
        ),
    ],
    ids=lambda seeds: f"from-{seeds.start}",
)
def test_laws_up_to_full_contact_are_finite_and_rise(tmp_path, capsys, seeds):
    """Of any grid, height, modulus, boundary and number of surfaces, with hardness and without."""
    for seed in seeds:
        rng = np.random.default_rng(seed)
        folder = tmp_path / str(seed)
        folder.mkdir()
        nodes, rough = rng.integers(4, 14, 2), 10 ** rng.uniform(-3, 0)
        names = [f"{folder}/{number}.npy" for number in range(rng.integers(1, 4))]
        for name in names:
            np.save(name, rough * rng.normal(size=nodes))
        e_star = float(f"{10 ** rng.uniform(0, 6):.3g}")
        ends = 1e-4 * rough * e_star, 2 * rough * e_star
        ask = [
            "law",
            *names,
            "--side",
            "8,9",
            "--e-star",
            f"{e_star}",
            "--conductivity",
            "1",
        ]
        ask += [
            "--boundary",
            rng.choice(["free", "mirror", "periodic"]),
            "-o",
            f"{folder}/law",
        ]
        if rng.random() < 0.5:
            ask += ["--hardness", f"{2.5 * rough * e_star}"]
        ask += ["--pressure", f"{ends[0]}:{ends[1]}:{rng.integers(3, 30)}:log"]
        if rng.random() < 0.7:
            ask += ["--no-check"]
        assert cli.main(ask) == 0, ask
        assert_finite_and_rising(folder)
        capsys.readouterr()


def test_the_end_of_one_table_is_not_said_of_the_other(tmp_path, capsys):
    """Where one surface of two is in full contact, the table against pressure goes on beyond."""
    for number, rough in enumerate((0.1, 1.0)):
        np.save(
            tmp_path / f"{number}.npy",
            rough * np.random.default_rng(1).normal(size=(8, 8)),
        )
    ask = [
        "law",
        f"{tmp_path}/0.npy",
        f"{tmp_path}/1.npy",
        "--side",
        "8",
        "--e-star",
        "5",
    ]
    assert cli.main([*ask, "--pressure", "0.01,0.1,0.2", "-o", f"{tmp_path}/law"]) == 0
    (note,) = (
        line for line in capsys.readouterr().out.splitlines() if "full contact" in line
    )
    assert note.endswith("um on: the table against delta_um ends below it")
    end = float(note.split()[3])
    part = [
        row for row in rows_of(tmp_path / "law.csv") if row["against"] == "pressure_MPa"
    ]
    assert float(part[-1]["closure_um"]) > end
    assert "larger pressures, up to full contact, if" in said(
        tmp_path / "law-calculix.inp"
    )


needs_calculix = pytest.mark.skipif(
    shutil.which("ccx") is None, reason="no CalculiX: apt-get install calculix-ccx"
)


@needs_calculix
def test_calculix_presses_two_blocks_as_the_table_says(law):
    folder, table = law
    rows = table.iloc[1:6].to_dict("records")
    found = pressed(folder, rows)
    assert [row["pressure_MPa"] for row in found] == [row["pressure_MPa"] for row in rows]
    for row in found:
        for name in QUANTITIES:
            assert row[f"{name}_calculix"] == pytest.approx(row[name], rel=0.01)
    softer = [
        row | {"pressure_MPa": 2 * row["pressure_MPa"]} for row in rows
    ]  # of another law
    assert min(abs(row["pressure_MPa_off"]) for row in pressed(folder, softer)) > 1


@needs_calculix
def test_calculix_follows_the_last_slope_past_the_end_of_the_table(law):
    """The joint stays as stiff as at the end, also where one step leads there."""
    folder, table = law
    last = table.iloc[-1]
    behaviour = read(folder / "joint-calculix.inp")[TABLE]
    slope = np.diff(behaviour[17:19, 0])[0] / np.diff(1e3 * behaviour[17:19, 1])[0]
    rows = []
    for more in (0.01, 0.1, 1.0):
        beyond = {"closure_um": last.closure_um + more}
        beyond["pressure_MPa"] = last.pressure_MPa + slope * more
        rows.append(last.to_dict() | beyond)
    for steps in (rows, rows[-1:]):
        for row in pressed(folder, steps):
            for name in QUANTITIES:
                assert row[f"{name}_calculix"] == pytest.approx(row[name], rel=1e-3)


def test_4c_gets_the_monotone_cubic_with_its_tangent_in_its_signs(law, monkeypatch):
    folder, table = law
    path = folder / "joint_4c.py"
    lines = ast.walk(ast.parse(path.read_text(encoding="ascii")))
    modules = [each.module for each in lines if isinstance(each, ast.ImportFrom)]
    assert modules == ["bisect", "warnings"]
    monkeypatch.syspath_prepend(path.parent)
    module = importlib.import_module(path.stem)  # as 4C does
    offset = 0.25  # mm, by which the bodies overlap at first touch
    at = 1e-3 * table.closure_um.to_numpy()  # mm
    pressures = [module.evaluate(-each - offset, offset) for each in at[:-1].tolist()]
    np.testing.assert_allclose(pressures, -table.pressure_MPa[:-1], rtol=1e-10)
    assert module.evaluate(-float(at[-1]), 0.0) == -table.pressure_MPa.iloc[-1]
    assert module.evaluate(0.0, 0.0) == 0.0
    gaps = np.linspace(-at[-1], 0, 1001)
    values = [module.evaluate(gap, 0.0) for gap in gaps.tolist()]
    assert {type(value) for value in values} == {float}
    assert (np.diff(values) > 0).all(), (
        "pressures are negative, and rise to 0 at first touch"
    )
    for low, high in zip([0.0, *at], at, strict=False):
        gap, step = -(low + 0.3 * (high - low)), 0.1 * (high - low)
        ends = [module.evaluate(gap + more * step, 0.0) for more in (-2, -1, 1, 2)]
        tangent = np.dot([1, -8, 8, -1], ends) / (12 * step)  # exact for a cubic
        assert module.evaluate_derivative(gap, 0.0) == pytest.approx(tangent, rel=1e-8)
    for gap, moved in ((1.0, 0.0), (-0.2, 0.25), (np.nan, 0.0)):
        for function in (module.evaluate, module.evaluate_derivative):
            with pytest.raises(ValueError, match="this law begins at 0"):
                function(gap, moved)
    assert "beyond, the pressure follows the last slope" in path.read_text().replace(
        "\n#   ", " "
    )
    stiffness = module.evaluate_derivative(-float(at[-1]), 0.0)
    assert stiffness > 0
    for share in (1.01, 2.0, 10.0):
        with pytest.warns(UserWarning, match="where this law ends: the pressure follows"):
            pressure = module.evaluate(-float(share * at[-1]), 0.0)
        beyond = table.pressure_MPa.iloc[-1] + stiffness * (share - 1) * at[-1]
        assert pressure == pytest.approx(-beyond, rel=1e-12)
        with pytest.warns(UserWarning, match="no contact was computed there"):
            assert module.evaluate_derivative(-float(share * at[-1]), 0.0) == stiffness


def test_a_file_that_4c_could_not_import_is_refused_before_any_work(
    surfaces, run, capsys
):
    for name in ("math.py", "law.2.py", "law.txt"):
        run("many/s0.npy", "--pressure", "10", "--4c", name, ends=2)
        assert f"--4c {name}: 4C imports it by its name" in capsys.readouterr().err
    run("many/s0.npy", "--pressure", "10", "-o", "steel.2")
    assert (surfaces / "steel_2_4c.py").exists()


def heights_of(kind, nodes):
    """Heights of one kind of surface, on a side of 100 um."""
    if kind == "waves":
        return 100 * random_waves(3, 9, 0.8, 1)(nodes)
    rng = np.random.default_rng(1)
    if kind == "white":
        return 0.5 * rng.normal(size=(nodes, nodes))
    return generate("diamond-square", nodes, 0.8, 0.5, rng)


def close_contacts(heights):
    """150 contacts between 30 nodes in contact and 90 %, as rows of a table."""
    settings = {"modulus": 230e3, "boundary": "mirror"}
    wide = np.geomspace(1, 200e3, 100)
    pressures = []
    for contact, pressure in zip(
        bem.ladder(heights, 100.0, pressures=wide, **settings), wide, strict=True
    ):
        if contact.contact_nodes >= 30:
            pressures.append(pressure)
        if contact.area_percent > 90:
            break
    dense = np.geomspace(pressures[0], pressures[-2], 150)
    rows = [
        {
            "pressure_MPa": pressure,
            "closure_mm": 1e-3 * contact.delta,
            "conductance": 1e3 * 50 / 230e3 * contact.interface_stiffness / 100**2,
        }
        for pressure, contact in zip(
            dense,
            bem.ladder(heights, 100.0, pressures=dense, **settings),
            strict=True,
        )
    ]
    return pd.DataFrame(rows)


def distances(path, rows):
    """How far straight lines of a file are off contacts, in per cent: pressure, conductance."""
    pressing, conducting = (block for block in read(path).values() if block.size)
    pressures = np.interp(rows.closure_mm, pressing[:, 1], pressing[:, 0])
    conductances = np.interp(rows.pressure_MPa, conducting[:, 1], conducting[:, 0])
    off_pressure = pressures / rows.pressure_MPa - 1
    off_conductance = conductances / rows.conductance - 1
    return [100 * np.abs(off).max() for off in (off_pressure, off_conductance)]


def told(path):
    """How far a file says that its lines are off, the same."""
    words = r"touch: pressure ([\d.e-]+) %, conductance ([\d.e-]+) %"
    return [float(number) for number in re.search(words, said(path)).groups()]


KINDS = [
    pytest.param(("waves", 96), id="waves", marks=pytest.mark.long),
    pytest.param(("diamond-square", 33), id="coarse"),
    pytest.param(("diamond-square", 65), id="diamond-square", marks=pytest.mark.long),
    pytest.param(("diamond-square", 129), id="fine", marks=pytest.mark.long),
    pytest.param(("white", 64), id="white", marks=pytest.mark.long),
]


@pytest.fixture(scope="module", params=KINDS)
def rough(request, tmp_path_factory):
    """The files of the law of a rough surface, and contacts close together that it is off from."""
    folder = tmp_path_factory.mktemp("rough")
    heights = heights_of(*request.param)
    np.save(folder / "s.npy", heights)
    rows = close_contacts(heights)
    low = rows.pressure_MPa.iloc[0]
    high = 1.1 * rows.pressure_MPa.iloc[-1]
    ask = [f"{folder}/s.npy", "--side", "100", "--e-star", "230e3", "--conductivity"]
    ask += ["50", "--pressure", f"{low}:{high}:7:log", "-o", f"{folder}/law"]
    assert cli.main(["law", *ask]) == 0
    return folder, rows


@pytest.mark.long
def test_rows_of_calculix_are_within_5_percent_up_to_90_percent_contact(rough):
    """The conductance diverges towards full contact: by the loads alone it was 163 % too large."""
    folder, rows = rough
    assert max(distances(folder / "law-calculix.inp", rows)) < 5


@pytest.mark.long
def test_files_say_how_far_their_lines_are_off(rough):
    folder, rows = rough
    for program in ("calculix", "abaqus"):
        path = folder / f"law-{program}.inp"
        assert re.search(r"off contacts at \d+ pressures between the loads", said(path))
        for announced, measured in zip(told(path), distances(path, rows), strict=True):
            assert measured < announced + 3.5, "a contact between others is further off"


@pytest.mark.long
def test_files_say_how_far_their_cubics_are_off(rough):
    folder, _ = rough
    head = (folder / "law.h").read_text().partition("*/")[0].replace("\n *", "")
    for function in ("area", "conductance_at_pressure", "pressure_at_closure"):
        assert re.search(rf" {function} [\d.e-]+ %", " ".join(head.split())), function
    text = " ".join((folder / "law_4c.py").read_text().replace("\n#", "").split())
    assert re.search(r"touch: pressure_at_closure [\d.e-]+ %", text)


def test_without_the_check_no_contact_is_solved_between_the_loads(tmp_path, monkeypatch):
    """Nor where no file joins the points of a table."""
    folder = tmp_path
    np.save(folder / "s.npy", heights_of("waves", 48))
    solved = []
    solve_loads = solver.solve_loads

    def counted(surface, load, loads, **settings):
        solved.extend(loads)
        return solve_loads(surface, load, loads, **settings)

    monkeypatch.setattr(solver, "solve_loads", counted)
    ask = ["law", f"{folder}/s.npy", "--side", "100", "--e-star", "230e3"]
    ask += ["--pressure", "100:1600:5:log"]
    for files in (
        ["-o", f"{folder}/some", "--no-check"],
        ["--csv", f"{folder}/some.csv"],
    ):
        solved.clear()
        assert cli.main([*ask, *files]) == 0
        np.testing.assert_allclose(solved, np.geomspace(100, 1600, 5))
    assert "between which no contact was solved" in said(folder / "some-calculix.inp")
    assert "No contact was solved between the points" in (folder / "some.h").read_text()
    solved.clear()
    assert cli.main([*ask, "--calculix", f"{folder}/some.inp"]) == 0
    assert len(solved) > 5 + 4


def test_a_closure_beyond_the_points_far_away_is_refused():
    with pytest.raises(InputError, match="closes by 12"):
        finite_elements._with_far_points(np.array([0.0, 1.0]), np.array([0.0, 12.0]))


FREECAD = Path(__file__).parent / "freecad-two-blocks.inp"
"""What the solver object of FreeCAD 0.20.2 wrote for two steel blocks of a cubic millimetre, with a
contact constraint between two faces and a pressure of 20 MPa on the upper one. The faces overlap by
0.1 um, so that FreeCAD tells them apart."""

STEEL_BLOCKS = ("law", "surface.npy", "--side=100", "--young=210e3", "--poisson=0.3")
OVERLAP = 1e-4  # of the faces before they are pressed [mm]
PRESSURE = 20.0  # [MPa]


def with_law(text):
    """Put the law in place of the linear contact of FreeCAD's input."""
    block = re.compile(r"^\*SURFACE INTERACTION.*?(?=^\*\*)", re.DOTALL | re.MULTILINE)
    text, replaced = block.subn("*INCLUDE, INPUT=joint.inp\n", text)
    assert replaced == 1
    pair = r"^\*CONTACT PAIR, INTERACTION=\w+,TYPE=SURFACE TO SURFACE$"
    named = "*CONTACT PAIR, INTERACTION=JOINT, TYPE=SURFACE TO SURFACE"
    text, renamed = re.subn(pair, named, text, flags=re.MULTILINE)
    assert renamed == 1
    return text


def displacements(path):
    """Return the displacement along z of each node of a .frd file with one step [mm]."""
    text = path.read_text(encoding="ascii")
    table = text.partition(" DISP ")[2].partition("\n -3")[0]
    lines = [line for line in table.splitlines() if line.startswith(" -1")]
    return {int(line[3:13]): float(line[37:49]) for line in lines}


@needs_calculix
def test_the_input_of_freecad_closes_as_the_law_says(here):
    np.save("surface.npy", waves(24, 2))
    line = [
        *STEEL_BLOCKS,
        "--pressure=2:80:30:log",
        "--calculix=joint.inp",
        "--csv=joint.csv",
    ]
    assert cli.main(line) == 0
    Path("blocks.inp").write_text(with_law(FREECAD.read_text(encoding="ascii")), "ascii")
    subprocess.run(["ccx", "blocks"], cwd=here, check=True, capture_output=True)
    of_nodes = displacements(Path("blocks.frd"))
    lower = np.mean([of_nodes[node] for node in (5, 6, 7, 8)])
    upper = np.mean([of_nodes[node] for node in (101, 102, 103, 104)])
    closure = lower - upper + OVERLAP
    table = pd.read_csv("joint.csv")
    table = table[table.against == "pressure_MPa"]
    expected = np.interp(PRESSURE, table.pressure_MPa, table.closure_um)
    assert 1e3 * closure == pytest.approx(expected, rel=0.02)


def test_large_distances_from_the_law_are_written_without_powers_of_ten():
    distances = {"loss": Deviation(inside=1.6, outside=0.0123)}
    assert "touch: loss 160 %; elsewhere: loss 1.2 %" in in_words(distances)


def test_files_tell_loads_outside_a_training_from_loads_that_nobody_gave():
    table = SimpleNamespace(
        at=np.array([1.0, 2.0, 3.0]), flagged=np.array([False, False, True])
    )
    law = SimpleNamespace(over_pressure=table)
    assert "outside the surrogate's training" in beyond_in_words(law, 2.0)
    assert "Give larger pressures" in beyond_in_words(law, 3.0)
