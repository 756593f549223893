"""Contacts of one surface on the command line: bodies that yield, the warning of those that do not,
and patches without edges.
"""

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import bem
from gen import cli
from gen.maps.contacts import AnswerOptions, answers
from gen.surface import generate
from tests.bem.waves import random_waves

ROUGH = generate("diamond-square", 17, 0.7, 5.0, np.random.default_rng(4))
STEEL = ["--young", "210e3", "--poisson", "0.3"]


@pytest.fixture
def surface(here):
    np.save(here / "rough.npy", ROUGH)
    return "rough.npy"


def pressed(surface, *arguments):
    return cli.main(["contact", surface, "--side", "200", *arguments])


def test_loading_the_flattened_surface_again_is_elastic_up_to_the_load(surface, refused):
    """Shakedown: the surface that 100 MPa leave bears them without yielding any further."""
    load = ["--pressure", "100", *STEEL, "--hardness", "2000"]
    assert pressed(surface, *load, "--csv", "first.csv", "--flattened", "flat.npy") == 0
    flat, first = np.load("flat.npy"), pd.read_csv("first.csv").iloc[0]
    assert (flat <= ROUGH).all()
    assert (ROUGH - flat).max() == pytest.approx(first.largest_yielded_depth_um, rel=1e-9)
    assert pressed("flat.npy", "--pressure", "100", *STEEL, "--csv", "again.csv") == 0
    again = pd.read_csv("again.csv").iloc[0]
    assert again.largest_pressure_MPa == pytest.approx(2000, rel=1e-3)
    assert again.area_percent == pytest.approx(first.area_percent, rel=0.02)
    ask = ["contact", surface, "--side", "200"]
    for options, told in (
        (
            ["--delta", "1", *STEEL, "--flattened", "flat2.npy"],
            "--flattened needs --hardness",
        ),
        ([*load, "--flattened", "flat.txt"], "ends in .npy"),
        ([*load, "--flattened", "rough.npy"], "is an input: not replaced"),
    ):
        assert told in refused(cli, *ask, *options)


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


def solved(capsys, *arguments):
    """What a command says on standard error, and its table."""
    assert cli.main(["contact", "wide.npy", *SIDES, *arguments, "--csv", "out.csv"]) == 0
    return capsys.readouterr().err, pd.read_csv("out.csv").iloc[-1]


@pytest.mark.usefixtures("here")
def test_a_free_patch_says_what_its_borders_carry_and_which_option_has_none(capsys):
    np.save("wide.npy", WIDE)
    assert (
        cli.main(["contact", "wide.npy", *SIDES, "--delta", "2", "--csv", "out.csv"]) == 0
    )
    last = capsys.readouterr().out.splitlines()[-1]
    pressure = bem.solve(WIDE, (330.0, 300.0), 2.0).pressure
    share = 1 - pressure[1:-1, 1:-1].sum() / pressure.sum()
    assert last == (
        f"wide.npy: the outer 5 % on each side (12 % of the nodes) carry {100 * share:.3g} % of the"
        " force: if this is a piece of a larger surface, --boundary mirror leaves no edges"
    )
    assert "boundary" not in pd.read_csv("out.csv").columns
    assert cli.main(["contact", "wide.npy", *SIDES, "--delta", "0"]) == 0
    assert "--boundary" not in capsys.readouterr().out


@pytest.mark.usefixtures("here")
def test_a_map_that_is_not_periodic_is_warned_of(capsys):
    np.save("wide.npy", WIDE)
    _, row = solved(capsys, "--delta", "1", "--boundary", "mirror")
    assert not isinstance(row.warnings, str)
    np.save("wide.npy", WIDE + 20 * np.linspace(0, 1, 33)[:, None] ** 8)
    said, row = solved(capsys, "--delta", "1", "--boundary", "periodic")
    (line,) = said.splitlines()
    assert line.startswith("warning: opposite borders differ by ")
    assert line.endswith("the map is not periodic: --boundary mirror takes it as it is")
    assert row.warnings in line
    x, y = (2 * np.pi * np.arange(nodes) / nodes for nodes in WIDE.shape)
    np.save("wide.npy", np.cos(x)[:, None] * np.cos(y))
    said, _ = solved(capsys, "--delta", "0.1", "--boundary", "periodic")
    assert not said


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
    assert pressed(surface, *loads) == 2
    assert refusal in capsys.readouterr().err


