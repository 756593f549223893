"""The page of all reports: its parts are made once, and what they hold is shown as it is."""

import csv
import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
import typer

from bench.__main__ import app as bench
from bench.__main__ import main
from bench.circumstances import circumstances
from bench.page import run as running
from bench.page.content import Absent, Content, Figure, Table, Words
from bench.page.html import write_page
from bench.page.inputs import Inputs
from bench.page.part import Part
from bench.page.parts import PARTS
from bench.page.record import Record, read
from bench.page.run import Outcome, make
from bench.page.table import tabulated
from bench.picture import new_figure, save
from gen.runtime.errors import InputError
from learn.cli import app as learn

WRITE = "-c open('{folder}/made.txt','a').write('x')"


def written(name: str, rows: list[list[object]], folder: Path) -> Path:
    path = folder / name
    folder.mkdir(parents=True, exist_ok=True)
    with path.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file).writerows(rows)
    return path


def shows_made(folder: Path) -> list[Content]:
    return [Words((folder / "made.txt").read_text())]


def part(name: str, quick: str, full: str = "") -> Part:
    return Part(name, "Chapter", f"Title of {name}", quick, full or quick, shows_made)


def long_part(name: str, full: str) -> Part:
    return Part(name, "Chapter", f"Title of {name}", "", full, shows_made)


def inputs(folder: Path, *, full: bool = False) -> Inputs:
    return Inputs(folder, folder / "paper.h5", folder / "comparison", full)


def record(part: Part, folder: Path) -> Record:
    found = read(inputs(folder).making(part).path)
    assert found is not None
    return found


def makes(
    folder: Path, parts: list[Part], *, full: bool = False, said: list[str] | None = None
) -> Outcome:
    remark = (said if said is not None else []).append
    return make(parts, inputs(folder, full=full), remark, lambda: None)


# --- making ------------------------------------------------------------------


def test_parts_are_made_once(tmp_path: Path) -> None:
    parts = [part("one", WRITE), part("two", WRITE)]
    assert makes(tmp_path, parts) == Outcome()
    said: list[str] = []
    assert makes(tmp_path, parts, said=said) == Outcome()
    assert (tmp_path / "one" / "made.txt").read_text() == "x"
    assert said == ["[1/2] one: is there", "[2/2] two: is there"]


def test_another_command_or_commit_makes_a_part_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    makes(tmp_path, [part("one", WRITE)])
    makes(tmp_path, [part("one", WRITE.replace("'x'", "'y'"))])
    assert (tmp_path / "one" / "made.txt").read_text() == "xy"
    other = circumstances() | {"commit": "another"}
    monkeypatch.setattr("bench.page.record.circumstances", lambda: other)
    makes(tmp_path, [part("one", WRITE.replace("'x'", "'y'"))])
    assert (tmp_path / "one" / "made.txt").read_text() == "xyy"


def test_a_part_that_fails_is_named_and_does_not_stop_the_others(tmp_path: Path) -> None:
    said: list[str] = []
    failing = part("one", "-m bench hertz")  # no folder: code 2 and one line
    outcome = makes(tmp_path, [failing, part("two", WRITE)], said=said)
    assert outcome == Outcome(failed=("one",))
    assert (tmp_path / "two" / "made.txt").exists()
    found = record(failing, tmp_path)
    assert found.code == 2
    assert "Missing option" in found.told[-1]
    assert any("Missing option" in line for line in said)
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


def test_other_inputs_make_a_part_anew(tmp_path: Path) -> None:
    reading = part("reading", WRITE + "#{database}")
    (tmp_path / "paper.h5").write_text("a")
    makes(tmp_path, [reading])
    makes(tmp_path, [reading])
    assert (tmp_path / "reading" / "made.txt").read_text() == "x"
    os.utime(tmp_path / "paper.h5", ns=(0, 10**18))
    makes(tmp_path, [reading])
    assert (tmp_path / "reading" / "made.txt").read_text() == "xx"


