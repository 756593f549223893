"""What a contact decides, asked for on the command line: spots, stiffness, conductance."""

import math
import re

import numpy as np
import pandas as pd
import pytest

import bem
from gen import cli
from gen.display.contacts import print_contact
from gen.measured import outcome
from gen.measured.outcome import NOTHING, Wanted, answers
from gen.surface import generate

ROUGH = generate("diamond-square", 17, 0.7, 5.0, np.random.default_rng(4))
STEEL = ["--young", "210e3", "--poisson", "0.3"]
LOAD = {"pressure": 100.0, "modulus": 210e3, "poisson": 0.3}


@pytest.fixture
def surface(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    np.save("rough.npy", ROUGH)
    return "rough.npy"


def contact(surface, *arguments):
    return cli.main(["contact", surface, "--side", "200", *STEEL, *arguments])


def test_answers_are_printed_and_written(surface, capsys):
    asked = ["--spots", "--stiffness", "--conductivity", "50", "--conductivity", "20"]
    assert contact(surface, "--pressure", "100", *asked, "--csv", "one.csv") == 0
    parts = (re.split(r"  +", line, maxsplit=1) for line in capsys.readouterr().out.splitlines())
    lines = {part[0]: part[1].split() for part in parts if len(part) == 2}
    expected = bem.solve(ROUGH, 200.0, **LOAD)
    row = pd.read_csv("one.csv").iloc[0]
    assert row.spots == expected.spots.number == int(lines["spots of contact"][0])
    assert row.largest_spot_um2 == expected.spots.areas[0]
    assert row.largest_spot_percent == 100 * expected.spots.largest_share
    assert row.corrected_area_percent == expected.corrected_area_percent < row.area_percent
    assert row.stiffness_N_per_m == pytest.approx(expected.stiffness)
    assert row.interface_stiffness_N_per_m == pytest.approx(expected.interface_stiffness)
    assert row.conductance_W_per_K == pytest.approx(1e-6 * expected.conductance(50, 20))
    nominal = 17**2 * (200 / 16 * 1e-6) ** 2
    alone = 1e-6 * expected.interface_conductance(50, 20)
    assert row.interface_conductance_W_per_m2_K == pytest.approx(alone / nominal)
    assert "loading_stiffness_N_per_m" not in row
    assert lines["interface's stiffness"][1:4] == ["N/m,", "without", "the"]


def test_a_law_has_a_column_for_each(surface, capsys):
    asked = ["--hardness", "4000", "--stiffness", "--boundary", "mirror"]
    assert contact(surface, "--pressure", "10:100:3", *asked, "--csv", "law.csv") == 0
    assert "loading_stiffness_N_per_m" in capsys.readouterr().out
    table = pd.read_csv("law.csv")
    assert (np.diff(table.stiffness_N_per_m) > 0).all()
    assert (table.loading_stiffness_N_per_m <= table.stiffness_N_per_m).all()
    assert table.loading_stiffness_N_per_m.iloc[-1] < table.stiffness_N_per_m.iloc[-1]
    assert (table.interface_stiffness_N_per_m == table.stiffness_N_per_m).all()


def test_full_contact_is_said_to_leave_no_interface(surface, capsys):
    assert contact(surface, "--pressure", "1e7", "--stiffness") == 0
    (line,) = [each for each in capsys.readouterr().out.splitlines() if "interface" in each]
    assert "inf" in line
    assert "full contact" in line


def test_nothing_is_computed_that_is_not_asked_for(surface, monkeypatch):
    solved = bem.solve(ROUGH, 200.0, **LOAD)
    assert answers(solved, NOTHING) == []
    assert not {"spots", "punch"} & vars(solved).keys()
    answers(solved, Wanted(spots=True))
    assert "punch" not in vars(solved)
    assert contact(surface, "--pressure", "100", "--csv", "one.csv") == 0
    columns = pd.read_csv("one.csv").columns
    assert not any("stiffness" in name or "spot" in name for name in columns)


def test_oblong_cells_have_no_corrected_area(surface, capsys):
    arguments = ["contact", surface, "--side", "200,100", *STEEL, "--pressure", "100"]
    assert cli.main([*arguments, "--spots", "--csv", "one.csv"]) == 0
    assert math.isnan(pd.read_csv("one.csv").corrected_area_percent[0])
    assert "needs square cells" in capsys.readouterr().out


@pytest.mark.parametrize("given", [["0"], ["-1"], ["inf"], ["nan"], ["1", "2", "3"]])
def test_impossible_conductivities_are_one_line(surface, capsys, given):
    options = [word for each in given for word in ("--conductivity", each)]
    assert contact(surface, "--pressure", "1", *options) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "--conductivity" in line


def test_a_solve_that_fails_is_one_line(surface, capsys, monkeypatch):
    def fail(*_):
        raise ArithmeticError("stiffness of 3 nodes in contact: residual 1.0e+00")

    monkeypatch.setattr(outcome, "_stiffness", fail)
    assert contact(surface, "--pressure", "1", "--stiffness") == 2
    assert "stiffness of 3 nodes" in capsys.readouterr().err


def test_the_far_field_has_a_line_where_it_is_another_number_than_delta(surface, capsys):
    assert contact(surface, "--pressure", "100") == 0
    assert "far-field displacement" not in capsys.readouterr().out
    given = bem.solve(ROUGH, 200.0, delta=1.0, far_field="compliant", kernel="concentrated-force")
    print_contact(given, 0.0, NOTHING)
    line = next(line for line in capsys.readouterr().out.splitlines() if line.startswith("far-f"))
    assert float(line.split()[2]) == pytest.approx(given.approach) != given.delta
