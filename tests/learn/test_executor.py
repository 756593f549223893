"""The executor on one process; tests/mpi/test_executor_mpi.py has the same on several ranks."""

import pytest

from gen.runtime import farm
from gen.runtime.errors import InputError
from learn.executor import Executor, lead


def scaled(factor, task):
    return factor * task


def test_results_arrive_with_their_tasks():
    results = []
    Executor().run(scaled, 10, iter([1, 2, 3]), lambda *pair: results.append(pair))
    assert results == [(1, 10), (2, 20), (3, 30)]


def test_no_task_is_begun_once_it_is_told_to_stop():
    results = []
    executor = Executor()
    executor.run(
        scaled,
        1,
        range(9),
        lambda _, result: results.append(result),
        stopping=lambda: len(results) == 2,
    )
    assert results == [0, 1]


def test_the_master_leads_with_the_exit_code_of_its_job():
    assert lead(lambda executor: executor.call(scaled, 1, 7), farm.World()) == 7


def test_what_a_job_raises_is_not_swallowed():
    def refuse(executor):
        raise InputError("no job today")

    with pytest.raises(InputError, match="no job today"):
        lead(refuse, farm.World())
