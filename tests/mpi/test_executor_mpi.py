"""The executor of a job on three ranks: data sent once, failures on either side, interruptions."""

import json

import pytest
from launch import launch

pytest.importorskip("sklearn", reason="the extra 'learn' is not installed")
pytestmark = pytest.mark.mpi

JOBS = """
import faulthandler, json, os, sys
import typer
from gen.runtime import farm
from gen.runtime.errors import InputError
from learn.executor import led

faulthandler.dump_traceback_later(300, exit=True)

class Sent:
    copies = 0
    def __init__(self, factor):
        self.factor = factor
    def __getstate__(self):
        Sent.copies += 1
        return {"factor": self.factor}

def work(shared, task):
    if task < 0:
        raise InputError(f"no {task} today")
    return shared.factor * task, os.getpid()

def rounds(executor):
    first, second = Sent(2), Sent(3)
    found = []
    for shared, tasks in ((first, range(40)), (first, range(5)), (second, [7]), (first, [])):
        results = {}
        executor.run(work, shared, tasks, lambda task, result: results.update({task: result}))
        found.append([results[task][0] for task in tasks])
        if len(tasks) == 40:
            workers = {pid for _, pid in results.values()}
            assert os.getpid() not in workers
    alone, _ = executor.call(work, second, 4)
    print(json.dumps([found, alone, Sent.copies, executor.world.workers]), flush=True)

def failing_work(executor):
    executor.run(work, Sent(1), [1, -5, 2], lambda *pair: None)

def failing_master(executor):
    def refuse(task, result):
        raise InputError("disk full today")
    executor.run(work, Sent(1), range(9), refuse)

world = farm.this_world()
for job in (rounds, failing_work, failing_master):
    code = 0
    try:
        with led() as executor:
            job(executor)
    except typer.Exit as left:
        code = left.exit_code
    except farm.MasterLeft as left:
        code = left.code
    except InputError as error:
        code = 2
        print(json.dumps(str(error)), flush=True)
    if code == 2 and world.is_master:
        world.end(2)
    codes = world.communicator.gather(code)
    if world.is_master:
        print(json.dumps(codes), flush=True)
"""


def test_a_job_runs_on_the_master_and_its_tasks_on_the_workers(tmp_path):
    (tmp_path / "jobs.py").write_text(JOBS)
    done = launch(3, folder=tmp_path, module="jobs")
    assert done.returncode == 0, done.stderr
    said = [json.loads(line) for line in done.stdout.splitlines()]
    results = [
        [2 * task for task in range(40)],
        [2 * task for task in range(5)],
        [21],
        [],
    ]
    # The data changed four times, and were copied as often: tasks on the same data resend nothing.
    assert said[0] == [results, 12, 4, 2]
    assert said[1:] == [[0, 0, 0], "no -5 today", [2, 2, 2], "disk full today", [2, 2, 2]]