def test_what_is_not_there_is_left_out_of_a_command(tmp_path: Path) -> None:
    wishing = part("wishing", "-m bench paper [--cost {cost}] [--comparison {comparison}]")
    assert inputs(tmp_path).arguments(wishing) == ["-m", "bench", "paper"]
    written("cost.csv", [["solve"], [1]], tmp_path / "cost")
    assert inputs(tmp_path).arguments(wishing)[3:] == ["--cost", str(tmp_path / "cost")]


def test_a_short_run_leaves_a_full_one_alone(tmp_path: Path) -> None:
    both = part("both", WRITE.replace("'x'", "'short'"), full=WRITE.replace("'x'", "'full'"))
    makes(tmp_path, [both], full=True)
    makes(tmp_path, [both])
    assert (tmp_path / "both" / "made.txt").read_text() == "full"


def test_a_part_that_cannot_be_shown_does_not_hide_the_others(tmp_path: Path) -> None:
    def without_file(folder: Path) -> list[Content]:
        return [Table(folder / "none.csv", "Nothing.")]

    one = Part("one", "First", "No table", WRITE, WRITE, without_file)
    two = part("two", WRITE)
    makes(tmp_path, [one, two])
    text = write_page([one, two], inputs(tmp_path)).read_text(encoding="utf-8")
    assert "none.csv: cannot be read as a table" in text
    assert "<p>x</p>" in text


def test_a_signal_ends_the_part_and_the_same_call_goes_on(tmp_path: Path) -> None:
    (tmp_path / "slow.py").write_text("import time\ntime.sleep(60)\n")
    code = (
        "import pathlib, sys\n"
        "from bench.page.part import Part\n"
        "from bench.page.inputs import Inputs\n"
        "from bench.page.run import make\n"
        f"here = pathlib.Path({str(tmp_path)!r})\n"
        f"slow = Part('slow', '', '', {str(tmp_path / 'slow.py')!r}, '', lambda folder: [])\n"
        "outcome = make([slow], Inputs(here, here, here, False), print, lambda: None)\n"
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


def test_record_says_where_and_with_what(tmp_path: Path) -> None:
    makes(tmp_path, [part("one", WRITE)])
    path = inputs(tmp_path).making(part("one", WRITE)).path
    found = json.loads(path.read_text())
    assert found["command"].startswith("python -c ")
    assert {"code", "seconds", "created", "commit", "machine", "versions"} <= found.keys()
    path.write_text("{")
    with pytest.raises(InputError, match="cannot be read"):
        makes(tmp_path, [part("one", WRITE)])


# --- the page ----------------------------------------------------------------


def contents(folder: Path) -> list[Content]:
    """One of each kind, wide and long."""
    figure = new_figure(16, 4)
    figure.subplots().plot([0, 1], [1, 0])
    data = written("data.csv", [["delta_um", "r2"], [0.1 + 0.2, 1]], folder)
    wide: list[list[object]] = [[f"column_{i}" for i in range(30)], [1.5 * i for i in range(30)]]
    cases: list[list[object]] = [
        ["case", "error", "verdict"],
        ["<b>bold</b> & plain", "1e-15", "passed"],
        ["bad one", "nan", "failed: too far"],
    ]
    return [
        Figure(save(figure, folder / "wide.png"), "A line that falls.", data=(data,)),
        Table(data, "Two numbers."),
        Table(written("wide.csv", wide, folder), "Very wide.", "python -m bench " + "x" * 300),
        Table(written("cases.csv", cases, folder), "Cases.", verdict="verdict"),
        Words("First line,\n  then " + "x" * 500, typed=True),
        Words("y" * 500),
        Absent("Peers", "pip install them"),
    ]


@pytest.fixture
def shown(tmp_path: Path) -> Path:
    """A page with everything on it."""
    one = Part("one", "First", "All kinds", WRITE, WRITE, contents)
    two = Part("two", "Second", "Not made", "", WRITE, contents)
    makes(tmp_path, [one])
    return write_page([one, two], inputs(tmp_path))


def test_page_stands_alone(shown: Path) -> None:
    text = shown.read_text(encoding="utf-8")
    addresses = re.findall(r'(?:src|href)="([^"]*)"', text)
    assert addresses
    assert all(address.startswith(("data:", "#")) for address in addresses)
    assert not re.search(r"@import|<script|url\(", text)


def test_page_shows_what_there_is_and_says_what_is_not(shown: Path) -> None:
    text = shown.read_text(encoding="utf-8")
    assert "&lt;b&gt;bold&lt;/b&gt; &amp; plain" in text
    assert text.count('<tr class="failed">') == 1
    assert "2 stiff and extreme cases judged" in text
    assert "1 failed" in text
    assert "Left out: Peers. pip install them" in text
    assert "Not here. It is made by: python -m bench run --full" in text
    assert 'alt="A line that falls."' in text
    assert "delta [µm]" in text
    assert ">0.3<" in text


def test_page_links_hold_all_digits(shown: Path) -> None:
    import base64

    text = shown.read_text(encoding="utf-8")
    (source,) = set(re.findall(r'download="data.csv" href="data:text/csv;base64,([^"]*)"', text))
    assert base64.b64decode(source) == (shown.parent / "one" / "data.csv").read_bytes()
    assert b"0.30000000000000004" in base64.b64decode(source)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", ""),
        ("nan", "nan"),
        ("NaN", "NaN"),
        ("infinity", "infinity"),
        ("inf", "∞"),
        ("15878", "15,878"),
        ("129", "129"),
        ("1.0", "1"),
        ("0.30000000000000004", "0.3"),
        ("1.23456e-12", "1.235e-12"),
        ("some words", "some words"),
    ],
)
def test_numbers_are_short(text: str, expected: str, tmp_path: Path) -> None:
    data = written("data.csv", [["value", "other"], [text, 1]], tmp_path)
    assert tabulated(Table(data, "")).rows[0].cells[0].text == expected


