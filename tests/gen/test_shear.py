"""Shear on the command line: stiffness, elastic slip and slip curves of two like bodies."""

import csv
import json
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from maps import waves

import bem
from bem.derived.slip import isotropic_ratio, shear_patch_stiffness, shear_stiffness
from gen import cli
from gen.material import Friction
from gen.shear import SHARES, Sheared

NU = 0.3
STEEL = ("--young=210e3", "--young=210e3", f"--poisson={NU}", f"--poisson={NU}")
CONTACT = ("contact", "a.npy", "--side=100", "--pressure=400", "--friction=0.3")
LAW = (
    "law",
    "a.npy",
    "--side=100",
    "--pressure=50:2000:6:log",
    "--friction=0.3",
    "--no-grid-error",
    *STEEL,
)


@pytest.fixture
def surface(here):
    """A map, a.npy, of 32 x 32 nodes."""
    np.save("a.npy", waves(32, 1))
    return here


def cells_of(path):
    """Return the only row of a table."""
    with Path(path).open(newline="", encoding="utf-8") as file:
        (row,) = csv.DictReader(file)
    return row


@pytest.mark.usefixtures("surface")
@pytest.mark.parametrize("boundary", ["free", "periodic"])
def test_a_sheared_contact_has_the_answers_of_partial_slip(boundary):
    line = [*CONTACT, *STEEL, f"--boundary={boundary}", "--shear=0.25,0.75"]
    assert cli.main([*line, "--csv", "c.csv"]) == 0
    row = cells_of("c.csv")
    contact = bem.solve(
        np.load("a.npy"),
        100.0,
        pressure=400.0,
        modulus=210e3 / 2,
        poisson=NU,
        boundary=boundary,
    )
    sliding = 0.3 * contact.force
    for axis, name in enumerate("xy"):
        slip = bem.partial_slip(
            contact, 0.3, [0.25 * sliding, 0.75 * sliding], poisson=NU, axis=axis
        )
        shift = slip.shift
        stiffness = slip.first_stiffness
        if boundary == "free":
            patch = shear_patch_stiffness(contact.problem, NU, axis)
            shift = shift - slip.shears / patch
            stiffness = 1 / (1 / stiffness - 1 / patch)
        for place, share in enumerate(("0.25", "0.75")):
            column = f"{name}_at_{share}"
            assert float(row[f"shift_{column}_um"]) == pytest.approx(shift[place])
            assert float(row[f"loss_{column}_pJ"]) == pytest.approx(slip.loss[place])
            stick = float(row[f"stick_{column}_percent"])
            assert stick == pytest.approx(slip.stick_percent[place])
        assert float(row[f"shear_stiffness_{name}_N_per_m"]) == pytest.approx(stiffness)
        elastic_slip = float(row[f"elastic_slip_{name}_um"])
        assert elastic_slip == pytest.approx(sliding / stiffness)


@pytest.mark.usefixtures("surface")
def test_a_contact_without_friction_has_no_column_of_shear():
    line = ["contact", "a.npy", "--side=100", "--pressure=400", *STEEL]
    assert cli.main([*line, "--csv", "c.csv"]) == 0
    assert not [name for name in cells_of("c.csv") if "shear" in name or "slip" in name]


@pytest.mark.usefixtures("surface")
@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--young=210e3", "--poisson=0.3"], "--friction with a rigid body"),
        (["--e-star=1e5"], "--friction needs Poisson's ratio"),
        (
            ["--young=210e3", "--young=70e3", "--poisson=0.3", "--poisson=0.33"],
            "--friction between unlike bodies",
        ),
        ([*STEEL, "--hardness=2000"], "--friction with --hardness"),
        ([*STEEL, "--shear=1"], "--shear 1: must be at least 0 and below 1"),
        ([*STEEL, "--shear=x"], "--shear 'x': give shares of the sliding force"),
        ([*STEEL, "--far-field=compliant"], "shear is that of half-spaces"),
    ],
)
def test_what_cannot_be_sheared_is_refused_in_one_line(options, message, refused):
    assert message in refused(cli, *CONTACT, *options)


@pytest.mark.usefixtures("surface")
@pytest.mark.parametrize("option", ["--shear=0.5", "--like-bodies"])
def test_options_of_shear_go_with_friction(option, refused):
    line = [text for text in CONTACT if "friction" not in text]
    assert f"{option.split('=')[0]} goes with --friction" in refused(
        cli, *line, *STEEL, option
    )


