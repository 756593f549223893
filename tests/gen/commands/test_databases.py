"""Commands about databases: their exit codes, and what they print."""

import re
from pathlib import Path

import h5py
import pytest

from gen import cli
from gen.schema import PHYSICS

SCENE = "samples = 4\ntitle = 'Small'\n[surface]\nnodes = 9\n[contact]\nhardness = [0.1, 0.2]\n"


@pytest.fixture
def database(here, capsys):
    """A small database, small.h5, of the scene small.toml."""
    Path("small.toml").write_text(SCENE)
    assert cli.main(["run", "small.toml", "-o", "small.h5"]) == 0
    capsys.readouterr()
    return here / "small.h5"


@pytest.fixture
def damaged(database):
    """The database with a row whose force is not that of its checksum."""
    with h5py.File(database, "r+") as file:
        file["force"][2] = 1.5
    return database


def printed(capsys, *line):
    """Run a command line that succeeds, and return what it prints on standard output."""
    assert cli.main([*line]) == 0
    return capsys.readouterr().out


def test_a_run_counts_its_rows(database, capsys):
    out = printed(capsys, "run", "small.toml", "-o", str(database))
    assert out == f"{database}: 4 rows done, 0 failed, 0 pending\n"


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("rows", ["0-3", "1:", "a:b"])
def test_rows_that_are_no_numbers_are_refused(rows, refused):
    Path("small.toml").write_text(SCENE)
    line = refused(cli, "run", "small.toml", "-o", "a.h5", "--rows", rows)
    assert f"--rows '{rows}': give two row numbers, as 0:1000" in line


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("limit", ["0", "-1", "nan", "1e30"])
def test_a_limit_that_no_timer_takes_is_refused(limit, refused):
    Path("small.toml").write_text(SCENE)
    line = refused(cli, "run", "small.toml", "-o", "a.h5", "--sample-limit", limit)
    assert "give seconds, a number above 0, at most" in line


@pytest.mark.usefixtures("here")
def test_a_dry_run_writes_nothing(capsys):
    Path("small.toml").write_text(SCENE)
    out = printed(capsys, "run", "small.toml", "-o", "small.h5", "--dry-run")
    assert "  output    small.h5 does not exist yet; nothing was written" in out
    assert not Path("small.h5").exists()


@pytest.mark.usefixtures("here")
def test_a_plan_has_the_range_of_the_hardness(capsys):
    Path("small.toml").write_text(SCENE)
    out = printed(capsys, "run", "small.toml", "-o", "small.h5", "--dry-run")
    assert "  hardness  0.1 to 0.2 MPa" in out


@pytest.mark.parametrize(("ranks", "noun"), [("2", "1 worker:"), ("3", "2 workers:")])
@pytest.mark.usefixtures("here")
def test_an_estimate_counts_the_workers(ranks, noun, capsys):
    Path("small.toml").write_text(SCENE)
    out = printed(capsys, "estimate", "small.toml", "--ranks", ranks)
    assert re.search(rf"^  time      \S+ s on {noun}", out, flags=re.MULTILINE)


def test_info_shows_the_tables_of_the_scene(database, capsys):
    lines = printed(capsys, "info", str(database)).splitlines()
    (contact,) = [line for line in lines if line.startswith("  scene     [contact]")]
    assert "hardness = [0.1, 0.2]" in contact


def test_info_shows_the_title_once(database, capsys):
    assert printed(capsys, "info", str(database)).count("Small") == 1


def test_info_says_how_results_have_changed_since(database, capsys):
    with h5py.File(database, "r+") as file:
        file.attrs["physics"] = PHYSICS - 1
    out = printed(capsys, "info", str(database))
    assert f"this version computes {PHYSICS})" in out
    assert f"            since physics {PHYSICS}, " in out


def test_a_sound_database_has_exit_code_0(database, capsys):
    out = printed(capsys, "check", str(database), "--recompute", "2")
    assert "sound; 4 rows done, 0 failed, 0 pending; 2 of them computed again" in out


def test_a_damaged_database_has_exit_code_1(damaged, capsys):
    assert cli.main(["check", str(damaged)]) == 1
    assert "row 2: checksum is not that of the row's bytes" in capsys.readouterr().out


def test_a_repaired_database_has_exit_code_0(damaged, capsys):
    out = printed(capsys, "check", str(damaged), "--repair")
    assert "1 row is pending now" in out
