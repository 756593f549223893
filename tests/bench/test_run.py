"""Parts are made once, each by its command; failures and signals end what they should."""

import json
import os
import re
import signal
import time
from dataclasses import replace

import pytest
from page_parts import WRITE, inputs, makes, part, record, shows_made, written

from bench import run as running
from bench.commands import main
from bench.page import write_page
from bench.record import circumstances, code_state
from bench.report import PARTS, Part
from bench.run import Outcome
from gen.runtime.errors import InputError


def test_parts_are_made_once(tmp_path, capsys):
    parts = [part("one", WRITE), part("two", WRITE)]
    assert makes(tmp_path, parts) == Outcome()
    capsys.readouterr()
    assert makes(tmp_path, parts) == Outcome()
    assert (tmp_path / "one" / "made.txt").read_text() == "x"
    said = capsys.readouterr().err.splitlines()
    assert said == ["[1/2] one: is there", "[2/2] two: is there"]
    path = inputs(tmp_path).path(parts[0])
    found = json.loads(path.read_text())
    assert found["command"].startswith("python -c ")
    assert {
        "code",
        "seconds",
        "created",
        "commit",
        "state",
        "machine",
        "versions",
    } <= found.keys()
    path.write_text("{")
    with pytest.raises(InputError, match="cannot be read"):
        makes(tmp_path, parts)


def test_a_part_that_fails_is_named_and_does_not_stop_the_others(tmp_path, capsys):
    failing = part("one", "-m bench cost")  # no folder: code 2 and one line
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


@pytest.mark.parametrize(
    ("judges", "said", "made", "shown"),
    [
        (True, "bad", "x", "<p>x</p>"),
        (False, "bad", "xx", "code 1"),
        (True, "Traceback", "xx", "code 1"),
    ],
    ids=["failed check", "no check", "crash"],
)
def test_a_failed_check_is_shown_and_stays_failed_and_a_crash_is_tried_again(
    tmp_path, *, judges, said, made, shown
):
    command = (
        "-c s=__import__('sys');open('{folder}/made.txt','a').write('x');"
        f"s.stderr.write('{said}');s.exit(1)"
    )
    checks = Part(
        "checks", "Chapter", "Checks", command, command, shows_made, judges=judges
    )
    for _ in range(2):
        assert makes(tmp_path, [checks]).failed == ("checks",)
    assert (tmp_path / "checks" / "made.txt").read_text() == made
    assert shown in write_page([checks], inputs(tmp_path)).read_text(encoding="utf-8")


def test_what_was_made_while_the_code_changed_is_made_anew(tmp_path, monkeypatch):
    states = iter(["before", "after"])
    monkeypatch.setattr(running, "code_state", lambda: next(states))
    one = part("one", WRITE)
    makes(tmp_path, [one])
    monkeypatch.undo()
    assert "the code changed meanwhile" in record(one, tmp_path).told[-1]
    assert makes(tmp_path, [one]) == Outcome()
    assert (tmp_path / "one" / "made.txt").read_text() == "xx"


def test_a_short_run_leaves_a_full_one_alone(tmp_path):
    both = part(
        "both", WRITE.replace("'x'", "'short'"), full=WRITE.replace("'x'", "'full'")
    )
    makes(tmp_path, [both], full=True)
    makes(tmp_path, [both])
    assert (tmp_path / "both" / "made.txt").read_text() == "full"


def test_a_part_that_does_not_heed_a_signal_is_killed(tmp_path, monkeypatch):
    deaf = tmp_path / "deaf.py"
    deaf.write_text(
        "import os, signal, time\n"
        "signal.signal(signal.SIGINT, signal.SIG_IGN)\n"
        "os.kill(os.getppid(), signal.SIGINT)\n"
        "time.sleep(600)\n"
    )
    monkeypatch.setattr(running, "END_LIMIT", 0.5)
    began = time.monotonic()
    parts = [part("deaf", str(deaf)), part("two", WRITE)]
    outcome = makes(tmp_path, parts)
    assert outcome.signal == signal.SIGINT
    assert time.monotonic() < began + 300
    assert not (tmp_path / "deaf" / "deaf.part.json").exists()
    assert not (tmp_path / "two").exists()


