"""Tables of laws for MOOSE, Ansys and COMSOL, read back by strict readers of their formats."""

import json
import re

import numpy as np
import pytest

from gen import cli
from gen.law.cubics import short_name
from gen.law.programs import conversions
from gen.quantities import IN_LAWS
from tests.maps import waves

LAW = (
    "law",
    "a.npy",
    "--side=100",
    "--pressure=50:1000:5:log",
    "--young=210e3",
    "--young=210e3",
    "--poisson=0.3",
    "--poisson=0.3",
    "--conductivity=50",
    "--friction=0.2",
    "--no-grid-error",
    "--no-check",
)
UNITS = ("mm", "si", "um")
NUMBER = r"-?\d+(?:\.\d+)?(?:e[-+]\d+)?"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with the files of a law in each system of units, and with its JSON."""
    folder = tmp_path_factory.mktemp("programs")
    np.save(folder / "a.npy", waves(24, 2))
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for units in UNITS:
            names = [
                f"--moose={units}.csv",
                f"--ansys={units}.inp",
                f"--comsol={units}.txt",
            ]
            assert cli.main([*LAW, *names, f"--units={units}", "--json=law.json"]) == 0
    return folder


def expected(folder, units):
    """Return the columns of the law over pressure in a system of units, by short names."""
    table = json.loads((folder / "law.json").read_text(encoding="utf-8"))["tables"][1]
    curves = {name: curve["value"] for name, curve in table["curves"].items()}
    curves["pressure_MPa"] = table["at"]
    factors = conversions(units)
    columns = {}
    for name, values in curves.items():
        factor = factors[IN_LAWS[name].law_unit].factor
        columns[short_name(name)] = factor * np.array(values)
    return columns


def comments_and_rest(path, mark):
    """Return the lines of a file without the comment at its top, each of at most 100 letters."""
    lines = path.read_text(encoding="ascii").splitlines()
    comment = [line for line in lines if line.startswith(mark)]
    assert all(len(line) <= 100 for line in comment)
    return "\n".join(comment), [line for line in lines if not line.startswith(mark)]


def read_moose(path):
    """Read a CSV file as MOOSE's DelimitedFileReader does: comments, titles, numbers."""
    _, (titles, *rows) = comments_and_rest(path, "#")
    numbers = np.array([[float(cell) for cell in row.split(",")] for row in rows])
    return dict(zip(titles.split(","), numbers.T, strict=True))


def read_apdl(path):
    """Read tables of APDL: their primary variables, arguments and values, by their names."""
    _, lines = comments_and_rest(path, "!")
    tables = {}
    for line in lines:
        dimension = re.fullmatch(r"\*DIM,([A-Z]\w*),TABLE,(\d+),1,1,(PRESSURE|GAP)", line)
        if dimension:
            name, rows, variable = dimension.groups()
            assert len(name) <= 32
            tables[name] = (variable, np.full((int(rows), 2), np.nan))
            continue
        name, row, column, number = re.fullmatch(
            rf"(\w+)\((\d+),([01])\)=({NUMBER})", line
        ).groups()
        tables[name][1][int(row) - 1, int(column)] = float(number)
    for _, numbers in tables.values():
        assert np.isfinite(numbers).all()
        assert (np.diff(numbers[:, 0]) > 0).all()  # arguments of a table rise
    return tables


def read_comsol(path):
    """Read COMSOL's spreadsheet format: comments, then rows of numbers."""
    comment, rows = comments_and_rest(path, "%")
    numbers = np.array([[float(cell) for cell in row.split()] for row in rows])
    text = re.sub(r"\n%\s*", " ", comment)
    argument, functions = re.search(
        r"Argument: (\w+)\. Functions, in this order: ([\w, ]+)\.", text
    ).groups()
    return dict(zip([argument, *functions.split(", ")], numbers.T, strict=True))


def require_law(columns, law):
    """Check that columns are those of a law, behind a row for first touch, within 1e-3."""
    assert columns.keys() >= {"pressure", "closure", "area", "conductance"}
    for name, values in columns.items():
        np.testing.assert_allclose(values[1:], law[name], rtol=1e-3, err_msg=name)
    for name in ("pressure", "closure", "area", "conductance"):
        assert columns[name][0] == 0


def require_continued(closures, pressures, law):
    """Check pressures over closures: the law, and a further point far away on each side.

    Programs that hold the end values and those that continue the end lines then have no tension in
    an open gap, and follow the last slope of the law behind its last point.
    """
    np.testing.assert_allclose(closures[2:-1], law["closure"], rtol=1e-3)
    np.testing.assert_allclose(pressures[2:-1], law["pressure"], rtol=1e-3)
    assert closures[1] == pressures[0] == pressures[1] == 0
    assert closures[-1] == -closures[0] >= 100 * closures[-2]
    last, far = np.diff(pressures[-3:]) / np.diff(closures[-3:])
    assert far == pytest.approx(last, rel=1e-6)


@pytest.mark.parametrize("units", UNITS)
def test_moose_reads_the_columns_of_the_law(folder, units):
    columns = read_moose(folder / f"{units}.csv")
    law = expected(folder, units)
    require_law(columns, law)
    assert columns.keys() == law.keys()
    inverse = read_moose(folder / f"{units}-closure.csv")
    assert list(inverse) == ["closure", "pressure"]
    require_continued(inverse["closure"], inverse["pressure"], law)


@pytest.mark.parametrize("units", UNITS)
def test_comsol_reads_the_columns_of_the_law(folder, units):
    law = expected(folder, units)
    columns = read_comsol(folder / f"{units}.txt")
    assert next(iter(columns)) == "pressure"
    require_law(columns, law)
    inverse = read_comsol(folder / f"{units}-closure.txt")
    assert list(inverse) == ["closure", "pressure"]
    require_continued(inverse["closure"], inverse["pressure"], law)


@pytest.mark.parametrize("units", UNITS)
def test_ansys_reads_the_columns_of_the_law(folder, units):
    law = expected(folder, units)
    tables = read_apdl(folder / f"{units}.inp")
    beginning = units.upper()
    variable, over_closure = tables.pop(f"{beginning}_PRESSURE")
    assert variable == "GAP"
    require_continued(*over_closure.T, law)
    names = {name.removeprefix(f"{beginning}_").lower() for name in tables}
    assert names == law.keys() - {"pressure"}
    for name, (variable, numbers) in tables.items():
        column = law[name.removeprefix(f"{beginning}_").lower()]
        assert variable == "PRESSURE"
        np.testing.assert_allclose(numbers[1:, 0], law["pressure"], rtol=1e-3)
        np.testing.assert_allclose(numbers[1:, 1], column, rtol=1e-3)


def test_every_unit_of_laws_has_one_in_files():
    units = {quantity.law_unit for quantity in IN_LAWS.values()}
    for system in UNITS:
        assert conversions(system).keys() == units


@pytest.mark.parametrize("program", ["comsol", "moose"])
def test_the_second_file_of_a_program_replaces_no_input(here, refused, program):
    np.savetxt("a-closure.txt", waves(24, 2))
    line = ["law", "a-closure.txt", "--side=100", "--pressure=1:9:3"]
    assert "is an input" in refused(cli, *line, f"--{program}", "a.txt")
