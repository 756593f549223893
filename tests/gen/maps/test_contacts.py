"""Contacts of one surface on the command line: bodies that yield, the warning of those that do not,
and patches without edges.
"""

import re
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import bem
from gen import cli
from gen.maps.answers import AnswerOptions, answers
from gen.surface import generate
from tests.bem.waves import random_waves

ROUGH = generate("diamond-square", 17, 0.7, 5.0, np.random.default_rng(4))
STEEL = ["--young", "210e3", "--poisson", "0.3"]


@pytest.fixture
def surface(here):
    np.save(here / "rough.npy", ROUGH)
    return "rough.npy"


def press(surface, *arguments):
    """Run `gen contact` on a map with a side of 200 um, and return the code of its end."""
    return cli.main(["contact", str(surface), "--side", "200", *arguments])


YIELDING = ["--pressure", "100", *STEEL, "--hardness", "2000"]


def test_loading_the_flattened_surface_again_is_elastic_up_to_the_load(surface):
    """Shakedown: the surface that 100 MPa leave bears them without yielding any further."""
    outputs = ["--csv", "first.csv", "--flattened", "flat.npy"]
    assert press(surface, *YIELDING, *outputs) == 0
    first = pd.read_csv("first.csv").iloc[0]
    again = ["--pressure", "100", *STEEL, "--csv", "again.csv"]
    assert press("flat.npy", *again) == 0
    second = pd.read_csv("again.csv").iloc[0]
    assert second.largest_pressure_MPa == pytest.approx(2000, rel=1e-3)
    assert second.area_percent == pytest.approx(first.area_percent, rel=0.02)


def test_the_flattened_surface_lies_below_by_the_depth_that_is_told(surface):
    outputs = ["--csv", "first.csv", "--flattened", "flat.npy"]
    assert press(surface, *YIELDING, *outputs) == 0
    depth = ROUGH - np.load("flat.npy")
    assert (depth >= 0).all()
    told = pd.read_csv("first.csv").largest_yielded_depth_um[0]
    assert depth.max() == pytest.approx(told, rel=1e-9)


def test_full_contact_has_no_gap(surface):
    """The mean of a gap that is 0 up to rounding is told as 0."""
    full = ["--pressure", "1", "--e-star", "1e-3", "--boundary", "mirror"]
    assert press(surface, *full, "--csv", "full.csv") == 0
    row = pd.read_csv("full.csv").iloc[0]
    assert row.area_percent == 100.0
    assert row.mean_gap_um == 0.0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ["--delta", "1", *STEEL, "--flattened", "flat2.npy"],
            "--flattened needs --hardness",
        ),
        ([*YIELDING, "--flattened", "flat.txt"], "ends in .npy"),
        ([*YIELDING, "--flattened", "rough.npy"], "is an input: not replaced"),
    ],
)
def test_a_flattened_surface_that_cannot_be_written_is_refused(
    surface, refused, arguments, message
):
    assert message in refused(cli, "contact", surface, "--side", "200", *arguments)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([*STEEL, "--hardness", "0"], "--hardness 0: the hardness must be between 1e-38"),
        (
            [*STEEL, "--hardness", "1e300"],
            "--hardness 1e+300: the hardness must be between",
        ),
        (
            ["--hardness", "2000"],
            "--hardness 2000: give the modulus too (--young or --e-star)",
        ),
        ([*STEEL, "--hardness", "2000", "--far-field", "compliant"], "compliant"),
    ],
)
def test_an_impossible_hardness_is_one_line(surface, refused, arguments, message):
    ask = ["contact", surface, "--side", "200", "--pressure", "100", *arguments]
    assert message in refused(cli, *ask)


WIDE = generate("diamond-square", 33, 0.7, 5.0, np.random.default_rng(6))[:, :30]
SIDES = ["--side", "330,300"]


@dataclass(frozen=True, eq=False)
class Pressed:
    """What `gen contact` prints and writes of a map with sides of 330 x 300 um."""

    lines: list[str]  # on standard output
    warnings: list[str]  # lines on standard error
    row: pd.Series  # last row of the table


