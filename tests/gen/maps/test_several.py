"""Several maps of one command: a row each, mean and deviation, and maps that cannot be read."""

import json
import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from gen import cli
from gen.maps.several import are_several, summary
from tests.maps import waves

SIDE = ["--side", "100"]


@pytest.fixture
def maps(here):
    """A folder of three maps and a text that is none, in the working directory."""
    (here / "many").mkdir()
    for seed in range(3):
        np.save(here / f"many/s{seed}.npy", waves(20, seed))
    Path("many/notes.txt").write_text("measured on a Monday\n")
    return here


def run(*arguments, ends=0):
    assert cli.main([*map(str, arguments)]) == ends


def test_a_summary_has_numbers_where_all_rows_have_one():
    rows = [
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
    mean, deviation = summary(rows)
    assert (mean["row"], mean["surface"], mean["x"]) == ("mean", "2 surfaces", 1.5)
    assert (mean["word"], mean["some"], mean["wild"]) == ("", "", math.inf)
    assert deviation["x"] == pytest.approx(math.sqrt(0.5))
    assert deviation["wild"] == ""
    assert summary(rows[:1])[1]["x"] == "", "one map does not scatter"
    assert are_several([Path("a"), Path("b")])
    assert not are_several([Path("a.npy")])


@pytest.mark.parametrize(
    "command", [["describe"], ["contact", "--pressure", "1e-3,5e-3"]]
)
def test_a_row_a_map_is_that_of_the_map_alone(maps, capsys, command):
    """Then mean and standard deviation; what cannot be read is named and costs no other."""
    name, *loads = command
    inputs = ["many/s1.npy", "many", "none.npy"]
    run(name, *inputs, *loads, *SIDE, "--csv", "all.csv", "--json", "all.json")
    said = capsys.readouterr()
    assert "warning: left out: many/notes.txt" in said.err
    assert "warning: left out: none.npy: is neither a file nor a folder" in said.err
    assert "standard deviation" in said.out
    found = pd.read_csv("all.csv")
    surfaces = found[found.row == "surface"]
    many = len(loads[-1].split(",")) if loads else 1
    assert surfaces.surface.tolist() == [
        f"many/s{seed}.npy" for seed in (1, 0, 1, 2) for _ in range(many)
    ]
    alone = []
    for seed in (1, 0, 1, 2):
        run(name, f"many/s{seed}.npy", *loads, *SIDE, "--csv", "one.csv")
        alone.append(pd.read_csv("one.csv"))
    alone = pd.concat(alone, ignore_index=True)
    pd.testing.assert_frame_equal(
        surfaces[alone.columns].reset_index(drop=True),
        alone,
        check_dtype=False,
        rtol=1e-9,
    )
    column = "area_percent" if loads else "Sq"
    values = alone[column].to_numpy().reshape(4, many)
    for kind, expected in (
        ("mean", values.mean(0)),
        ("standard deviation", values.std(0, ddof=1)),
    ):
        np.testing.assert_allclose(
            found[found.row == kind][column], expected, 1e-9, 1e-12
        )
    document = json.loads(Path("all.json").read_text())
    assert {*document["left_out"]} == {"many/notes.txt", "none.npy"}
    assert [row["row"] for row in document["rows"]] == found.row.tolist()
    numbers = [row[column] for row in document["rows"]]
    np.testing.assert_allclose(numbers, found[column])


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
