"""How commands end: memory that runs out, paths that are no files, long complaints."""

import h5py
import numpy as np
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


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["run", "quick", "-o", "x.h5", "--rows", ""], "'' after '--rows' is empty"),
        (["run", "quick", "-o", "x.h5", "--rows="], "'--rows=' is empty"),
        (["run", "", "-o", "x.h5"], "'' after 'run' is empty"),
        (["contact", "h.npy", "--side", "", "--delta", "1"], "'' after '--side' is empty"),
        (["check", "x.h5", "--recompute", ""], "'' after '--recompute' is empty"),
    ],
)
def test_an_empty_argument_chooses_nothing(tmp_path, monkeypatch, capsys, arguments, said):
    """As `--rows "$ROWS"` where ROWS is not set: all rows were computed."""
    monkeypatch.chdir(tmp_path)
    assert cli.main(arguments) == 2
    assert said in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("delta", ["1e308", "1,1e61", "1e-61"])
def test_a_displacement_beyond_what_is_computed_is_told_what_is_allowed(
    tmp_path, monkeypatch, capsys, delta
):
    monkeypatch.chdir(tmp_path)
    np.save("h.npy", np.eye(9))
    assert cli.main(["law", "h.npy", "--side", "9", "--delta", delta]) == 2
    said = capsys.readouterr().err
    assert "1e-60 to 1e+60 um" in said
    assert "above 0" not in said


def test_a_number_that_is_not_the_stored_one_is_written_plainly(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "s.toml").write_text(SCENE, encoding="utf-8")
    assert cli.main(["run", "s.toml", "-o", "a.h5"]) == 0
    with h5py.File("a.h5", "r+") as file:
        file["height_mean"][:] = 5.0
    assert cli.main(["check", "a.h5"]) == 1
    assert "height_mean is not what this machine and these versions compute: 5.0 in" in (
        capsys.readouterr().out
    )
