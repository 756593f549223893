"""The report on threads: what its rows hold."""

from itertools import count

import pytest

import bench.threads
from bem.convolution import displacement_filter
from bench.threads import gain, gain_of_copies, measure, verdict
from gen.runtime.errors import InputError


def test_rows_compare_threads_with_copies_of_the_transforms() -> None:
    (row,) = measure((513,), (5.0,), threads=2, rounds=1)
    assert row["area_percent"] == pytest.approx(5, rel=0.3)
    assert 30 < row["shared_percent"] <= 100
    assert 1 < row["reckoned_4"] < row["reckoned_8"] < 8
    assert row["gain"] == row["seconds_one"] / row["seconds"]
    assert row["gain_over_copies"] == row["gain"] / row["copies"]
    assert 0 < row["copies"] < 20  # of a machine that may be busy
    said = verdict([row | {"gain_over_copies": share} for share in (0.89, 0.9, 1.2)])
    assert "0.89 to 1.20, 0.9 or more (the mark) in 2 of 3 rows" in said
    assert "estimates, not measured" in said


def test_grids_that_cannot_be_nested_are_refused() -> None:
    with pytest.raises(InputError, match="nodes 100: give 2"):
        measure((100,), (5.0,), threads=2, rounds=1)


@pytest.mark.parametrize("percent", [-1.0, 0.0, 250.0, float("nan")])
def test_shares_of_contact_out_of_reach_are_refused(percent: float) -> None:
    with pytest.raises(InputError, match="% contact: give more than 0"):
        measure((129,), (percent,), threads=2, rounds=1)


def test_the_gain_of_a_slow_turn_does_not_count() -> None:
    assert gain([2.0, 30.0, 4.0], [1.0, 3.0, 2.0]) == 2.0


def test_an_error_on_one_thread_ends_the_others_and_is_raised(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    calls = count()

    def fails_once(*arguments: object, **options: object) -> object:
        if next(calls) == 0:
            raise MemoryError("no room")
        return displacement_filter((17, 17), "uniform-pressure", dtype="float32")

    monkeypatch.setattr(bench.threads, "displacement_filter", fails_once)
    with pytest.raises(MemoryError, match="no room"):
        gain_of_copies(17, threads=2, rounds=1)