@pytest.fixture
def press_wide(here, capsys):
    """Press heights with some options."""

    def pressed(heights, *options):
        np.save("wide.npy", heights)
        command = ["contact", "wide.npy", *SIDES, *options, "--csv", "out.csv"]
        assert cli.main(command) == 0
        printed = capsys.readouterr()
        row = pd.read_csv("out.csv").iloc[-1]
        return Pressed(printed.out.splitlines(), printed.err.splitlines(), row)

    return pressed


def test_a_free_patch_says_what_its_borders_carry_and_which_option_has_none(press_wide):
    pressure = bem.solve(WIDE, (330.0, 300.0), 2.0).pressure
    share = 1 - pressure[1:-1, 1:-1].sum() / pressure.sum()
    assert press_wide(WIDE, "--delta", "2").lines[-1] == (
        f"wide.npy: the outer 5 % on each side (12 % of the nodes) carry {100 * share:.3g} % of the"
        " force: if this is a piece of a larger surface, --boundary mirror leaves no edges"
    )


def test_borders_that_carry_nothing_are_not_told(press_wide):
    pressed = press_wide(WIDE, "--delta", "0")
    assert not any("--boundary" in line for line in pressed.lines)


def test_the_table_of_a_free_patch_has_no_boundary(press_wide):
    assert "boundary" not in press_wide(WIDE, "--delta", "2").row


def test_a_mirrored_patch_is_not_warned_of(press_wide):
    pressed = press_wide(WIDE, "--delta", "1", "--boundary", "mirror")
    assert not isinstance(pressed.row.warnings, str)


def test_a_map_that_is_not_periodic_is_warned_of(press_wide):
    stepped = WIDE + 20 * np.linspace(0, 1, 33)[:, None] ** 8
    pressed = press_wide(stepped, "--delta", "1", "--boundary", "periodic")
    [line] = pressed.warnings
    assert line.startswith("warning: opposite borders differ by ")
    assert line.endswith("the map is not periodic: --boundary mirror takes it as it is")
    assert pressed.row.warnings in line


def test_a_periodic_map_is_not_warned_of(press_wide):
    x, y = (2 * np.pi * np.arange(nodes) / nodes for nodes in WIDE.shape)
    waves = np.cos(x)[:, None] * np.cos(y)
    assert not press_wide(waves, "--delta", "0.1", "--boundary", "periodic").warnings


@pytest.mark.parametrize(
    ("loads", "refusal"),
    [
        (
            ["--delta", "1,100", "--boundary", "mirror"],
            "delta = 100 um has no equilibrium",
        ),
        (
            ["--pressure", "1,3000", *STEEL, "--hardness", "2000"],
            "pressure = 3000 MPa has no",
        ),
    ],
)
def test_a_load_without_equilibrium_is_refused_before_any_is_solved(
    surface, capsys, monkeypatch, loads, refusal
):
    def never(*_, **__):
        raise AssertionError

    monkeypatch.setattr(bem, "ladder", never)
    assert press(surface, *loads) == 2
    assert refusal in capsys.readouterr().err


HARD_LOADS = ["--pressure", "1:30000:6:log", *STEEL, "--max-iterations", "4"]
"""Loads of which the solver converges under some only."""


@dataclass(frozen=True, eq=False)
class Ladder:
    """What `gen contact` says and writes of `HARD_LOADS`."""

    path: Path  # of the map
    unsolved: list[str]  # warnings of loads that are not solved
    table: pd.DataFrame


@pytest.fixture(scope="module")
def ladder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("ladder")
    path = folder / "rough.npy"
    np.save(path, ROUGH)
    printed = StringIO()
    with redirect_stderr(printed):
        assert press(path, *HARD_LOADS, "--csv", str(folder / "few.csv")) == 0
    unsolved = [line for line in printed.getvalue().splitlines() if "not solved" in line]
    return Ladder(path, unsolved, pd.read_csv(folder / "few.csv"))


