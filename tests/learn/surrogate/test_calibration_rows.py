"""Rows that calibrate intervals: those of another database, by `learn fit --calibrate-on`."""

import pytest

from gen import cli as gen_cli
from learn import Surrogate, cli


def run(*arguments):
    return cli.main([str(argument) for argument in arguments])


@pytest.fixture(scope="module")
def other(tmp_path_factory):
    folder = tmp_path_factory.mktemp("other")
    (folder / "scene.toml").write_text("samples = 40\nseed = 5\n[surface]\nnodes = 33\n")
    arguments = ["run", str(folder / "scene.toml"), "-o", str(folder / "other.h5")]
    assert gen_cli.main(arguments) == 0
    return folder / "other.h5"


def test_rows_of_another_database_calibrate(solved, other, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert run("fit", solved, "--calibrate-on", other, "-o", "a.surrogate") == 0
    assert "72 rows train, 40 calibrate, 18 test" in capsys.readouterr().err
    card = Surrogate.load("a.surrogate").card
    assert card["calibration"]["database"] == str(other)
    assert card["database"] == str(solved)
    assert card["nodes"] == [33, 33]
    assert "databases" not in card
    assert run("card", "a.surrogate") == 0
    assert f"calibrated by 40 rows of {other}" in capsys.readouterr().out
    assert run("predict", "a.surrogate", "x.npy", "--delta", "3", "--interval", "0.98") == 2
    assert "calibrated by 40 rows, which reach 0.975 at most" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ((), "has another grid or hardness than the training"),
        (("--features", "paper"), "contact.hardness"),
    ],
)
def test_another_kind_of_database_is_refused(
    solved, yielding, tmp_path, monkeypatch, capsys, options, words
):
    monkeypatch.chdir(tmp_path)
    assert run("fit", solved, "--calibrate-on", yielding, "-o", "a.surrogate", *options) == 2
    said = capsys.readouterr().err.strip()
    assert words in said
    assert not list(tmp_path.iterdir())


def test_the_same_rows_are_no_calibration(solved, mirrored, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for path, words in ((solved, str(solved)), (mirrored, "boundary")):
        assert run("fit", solved, "--calibrate-on", path, "-o", "a.surrogate") == 2
        (said,) = capsys.readouterr().err.strip().splitlines()
        assert words in said
