"""The level of intervals that nobody asks for: the largest that holds, up to 90 %, and told."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from comparisons import run, table
from databases import database_of

from gen import cli as gen_cli
from learn import Surrogate

FEW = "samples = 60\nsamples_per_surface = 12\n[surface]\nnodes = 17\n"
SIDE = ["--side", "1000"]


@pytest.fixture(scope="module")
def of_few(tmp_path_factory):
    """A folder with a database of five surfaces, one of which is for the test."""
    folder = tmp_path_factory.mktemp("few")
    database_of(folder, FEW, "few")
    return folder


@pytest.fixture
def few(of_few, here, capsys):
    """A surrogate of that database in the working directory, one of its surfaces, and its level."""
    shutil.copy(of_few / "few.h5", "few.h5")
    assert run("fit", "few.h5", "-o", "few.surrogate", "--model", "kernel-ridge") == 0
    level = Surrogate.load("few.surrogate").largest_level
    assert level == 0.8
    told = f"intervals hold up to a level of {100 * level:g} % only"
    assert told in capsys.readouterr().err
    assert run("card", "few.surrogate") == 0
    assert told in capsys.readouterr().out
    return level


@pytest.fixture
def surface(of_few):
    """The file of the first surface of the database."""
    from gen.database import Reader
    from gen.generation.sample import surface_numbered

    with Reader(of_few / "few.h5") as reader:
        np.save("s.npy", surface_numbered(reader.scene, 0))
    return "s.npy"


def test_questions_get_the_largest_level_that_holds(few, surface, capsys):
    note = f"intervals of {100 * few:g} %: 4 surfaces calibrate them and reach no more"
    ask = ["predict", "few.surrogate", surface, *SIDE, "--delta", "12,15"]
    assert run(*ask, "-o", "p.csv") == 0
    said = capsys.readouterr().out
    assert note in said
    assert f"Predictions with {100 * few:g} % intervals" in said
    assert run(*ask, "-o", "same.csv", "--interval", few) == 0
    assert note not in capsys.readouterr().out
    assert Path("p.csv").read_bytes() == Path("same.csv").read_bytes()
    assert run(*ask, "--interval", "0.9") == 2
    assert "which reach 0.8 at most" in capsys.readouterr().err
    assert run("law", "few.surrogate", surface, *SIDE, "--delta", "10,12,15") == 0
    said = capsys.readouterr().out
    assert note in said
    assert f"{100 * few:g} % conformal interval" in said


def test_a_population_has_a_band_at_any_level(few, capsys):
    """Which is the scatter between its surfaces, and not the surrogate's intervals."""
    ask = ["law", "few.surrogate", "few.h5", "--surfaces", "4", "--delta", "10,12,15"]
    for level in ([], ["--interval", "0.95"]):
        assert run(*ask, *level, "--csv", "law.csv") == 0
        said = capsys.readouterr()
        share = 100 * float(level[-1]) if level else 90
        assert f"{share:g} % of further surfaces lie inside" in said.out
        assert "RuntimeWarning" not in said.err
    rows = table("law.csv")
    assert {"area_percent_std", "area_percent_surface_4"} <= {*rows[0]}


def test_python_takes_the_level_that_is_given(few, surface):
    surrogate = Surrogate.load("few.surrogate")
    heights = np.load(surface)
    with np.errstate(all="ignore"):
        beyond = surrogate.predict(heights, 1000.0, 12.0)
    held = surrogate.predict(heights, 1000.0, 12.0, level=surrogate.largest_level)
    assert beyond.high["force"] == np.inf
    assert np.isfinite(held.high["force"])


def test_a_table_of_several_maps_has_a_prediction_for_each_and_none_for_their_mean(
    few, surface
):
    shutil.copy(surface, "again.npy")
    assert (
        gen_cli.main(["describe", surface, "again.npy", *SIDE, "--csv", "maps.csv"]) == 0
    )
    assert (
        run("predict", "few.surrogate", "maps.csv", "--delta", "12", "-o", "p.csv") == 0
    )
    first, second = table("p.csv")
    assert first == second