def test_parts_that_take_no_times_are_made_side_by_side(tmp_path, monkeypatch, capsys):
    """The two meet; alone ones are made before, and those that read the comparison last."""
    monkeypatch.setattr(running, "LANES", 2)
    meet = tmp_path / "meet.py"
    meet.write_text(
        "import sys, time\n"
        "from pathlib import Path\n"
        "own, other = map(Path, sys.argv[1:])\n"
        "own.touch()\n"
        "end = time.monotonic() + 60\n"
        "while not other.exists():\n"
        "    assert time.monotonic() < end\n"
        "    time.sleep(0.01)\n"
    )
    here, there = tmp_path / "here", tmp_path / "there"
    parts = [
        part("last", WRITE + "#{comparison}"),
        replace(part("two", f"{meet} {here} {there}"), beside=True),
        replace(part("three", f"{meet} {there} {here}"), beside=True),
        part("one", WRITE),
    ]
    assert makes(tmp_path, parts) == Outcome()
    said = [
        line.split()[1] for line in capsys.readouterr().err.splitlines() if line[0] == "["
    ]
    assert said[::3] == ["one", "last"]
    assert set(said[1:3]) == {"two", "three"}


def test_parts_that_take_hours_have_to_be_named_and_have_no_limit(tmp_path, monkeypatch):
    parts = [part("short", WRITE), replace(part("long", WRITE), named=True)]
    monkeypatch.setattr(running, "PARTS", parts)
    monkeypatch.setattr(running, "write_page", lambda *_: tmp_path / "index.html")
    assert main(["run", "-o", str(tmp_path)]) == 0
    assert (tmp_path / "short" / "made.txt").exists()
    assert not (tmp_path / "long").exists()
    monkeypatch.setattr(running, "COMMAND_LIMIT", 0.0)
    assert main(["run", "-o", str(tmp_path), "long"]) == 0
    assert (tmp_path / "long" / "made.txt").exists()


def test_a_part_that_hangs_is_ended_and_failed(tmp_path, monkeypatch):
    monkeypatch.setattr(running, "COMMAND_LIMIT", 0.0)
    monkeypatch.setattr(running, "END_LIMIT", 0.1)
    (tmp_path / "hangs.py").write_text("import signal\nsignal.pause()\n")
    hanging = part("one", str(tmp_path / "hangs.py"))
    assert makes(tmp_path, [hanging]) == Outcome(failed=("one",))
    assert not record(hanging, tmp_path).finished


