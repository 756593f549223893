"""The commands that make a page, and those that they refuse."""

from pathlib import Path

import pytest

from bench.__main__ import main


def test_commands_make_and_rewrite_a_page(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    report = tmp_path / "new" / "report"
    arguments = ["run", "-o", str(report), "--only", "hertz"]
    assert main(arguments) == 0
    assert capfd.readouterr().out.split() == [str(report / "index.html")]
    assert (report / "hertz" / "hertz.csv").exists()
    (report / "index.html").unlink()
    assert main(["page", str(report)]) == 0
    text = (report / "index.html").read_text(encoding="utf-8")
    assert text.count("<img ") == 1
    assert f"python -m bench hertz -o {report / 'hertz'}" in text
    assert main(arguments) == 0
    assert "hertz: is there" in capfd.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["run", "-o", "here", "--only", "nothing"], "--only nothing: give one of solver, peers"),
        (["run", "-o", "here", "--only", "scale"], "--only scale: takes long, and needs --full"),
        (["run", "-o", "here", "--comparison", "nowhere"], "--comparison nowhere: give a folder"),
        (["run", "-o", "file"], "file is a file: give a folder"),
        (["run", "-o", "here", "--only", "cost", "--database", "none.h5"], "none.h5"),
        (["page", "nowhere"], "nowhere is not a folder"),
    ],
)
def test_bad_input_is_one_line(
    arguments: list[str],
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("file").touch()
    assert main(arguments) == 2
    said = capfd.readouterr().err
    assert message in said
    assert len(said.splitlines()) == 1
    assert "Traceback" not in said