def test_each_load_that_is_not_solved_is_named(ladder):
    assert 0 < len(ladder.unsolved) == 6 - len(ladder.table) < 6
    solved = ladder.table.pressure_MPa
    loads = np.geomspace(1, 30000, 6)
    left_out = [load for load in loads if not np.isclose(load, solved).any()]
    for load, line in zip(left_out, ladder.unsolved, strict=True):
        assert line.startswith(f"warning: not solved, left out: {load:.6g} MPa: residual")


def test_a_load_that_is_not_solved_is_named_in_the_table(ladder):
    assert ladder.table.warnings.str.contains("not solved, left out").all()


def test_a_load_that_is_not_solved_costs_no_others(ladder):
    loads = ",".join(map(repr, ladder.table.pressure_MPa.tolist()))
    table = ladder.path.with_name("alone.csv")
    assert press(ladder.path, "--pressure", loads, *STEEL, "--csv", str(table)) == 0
    alone = pd.read_csv(table)
    np.testing.assert_allclose(ladder.table.delta_um, alone.delta_um, rtol=1e-4)


def test_loads_of_which_none_is_solved_are_refused(surface, capsys):
    loads = ["--pressure", "1000,2000", *STEEL, "--max-iterations", "1"]
    assert press(surface, *loads) == 2
    assert "rough.npy: 2000 MPa: residual" in capsys.readouterr().err


def test_no_flattened_surface_is_written_if_a_load_is_not_solved(surface, capsys):
    loads = ["--pressure", "1,30000", *STEEL, "--hardness", "9e4"]
    outputs = ["--csv", "few.csv", "--flattened", "flat.npy"]
    assert press(surface, *loads, "--max-iterations", "4", *outputs) == 2
    message = "flat.npy: not written, as not every load was solved"
    assert message in capsys.readouterr().err
    assert not Path("flat.npy").exists()


SLIPS = {
    "a modulus in GPa": (
        ["--pressure", "20", "--young", "210", "--hardness", "2000"],
        "is the modulus in GPa?",
    ),
    "no modulus": (
        ["--pressure", "20"],
        "E* is 1 MPa, the default without a modulus (--young or --e-star)",
    ),
    "a modulus in Pa": (
        ["--pressure", "20", "--young", "210e9"],
        "is the modulus in Pa?",
    ),
}


@pytest.mark.parametrize("slip", SLIPS)
def test_a_unit_that_slipped_is_told_of_a_contact(slip, surface, capsys):
    """On the terminal and in its table."""
    arguments, doubt = SLIPS[slip]
    assert press(surface, *arguments, "--csv", "out.csv") == 0
    assert doubt in capsys.readouterr().err
    assert doubt in pd.read_csv("out.csv").warnings[0]


@pytest.mark.parametrize("slip", SLIPS)
def test_a_unit_that_slipped_is_told_of_a_law(slip, surface, capsys):
    arguments, doubt = SLIPS[slip]
    code = cli.main(["law", surface, "--side", "200", *arguments])
    if code == 2:  # there is full contact only
        doubt = "; E* is "
    assert doubt in "".join(capsys.readouterr())


QUIET = {
    "normalised": ["--pressure", "0.001"],
    "steel": ["--pressure", "20", *STEEL, "--hardness", "2000"],
}


@pytest.mark.parametrize("use", QUIET)
def test_normalised_and_proper_use_of_a_contact_is_quiet(use, surface, capsys):
    assert press(surface, *QUIET[use], "--csv", "out.csv") == 0
    assert not capsys.readouterr().err
    assert not pd.read_csv("out.csv", keep_default_na=False).warnings[0]


@pytest.mark.parametrize("use", QUIET)
def test_normalised_and_proper_use_of_a_law_is_quiet(use, surface, capsys):
    cli.main(["law", surface, "--side", "200", *QUIET[use]])
    printed = "".join(capsys.readouterr()).splitlines()
    warnings = [line for line in printed if "warning" in line]
    assert all("this grid" in line for line in warnings)


LOAD = {"pressure": 100.0, "modulus": 210e3, "poisson": 0.3}


