"""Tasks in other processes: on one, within a time; tests/mpi/test_executor_mpi.py has the ranks."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from gen.runtime.errors import InputError
from learn import executor
from learn.executor import Executor, led, within


def count(shared, task):
    return sum(range(task)) + shared, os.getpid()


def spin(shared, task):
    """Run for ever, as some fits seem to."""
    while True:
        np.linalg.svd(np.ones((100, 100)))


def refuse(shared, task):
    raise InputError("no")


def leave(shared, task):
    os._exit(3)


def soon(seconds=60.0):
    return time.time() + seconds


@pytest.mark.parametrize(
    ("time_needed", "text"),
    [(0.2, "1s"), (90.0, "90s"), (121.0, "3min"), (7100.0, "119min"), (9000.0, "2.5h")],
)
def test_a_budget_is_written_as_it_is_read_and_not_below_the_time(time_needed, text):
    assert executor.budget_of(time_needed) == text
    assert executor.seconds(text) >= time_needed


@pytest.mark.parametrize("text", ["", "-1h", "nan", "2 weeks", "h", "1e18s"])
def test_budgets_are_read_or_refused(text):
    assert [executor.seconds(each) for each in ("90s", "2h", "1.5min", "2")] == [
        90,
        7200,
        90,
        2,
    ]
    with pytest.raises(InputError, match="--budget"):
        executor.seconds(text)


@pytest.mark.long
def test_one_second_process_does_task_after_task():
    first, second = (within(count, 1, 3, soon()) for _ in range(2))
    assert first == second
    assert first[0] == 4
    assert first[1] != os.getpid()


@pytest.mark.long
def test_a_process_whose_task_takes_too_long_is_killed_and_replaced():
    _, process = within(count, 1, 3, soon())
    began = time.time()
    assert within(spin, 1, 3, soon(0.5)).seconds > 0.4
    assert time.time() - began < 60.0
    with pytest.raises(ProcessLookupError):
        os.kill(process, 0)
    assert within(count, 2, 3, soon())[0] == 5


def test_a_task_whose_time_is_over_is_not_begun():
    assert within(count, 2, 3, time.time()) == executor.Ended()


def test_refusals_come_back_and_the_end_of_the_process_is_one():
    with pytest.raises(InputError, match=r"^no$"):
        within(refuse, 1, 3, soon())
    with pytest.raises(InputError, match="has ended by itself"):
        within(leave, 1, 3, soon())
    assert within(count, 1, 3, soon())[0] == 4


def is_running(number):
    try:
        return " Z " not in Path(f"/proc/{number}/stat").read_text()
    except OSError:
        return False


KILLED = """
import sys, time
from learn.executor import within
import test_executor
print(within(test_executor.count, 0, 3, time.time() + 60)[1], flush=True)
within(test_executor.spin, 0, 3, time.time() + 60)
"""


def test_a_killed_process_leaves_none_behind():
    path = os.pathsep.join([str(Path(__file__).parent), *sys.path])
    parent = subprocess.Popen(
        [sys.executable, "-c", KILLED],
        stdout=subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": path},
        text=True,
    )
    child = int(parent.stdout.readline())
    parent.send_signal(signal.SIGKILL)
    parent.communicate()
    limit = time.time() + 60
    while is_running(child):
        assert time.time() < limit
        time.sleep(0.1)


def scaled(factor, task):
    return factor * task


def test_results_arrive_with_their_tasks():
    results = []
    Executor().run(scaled, 10, iter([1, 2, 3]), lambda *pair: results.append(pair))
    assert results == [(1, 10), (2, 20), (3, 30)]


def test_what_a_job_raises_is_not_swallowed():
    with pytest.raises(InputError, match="no job today"), led():
        raise InputError("no job today")