def test_a_load_that_is_not_solved_is_named_and_costs_no_others(surface, capsys):
    ask = ["--pressure", "1:30000:6:log", *STEEL, "--max-iterations", "4"]
    assert pressed(surface, *ask, "--csv", "few.csv") == 0
    warned = [
        line for line in capsys.readouterr().err.splitlines() if "not solved" in line
    ]
    table = pd.read_csv("few.csv")
    assert 0 < len(warned) == 6 - len(table) < 6
    lost = [
        p
        for p in np.geomspace(1, 30000, 6)
        if not np.isclose(p, table.pressure_MPa).any()
    ]
    for each, line in zip(lost, warned, strict=True):
        assert line.startswith(f"warning: not solved, left out: {each:.6g} MPa: residual")
    assert table.warnings.str.contains("not solved, left out").all()
    alone = ",".join(map(repr, table.pressure_MPa.tolist()))
    assert pressed(surface, "--pressure", alone, *STEEL, "--csv", "alone.csv") == 0
    np.testing.assert_allclose(
        table.delta_um, pd.read_csv("alone.csv").delta_um, rtol=1e-4
    )
    ask[1] = "1000,2000"
    assert pressed(surface, *ask[:-1], "1") == 2
    assert "rough.npy: 2000 MPa: residual" in capsys.readouterr().err
    ask = ["--pressure", "1,30000", *STEEL, "--hardness", "9e4", "--max-iterations", "4"]
    assert pressed(surface, *ask, "--csv", "few.csv", "--flattened", "flat.npy") == 2
    assert (
        "flat.npy: not written, as not every load was solved" in capsys.readouterr().err
    )
    assert not Path("flat.npy").exists()


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (
            ["--pressure", "20", "--young", "210", "--hardness", "2000"],
            "is the modulus in GPa?",
        ),
        (
            ["--pressure", "20"],
            "E* is 1 MPa, the default without a modulus (--young or --e-star)",
        ),
        (["--pressure", "20", "--young", "210e9"], "is the modulus in Pa?"),
        (["--pressure", "0.001"], ""),
        (["--pressure", "20", *STEEL, "--hardness", "2000"], ""),
    ],
)
def test_units_that_slipped_are_told_and_normalised_use_is_quiet(
    surface, capsys, arguments, told
):
    """Of a contact on the terminal, in its table and on its picture; and of a law."""
    assert pressed(surface, *arguments, "--csv", "out.csv") == 0
    said = capsys.readouterr().err
    assert (told in said) if told else not said
    warnings = pd.read_csv("out.csv", keep_default_na=False).warnings[0]
    assert (told in warnings) if told else not warnings
    code = cli.main(["law", surface, "--side", "200", *arguments])  # 2: only full contact
    law = "".join(capsys.readouterr())
    told = told if code == 0 or not told else "; E* is "
    others = [
        each for each in law.splitlines() if "warning" in each and "this grid" not in each
    ]
    assert (told in law) if told else not others


LOAD = {"pressure": 100.0, "modulus": 210e3, "poisson": 0.3}


def test_answers_are_printed_and_written(surface, capsys):
    asked = ["--spots", "--stiffness", "--conductivity", "50", "--conductivity", "20"]
    assert pressed(surface, *STEEL, "--pressure", "100", *asked, "--csv", "one.csv") == 0
    parts = (
        re.split(r"  +", line, maxsplit=1)
        for line in capsys.readouterr().out.splitlines()
    )
    lines = {part[0]: part[1].split() for part in parts if len(part) == 2}
    expected = bem.solve(ROUGH, 200.0, **LOAD)
    row = pd.read_csv("one.csv").iloc[0]
    assert row.spots == expected.spots.number == int(lines["spots of contact"][0])
    assert row.largest_spot_um2 == expected.spots.areas[0]
    assert row.largest_spot_percent == 100 * expected.spots.largest_share
    assert (
        row.continuum_area_percent == expected.continuum_area_percent < row.area_percent
    )
    assert row.stiffness_N_per_m == pytest.approx(expected.stiffness)
    assert row.interface_stiffness_N_per_m == pytest.approx(expected.interface_stiffness)
    assert row.conductance_W_per_K == pytest.approx(1e-6 * expected.conductance(50, 20))
    nominal = 17**2 * (200 / 16 * 1e-6) ** 2
    alone = 1e-6 * expected.interface_conductance(50, 20)
    assert row.interface_conductance_W_per_m2_K == pytest.approx(alone / nominal)
    assert "loading_stiffness_N_per_m" not in row
    assert lines["interface's stiffness"][1:4] == ["N/m,", "without", "the"]