def test_commands_make_and_rewrite_a_page(tmp_path, capfd):
    report = tmp_path / "new" / "report"
    arguments = ["run", "hertz", "-o", str(report)]
    assert main(arguments) == 0
    assert capfd.readouterr().out.split() == [str(report / "index.html")]
    assert (report / "hertz" / "hertz.csv").exists()
    (report / "index.html").unlink()
    assert main(["page", str(report)]) == 0
    text = (report / "index.html").read_text(encoding="utf-8")
    assert text.count("<img ") == 1
    assert f"asperity bench hertz -o {report / 'hertz'}" in text
    assert main(arguments) == 0
    assert "hertz: is there" in capfd.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["run", "nothing", "-o", "here"], "nothing: give one of accuracy"),
        (["run", "speedup", "-o", "here"], "speedup: takes long, and needs --full"),
        (["run", "cost", "-o", "here", "--database", "none.h5"], "none.h5"),
        (["page", "nowhere"], "nowhere is not a folder"),
    ],
)
def test_bad_input_is_one_line(arguments, message, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 2
    said = capfd.readouterr().err
    assert message in said
    assert len(said.splitlines()) == 1
    assert "Traceback" not in said


def test_what_is_not_there_is_left_out_of_a_command(tmp_path):
    wishing = part("wishing", "-m bench paper [--comparison {comparison}]")
    assert inputs(tmp_path).arguments(wishing) == ["-m", "bench", "paper"]
    compared = tmp_path / "comparison"
    written("scores.csv", [["r2"], [1]], compared)
    assert inputs(tmp_path).arguments(wishing)[3:] == ["--comparison", str(compared)]


def test_a_command_that_was_run_elsewhere_names_no_folder_of_that_machine(tmp_path):
    one = part("one", "-m bench one -o {folder}")
    here = inputs(tmp_path)
    there = (
        "python -m bench one --database '/a b/all/databases/paper.h5' -o '/a b/all/one'"
    )
    assert here.portable(one, there) == (
        "asperity bench one --database report/databases/paper.h5 -o report/one"
    )
    own = f"bench one -o {tmp_path / 'one'}"
    for command in (own, "bench other /data/one.csv"):
        assert here.portable(one, f"python -m {command}") == f"asperity {command}"
    assert here.portable(one, "python -m tests.faults") == "python -m tests.faults"
    assert here.portable(one, "") == ""


OTHER = WRITE.replace("'x'", "'y'")
"""Another command for the same file."""


def test_another_command_makes_a_part_anew(tmp_path):
    makes(tmp_path, [part("one", WRITE)])
    makes(tmp_path, [part("one", OTHER)])
    assert (tmp_path / "one" / "made.txt").read_text() == "xy"
    assert inputs(tmp_path).stale(part("one", OTHER)) == ""
    assert inputs(tmp_path).stale(part("one", WRITE)) == "other command"


def test_another_state_of_the_code_makes_a_part_anew(tmp_path, monkeypatch):
    other = circumstances() | {"state": "another"}
    monkeypatch.setattr("bench.record.circumstances", lambda: other)
    makes(tmp_path, [part("one", WRITE)])
    monkeypatch.undo()
    assert inputs(tmp_path).stale(part("one", WRITE)) == "other code"
    assert inputs(tmp_path).stale(part("one", OTHER)) == "other command, code"
    makes(tmp_path, [part("one", WRITE)])
    assert (tmp_path / "one" / "made.txt").read_text() == "xx"


def test_an_input_that_changed_makes_a_part_anew(tmp_path):
    reading = part("reading", WRITE + "#{database}")
    assert inputs(tmp_path).stale(reading) == "new"
    for day in (1, 1, 2):
        (tmp_path / "paper.h5").touch()
        os.utime(tmp_path / "paper.h5", ns=(0, day * 10**18))
        makes(tmp_path, [reading])
    assert (tmp_path / "reading" / "made.txt").read_text() == "xx"


def test_documents_and_results_are_no_code(tmp_path):
    for name in (
        "bem/solve.py",
        "bench/page.toml",
        "bench/results/a.toml",
        "docs/conf.py",
    ):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("a")
    before = code_state(tmp_path)
    for name, same in {
        "docs/conf.py": True,
        "bench/results/a.toml": True,
        "bench/page.toml": False,
        "learn/new.py": False,
    }.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("b")
        assert (code_state(tmp_path) == before) is same, name
        before = code_state(tmp_path)
    (tmp_path / "bem" / "solve.py").rename(tmp_path / "bem" / "solved.py")
    assert code_state(tmp_path) != before


@pytest.mark.parametrize(("full", "minutes"), [([], 10), (["--full"], 180)])
def test_runs_take_ten_minutes_or_three_hours_by_the_published_times(
    full, minutes, tmp_path, capfd
):
    assert main(["run", "-o", str(tmp_path / "report"), "--plan", *full]) == 0
    *_, last = capfd.readouterr().out.splitlines()
    time = re.search(r"(\d+) min by earlier records", last)
    assert time is not None
    assert int(time[1]) <= minutes, (
        "if a published record is of a busy machine, give `minutes` in the report's TOML file"
    )
    assert not (tmp_path / "report").exists()


def test_every_short_run_has_its_measured_time():
    short = {part.name for part in PARTS if part.quick}
    measured = {part.name for part in PARTS if part.seconds is not None}
    assert measured == short, "`seconds` of a report's TOML file: its processor time"
