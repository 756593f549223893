"""Contacts of one surface on the command line: bodies that yield, and the warning of those that do
not.
"""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import bem
from gen import cli
from gen.surface import generate

ROUGH = generate("diamond-square", 17, 0.7, 5.0, np.random.default_rng(4))
STEEL = ["--young", "210e3", "--poisson", "0.3"]
E_STAR = 210e3 / (1 - 0.3**2)


@pytest.fixture
def surface(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.chdir(tmp_path)
    np.save("rough.npy", ROUGH)
    return "rough.npy"


def contact(surface: str, *arguments: str) -> int:
    return cli.main(["contact", surface, "--side", "200", *arguments])


def test_a_contact_of_a_body_that_yields_is_printed_and_written(surface, capsys) -> None:
    load = ["--pressure", "100", *STEEL, "--hardness", "2000"]
    assert contact(surface, *load, "--csv", "one.csv") == 0
    told = capsys.readouterr()
    assert "warning" not in told.err
    (expected,) = bem.ladder(ROUGH, 200.0, pressures=[100.0], modulus=E_STAR, hardness=2000.0)
    depth = expected.yielded_depth.max()
    assert 0 < expected.yielded_percent < 100
    lines = {line[:24].strip(): line[24:].split() for line in told.out.splitlines()}
    assert lines["hardness"] == ["2000", "MPa"]
    assert lines["yielded nodes"][0] == f"{expected.yielded_percent:.6g}"
    assert lines["largest yielded depth"] == [f"{depth:.6g}", "um"]
    row = pd.read_csv("one.csv").iloc[0]
    assert row.hardness_MPa == row.largest_pressure_MPa == 2000
    assert row.yielded_percent == expected.yielded_percent
    assert row.largest_yielded_depth_um == pytest.approx(depth, rel=1e-12)
    assert row.area_percent >= 100 * 100 / 2000, "the mean contact pressure is at most the hardness"


def test_a_law_of_a_body_that_yields_has_its_columns(surface, capsys) -> None:
    load = ["--delta", "1:6:3", *STEEL, "--hardness", "4000"]
    assert contact(surface, *load, "--csv", "law.csv") == 0
    title, *rows = capsys.readouterr().out.splitlines()[-4:]
    assert title.split("  ")[-1].strip() == "depth um"
    assert "yielded %" in title
    table = pd.read_csv("law.csv")
    assert [float(row.split()[-2]) for row in rows] == pytest.approx(
        list(table.yielded_percent), rel=1e-5
    )
    assert (np.diff(table.largest_yielded_depth_um) > 0).all()


def test_loading_the_flattened_surface_again_is_elastic_up_to_the_load(surface, capsys) -> None:
    """Shakedown: the surface that 100 MPa leave bears them without yielding any further."""
    load = ["--pressure", "100", *STEEL, "--hardness", "2000"]
    assert contact(surface, *load, "--csv", "first.csv", "--flattened", "flat.npy") == 0
    flat, first = np.load("flat.npy"), pd.read_csv("first.csv").iloc[0]
    assert (flat <= ROUGH).all()
    assert (ROUGH - flat).max() == pytest.approx(first.largest_yielded_depth_um, rel=1e-9)
    assert contact("flat.npy", "--pressure", "100", *STEEL, "--csv", "again.csv") == 0
    again = pd.read_csv("again.csv").iloc[0]
    assert again.largest_pressure_MPa == pytest.approx(2000, rel=1e-3)
    assert again.area_percent == pytest.approx(first.area_percent, rel=0.02)
    capsys.readouterr()
    assert contact(surface, "--delta", "1", *STEEL, "--flattened", "flat2.npy") == 2
    assert "--flattened needs --hardness" in capsys.readouterr().err
    assert contact(surface, *load, "--flattened", "flat.txt") == 2
    assert "ends in .npy" in capsys.readouterr().err
    assert contact(surface, *load, "--flattened", "rough.npy") == 2
    assert "is an input: not replaced" in capsys.readouterr().err


def test_an_elastic_contact_says_which_option_lets_it_yield(surface, capsys) -> None:
    assert contact(surface, "--pressure", "100", *STEEL, "--csv", "elastic.csv") == 0
    told = capsys.readouterr()
    (warning,) = told.err.splitlines()
    assert "above E*/100 = 2308 MPa: real metals and polymers would have yielded" in warning
    assert warning.endswith("give --hardness")
    assert "yielded" not in told.out
    assert not {"hardness_MPa", "yielded_percent"} & set(pd.read_csv("elastic.csv").columns)
    assert contact(surface, "--delta", "3") == 0
    assert not capsys.readouterr().err, "without a modulus pressures mean nothing"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([*STEEL, "--hardness", "0"], "--hardness 0: the hardness must be above 0 MPa"),
        ([*STEEL, "--hardness", "-5"], "--hardness -5: the hardness must be above 0 MPa"),
        ([*STEEL, "--hardness", "inf"], "--hardness inf: the hardness must be above 0 MPa"),
        ([*STEEL, "--hardness", "nan"], "--hardness nan: the hardness must be above 0 MPa"),
        (["--hardness", "2000"], "--hardness 2000: give the modulus too (--young or --e-star)"),
        ([*STEEL, "--hardness", "2000", "--far-field", "compliant"], "compliant"),
        ([*STEEL, "--hardness", "100"], "hardness"),
        ([*STEEL, "--hardness", "99"], "hardness"),
    ],
)
def test_an_impossible_hardness_is_one_line(surface, capsys, arguments, message) -> None:
    assert contact(surface, "--pressure", "100", *arguments) == 2
    told = capsys.readouterr()
    (line,) = told.err.splitlines()
    assert message in line
    assert not told.out
