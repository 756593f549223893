"""How commands end: memory that runs out, paths that are no files, long complaints."""

import pytest

from gen import cli

SCENE = 'title = "Rauheit ä€中 ±"\nsamples = 3\n[surface]\nnodes = 9\n'


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.toml").write_text(SCENE, encoding="utf-8")
    return tmp_path


def test_memory_that_runs_out_anywhere_is_one_line(folder, monkeypatch, capsys):
    def out_of_memory(*_):
        raise MemoryError("Unable to allocate 7 TiB")

    monkeypatch.setattr("gen.scene.load", out_of_memory)
    assert cli.main(["estimate", "scene.toml"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("gen: this needs more memory than there is: Unable to allocate 7 TiB;")
    assert "are allowed here" in line


def test_loops_of_links_and_the_root_are_no_files(folder, capsys):
    (folder / "one").symlink_to("other")
    (folder / "other").symlink_to("one")
    cases = (
        ["run", "scene.toml", "-o", "/"],
        ["run", "scene.toml", "-o", "one"],
        ["run", "one", "-o", "rows.h5"],
        ["info", "one"],
        ["merge", "one", "-o", "rows.h5"],
        ["describe", "one", "--side", "9"],
    )
    for arguments in cases:
        assert cli.main(arguments) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert "/" in line or "one" in line


def test_a_complaint_about_a_long_text_is_short(folder, capsys):
    assert cli.main(["info", "x" * 5000 + ".h5"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("gen: xxx")
    assert " ... xxx" in line
    assert line.endswith("File name too long")
    assert len(line) < 1300