@dataclass(frozen=True, eq=False)
class Answered:
    """What `gen contact` prints and writes of a contact with further answers."""

    lines: dict[str, list[str]]  # words of each line by the name that it begins with
    row: pd.Series
    contact: bem.Contact  # solved by itself


@pytest.fixture(scope="module")
def answered(tmp_path_factory):
    folder = tmp_path_factory.mktemp("answered")
    np.save(folder / "rough.npy", ROUGH)
    options = ["--spots", "--stiffness", "--conductivity", "50", "--conductivity", "20"]
    load = [*STEEL, "--pressure", "100"]
    printed = StringIO()
    with redirect_stdout(printed):
        table = ["--csv", str(folder / "one.csv")]
        assert press(folder / "rough.npy", *load, *options, *table) == 0
    lines = {}
    for line in printed.getvalue().splitlines():
        name, *words = re.split(r"  +", line, maxsplit=1)
        if words:
            lines[name] = words[0].split()
    row = pd.read_csv(folder / "one.csv").iloc[0]
    return Answered(lines, row, bem.solve(ROUGH, 200.0, **LOAD))


def test_spots_are_printed_and_written(answered):
    spots = answered.contact.spots
    assert int(answered.lines["spots of contact"][0]) == spots.number
    assert answered.row.spots == spots.number
    assert answered.row.largest_spot_um2 == spots.areas[0]
    assert answered.row.largest_spot_percent == 100 * spots.largest_share


def test_the_area_in_the_continuum_is_written(answered):
    area = answered.row.continuum_area_percent
    assert area == answered.contact.continuum_area_percent < answered.row.area_percent


def test_stiffnesses_are_written(answered):
    row = answered.row
    contact = answered.contact
    assert row.stiffness_N_per_m == pytest.approx(contact.stiffness)
    assert row.interface_stiffness_N_per_m == pytest.approx(contact.interface_stiffness)
    assert "loading_stiffness_N_per_m" not in row


def test_the_stiffness_of_the_interface_is_printed_with_what_it_leaves_out(answered):
    words = answered.lines["interface's stiffness"]
    assert words[1:4] == ["N/um,", "without", "the"]


def test_conductances_are_written(answered):
    contact = answered.contact
    conductance = 1e-6 * contact.conductance(50, 20)
    assert answered.row.conductance_W_per_K == pytest.approx(conductance)
    nominal = 17**2 * (200 / 16 * 1e-6) ** 2
    per_area = 1e-6 * contact.interface_conductance(50, 20) / nominal
    assert answered.row.interface_conductance_W_per_m2_K == pytest.approx(per_area)


def test_nothing_is_computed_that_is_not_asked_for():
    contact = bem.solve(ROUGH, 200.0, **LOAD)
    answers(contact, AnswerOptions())
    assert not {"spots", "punch", "_flows"} & vars(contact).keys()
    answers(contact, AnswerOptions(spots=True))
    assert "punch" not in vars(contact)


def test_nothing_is_written_that_is_not_asked_for(surface):
    assert press(surface, *STEEL, "--pressure", "100", "--csv", "one.csv") == 0
    columns = " ".join(pd.read_csv("one.csv").columns)
    assert not re.search("stiffness|spot|flow", columns)


@pytest.fixture(scope="module")
def flows(tmp_path_factory):
    """The folder of the table and the picture of a light contact and one that seals."""
    folder = tmp_path_factory.mktemp("flows")
    np.save(folder / "rough.npy", ROUGH)
    outputs = ["--csv", str(folder / "two.csv"), "--plot", str(folder / "two.png")]
    loads = [*STEEL, "--force", "1e4,1e12", "--flow"]
    printed = StringIO()
    with redirect_stdout(printed):
        assert press(folder / "rough.npy", *loads, *outputs) == 0
    assert "hydraulic_aperture_y_um" in printed.getvalue()
    return folder