@pytest.mark.usefixtures("surface")
def test_unlike_bodies_are_taken_for_alike_if_the_user_says_so():
    unlike = ["--young=210e3", "--young=70e3", "--poisson=0.3", "--poisson=0.33"]
    line = [*CONTACT, *unlike, "--boundary=periodic", "--like-bodies"]
    assert cli.main([*line, "--csv", "c.csv"]) == 0
    contact = bem.solve(
        np.load("a.npy"),
        100.0,
        pressure=400.0,
        modulus=1 / ((1 - 0.3**2) / 210e3 + (1 - 0.33**2) / 70e3),
        boundary="periodic",
    )
    softness = [1.3 / 210e3, 1.33 / 70e3]
    mean = (0.3 * softness[0] + 0.33 * softness[1]) / sum(softness)
    expected = shear_stiffness(contact, mean, 0)
    row = cells_of("c.csv")
    assert float(row["shear_stiffness_x_N_per_m"]) == pytest.approx(expected)


def test_a_rigid_body_on_rubber_is_alike():
    rubber = Friction.of_options(0.5, [5.0], [0.5], like_bodies=False)
    assert rubber == Friction(coefficient=0.5, poisson=0.5)


@pytest.mark.usefixtures("surface")
def test_a_law_has_the_slip_of_each_contact():
    assert cli.main([*LAW, "--json", "c.json"]) == 0
    document = json.loads(Path("c.json").read_text(encoding="utf-8"))
    assert document["friction"] == 0.3
    assert document["poisson_in_shear"] == NU
    table = document["tables"][1]
    place = 3
    contact = bem.solve(
        np.load("a.npy"),
        100.0,
        pressure=table["at"][place],
        modulus=210e3 / 2,
        poisson=NU,
        boundary="mirror",
    )
    area = 100.0**2
    for axis, name in enumerate("xy"):
        sheared = Sheared(contact, Friction(coefficient=0.3, poisson=NU), axis)
        curve = sheared.curve(SHARES)
        expected = {
            f"shear_stiffness_{name}_MPa_per_um": sheared.interface_stiffness / area,
            f"elastic_slip_{name}_um": sheared.elastic_slip,
            f"shift_{name}_60_um": curve[2].shift,
            f"loss_{name}_60_J_per_m2": curve[2].loss / area,
        }
        for column, value in expected.items():
            in_law = table["curves"][column]["value"][place]
            assert in_law == pytest.approx(value, rel=1e-4)


@pytest.mark.usefixtures("surface")
def test_isotropic_interfaces_have_mindlins_ratio_in_laws():
    assert cli.main([*LAW, "--json", "c.json"]) == 0
    curves = json.loads(Path("c.json").read_text(encoding="utf-8"))["tables"][1]["curves"]
    normal = np.array(curves["stiffness_MPa_per_um"]["value"])
    along = [curves[f"shear_stiffness_{axis}_MPa_per_um"]["value"] for axis in "xy"]
    ratios = np.mean(along, axis=0) / normal
    np.testing.assert_allclose(ratios, isotropic_ratio(NU), rtol=0.02)


@pytest.mark.usefixtures("surface")
def test_abaqus_gets_the_elastic_slip_of_the_law():
    assert cli.main([*LAW, "--json", "c.json", "--abaqus", "c.inp"]) == 0
    curves = json.loads(Path("c.json").read_text(encoding="utf-8"))["tables"][1]["curves"]
    slips = [curves[f"elastic_slip_{axis}_um"]["value"] for axis in "xy"]
    text = Path("c.inp").read_text(encoding="ascii")
    (slip, friction) = re.search(
        r"^\*FRICTION, ELASTIC SLIP=(.+)\n(.+)$", text, re.MULTILINE
    ).groups()
    assert float(slip) == pytest.approx(1e-3 * np.median(slips))  # in mm
    assert float(friction) == 0.3


@pytest.mark.usefixtures("surface")
def test_calculix_gets_a_stick_slope_at_a_pressure_alone(refused):
    assert cli.main([*LAW, "--calculix", "c.inp", "--no-check"]) == 0
    text = Path("c.inp").read_text(encoding="ascii")
    assert not re.search(r"^\*FRICTION", text, re.MULTILINE)
    assert "--at-pressure" in text
    message = refused(cli, *LAW, "--calculix", "c.inp", "--at-pressure", "1e5")
    assert "--at-pressure 100000: the law is from 50 to 2000 MPa" in message


FRICTIONS = {
    "abaqus": re.compile(r"^\*FRICTION, ELASTIC SLIP=(.+)\n0\.3$", re.M),
    "calculix": re.compile(r"^\*FRICTION\n0\.3, (.+)$", re.M),
}
"""The lines of the friction of `LAW` by the program, with the number for the shear before slip."""


