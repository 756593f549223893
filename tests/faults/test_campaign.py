"""A short form of the fault campaign, and its judges; `python -m tests.faults` is the long one."""

from unittest import mock

import numpy as np
import pytest
from databases import database_of

import bem
from gen.generation.plan import parameters
from gen.generation.sample import compute_rows
from gen.runtime.errors import InputError
from gen.scene import Scene
from gen.schema import Reason, Status
from tests.faults import program
from tests.faults.__main__ import by_kind, campaign
from tests.faults.kinds import FAILURES, KINDS
from tests.faults.stage import (
    Ended,
    code_fault,
    columns_of,
    difference,
    refusal_fault,
    row_fault,
)

SHORT = [
    kind for kind in KINDS if kind not in {"SIGKILL to a run alone", "SIGKILL to mpiexec"}
]


@pytest.mark.mpi
@pytest.mark.campaign
def test_disturbed_runs_lose_nothing(tmp_path):
    rounds = list(campaign(tmp_path, rounds=len(SHORT), seed=3, samples=200, kinds=SHORT))
    assert [done.line() for done in rounds if done.fault] == []
    assert sum(done.hit for done in rounds) >= len(SHORT) - 1
    assert rounds[-1].after == 200
    assert {row["verdict"] for row in by_kind(rounds)} == {"passed"}


def test_an_unknown_kind_is_refused(tmp_path):
    with pytest.raises(InputError, match="no kind 'flood'"):
        list(campaign(tmp_path, kinds=["flood"]))


@pytest.fixture(scope="module")
def reference(tmp_path_factory):
    text = "samples = 12\n[surface]\nnodes = 9\n"
    return columns_of(database_of(tmp_path_factory.mktemp("faults"), text))


def copied(columns, **changes):
    """Columns with other values of row 3."""
    copies = {name: values.copy() for name, values in columns.items()}
    for name, value in changes.items():
        copies[name][3] = value
    return copies


def test_every_kind_of_damage_is_found(reference):
    assert row_fault(None, copied(reference, status=0, force=np.nan), reference) == ""
    assert difference(reference, reference) == ""
    wrong = copied(reference, force=np.nextafter(reference["force"][3], np.inf))
    lost, again = copied(reference, status=0), copied(reference, solve_seconds=7.0)
    assert row_fault(reference, wrong, reference) == "a finished row has a wrong force"
    assert row_fault(reference, lost, reference) == "a finished row is pending again"
    assert row_fault(reference, again, reference) == "a finished row was computed again"
    assert row_fault(reference, None, reference) == "the database has vanished"
    assert "wrong force" in difference(wrong, reference)
    assert "pending" in difference(lost, reference)
    failed = copied(
        reference, status=Status.FAILED, reason=Reason.NOT_FINITE, force=np.nan
    )
    assert row_fault(None, failed, reference, {3: Reason.NOT_FINITE}) == ""
    assert "row 3" in row_fault(None, failed, reference, {3: Reason.ARITHMETIC})
    assert "row 5" in row_fault(None, failed, reference, {5: Reason.NOT_FINITE})


def test_answers_are_judged(reference):
    half = copied(reference, status=0)
    assert "rows are pending" in code_fault(Ended(0, ""), half)
    assert code_fault(Ended(0, ""), reference) == ""
    assert "traceback" in code_fault(Ended(2, "Traceback (most recent call last)"), half)
    assert refusal_fault(Ended(2, "gen: x.h5: the disk is full\n"), "disk is full") == ""
    assert "exit code 0" in refusal_fault(Ended(0, ""), "disk is full")
    assert "one clear line" in refusal_fault(Ended(2, "gen: a\ngen: b\n"), "a")
    assert "without 'full'" in refusal_fault(Ended(2, "gen: x.h5 is locked\n"), "full")


@pytest.mark.parametrize(("ailment", "reason"), FAILURES.items())
def test_samples_ail_as_they_should(ailment, reason):
    scene = Scene.parse("samples = 5\n[surface]\nnodes = 17\n", "test")
    ailments = {float(parameters(scene, 2, 3).load[0]): ailment}
    with mock.patch.object(bem, "solve", program.ailing(ailments)):
        rows = compute_rows(scene, 0, 5)
    np.testing.assert_array_equal(rows["reason"], [0, 0, reason, 0, 0])
    np.testing.assert_array_equal(rows["status"], [1, 1, 2, 1, 1])
