"""A short form of the fuzzer, and its judge; `python -m tests.fuzz` is the long one."""

import json
import signal

import numpy as np
import pytest

from tests.fuzz import child
from tests.fuzz.__main__ import Case, cases
from tests.fuzz.child import Ended, fault, run
from tests.fuzz.corpus import BY_ENDING, damaged

RUN = ("gen", "run", "scene.toml")


@pytest.mark.parametrize("last", [15, pytest.param(60, marks=pytest.mark.long)])
def test_damaged_files_end_in_one_line(tmp_path, last):
    ended = list(cases(tmp_path, seed=1, kinds=("scene",), last=last))
    assert [(case.number, case.command, case.fault) for case in ended if case.fault] == []
    assert {case.ended.code for case in ended} == {0, 2}


def test_the_same_seed_and_number_do_the_same_damage():
    data = json.dumps({"a": [1, {"b": "c"}], "d": 2.5}).encode()
    for ending in BY_ENDING:
        first, again, other = (
            [
                damaged(data, f"x{ending}", np.random.default_rng([seed, n]))
                for n in range(30)
            ]
            for seed in (0, 0, 1)
        )
        assert first == again != other


REFUSAL = "gen: scene.toml: not TOML\n"
TRACE = "Traceback (most recent call last):\n  File\nKeyError: 'a'\n"
ENDINGS = [
    (Ended(0, "", ""), ""),
    (Ended(2, "", f"warning: steep\n{REFUSAL}"), ""),
    (Ended(1, "", ""), "exit code 1"),
    (Ended(2, "", ""), "0 lines of refusal in place of one"),
    (Ended(2, "", f"{REFUSAL}more\n"), "lines below the refusal"),
    (Ended(-signal.SIGSEGV, "", ""), "signal 11"),
    (Ended(-signal.SIGKILL, "", "", hung=True), "hang"),
    (Ended(1, "", TRACE), "traceback: KeyError: 'a'"),
    (Ended(0, "", "a/b.py:7: RuntimeWarning: overflow"), "a library's warning"),
]


def test_endings_are_judged():
    assert [fault(RUN, ended) for ended, _ in ENDINGS] == [said for _, said in ENDINGS]
    assert fault(("gen", "check", "x.h5"), Ended(1, "x.h5: row 3", "")) == ""


def test_a_child_is_bounded_and_leaves_this_process_alone(tmp_path, monkeypatch):
    def hang():
        while True:
            pass

    def run_as(act, **bounds):
        monkeypatch.setattr("gen.cli.main", lambda arguments: act())
        return run(RUN, tmp_path, **bounds)

    ended = run_as(hang, bound=0.2)
    assert (ended.hung, fault(RUN, ended)) == (True, "hang")
    assert "MemoryError" in run_as(lambda: len(bytes(child.MEMORY + 2**30))).errors
    assert run_as(lambda: 2).code == 2


def test_a_finding_is_kept_once_with_its_command(tmp_path):
    worked, kept = tmp_path / "case", tmp_path / "kept"
    worked.mkdir()
    (worked / "scene.toml").write_text("damaged")
    one, other = (
        Case(
            number, "scene", RUN, Ended(1, "", "words"), f"traceback: KeyError: {number}"
        )
        for number in (3, 4)
    )
    assert one.signature == other.signature == "gen run: traceback: KeyError: _"
    assert one.kept(worked, kept).startswith(
        "case 3: python -m gen run scene.toml: traceback"
    )
    assert (kept / "command.txt").read_text() == "python -m gen run scene.toml\n"
    assert (kept / "scene.toml").read_text() == "damaged"
