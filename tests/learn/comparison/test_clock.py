"""The time of a job: its shares, what interruptions take of it, and when it begins anew."""

import itertools
import json
import shutil
import tempfile
from pathlib import Path
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gen.runtime.errors import InputError
from learn.columns import short_name
from learn.comparison import clock
from learn.comparison.clock import Clock
from learn.comparison.search.budget import Share
from learn.request import Request

MODELS = ("svm", "mlp", "xgboost")


class Watch:
    """A time that passes only when a test says so."""

    def __init__(self, monkeypatch):
        self.now = 1000.0
        monkeypatch.setattr(clock, "time", SimpleNamespace(monotonic=lambda: self.now))


@pytest.fixture
def watch(monkeypatch):
    return Watch(monkeypatch)


def job(folder, limit=90.0, models=MODELS, command="tune", targets=("area",)):
    for target in targets:
        (folder / short_name(target) / "trials").mkdir(parents=True, exist_ok=True)
    return Clock(command, Request(Path("rows.h5"), folder, targets, limit=limit), models)


def search(job, watch, model, seconds, *, interrupted=False, target="area"):
    with job.search(target, model, lambda: interrupted) as share:
        watch.now += seconds
    return share


def test_what_a_search_leaves_of_its_share_goes_to_the_others(tmp_path, watch):
    running = job(tmp_path)
    assert search(running, watch, "svm", 10) == Share(30)
    assert search(running, watch, "mlp", 60) == Share(40)
    assert search(running, watch, "xgboost", 5) == Share(20)
    running.close()
    assert not [*tmp_path.rglob("*.json")]
    assert search(job(tmp_path), watch, "svm", 1) == Share(30), "a further budget"


def test_an_interrupted_job_goes_on_with_what_is_left(tmp_path, watch):
    running = job(tmp_path)
    search(running, watch, "svm", 12)
    search(running, watch, "mlp", 20, interrupted=True)
    again = job(tmp_path)
    assert [again.ended("area", model) for model in MODELS] == [True, False, False]
    assert search(again, watch, "mlp", 19, interrupted=True) == Share(39, spent=20)
    again = job(tmp_path)
    assert search(again, watch, "mlp", 1) == Share(39, spent=39)
    assert search(again, watch, "xgboost", 1) == Share(38)


def test_a_search_that_fails_or_is_killed_has_its_share_anew(tmp_path, watch):
    running = job(tmp_path)

    def fail():
        with running.search("area", "svm", lambda: False):
            raise InputError("disk full")

    with pytest.raises(InputError):
        fail()
    assert search(job(tmp_path), watch, "svm", 1) == Share(30)


@pytest.mark.parametrize(
    "other",
    [{"limit": 60.0}, {"models": ("svm", "mlp")}, {"command": "estimate"}, {"targets": ("force",)}],
)
def test_another_job_has_a_time_of_its_own(tmp_path, watch, other):
    search(job(tmp_path), watch, "svm", 12)
    changed = job(tmp_path, **other)
    target = other.get("targets", ("area",))[0]
    assert not changed.ended(target, "svm")
    assert search(changed, watch, "svm", 1, target=target).spent == 0


def test_columns_and_targets_by_their_short_name_are_one(tmp_path, watch):
    running = job(tmp_path, targets=("area_percent", "force"))
    assert search(running, watch, "svm", 15) == Share(15)
    assert search(running, watch, "svm", 15, target="force") == Share(15)


def test_without_a_budget_nothing_is_shared_or_written(tmp_path, watch):
    running = job(tmp_path, limit=None)
    assert search(running, watch, "svm", 5) is None
    assert not running.ended("area", "svm")
    running.close()
    assert not [*tmp_path.rglob("*.json")]


def test_a_damaged_file_is_named(tmp_path, watch):
    search(job(tmp_path), watch, "svm", 12)
    path = tmp_path / "area/trials/svm.clock.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"spent": -1}))
    with pytest.raises(InputError, match=r"svm\.clock\.json.* is damaged"):
        job(tmp_path)


@given(st.lists(st.floats(0.1, 40.0), max_size=6), st.integers(1, 4))
def test_however_often_it_is_interrupted_a_job_takes_its_budget(runs, count):
    models, folder = [f"model{number}" for number in range(count)], Path(tempfile.mkdtemp())
    with pytest.MonkeyPatch.context() as patch:
        watch = Watch(patch)
        began = watch.now
        for run in itertools.chain(runs, itertools.repeat(1e9)):
            running, patience = job(folder, models=models), run
            for model in models:
                if running.ended("area", model):
                    continue
                with running.search("area", model, lambda: patience == 0) as share:  # noqa: B023
                    lasts = min(share.limit - share.spent, patience)
                    watch.now, patience = watch.now + lasts, patience - lasts
                if patience == 0:
                    break
            if run == 1e9:
                break
        running.close()
    shutil.rmtree(folder)
    assert watch.now - began == pytest.approx(90.0, rel=1e-9)
