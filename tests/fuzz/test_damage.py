"""A short form of the fuzzer, and its judge; `python -m tests.fuzz` is the long one."""

import json
import signal

import numpy as np
import pytest

from tests.fuzz import child
from tests.fuzz.__main__ import Case, Findings, cases
from tests.fuzz.child import Ended, fault, run
from tests.fuzz.corpus import BY_ENDING, damaged

RUN = ("gen", "run", "scene.toml")


def test_damaged_files_end_in_one_line(tmp_path):
    ended = list(cases(tmp_path, seed=1, kinds=("scene",), last=40))
    assert [(case.number, case.command, case.fault) for case in ended if case.fault] == []
    assert {case.ended.code for case in ended} == {0, 2}


def test_the_same_seed_and_number_do_the_same_damage():
    data = json.dumps({"a": [1, {"b": "c"}], "d": 2.5}).encode()
    for ending in BY_ENDING:
        first, again, other = (
            [damaged(data, f"x{ending}", np.random.default_rng([seed, n])) for n in range(30)]
            for seed in (0, 0, 1)
        )
        assert first == again != other


def test_endings_are_judged():
    refusal = "gen: scene.toml: not TOML\n"
    assert fault(RUN, Ended(0, "", "")) == ""
    assert fault(RUN, Ended(2, "", refusal)) == ""
    assert fault(RUN, Ended(2, "", "warning: steep\n" + refusal)) == ""
    assert fault(("gen", "check", "x.h5"), Ended(1, "x.h5: row 3", "")) == ""
    assert fault(RUN, Ended(1, "", "")) == "exit code 1"
    assert fault(RUN, Ended(2, "", "")) == "0 lines of refusal in place of one"
    assert fault(RUN, Ended(2, "", refusal + "more\n")) == "lines below the refusal"
    assert fault(RUN, Ended(-signal.SIGSEGV, "", "")) == "signal 11"
    assert fault(RUN, Ended(-signal.SIGKILL, "", "", hung=True)) == "hang"
    trace = "Traceback (most recent call last):\n  File\nKeyError: 'a'\n"
    assert fault(RUN, Ended(1, "", trace)) == "traceback: KeyError: 'a'"
    assert fault(RUN, Ended(0, "", "a/b.py:7: RuntimeWarning: overflow")) == "a library's warning"


@pytest.fixture
def program(monkeypatch):
    """A program of ours that does what a function says."""

    def stand_in(act):
        monkeypatch.setattr("gen.cli.main", lambda arguments: act())

    return stand_in


def test_a_child_is_bounded_and_leaves_this_process_alone(tmp_path, program):
    def hang():
        while True:
            pass

    program(hang)
    ended = run(RUN, tmp_path, bound=0.2)
    assert (ended.hung, fault(RUN, ended)) == (True, "hang")
    program(lambda: len(bytes(child.MEMORY + 2**30)))
    assert "MemoryError" in run(RUN, tmp_path).errors
    program(lambda: 2)
    assert run(RUN, tmp_path).code == 2


def test_a_finding_is_kept_once_with_its_command(tmp_path):
    worked = tmp_path / "case"
    worked.mkdir()
    (worked / "scene.toml").write_text("damaged")
    found = Findings(tmp_path / "kept")
    for number, text in enumerate(("", "traceback: KeyError: 3", "traceback: KeyError: 4")):
        said = found.add(Case(number, "scene", RUN, Ended(1, "", "words"), text), worked)
        assert bool(said) == (number == 1)
    (kept,) = (tmp_path / "kept").iterdir()
    assert (kept / "command.txt").read_text() == "python -m gen run scene.toml\n"
    assert (kept / "scene.toml").read_text() == "damaged"
    assert found.summary(3.0).startswith("3 cases in 3 s; 2 findings of 1 kinds")
