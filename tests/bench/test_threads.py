"""The report on threads: what its rows hold."""

from itertools import count
from pathlib import Path

import pytest

import bench.threads
from bem.operators.patch import displacement_filter
from bench import peer_threads
from bench.commands.solver import threads
from bench.threads import gain_of_copies, measure, report, verdict
from gen.runtime.errors import InputError


def test_rows_compare_threads_with_copies_of_the_transforms() -> None:
    (row,) = measure((513,), (5.0,), threads=2, rounds=1)
    assert row["area_percent"] == pytest.approx(5, rel=0.3)
    assert 30 < row["shared_percent"] <= 100
    assert 1 < row["reckoned_4"] < row["reckoned_8"] < 8
    assert row["gain"] == row["seconds_one"] / row["seconds"]
    assert row["gain_over_copies"] == row["gain"] / row["copies"]
    assert 0 < row["copies"] < 20  # of a machine that may be busy
    made = report([row], [])
    assert "4 threads, estimate" in made.text
    assert "none installed" in made.text
    said = verdict([row | {"gain_over_copies": share} for share in (0.89, 0.9, 1.2)])
    assert "0.89 to 1.20, 0.9 or more (the mark) in 2 of 3 rows" in said
    assert "estimates, not measured" in said


def test_others_are_timed_in_processes_of_their_own(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each with its number of threads; where none is installed, there are no rows."""
    started: list[tuple[str, int]] = []

    def timed(name: str, nodes: int, threads: int) -> float:
        started.append((name, threads))
        return 6.0 / threads

    monkeypatch.setattr(peer_threads, "_timed_apart", timed)
    monkeypatch.setattr(peer_threads, "find_spec", lambda name: None)
    assert peer_threads.measure((65,), 3, 2) == []
    monkeypatch.setattr(peer_threads, "find_spec", lambda name: name)
    rows = peer_threads.measure((65,), 3, 2)
    assert started == [(name, many) for name in ("Tamaas", "ASPHER") for many in (3, 1, 1, 3)]
    assert [row["gain"] for row in rows] == [3, 3]
    assert "Tamaas, 3 iterations" in peer_threads.table(rows)


@pytest.mark.parametrize(("name", "package"), [("Tamaas", "tamaas"), ("ASPHER", "aspher")])
def test_iterations_of_others_are_timed(name: str, package: str) -> None:
    pytest.importorskip(package)
    assert 0 < peer_threads._timed_apart(name, 65, 2) < 60


def test_grids_that_cannot_be_nested_are_refused() -> None:
    with pytest.raises(InputError, match="nodes 100: give 2"):
        measure((100,), (5.0,), threads=2, rounds=1)


@pytest.mark.parametrize("percent", [-1.0, 0.0, 250.0, float("nan")])
def test_shares_of_contact_out_of_reach_are_refused(percent: float) -> None:
    with pytest.raises(InputError, match="% contact: give more than 0"):
        measure((129,), (percent,), threads=2, rounds=1)


def test_other_solvers_are_refused_where_only_long_grids_are_asked_for(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="--peers: give a grid of less than 4097 nodes"):
        threads(tmp_path, nodes="4097", percents="1", number=2, rounds=1, peers=True)


def test_the_gain_of_a_slow_turn_does_not_count() -> None:
    assert peer_threads.gain([2.0, 30.0, 4.0], [1.0, 3.0, 2.0]) == 2.0


def test_an_error_on_one_thread_ends_the_others_and_is_raised(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    calls = count()

    def fails_once(*arguments: object, **options: object) -> object:
        if next(calls) == 0:
            raise MemoryError("no room")
        return displacement_filter((17, 17), "free", "uniform-pressure", 1.0, "float32")

    monkeypatch.setattr(bench.threads, "displacement_filter", fails_once)
    with pytest.raises(MemoryError, match="no room"):
        gain_of_copies(17, threads=2, rounds=1)
