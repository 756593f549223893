"""Parts are made once, each by its command; failures and signals end what they should."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from page_parts import WRITE, inputs, long_part, makes, part, record, shows_made

from bench.__main__ import main
from bench.page import run as running
from bench.page.html import write_page
from bench.page.parts import Part
from bench.page.run import Outcome
from gen.runtime.lock import lock_folder


def test_parts_are_made_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    parts = [part("one", WRITE), part("two", WRITE)]
    assert makes(tmp_path, parts) == Outcome()
    capsys.readouterr()
    assert makes(tmp_path, parts) == Outcome()
    assert (tmp_path / "one" / "made.txt").read_text() == "x"
    said = capsys.readouterr().err.splitlines()
    assert said == ["[1/2] one: is there", "[2/2] two: is there"]


def test_a_part_that_fails_is_named_and_does_not_stop_the_others(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    failing = part("one", "-m bench hertz")  # no folder: code 2 and one line
    outcome = makes(tmp_path, [failing, part("two", WRITE)])
    assert outcome == Outcome(failed=("one",))
    assert (tmp_path / "two" / "made.txt").exists()
    found = record(failing, tmp_path)
    assert found.code == 2
    assert "Missing option" in found.told[-1]
    assert "Missing option" in capsys.readouterr().err
    page = write_page([failing], inputs(tmp_path)).read_text(encoding="utf-8")
    assert "Missing option" in page
    assert makes(tmp_path, [failing]).failed == ("one",)  # tried again, not taken as made


def test_only_parts_of_the_run_are_made(tmp_path: Path) -> None:
    parts = [part("one", WRITE), long_part("two", WRITE)]
    makes(tmp_path, parts)
    assert not (tmp_path / "two").exists()
    makes(tmp_path, parts, full=True)
    assert (tmp_path / "two" / "made.txt").exists()


def failing_check(name: str, *, judges: bool, crashes: bool = False) -> Part:
    said = "Traceback" if crashes else "bad"
    command = (
        f"-c s=__import__('sys');open('{{folder}}/made.txt','a').write('x');"
        f"s.stderr.write('{said}');s.exit(1)"
    )
    return Part(name, "Chapter", name, command, command, shows_made, judges=judges)


def test_a_failed_check_is_shown_and_stays_failed(tmp_path: Path) -> None:
    checks = failing_check("checks", judges=True)
    for _ in range(2):  # made, and then there
        assert makes(tmp_path, [checks]).failed == ("checks",)
    assert (tmp_path / "checks" / "made.txt").read_text() == "x"
    assert "<p>x</p>" in write_page([checks], inputs(tmp_path)).read_text(encoding="utf-8")


@pytest.mark.parametrize(("judges", "crashes"), [(False, False), (True, True)])
def test_a_crash_is_no_failed_check(tmp_path: Path, *, judges: bool, crashes: bool) -> None:
    crashed = failing_check("crashed", judges=judges, crashes=crashes)
    for _ in range(2):  # it is tried again
        assert makes(tmp_path, [crashed]).failed == ("crashed",)
    assert (tmp_path / "crashed" / "made.txt").read_text() == "xx"
    assert "code 1" in write_page([crashed], inputs(tmp_path)).read_text(encoding="utf-8")


def test_what_was_made_while_the_code_changed_is_made_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    states = iter(["before", "after"])
    monkeypatch.setattr(running, "code_state", lambda: next(states))
    one = part("one", WRITE)
    makes(tmp_path, [one])
    monkeypatch.undo()
    assert "the code changed meanwhile" in record(one, tmp_path).told[-1]
    assert makes(tmp_path, [one]) == Outcome()
    assert (tmp_path / "one" / "made.txt").read_text() == "xx"


def test_a_short_run_leaves_a_full_one_alone(tmp_path: Path) -> None:
    both = part("both", WRITE.replace("'x'", "'short'"), full=WRITE.replace("'x'", "'full'"))
    makes(tmp_path, [both], full=True)
    makes(tmp_path, [both])
    assert (tmp_path / "both" / "made.txt").read_text() == "full"


def test_a_signal_ends_the_part_and_the_same_call_goes_on(tmp_path: Path) -> None:
    (tmp_path / "slow.py").write_text("import time\ntime.sleep(60)\n")
    code = (
        "import pathlib, sys\n"
        "from bench.page.parts import Part\n"
        "from bench.page.inputs import Inputs\n"
        "from bench.page.run import make\n"
        f"here = pathlib.Path({str(tmp_path)!r})\n"
        f"slow = Part('slow', '', '', {str(tmp_path / 'slow.py')!r}, '', lambda folder: [])\n"
        "outcome = make([slow], Inputs(here, here, here, False), lambda: None)\n"
        "sys.exit(128 + outcome.signal)\n"
    )
    process = subprocess.Popen([sys.executable, "-c", code])
    try:
        began = time.monotonic()
        while not (tmp_path / "slow" / "slow.printed.txt").exists():
            assert time.monotonic() < began + 60
            time.sleep(0.05)
        time.sleep(0.5)
        os.kill(process.pid, signal.SIGTERM)
        assert process.wait(timeout=60) == 128 + signal.SIGTERM
    finally:
        process.kill()
        process.wait()
    assert not (tmp_path / "slow" / "slow.part.json").exists()


def test_a_part_that_does_not_heed_a_signal_is_killed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    deaf = tmp_path / "deaf.py"
    deaf.write_text(
        "import os, signal, time\n"
        "signal.signal(signal.SIGINT, signal.SIG_IGN)\n"
        "os.kill(os.getppid(), signal.SIGINT)\n"
        "time.sleep(60)\n"
    )
    monkeypatch.setattr(running, "PATIENCE", 0.5)
    began = time.monotonic()
    outcome = makes(tmp_path, [part("deaf", str(deaf)), part("two", WRITE)])
    assert outcome.signal == signal.SIGINT
    assert time.monotonic() < began + 30
    assert not (tmp_path / "two").exists()


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


def test_a_folder_that_another_run_writes_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "report"
    with lock_folder(output):
        assert main(["run", "-o", str(output), "--only", "hertz"]) == 2
        said = capsys.readouterr().err.splitlines()
        assert len(said) == 1
        assert "report is being written by host" in said[0]
    assert not output.exists()
