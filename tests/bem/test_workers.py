"""Threads that share the work of a solve: the same bits on any number of them."""

import threading
import time
from typing import Any

import numpy as np
import pytest

import bem
from bem.operators import filters
from bem.workers import Helpers, Workers, checked_threads, default_threads, on_threads, workers
from gen.surface import generate


@pytest.fixture(autouse=True)
def four_cores(monkeypatch: pytest.MonkeyPatch) -> None:
    """More threads than there are processors are never begun."""
    monkeypatch.setattr("bem.workers.cores", lambda: 4)


def test_no_more_threads_are_begun_than_there_are_processors(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    class Counted(Helpers):
        def __init__(self, many: int) -> None:
            begun.append(many)
            super().__init__(min(many, 3))

    begun: list[int] = []
    monkeypatch.setattr("bem.workers.Helpers", Counted)
    monkeypatch.setenv("OMP_NUM_THREADS", str(10**9))
    heights = np.random.default_rng(0).normal(size=(9, 9))
    for threads in (10**9, None):
        assert bem.solve(heights, 1.0, 0.5, threads=threads).contact_nodes > 0
    assert begun == [3, 3]


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_every_piece_is_worked_on_once(threads: int) -> None:
    done: list[int] = []
    with on_threads(threads):
        workers().share(done.append, range(50))
    assert sorted(done) == list(range(50))


def test_helpers_work_and_share_the_settings_of_the_calling_thread() -> None:
    meet, seen = threading.Barrier(3, timeout=30), set()

    def work(_: int) -> None:
        meet.wait()
        seen.add((threading.get_ident(), np.geterr()["over"]))

    with on_threads(3), np.errstate(over="ignore"):
        workers().share(work, range(3))
    assert len(seen) == 3
    assert {setting for _, setting in seen} == {"ignore"}


def test_an_error_of_any_piece_is_raised_when_nobody_works_any_more() -> None:
    working = []

    def work(piece: int) -> None:
        working.append(piece)
        time.sleep(0.01)
        working.remove(piece)
        raise ArithmeticError(str(piece))

    with on_threads(3), pytest.raises(ArithmeticError):
        workers().share(work, range(20))
    assert not working


def test_blocks_of_threads_nest() -> None:
    with on_threads(2):
        with on_threads(None):
            assert workers().threads == 2
        with on_threads(1):
            assert workers().threads == 1
        assert workers().threads == 2
    assert workers().threads == 1


@pytest.mark.parametrize(
    ("said", "threads"), [("4", 4), ("3,1", 3), (" 2 ", 2), ("", 7), ("0", 7), ("all", 7)]
)
def test_the_environment_says_how_many(
    monkeypatch: pytest.MonkeyPatch, said: str, threads: int
) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", said)
    assert default_threads(7) == threads
    with on_threads(None):
        assert workers().threads == (threads if threads != 7 else 1)


@pytest.mark.parametrize("threads", [0, -1, 1.5, True, "2"])
def test_other_numbers_of_threads_are_refused(threads: object) -> None:
    with pytest.raises(ValueError, match=r"threads = .*: give a whole number of 1 or more"):
        checked_threads(threads)
    with pytest.raises(ValueError, match="threads"):
        bem.solve(np.eye(3), 1.0, 0.5, threads=threads)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("load", "settings"),
    [
        ({"delta": 15.0}, {}),
        ({"pressure": 2e-3}, {}),
        ({"pressure": 2e-3}, {"hardness": 0.05}),
        ({"pressure": 2e-3}, {"boundary": "periodic"}),
        ({"pressure": 2e-3}, {"boundary": "mirror"}),
    ],
)
def test_contacts_are_the_same_bits_on_any_number_of_threads(
    load: dict[str, float], settings: dict[str, object]
) -> None:
    edgeless = "boundary" in settings
    heights = generate("diamond-square", 513, 0.7, 12.5, np.random.default_rng(5))
    surface = heights[:512, :512] if edgeless else heights
    one, *others = (
        bem.solve(surface, 1000.0, threads=threads, **load, **settings)  # type: ignore[arg-type]
        for threads in (1, 2, 3)
    )
    for other in others:
        np.testing.assert_array_equal(other.pressure, one.pressure)
        assert (other.delta, other.residual) == (one.delta, one.residual)
        assert (other.iterations, other.convolutions) == (one.iterations, one.convolutions)


def test_ladders_have_threads_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(filters, "LARGE", 0)
    share, teams = Workers.share, set()

    def watched(team: Workers, *work: Any) -> None:
        teams.add(team.threads)
        share(team, *work)

    monkeypatch.setattr(Workers, "share", watched)
    heights = generate("diamond-square", 129, 0.7, 12.5, np.random.default_rng(5))
    one, two = (
        [contact.force for contact in bem.ladder(heights, 1000.0, (5.0, 8.0, 11.0), threads=many)]
        for many in (1, 2)
    )
    assert one == two
    assert teams == {1, 2}
    assert workers().threads == 1
