"""A plan of a run: what is there, and what earlier records say of the rest."""

import json
from pathlib import Path

import pytest
from page_parts import WRITE, inputs, makes, part, record

from bench.__main__ import main
from bench.files import read_toml
from bench.page import estimate
from bench.page.estimate import plan, seconds, told
from bench.page.parts import PARTS


def test_times_are_those_of_the_same_command_here_else_of_what_is_published(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    one, report = part("one", WRITE), tmp_path / "report"
    monkeypatch.setattr(estimate, "RESULTS", tmp_path / "results")
    full, short = inputs(report, full=True), inputs(report)
    assert seconds(one, full) is None
    makes(report, [one])
    found = json.loads(record(one, report).model_dump_json())
    folder = tmp_path / "results" / "one"
    folder.mkdir(parents=True)
    (folder / "one.part.json").write_text(json.dumps(found | {"command": "", "seconds": 600.0}))
    path = short.making(one).path
    path.write_text(json.dumps(found | {"seconds": 30.0}))
    assert seconds(one, short) == 30
    path.unlink()
    assert seconds(one, short) is None
    assert seconds(one, full) == 600


def test_what_is_there_takes_no_time(tmp_path: Path) -> None:
    one, two = part("one", WRITE), part("two", WRITE)
    makes(tmp_path, [one, two])
    lines = plan([one, two], inputs(tmp_path), [True, False]).splitlines()
    assert lines[0].split()[:3] == ["one", "is", "there"]
    assert lines[-1] == "1 parts to make: 0 s by earlier records"
    assert [told(each) for each in (None, 99.4, 100, 7200)] == [
        "not known",
        "99 s",
        "2 min",
        "120 min",
    ]


def test_the_times_of_all_parts_of_a_short_run_are_known(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    short = {part.name for part in PARTS if part.quick}
    assert read_toml("page/short")["seconds"].keys() == short
    assert main(["run", "-o", str(tmp_path / "report"), "--plan"]) == 0
    said = capfd.readouterr().out
    assert "known" not in said
    assert f"{len(short)} parts to make: " in said


def test_command_plans_and_makes_nothing(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "--full", "-o", str(tmp_path / "report"), "--plan"]) == 0
    said = capfd.readouterr().out
    assert "coverage " in said
    assert "parts to make: " in said
    assert not (tmp_path / "report").exists()
