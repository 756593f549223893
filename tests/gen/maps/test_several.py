"""Several maps of one command: a row each, mean and deviation, and maps that cannot be read."""

import contextlib
import io
import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from gen import cli
from gen.maps.several import are_several, summary
from tests.maps import waves

SIDE = ["--side", "100"]


def write_maps(folder):
    """Write a folder of three maps and a text that is none."""
    (folder / "many").mkdir()
    for seed in range(3):
        np.save(folder / f"many/s{seed}.npy", waves(20, seed))
    (folder / "many/notes.txt").write_text("measured on a Monday\n")


@pytest.fixture
def maps(here):
    """A folder of three maps and a text that is none, in the working directory."""
    write_maps(here)
    return here


def run(*arguments, ends=0):
    assert cli.main([*map(str, arguments)]) == ends


ROWS = [
    {
        "row": "surface",
        "surface": "a",
        "x": 1.0,
        "word": "yes",
        "some": "",
        "wild": math.inf,
    },
    {
        "row": "surface",
        "surface": "b",
        "x": 2.0,
        "word": "no",
        "some": 3.0,
        "wild": math.inf,
    },
]


def test_a_summary_has_numbers_where_all_rows_have_one():
    mean, deviation = summary(ROWS)
    assert (mean["row"], mean["surface"], mean["x"]) == ("mean", "2 surfaces", 1.5)
    assert (mean["word"], mean["some"], mean["wild"]) == ("", "", math.inf)
    assert deviation["x"] == pytest.approx(math.sqrt(0.5))
    assert deviation["wild"] == ""


def test_one_map_does_not_scatter():
    _, deviation = summary(ROWS[:1])
    assert deviation["x"] == ""


def test_loads_that_differ_by_rounding_do_not_scatter():
    rows = [{**ROWS[0], "x": 0.3}, {**ROWS[0], "x": 0.1 + 0.2}]
    _, deviation = summary(rows)
    assert deviation["x"] == 0.0


def test_two_files_are_several():
    assert are_several([Path("a"), Path("b")])
    assert not are_several([Path("a.npy")])


@dataclass(frozen=True)
class Described:
    """What a command gives of several maps, and of each of them alone."""

    output: str
    errors: str
    table: pd.DataFrame
    document: dict[str, Any]
    alone: pd.DataFrame  # rows of the maps alone, one after the other
    column: str  # a column with numbers
    loads: int  # number of rows of each map

    @property
    def surfaces(self):
        """The rows of maps."""
        return self.table[self.table.row == "surface"]


SEEDS = (1, 0, 1, 2)  # the first map is named twice, once by its folder


@pytest.fixture(
    scope="module", params=[["describe"], ["contact", "--pressure", "1e-3,5e-3"]]
)
def described(request, tmp_path_factory):
    """A command of several maps and of files that are none."""
    name, *loads = request.param
    folder = tmp_path_factory.mktemp("described")
    write_maps(folder)
    output = io.StringIO()
    errors = io.StringIO()
    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.chdir(folder)
        inputs = ["many/s1.npy", "many", "none.npy"]
        with contextlib.redirect_stdout(output), contextlib.redirect_stderr(errors):
            run(name, *inputs, *loads, *SIDE, "--csv", "all.csv", "--json", "all.json")
        alone = []
        for seed in SEEDS:
            run(name, f"many/s{seed}.npy", *loads, *SIDE, "--csv", "one.csv")
            alone.append(pd.read_csv("one.csv"))
    return Described(
        output.getvalue(),
        errors.getvalue(),
        pd.read_csv(folder / "all.csv"),
        json.loads((folder / "all.json").read_text()),
        pd.concat(alone, ignore_index=True),
        "area_percent" if loads else "Sq",
        len(loads[-1].split(",")) if loads else 1,
    )


def test_what_cannot_be_read_is_named_and_left_out(described):
    assert "warning: left out: many/notes.txt" in described.errors
    missing = "warning: left out: none.npy: is neither a file nor a folder"
    assert missing in described.errors
    assert {*described.document["left_out"]} == {"many/notes.txt", "none.npy"}


def test_a_row_of_a_map_is_that_of_the_map_alone(described):
    names = [f"many/s{seed}.npy" for seed in SEEDS for _ in range(described.loads)]
    assert described.surfaces.surface.tolist() == names
    pd.testing.assert_frame_equal(
        described.surfaces[described.alone.columns].reset_index(drop=True),
        described.alone,
        check_dtype=False,
        rtol=1e-9,
    )


@pytest.mark.parametrize("kind", ["mean", "standard deviation"])
def test_mean_and_deviation_are_those_over_the_maps(described, kind):
    numbers = described.alone[described.column].to_numpy()
    values = numbers.reshape(len(SEEDS), described.loads)
    expected = values.mean(0) if kind == "mean" else values.std(0, ddof=1)
    found = described.table[described.table.row == kind][described.column]
    np.testing.assert_allclose(found, expected, 1e-9, 1e-12)
    assert "standard deviation" in described.output


def test_the_document_has_the_rows_of_the_table(described):
    rows = described.document["rows"]
    assert [row["row"] for row in rows] == described.table.row.tolist()
    numbers = [row[described.column] for row in rows]
    np.testing.assert_allclose(numbers, described.table[described.column])


@pytest.mark.parametrize("command", [["describe"], ["contact", "--delta", "0.1"]])
def test_one_file_is_as_before_and_may_be_json(maps, capsys, command):
    name, *loads = command
    run(name, "many/s0.npy", *loads, *SIDE, "--csv", "one.csv", "--json", "one.json")
    assert "standard deviation over" not in capsys.readouterr().out
    (line,) = pd.read_csv("one.csv").to_dict("records")
    assert "row" not in line
    assert "surface" not in line
    (row,) = json.loads(Path("one.json").read_text())["rows"]
    assert row["surface"] == "many/s0.npy"
    column = "area_percent" if loads else "Sq"
    assert row[column] == pytest.approx(line[column])


def test_loads_that_are_not_solved_cost_a_map_these_alone(maps, capsys):
    ask = ["contact", "many", "--pressure", "1e-3,5e-2", *SIDE, "--max-iterations", "3"]
    run(*ask, "--csv", "few.csv")
    found = pd.read_csv("few.csv")
    surfaces = found[found.row == "surface"]
    assert 0 < len(surfaces) < 6
    assert "not solved, left out" in capsys.readouterr().err
    for load, rows in surfaces.groupby("given_pressure_MPa"):
        (mean,) = found[
            (found.row == "mean") & (found.given_pressure_MPa == load)
        ].surface
        assert mean == f"{len(rows)} surfaces"


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (
            ["describe", "many", *SIDE, "--spectrum", "x.csv"],
            "--spectrum x.csv: is of one surface",
        ),
        (
            ["describe", "many", *SIDE, "--plot", "x.png"],
            "--plot x.png: is of one surface",
        ),
        (
            ["contact", "many", *SIDE, "--delta", "1", "--plot", "x.png"],
            "is of one surface",
        ),
        (
            ["contact", "many", *SIDE, "--delta", "1", "--csv", "many/s0.npy"],
            "is an input",
        ),
        (
            ["contact", "many", "--delta", "1"],
            "none of 4 maps could be used, the first: ",
        ),
        (["describe", "none.npy"], "none.npy"),
    ],
)
def test_what_several_maps_cannot_have_is_refused_in_one_line(
    maps, capsys, arguments, word
):
    run(*arguments, ends=2)
    assert word in capsys.readouterr().err.splitlines()[-1]
    assert not list(Path().glob("x.*"))
