"""The farm with tasks that cost nothing."""

from bench.farm.launch import dispatch, expected
from gen.runtime.farm import World


def test_dispatch_counts_each_task_once() -> None:
    assert dispatch(100, World()) == expected(100)
    assert expected(3) == dispatch(3, World()) != dispatch(2, World())
