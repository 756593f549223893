"""What is written beside a part, and what of it makes the part anew."""

import json
import os
from pathlib import Path

import pytest
from page_parts import WRITE, inputs, makes, part

from bench.circumstances import circumstances, code_state
from gen.runtime.errors import InputError


def test_another_command_or_state_of_the_code_makes_a_part_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    makes(tmp_path, [part("one", WRITE)])
    makes(tmp_path, [part("one", WRITE.replace("'x'", "'y'"))])
    assert (tmp_path / "one" / "made.txt").read_text() == "xy"
    other = circumstances() | {"state": "another"}
    monkeypatch.setattr("bench.page.record.circumstances", lambda: other)
    makes(tmp_path, [part("one", WRITE.replace("'x'", "'y'"))])
    assert (tmp_path / "one" / "made.txt").read_text() == "xyy"


def test_documents_and_results_are_no_code(tmp_path: Path) -> None:
    for name in ("bem/solve.py", "bench/page.toml", "bench/results/a.toml", "docs/conf.py"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("a")
    before = code_state(tmp_path)
    for name, same in {
        "docs/conf.py": True,
        "bench/results/a.toml": True,
        "bench/results/b.csv": True,
        "gen/read.md": True,
        "bench/page.toml": False,
        "learn/new.py": False,
    }.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("b")
        assert (code_state(tmp_path) == before) is same, name
        before = code_state(tmp_path)
    (tmp_path / "bem" / "solve.py").rename(tmp_path / "bem" / "solved.py")
    assert code_state(tmp_path) != before


def test_other_inputs_make_a_part_anew(tmp_path: Path) -> None:
    reading = part("reading", WRITE + "#{database}")
    (tmp_path / "paper.h5").write_text("a")
    makes(tmp_path, [reading])
    makes(tmp_path, [reading])
    assert (tmp_path / "reading" / "made.txt").read_text() == "x"
    os.utime(tmp_path / "paper.h5", ns=(0, 10**18))
    makes(tmp_path, [reading])
    assert (tmp_path / "reading" / "made.txt").read_text() == "xx"


def test_record_says_where_and_with_what(tmp_path: Path) -> None:
    makes(tmp_path, [part("one", WRITE)])
    path = inputs(tmp_path).making(part("one", WRITE)).path
    found = json.loads(path.read_text())
    assert found["command"].startswith("python -c ")
    assert {"code", "seconds", "created", "commit", "state", "machine", "versions"} <= found.keys()
    path.write_text("{")
    with pytest.raises(InputError, match="cannot be read"):
        makes(tmp_path, [part("one", WRITE)])
