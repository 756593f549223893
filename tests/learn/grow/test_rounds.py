"""Growths from their first row to their end: kills and stops, budgets, marks of all kinds."""

import contextlib
import math
import shutil
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
MARK = 45.0
"""Met at the third look by a decision tree, which is fitted quickly."""


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


def test_a_growth_ends_when_the_bound_is_below_the_mark(whole):
    _, grown, _ = whole
    bound = grown.last.bound("area")
    assert grown.ending == "met"
    assert bound <= MARK < 2 * bound


def test_each_look_writes_a_line_and_the_last_one_says_that_the_mark_is_met(whole):
    _, _, lines = whole
    looks = [line for line in lines if "nMAE of area" in line]
    assert len(looks) >= 2
    assert looks[-1].endswith("met")


def test_all_rows_of_a_grown_database_are_done_and_right(whole):
    folder, grown, _ = whole
    with Reader(folder / "my.h5") as reader:
        assert reader.counts().done == grown.last.rows == reader.scene.samples
    assert not list(faults(folder / "my.h5", 3))


def test_the_card_says_how_a_surrogate_was_grown(whole):
    folder, grown, _ = whole
    _, record = parts(folder / "my.surrogate")
    assert record["met"] is True
    assert record["rows"] == grown.last.rows
    assert record["bounds"]["area"] == grown.last.bound("area")


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


@pytest.fixture(scope="module")
def hopeless(tmp_path_factory):
    """A growth to a mark that it cannot reach."""
    folder = tmp_path_factory.mktemp("hopeless")
    grown, lines = grow(order(folder, mark=1e-4))
    return folder, grown, lines


def test_a_mark_out_of_reach_ends_a_growth_after_few_rows(hopeless):
    _, grown, _ = hopeless
    assert grown.ending == "hopeless"
    assert grown.last.rows < 500


def test_a_mark_out_of_reach_has_no_number_of_rows(hopeless):
    _, grown, lines = hopeless
    assert math.isinf(grown.last.advised_rows)
    assert lines[-1].endswith(
        "the learning curve does not reach the mark within 2,000 rows"
    )


def test_a_growth_to_its_row_limit_does_not_promise_to_go_on(tmp_path, capsys):
    """The fourth look, which has a curve, is at the last allowed row: 60, 85, 120, 150."""
    wanted = order(tmp_path, mark=12.0, most=150)
    growth = Growth(*wanted, SCENE, Executor(), lambda _: None)
    ending, last = growth.grow()
    assert (ending, last.rows) == ("rows", 150)
    assert last.curve is not None
    assert "learning curve" not in last.in_words()
    rounds.show(growth, ending, last)
    out = capsys.readouterr().out
    assert "No more than 150 rows are allowed: ask for less, allow more --rows" in out
    assert "goes on" not in out


def test_a_budget_that_ends_before_the_look_at_the_last_rows_is_no_row_limit(tmp_path):
    growth = Growth(*order(tmp_path, most=150), SCENE, Executor(), print, until=0.0)
    last = SimpleNamespace(rows=120, met=False, advised_rows=None)
    assert growth._ending(150, last) == "budget"


def test_the_card_says_that_a_mark_was_not_met(hopeless):
    folder, grown, _ = hopeless
    assert not grown.last.met
    assert parts(folder / "my.surrogate")[1]["met"] is False


def grow_by_clock(folder, limit):
    """Grow with a budget, on a clock that each row moves by a hundredth of a second.

    Returns the growth, None if it was refused, and the time that it took by this clock.
    """
    clock, write = Clock(), Writer.write_block

    def written(self, start, stop, columns):
        clock.now += 0.01 * (stop - start)
        write(self, start, stop, columns)

    def at_once(work, shared, task, until):
        return work(shared, task)

    grown = None
    with pytest.MonkeyPatch.context() as patch, contextlib.suppress(InputError):
        patch.setattr(rounds, "time", clock)
        patch.setattr(Writer, "write_block", written)
        patch.setattr(rounds, "within", at_once)
        grown, _ = grow(order(folder, mark=12.0), limit=limit)
    return grown, clock.now - Clock.now


@pytest.fixture(scope="module")
def budgeted(tmp_path_factory):
    """The folder of a growth that its budget of a second ends, this growth, and its time."""
    folder = tmp_path_factory.mktemp("budgeted")
    return folder, *grow_by_clock(folder, 1.0)


def done_rows(folder):
    with Reader(folder / "my.h5") as reader:
        return reader.counts().done


def test_a_budget_ends_a_growth_by_the_clock_of_its_rows(budgeted):
    folder, grown, seconds = budgeted
    assert grown.ending == "budget"
    assert 0.9 <= seconds <= 1.0 + 0.0101
    assert done_rows(folder) <= 101


def test_a_budget_for_fewer_rows_than_a_look_needs_is_refused(tmp_path):
    grown, _ = grow_by_clock(tmp_path, 0.05)
    assert grown is None
    assert done_rows(tmp_path) <= 6


def test_a_growth_goes_on_after_the_end_of_its_budget(budgeted, tmp_path):
    folder, _, _ = budgeted
    shutil.copy(folder / "my.h5", tmp_path)
    again, _ = grow(order(tmp_path, mark=90.0))
    assert again.ending == "met"
    assert again.last.rows >= done_rows(folder)


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