def test_both_sides_of_a_band_have_the_friction_of_the_law(surface):
    for seed in (2, 3):
        np.save(f"b{seed}.npy", waves(32, seed))
    files = [f"--{program}={program}.inp" for program in FRICTIONS]
    line = [*LAW, "b2.npy", "b3.npy", "--pressure=200:800:2:log", *files, "--no-check"]
    assert cli.main([*line, "--at-pressure", "500"]) == 0
    numbers = {
        program: [
            float(pattern.search(Path(f"{program}{side}.inp").read_text())[1])
            for side in ("-soft", "", "-stiff")
        ]
        for program, pattern in FRICTIONS.items()
    }
    soft, law, stiff = numbers["abaqus"]
    assert soft > law > stiff  # elastic slips: a soft joint gives way further
    soft, law, stiff = numbers["calculix"]
    assert soft < law < stiff  # slopes


@pytest.mark.parametrize(
    ("units", "slip", "slope"), [("mm", "mm", "MPa/mm"), ("si", "m", "Pa/m")]
)
def test_files_say_what_the_number_for_shear_is(surface, units, slip, slope):
    files = ["--abaqus", "a.inp", "--calculix", "c.inp", "--at-pressure", "500"]
    assert cli.main([*LAW, *files, "--no-check", "--units", units]) == 0
    texts = {
        name: re.sub(r"\n\*\* +", " ", Path(name).read_text())
        for name in ("a.inp", "c.inp")
    }
    number = FRICTIONS["abaqus"].search(texts["a.inp"])[1]
    assert f"Elastic slip: {float(number):.4g} {slip} for all" in texts["a.inp"]
    number = FRICTIONS["calculix"].search(texts["c.inp"])[1]
    assert f"Stick slope: {float(number):.4g} {slope} for all" in texts["c.inp"]


BLOCKS = """*NODE, NSET=LOWER
1, 0, 0, -1
2, 1, 0, -1
3, 1, 1, -1
4, 0, 1, -1
5, 0, 0, 0
6, 1, 0, 0
7, 1, 1, 0
8, 0, 1, 0
*NODE, NSET=UPPER
11, 0, 0, 0
12, 1, 0, 0
13, 1, 1, 0
14, 0, 1, 0
15, 0, 0, 1
16, 1, 0, 1
17, 1, 1, 1
18, 0, 1, 1
*ELEMENT, TYPE=C3D8, ELSET=BLOCKS
1, 1, 2, 3, 4, 5, 6, 7, 8
2, 11, 12, 13, 14, 15, 16, 17, 18
*MATERIAL, NAME=STEEL
*ELASTIC
210000, 0.3
*SOLID SECTION, ELSET=BLOCKS, MATERIAL=STEEL
*SURFACE, NAME=FACE_OF_LOWER, TYPE=ELEMENT
1, S2
*SURFACE, NAME=FACE_OF_UPPER, TYPE=ELEMENT
2, S1
*INCLUDE, INPUT=joint.inp
*CONTACT PAIR, INTERACTION=JOINT, TYPE=SURFACE TO SURFACE
FACE_OF_UPPER, FACE_OF_LOWER
*BOUNDARY
LOWER, 1, 3, 0
UPPER, 2, 2, 0
*STEP, NLGEOM
*STATIC
*BOUNDARY
UPPER, 3, 3, {closure:.10g}
UPPER, 1, 1, {shift:.10g}
*NODE PRINT, NSET=UPPER, TOTALS=ONLY
RF
*END STEP
"""


@pytest.mark.skipif(shutil.which("ccx") is None, reason="no CalculiX")
def test_calculix_shears_two_blocks_with_the_stick_slope_of_the_law(surface):
    line = [*LAW, "--calculix", "joint.inp", "--json", "c.json", "--at-pressure", "500"]
    assert cli.main([*line, "--no-check"]) == 0
    table = json.loads(Path("c.json").read_text(encoding="utf-8"))["tables"][1]
    curves = table["curves"]
    at_500 = [
        np.interp(500, table["at"], curves[f"shear_stiffness_{axis}_MPa_per_um"]["value"])
        for axis in "xy"
    ]
    closure = np.interp(500, table["at"], curves["closure_um"]["value"])
    shift = 0.02 * 0.3 * 500 / np.mean(at_500)  # sticks [um]
    deck = BLOCKS.format(closure=-1e-3 * closure, shift=1e-3 * shift)
    Path("shear.inp").write_text(deck, encoding="ascii")
    subprocess.run(["ccx", "shear"], cwd=surface, check=True, capture_output=True)
    last = Path("shear.dat").read_text(encoding="ascii").split("\n\n")[-1]
    force = float(last.split()[0])  # over 1 mm2: a shear stress [MPa]
    assert force / shift == pytest.approx(np.mean(at_500), rel=0.05)
    slope = re.search(r"^\*FRICTION\n0\.3, (.+)$", Path("joint.inp").read_text(), re.M)
    assert force / (1e-3 * shift) == pytest.approx(float(slope[1]), rel=0.01)
