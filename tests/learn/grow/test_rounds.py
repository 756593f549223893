"""Growths from their first row to their end: kills and stops, budgets, marks of all kinds."""

import math
from dataclasses import replace
from types import SimpleNamespace

import pytest
from comparisons import numbers_of
from databases import database_of, deterministic_bytes

from gen import database
from gen.database import Reader, Writer
from gen.generation.check import faults
from gen.runtime.errors import InputError
from gen.scene import Scene
from learn import Surrogate
from learn.dataset import Request
from learn.executor import Executor
from learn.grow import rounds
from learn.grow.rounds import Growth

SCENE = Scene.parse(
    "samples = 10\nsamples_per_surface = 1\n[surface]\nnodes = 9\n", "scene"
)
MARK = 25.0
"""Met at the second look by a decision tree, which is fitted quickly."""


class Clock:
    """A clock that stands still unless it is moved."""

    now = 1000.0

    def time(self):
        return self.now


class Killed(BaseException):
    """The end of a process, which nothing catches."""


def order(folder, mark=MARK, most=2000, **keys):
    """The request, the mark and the most rows of a growth."""
    request = Request(
        databases=(folder / "my.h5",),
        output=folder / "my.surrogate",
        targets=("area",),
        models=("decision-tree",),
        normalisation="standard",
        features="dimensionless",
        roots=True,
    )
    return replace(request, **keys), mark, most


def grow(wanted, *, limit=None, scene=SCENE, stopping=lambda: False):
    said: list[str] = []
    until = math.inf if limit is None else rounds.time.time() + limit
    ending, last = Growth(*wanted, scene, Executor(), said.append, stopping, until).grow()
    return SimpleNamespace(ending=ending, last=last), said


