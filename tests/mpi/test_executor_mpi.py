"""The executor of a job on three ranks: data sent once, failures on either side, interruptions."""

import json
import signal
import subprocess
import time

import pytest
from comparisons import run
from launch import TIMEOUT, command, environment, is_open_mpi, launch, mpiexec

pytest.importorskip("sklearn", reason="the extra 'learn' is not installed")
pytestmark = [
    pytest.mark.mpi,
    pytest.mark.skipif(mpiexec() is None, reason="no mpiexec: install the extra 'mpich'"),
]

JOBS = """
import faulthandler, json, os, sys
from gen.runtime import farm
from gen.runtime.errors import InputError
from learn.executor import lead

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
    print(json.dumps([found, alone, Sent.copies, executor.workers]), flush=True)
    return 0

def failing_work(executor):
    executor.run(work, Sent(1), [1, -5, 2], lambda *pair: None)
    return 0

def failing_master(executor):
    def refuse(task, result):
        raise InputError("disk full today")
    executor.run(work, Sent(1), range(9), refuse)
    return 0

def early(executor):
    raise InputError("no database today")

world = farm.this_world()
for job in (rounds, failing_work, failing_master, early):
    code = 0
    try:
        code = lead(job, world)
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
    results = [[2 * task for task in range(40)], [2 * task for task in range(5)], [21], []]
    # The data changed four times, and were copied as often: tasks on the same data resend nothing.
    assert said[0] == [results, 12, 4, 2]
    assert said[1:] == [
        [0, 0, 0],
        *("no -5 today", [2, 2, 2]),
        *("disk full today", [2, 2, 2]),
        *("no database today", [2, 2, 2]),
    ]


@pytest.fixture(scope="module")
def database(tmp_path_factory):
    folder = tmp_path_factory.mktemp("database")
    (folder / "scene.toml").write_text("samples = 90\n[surface]\nnodes = 17\n")
    done = launch(0, "run", "scene.toml", "-o", "rows.h5", folder=folder)
    assert done.returncode == 0, done.stderr
    return folder / "rows.h5"


TUNE = ("--model", "decision-tree", "--model", "kernel-ridge")


@pytest.mark.long
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_search_on_ranks_stops_at_a_signal_and_goes_on(
    database, tmp_path, number, monkeypatch, capsys
):
    arguments = ("tune", database, "-o", "found", *TUNE)
    started = subprocess.Popen(
        command(3, *arguments, module="learn"),
        cwd=tmp_path,
        env=environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    trials = tmp_path / "found/area/trials/decision-tree.jsonl"
    limit = time.monotonic() + TIMEOUT
    while not trials.exists() or trials.read_bytes().count(b"\n") < 12:
        assert time.monotonic() < limit
        assert started.poll() is None, started.communicate()
        time.sleep(0.01)
    started.send_signal(number)
    out, err = started.communicate(timeout=TIMEOUT)
    assert "Traceback" not in err
    if is_open_mpi():  # it may kill before all is in order
        assert started.returncode
    else:
        assert started.returncode == 128 + number, err
        assert f"stopped by {number.name}; the same command goes on" in out
    if number == signal.SIGTERM:
        again = launch(3, *arguments, folder=tmp_path, module="learn")
        assert again.returncode == 0, again.stderr
        said = again.stderr
    else:  # any number of ranks goes on with the fits of any other: here one, without a new start
        monkeypatch.chdir(tmp_path)
        assert run(*arguments) == 0
        said = capsys.readouterr().err
    assert "550 fits" in said
    assert "550 fits, 550 to do" not in said
    assert (tmp_path / "found/area/tuned/kernel-ridge.json").exists()
