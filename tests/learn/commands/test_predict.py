"""The level of intervals that nobody asks for: the largest that holds, up to 90 %, and told."""

import contextlib
import io
import shutil
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from comparisons import run, table
from databases import database_of

from gen import cli as gen_cli
from gen.database import Reader
from gen.generation.sample import surface_numbered
from learn import Surrogate

FEW = "samples = 60\nsamples_per_surface = 12\n[surface]\nnodes = 17\n"
SIDE = ["--side", "1000"]
LEVEL = 0.8
"""Level that the four surfaces of the training reach."""

ASK = ["predict", "few.surrogate", "s.npy", *SIDE, "--delta", "12,15"]
NOTE = "intervals of 80 %: 4 surfaces calibrate them and reach no more"


class Told(NamedTuple):
    """What a command has printed."""

    out: str
    err: str


def told_by(*arguments, code=0):
    """Run a command of learn, which has to end with this exit code; return what it prints."""
    with (
        contextlib.redirect_stdout(io.StringIO()) as out,
        contextlib.redirect_stderr(io.StringIO()) as err,
    ):
        assert run(*arguments) == code, err.getvalue()
    return Told(out.getvalue(), err.getvalue())


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A database of five surfaces, one of which is for the test, and the first of them."""
    folder = tmp_path_factory.mktemp("few")
    database_of(folder, FEW, "few")
    with Reader(folder / "few.h5") as reader:
        np.save(folder / "s.npy", surface_numbered(reader.scene, 0))
    return folder


@pytest.fixture(scope="module")
def fitted(folder):
    """What the fit of the surrogate of this database has printed."""
    options = ["-o", folder / "few.surrogate", "--model", "kernel-ridge"]
    return told_by("fit", folder / "few.h5", *options)


@pytest.fixture
def few(folder, fitted, here):
    """The working directory, with the database, the surface and the surrogate."""
    for name in ("few.h5", "s.npy", "few.surrogate"):
        (here / name).symlink_to(folder / name)
    return here


@pytest.mark.usefixtures("few")
def test_the_largest_level_that_holds_is_told_by_fit_and_card(fitted):
    assert Surrogate.load("few.surrogate").largest_level == LEVEL
    told = "intervals hold up to a level of 80 % only"
    assert told in fitted.err
    assert told in told_by("card", "few.surrogate").out


@pytest.mark.usefixtures("few")
def test_predictions_get_the_largest_level_that_holds_and_a_note():
    out = told_by(*ASK).out
    assert NOTE in out
    assert "Predictions with 80 % intervals" in out


@pytest.mark.usefixtures("few")
def test_predictions_at_the_same_level_are_the_same_without_a_note():
    told_by(*ASK, "-o", "p.csv")
    assert NOTE not in told_by(*ASK, "-o", "same.csv", "--interval", LEVEL).out
    assert Path("p.csv").read_bytes() == Path("same.csv").read_bytes()


@pytest.mark.usefixtures("few")
def test_a_level_that_does_not_hold_is_refused():
    told = told_by(*ASK, "--interval", "0.9", code=2)
    assert "which reach 0.8 at most" in told.err


@pytest.mark.usefixtures("few")
def test_a_law_gets_the_largest_level_that_holds_and_a_note():
    out = told_by("law", *ASK[1:-1], "10,12,15").out
    assert NOTE in out
    assert "80 % conformal interval" in out


@pytest.mark.usefixtures("few")
@pytest.mark.parametrize(("options", "share"), [([], 90), (["--interval", "0.95"], 95)])
def test_a_population_has_a_band_at_any_level(options, share):
    """The band is the scatter between its surfaces, not the surrogate's intervals."""
    ask = ["law", "few.surrogate", "few.h5", "--surfaces", "4", "--delta", "10,12,15"]
    told = told_by(*ask, *options, "--csv", "law.csv")
    assert f"{share} % of further surfaces lie inside" in told.out
    assert "RuntimeWarning" not in told.err
    assert {"area_percent_std", "area_percent_surface_4"} <= {*table("law.csv")[0]}


@pytest.mark.usefixtures("few")
def test_python_takes_the_level_that_is_given():
    surrogate = Surrogate.load("few.surrogate")
    heights = np.load("s.npy")
    with np.errstate(all="ignore"):
        beyond = surrogate.predict(heights, 1000.0, 12.0)
    held = surrogate.predict(heights, 1000.0, 12.0, level=surrogate.largest_level)
    assert beyond.high["force"] == np.inf
    assert np.isfinite(held.high["force"])


@pytest.mark.usefixtures("few")
def test_a_table_of_several_maps_has_a_prediction_for_each_and_none_for_their_mean():
    shutil.copy("s.npy", "again.npy")
    describe = ["describe", "s.npy", "again.npy", *SIDE, "--csv", "maps.csv"]
    assert gen_cli.main(describe) == 0
    told_by("predict", "few.surrogate", "maps.csv", "--delta", "12", "-o", "p.csv")
    first, second = table("p.csv")
    assert first == second