def test_tables_without_a_column_are_refused(tmp_path: Path) -> None:
    data = written("data.csv", [["value"], [1]], tmp_path)
    with pytest.raises(InputError, match="has no column nothing"):
        tabulated(Table(data, "", columns=("nothing",)))
    with pytest.raises(InputError, match="cannot be read as a table"):
        tabulated(Table(tmp_path / "none.csv", ""))


# --- the commands ------------------------------------------------------------


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


def test_names_of_parts_are_those_of_their_folders() -> None:
    names = [part.name for part in PARTS]
    assert len(names) == len(set(names))
    for each in PARTS:
        assert each.full, each.name
        _assert_a_command(inputs(Path("report")), each)


def _assert_a_command(given: Inputs, each: Part) -> None:
    """Its words are those of a command that there is; options are asked of the command itself."""
    for full in (False, True):
        arguments = inputs(given.output, full=full).arguments(each)
        if not arguments:
            continue
        assert arguments[0] == "-m"
        if arguments[1] == "pytest":
            continue
        program: Any = {"bench": bench, "learn": learn}[arguments[1]]
        command = typer.main.get_command(program).commands[arguments[2]]
        known = {option for parameter in command.params for option in parameter.opts}
        assert {word for word in arguments[3:] if word.startswith("-")} <= known, arguments


# --- in a browser ------------------------------------------------------------


@pytest.mark.parametrize("width", [360, 1440])
def test_browser_shows_the_page_without_error_or_overflow(shown: Path, width: int) -> None:
    from browser import look

    seen = look(shown, width)
    assert seen.complaints == []
    assert seen.content_width <= width
    assert seen.broken_pictures == 0
    assert seen.shown_pictures == 1