def test_nothing_is_computed_that_is_not_asked_for(surface, monkeypatch):
    solved = bem.solve(ROUGH, 200.0, **LOAD)
    answers(solved, AnswerOptions())
    assert not {"spots", "punch", "_flows"} & vars(solved).keys()
    answers(solved, AnswerOptions(spots=True))
    assert "punch" not in vars(solved)
    assert pressed(surface, *STEEL, "--pressure", "100", "--csv", "one.csv") == 0
    columns = pd.read_csv("one.csv").columns
    assert not any(
        "stiffness" in name or "spot" in name or "flow" in name for name in columns
    )


def test_the_flow_through_the_gap_is_printed_written_and_drawn(surface, capsys):
    given = "--force", "1e4,1e12", "--flow", "--csv", "two.csv", "--plot", "two.png"
    assert pressed(surface, *STEEL, *given) == 0
    assert "hydraulic_aperture_y_um" in capsys.readouterr().out
    light, sealed = (row for _, row in pd.read_csv("two.csv").iterrows())
    contact = bem.solve(ROUGH, 200.0, force=1e4, modulus=light.modulus_MPa)
    for axis, name in enumerate("xy"):
        flow = contact.flow(axis)
        assert light[f"flow_factor_{name}"] == pytest.approx(flow.factor, rel=1e-9)
        assert light[f"hydraulic_aperture_{name}_um"] == pytest.approx(
            flow.aperture, rel=1e-9
        )
        assert sealed[f"flow_factor_{name}"] == 0
    assert Path("two.png").stat().st_size > 0
    assert pressed(surface, *STEEL, "--force", "1e12", "--flow") == 0
    assert "no flow: the contact seals" in capsys.readouterr().out


def test_the_area_in_the_continuum_stands_beside_the_count_of_nodes(
    tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    np.save("waves.npy", 1000 * random_waves(1, 8, 0.8, 1)(64))
    given = [
        "contact",
        "waves.npy",
        "--side",
        "1000",
        "--e-star",
        "1e4",
        "--boundary",
        "periodic",
    ]
    assert cli.main([*given, "--pressure", "300", "--csv", "one.csv"]) == 0
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    (area,) = (line for line in lines if line[:4] == ["area", "in", "the", "continuum"])
    expected = bem.solve(
        np.load("waves.npy"), 1e3, pressure=300, modulus=1e4, boundary="periodic"
    )
    bar = expected.grid_error().area_percent
    assert float(area[6]) == pytest.approx(bar, rel=0.06)
    assert float(area[4]) == pytest.approx(expected.continuum_area_percent, abs=bar / 10)
    assert len(area[4].partition(".")[2]) <= len(f"{bar:.2g}".partition(".")[2])
    row = pd.read_csv("one.csv").iloc[0]
    assert row.resolved == "yes"
    assert row.continuum_area_error_percent == pytest.approx(bar)
    assert (
        cli.main([*given, "--pressure", "300", "--no-grid-error", "--csv", "one.csv"])
        == 0
    )
    assert "continuum" not in capsys.readouterr().out
    assert "resolved" not in pd.read_csv("one.csv").columns
    np.save(
        "waves.npy", generate("diamond-square", 65, 0.5, 5.0, np.random.default_rng(0))
    )
    assert cli.main([*given[:-2], "--pressure", "10", "--csv", "two.csv"]) == 0
    (row,) = pd.read_csv("two.csv").itertuples()
    assert row.resolved == "no"
    assert np.isnan(row.continuum_area_error_percent)
