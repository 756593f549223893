"""Bad input is one clear line and exit code 2; nothing is written. tests/mpi has three ranks."""

import bad_input
import pytest

from gen import cli


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bad")
    bad_input.prepare(folder)
    return folder


@pytest.mark.parametrize(
    ("arguments", "word"), bad_input.CASES, ids=[" ".join(case) for case, _ in bad_input.CASES]
)
def test_bad_input_is_one_line_and_exit_code_2(folder, monkeypatch, capsys, arguments, word):
    monkeypatch.chdir(folder)
    before = {path.name: path.stat().st_mtime_ns for path in folder.iterdir()}
    assert cli.main(arguments) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    assert word in captured.err
    assert {path.name: path.stat().st_mtime_ns for path in folder.iterdir()} == before


def test_there_are_enough_cases():
    assert len(bad_input.CASES) >= 60
