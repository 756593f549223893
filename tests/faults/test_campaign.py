"""A short form of the fault campaign, and its judges; `python -m tests.faults` is the long one."""

import json
from unittest import mock

import numpy as np
import pytest
from launch import mpiexec

import gen.generation.sample
from gen import cli
from gen.generation.plan import parameters
from gen.generation.sample import compute_rows
from gen.runtime.errors import InputError
from gen.scene import load
from gen.schema import Reason, Status
from tests.faults import program
from tests.faults.campaign import KINDS, campaign
from tests.faults.rows import columns_of, difference, finished, row_fault
from tests.faults.runs import Ended
from tests.faults.stage import code_fault, refusal_fault
from tests.faults.storage import PAGE, copy_with_holes
from tests.faults.table import line, summary

SHORT = (
    "SIGKILL to a worker",
    "SIGTERM",
    "SIGSTOP, then SIGCONT",
    "files may not grow",
    "file cut off",
    "second writer",
    "second writer by a link",
    "file replaced",
    "file moved",
    "file made read-only",
    "full disk under stderr",
    "pipe for a file",
    "wrong option on all ranks",
    "sample raises",
    "sample never ends",
)


@pytest.mark.mpi
@pytest.mark.campaign
@pytest.mark.skipif(mpiexec() is None, reason="no mpiexec: install the extra 'mpich'")
def test_disturbed_runs_lose_nothing(tmp_path):
    rounds = list(campaign(tmp_path, rounds=len(SHORT), seed=3, samples=200, kinds=SHORT))
    assert [(done.kind, done.fault) for done in rounds if done.fault] == []
    assert sum(done.hit for done in rounds) == len(SHORT)
    assert rounds[-1].after == 200
    assert "0 times a row was lost" in summary(rounds)
    assert all(done.kind in line(1, done) for done in rounds)


def test_an_unknown_kind_is_refused(tmp_path):
    with pytest.raises(InputError, match="no kind 'flood'"):
        list(campaign(tmp_path, kinds=["flood"]))


@pytest.fixture(scope="module")
def reference(tmp_path_factory):
    folder = tmp_path_factory.mktemp("faults")
    (folder / "scene.toml").write_text("samples = 12\n[surface]\nnodes = 9\n")
    path = folder / "rows.h5"
    assert cli.main(["run", str(folder / "scene.toml"), "-o", str(path)]) == 0
    columns = columns_of(path)
    assert finished(columns).all()
    return columns


def copied(columns):
    return {name: values.copy() for name, values in columns.items()}


def test_what_is_right_is_no_fault(reference):
    half = copied(reference)
    half["status"][6:] = Status.PENDING
    half["force"][6:] = np.nan
    assert row_fault(None, half, reference) == ""
    assert row_fault(half, reference, reference) == ""
    assert difference(reference, reference) == ""


def test_every_kind_of_damage_is_found(reference):
    wrong, lost, again = copied(reference), copied(reference), copied(reference)
    wrong["force"][3] = np.nextafter(wrong["force"][3], np.inf)
    lost["status"][3] = Status.PENDING
    again["solve_seconds"][3] += 1.0
    assert row_fault(reference, wrong, reference) == "a finished row has a wrong force"
    assert row_fault(reference, lost, reference) == "a finished row is pending again"
    assert row_fault(reference, again, reference) == "a finished row was computed again"
    assert row_fault(reference, None, reference) == "the database has vanished"
    assert "another force" in difference(wrong, reference)
    assert "another status" in difference(lost, reference)


def test_rows_that_should_have_failed_are_asked_for(reference):
    failed = copied(reference)
    failed["status"][4], failed["reason"][4] = Status.FAILED, Reason.NOT_FINITE
    failed["force"][4] = np.nan
    assert row_fault(None, failed, reference, {4: Reason.NOT_FINITE}) == ""
    assert "row 4" in row_fault(None, failed, reference, {4: Reason.ARITHMETIC})
    assert "row 5" in row_fault(None, failed, reference, {5: Reason.NOT_FINITE})


def test_answers_are_judged(reference):
    half = copied(reference)
    half["status"][6:] = Status.PENDING
    assert "rows are pending" in code_fault(Ended(0, ""), half)
    assert code_fault(Ended(0, ""), reference) == ""
    assert "traceback" in code_fault(Ended(2, "Traceback (most recent call last)"), half)
    assert refusal_fault(Ended(2, "gen: x.h5: the disk is full\n"), "disk is full") == ""
    assert "exit code 0" in refusal_fault(Ended(0, ""), "disk is full")
    assert "one clear line" in refusal_fault(Ended(2, "gen: a\ngen: b\n"), "a")
    assert "without 'full'" in refusal_fault(Ended(2, "gen: x.h5 is locked\n"), "full")


@pytest.mark.parametrize(
    ("ailment", "reason"),
    [
        ("raises", Reason.ARITHMETIC),
        ("returns_nan", Reason.NOT_FINITE),
        ("does_not_converge", Reason.NOT_CONVERGED),
    ],
)
def test_samples_ail_as_they_should(tmp_path, ailment, reason):
    (tmp_path / "scene.toml").write_text("samples = 5\n[surface]\nnodes = 17\n")
    scene = load(str(tmp_path / "scene.toml"))
    ailments = {float(parameters(scene, 2, 3).delta[0]): ailment}
    with mock.patch.object(gen.generation.sample, "solve_contact", program.ailing(ailments)):
        rows = compute_rows(scene, 0, 5)
    np.testing.assert_array_equal(rows["reason"], [0, 0, reason, 0, 0])
    np.testing.assert_array_equal(rows["status"], [1, 1, 2, 1, 1])


def test_a_bug_ends_the_program_with_its_name(tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.toml").write_text("samples = 5\n[surface]\nnodes = 9\n")
    delta = float(parameters(load("scene.toml"), 2, 3).delta[0])
    (tmp_path / "ailments.json").write_text(json.dumps({repr(delta): "has_a_bug"}))
    arguments = ["", "ailments.json", "run", "scene.toml", "-o", "rows.h5"]
    monkeypatch.setattr("sys.argv", arguments)
    with pytest.raises(SystemExit):
        program.main()
    assert "TypeError: injected" in capfd.readouterr().err


def test_a_copy_with_holes_is_the_same_file(tmp_path):
    content = b"a" * PAGE + bytes(5 * PAGE) + b"b" * 100 + bytes(3 * PAGE)
    (tmp_path / "whole").write_bytes(content)
    copy_with_holes(tmp_path / "whole", tmp_path / "holes")
    assert (tmp_path / "holes").read_bytes() == content


def test_there_are_kinds_enough():
    assert len(KINDS) >= 8
    assert set(SHORT) <= set(KINDS)