@pytest.mark.few(1)
@pytest.mark.parametrize(("axis", "name"), [(0, "x"), (1, "y")])
def test_the_flow_through_the_gap_is_written(axis, name, flows):
    light = pd.read_csv(flows / "two.csv").iloc[0]
    contact = bem.solve(ROUGH, 200.0, force=1e4, modulus=light.modulus_MPa)
    flow = contact.flow(axis)
    assert light[f"flow_factor_{name}"] == pytest.approx(flow.factor, rel=1e-9)
    aperture = light[f"hydraulic_aperture_{name}_um"]
    assert aperture == pytest.approx(flow.aperture, rel=1e-9)


def test_nothing_flows_through_a_contact_that_seals(flows):
    sealed = pd.read_csv(flows / "two.csv").iloc[1]
    assert sealed.flow_factor_x == 0
    assert sealed.flow_factor_y == 0


def test_the_flow_is_drawn(flows):
    assert (flows / "two.png").stat().st_size > 0


def test_a_contact_that_seals_is_said_to(surface, capsys):
    assert press(surface, *STEEL, "--force", "1e12", "--flow") == 0
    assert "no flow: the contact seals" in capsys.readouterr().out


PERIODIC = ["--e-star", "1e4", "--boundary", "periodic"]


def press_waves(folder, *options):
    """Press waves of 8 nodes each with a side of 1,000 um, and return what is printed."""
    np.save(folder / "waves.npy", 1000 * random_waves(1, 8, 0.8, 1)(64))
    command = ["contact", str(folder / "waves.npy"), "--side", "1000", *PERIODIC]
    printed = StringIO()
    with redirect_stdout(printed):
        assert cli.main([*command, "--pressure", "300", *options]) == 0
    return printed.getvalue()


@dataclass(frozen=True, eq=False)
class Continuum:
    """The area in the continuum of waves, and its error by the grid."""

    words: list[str]  # of its line
    row: pd.Series
    area: float  # solved by itself [%]
    error: float  # [%]


@pytest.fixture(scope="module")
def continuum(tmp_path_factory):
    folder = tmp_path_factory.mktemp("continuum")
    printed = press_waves(folder, "--csv", str(folder / "one.csv"))
    [line] = re.findall("^area in the continuum .*$", printed, re.M)
    contact = bem.solve(
        np.load(folder / "waves.npy"),
        1e3,
        pressure=300,
        modulus=1e4,
        boundary="periodic",
    )
    return Continuum(
        words=line.split(),
        row=pd.read_csv(folder / "one.csv").iloc[0],
        area=contact.continuum_area_percent,
        error=contact.grid_error().area_percent,
    )


def test_the_area_in_the_continuum_is_printed_with_its_error(continuum):
    area, _, error = continuum.words[4:7]
    assert float(error) == pytest.approx(continuum.error, rel=0.06)
    assert float(area) == pytest.approx(continuum.area, abs=continuum.error / 10)


def test_the_area_in_the_continuum_has_no_more_digits_than_are_true(continuum):
    area = continuum.words[4]
    error = f"{continuum.error:.2g}"
    assert len(area.partition(".")[2]) <= len(error.partition(".")[2])


def test_the_error_of_the_grid_is_written_if_it_resolves_the_surface(continuum):
    assert continuum.row.resolved == "yes"
    assert continuum.row.continuum_area_error_percent == pytest.approx(continuum.error)


def test_the_error_of_the_grid_can_be_left_out(tmp_path):
    table = tmp_path / "one.csv"
    printed = press_waves(tmp_path, "--no-grid-error", "--csv", str(table))
    assert "continuum" not in printed
    assert "resolved" not in pd.read_csv(table).columns


@pytest.mark.usefixtures("here")
def test_a_surface_that_the_grid_does_not_resolve_has_no_error():
    random = np.random.default_rng(0)
    np.save("fractal.npy", generate("diamond-square", 65, 0.5, 5.0, random))
    command = ["contact", "fractal.npy", "--side", "1000", "--e-star", "1e4"]
    assert cli.main([*command, "--pressure", "10", "--csv", "two.csv"]) == 0
    row = pd.read_csv("two.csv").iloc[0]
    assert row.resolved == "no"
    assert np.isnan(row.continuum_area_error_percent)