def parts(path):
    """Models of a surrogate, as numbers, and what its card says of the growth."""
    return numbers_of(path), Surrogate.load(path).card["grown"]


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A growth that nothing disturbs."""
    folder = tmp_path_factory.mktemp("whole")
    grown, said = grow(order(folder))
    return folder, grown, said


def test_a_growth_ends_with_a_surrogate_that_meets_its_mark(whole):
    folder, grown, said = whole
    assert grown.ending == "met"
    found = grown.last
    assert found.bound("area") <= MARK < 2 * found.bound("area")
    looks = [line for line in said if "nMAE of area" in line]
    assert len(looks) >= 2
    assert looks[-1].endswith("met")
    with Reader(folder / "my.h5") as reader:
        assert reader.counts().done == found.rows == reader.scene.samples
    assert not list(faults(folder / "my.h5", 3))
    _, record = parts(folder / "my.surrogate")
    assert record["met"] is True
    assert record["rows"] == found.rows
    assert record["bounds"]["area"] == found.bound("area")


def test_the_holdout_never_train(whole):
    _, grown, _ = whole
    found = grown.last
    assert not set(found.parts.test) & set(found.parts.train)
    rows = found.surrogate.card["rows"]
    assert rows["train"] == found.parts.train.size >= rows["calibration"]
    assert rows["test"] == found.parts.test.size


STAGES = {
    "in later rows": (Writer, "write_block", 4),
    "before a fit": (Growth, "look", 2),
    "before a surrogate is written": (Surrogate, "save", 1),
    "between two databases": (database.creation, "lay_out", 2),
}


@pytest.mark.few(1)
@pytest.mark.parametrize("stage", STAGES)
def test_a_growth_that_is_killed_goes_on_to_the_same_end(
    stage, whole, tmp_path, monkeypatch
):
    folder, grown, _ = whole
    home, name, number = STAGES[stage]
    original, calls = getattr(home, name), []

    def dying(*arguments, **keys):
        calls.append(name)
        if len(calls) == number:
            raise Killed
        return original(*arguments, **keys)

    monkeypatch.setattr(home, name, dying)
    with pytest.raises(Killed):
        grow(order(tmp_path))
    monkeypatch.undo()
    again, _ = grow(order(tmp_path))
    assert again.ending == grown.ending
    assert deterministic_bytes(tmp_path / "my.h5") == deterministic_bytes(
        folder / "my.h5"
    )
    assert parts(tmp_path / "my.surrogate") == parts(folder / "my.surrogate")


def test_a_mark_out_of_reach_is_said_to_be(tmp_path):
    grown, said = grow(order(tmp_path, mark=1e-4))
    assert grown.ending == "hopeless"
    assert not grown.last.met
    assert math.isinf(grown.last.advice)
    assert "does not come to it" in said[-1]
    assert grown.last.rows < 500  # it takes few rows to see that
    assert parts(tmp_path / "my.surrogate")[1]["met"] is False


@pytest.mark.parametrize("limit", [0.05, 1.0])
def test_a_budget_ends_a_growth_by_the_clock_of_its_rows(limit, tmp_path, monkeypatch):
    """Each row takes a hundredth of a second of a clock that nothing else moves."""

    clock, write = Clock(), Writer.write_block

    def written(self, start, stop, columns):
        clock.now += 0.01 * (stop - start)
        write(self, start, stop, columns)

    monkeypatch.setattr(rounds, "time", clock)
    monkeypatch.setattr(Writer, "write_block", written)
    monkeypatch.setattr(
        rounds, "within", lambda work, shared, task, until: work(shared, task)
    )
    if limit < 0.6:  # fewer rows than a first look needs
        with pytest.raises(InputError, match="the budget sufficed for"):
            grow(order(tmp_path, mark=12.0), limit=limit)
    else:
        grown, _ = grow(order(tmp_path, mark=12.0), limit=limit)
        assert grown.ending == "budget"
        assert 0.9 * limit <= clock.now - 1000 <= limit + 0.0101
    with Reader(tmp_path / "my.h5") as reader:
        assert reader.counts().done <= 100 * limit + 1
    monkeypatch.undo()
    again, _ = grow(order(tmp_path, mark=90.0))
    assert again.ending == "met"


def test_a_scenes_own_numbers_grow_until_their_means_are_known(tmp_path):
    """Errors are those of means, of each target in its unit, and not the scatter of surfaces."""
    own = {"models": ("population",), "features": "scene", "targets": ("area", "force")}
    grown, said = grow(order(tmp_path, 20.0, load="delta", **own))
    assert grown.ending == "met", said
    for name, judged in grown.last.judged.items():
        scatter = 100 * abs(judged.prediction - judged.truth).mean() / judged.truth.mean()
        assert scatter / 20 < judged.accuracy.nmae < scatter
        assert judged.accuracy.nmae < grown.last.bound(name) <= 20.0


def test_another_scene_is_refused_and_nothing_changes(whole):
    folder, _, _ = whole
    before = (folder / "my.h5").read_bytes()
    other = Scene.parse("samples = 10\nseed = 1\n[surface]\nnodes = 9\n", "scene")
    with pytest.raises(InputError, match="holds another scene"):
        grow(order(folder), scene=other)
    assert (folder / "my.h5").read_bytes() == before


def test_a_database_of_a_run_is_taken_as_it_is(tmp_path):
    for samples in (150, 160):
        database_of(tmp_path, f"samples = {samples}\n[surface]\nnodes = 9\n", "my")
        grown, _ = grow(order(tmp_path, mark=90.0))
        assert (grown.ending, grown.last.rows) == ("met", samples)
        assert math.isfinite(grown.last.bound("area"))


def test_a_growth_says_what_is_doubted_of_its_scene(tmp_path):
    """Before its first row, in the words of a run."""
    text = "samples = 40\n[surface]\nnodes = 9\n[load]\nquantity = 'pressure'\nrange = [50, 100]\n"
    scene = Scene.parse(text, "scene")
    _, said = grow(order(tmp_path), scene=scene, stopping=lambda: True)
    assert said[0].startswith("warning: from Delta = ")
    assert said[0].endswith(
        "E* is 1 MPa, the default without a modulus (modulus in [contact])"
    )
