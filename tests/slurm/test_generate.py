"""slurm/generate.sbatch on a Slurm of our own: launchers, interruptions, crashes, bad input."""

import os
import shutil
import signal
import sys
from pathlib import Path

import numpy as np
import pytest
from databases import deterministic_bytes, status
from launch import mpiexec

from tests.slurm.cluster import thin_environment

pytestmark = [pytest.mark.mpi, pytest.mark.slurm]

SCRIPT = Path(__file__).resolve().parents[2] / "slurm" / "generate.sbatch"
RANKS = 3
PLUGIN = (
    "pmi2"
    if mpiexec() and Path(mpiexec()).with_name("hydra_pmi_proxy").exists()
    else "pmix"
)


@pytest.fixture
def folder(tmp_path, serial):
    for name in ("short", "long"):
        shutil.copy(serial / f"{name}.toml", tmp_path)
    return tmp_path


@pytest.fixture
def generate(cluster, overrunning, folder):
    """Submit the script from the folder; what is not given has the script's own default."""

    def submit(*options, **parameters):
        given = {"VENV": sys.prefix, "SCENE": "short.toml"} | parameters
        options = (f"--ntasks={RANKS}", *options)
        return cluster.sbatch(*options, SCRIPT, folder=folder, parameters=given)

    return submit


def log(folder, job):
    return (folder / f"asperity-{job}.log").read_text()


def in_its_midst(path):
    return path.exists() and 0 < np.count_nonzero(status(path)) < status(path).size


def rank_of(job, rank):
    """The process id of one rank of a job's run."""
    wanted = {f"SLURM_JOB_ID={job}".encode()}
    names = {f"PMI_RANK={rank}".encode(), f"OMPI_COMM_WORLD_RANK={rank}".encode()}
    for entry in Path("/proc").iterdir():
        try:
            variables = set((entry / "environ").read_bytes().split(b"\0"))
            arguments = (entry / "cmdline").read_bytes().split(b"\0")
        except OSError:
            continue
        if wanted <= variables and names & variables and b"gen" in arguments:
            return int(entry.name)
    raise AssertionError(f"job {job} has no rank {rank}")


def test_every_launcher_makes_the_serial_columns(cluster, generate, folder, serial):
    launchers = {
        "auto.h5": "auto",
        "mpiexec.h5": f"{mpiexec()} -n {RANKS}",
        "srun.h5": f"srun --mpi={PLUGIN}",
    }
    jobs = [
        generate("--nodes=2", DATABASE=name, LAUNCHER=launcher)
        for name, launcher in launchers.items()
    ]
    for job, (name, launcher) in zip(jobs, launchers.items(), strict=True):
        assert cluster.wait(job)["ExitCode"] == "0:0", log(folder, job)
        used = f"mpiexec -n {RANKS}" if launcher == "auto" else launcher
        assert f"{used}: the world has size '{RANKS}', {RANKS} are asked for" in log(
            folder, job
        )
        assert deterministic_bytes(folder / name) == deterministic_bytes(
            serial / "short.h5"
        )


def test_a_warned_job_queues_again_and_loses_nothing(cluster, generate, folder, serial):
    job = generate(SCENE="long.toml")
    database = folder / "long.h5"
    cluster.wait_until(lambda: in_its_midst(database), "rows", every=0.02)
    cluster.ask("scancel", "--batch", "--signal=USR1", job)
    cluster.wait_until(lambda: cluster.job(job)["Restarts"] == "1", "a restart")
    kept = np.count_nonzero(status(database))
    assert 0 < kept < status(database).size
    assert cluster.wait(job)["ExitCode"] == "0:0", log(folder, job)
    assert f", {status(database).size - kept} to do" in log(folder, job)
    assert "generate stopped in order: queues again" in log(folder, job)
    assert deterministic_bytes(database) == deterministic_bytes(serial / "long.h5")
    assert not list(folder.glob("*.state"))


def test_a_killed_rank_is_a_crash_and_the_job_finishes(cluster, generate, folder, serial):
    job = generate(SCENE="long.toml", RETRIES=1)
    database = folder / "long.h5"
    cluster.wait_until(lambda: in_its_midst(database), "rows", every=0.02)
    os.kill(rank_of(job, 1), signal.SIGKILL)
    ended = cluster.wait(job)
    assert (ended["ExitCode"], ended["Restarts"]) == ("0:0", "1"), log(folder, job)
    assert "crash 1 of this job" in log(folder, job)
    assert deterministic_bytes(database) == deterministic_bytes(serial / "long.h5")


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"SCENE": "nosuch.toml"}, "nosuch.toml"),
        ({"LAUNCHER": "srun --mpi=none"}, f"no world of {RANKS} ranks: set LAUNCHER"),
        ({"VENV": "nowhere"}, "VENV=nowhere: there is no nowhere/bin/python"),
        ({"LOCAL_ENV": "maybe"}, "LOCAL_ENV=maybe: give yes or no"),
        ({"RETRIES": "often"}, "RETRIES=often: give a number"),
    ],
)
def test_bad_input_is_not_tried_again(cluster, generate, folder, parameters, message):
    job = generate(**parameters)
    ended = cluster.wait(job)
    assert (ended["ExitCode"], ended["Restarts"]) == ("2:0", "0"), log(folder, job)
    assert message in log(folder, job)
    assert not list(folder.glob("*.h5"))


@pytest.mark.skipif(PLUGIN != "pmi2", reason="only MPICH's wheel is small enough to lend")
def test_ranks_use_the_copy_on_the_node_and_leave_none(cluster, generate, folder, serial):
    notes, disk = folder / "notes", folder / "disk"
    disk.mkdir()
    venv = thin_environment(folder, notes)
    job = generate("--nodes=2", VENV=venv, LOCAL_ENV="yes", TMPDIR=disk)
    assert cluster.wait(job)["ExitCode"] == "0:0", log(folder, job)
    assert f"copied {venv} to {disk}/asperity-{job}-0 on 2 node(s)" in log(folder, job)
    assert set(notes.read_text().split()) == {f"{disk}/asperity-{job}-0"}
    assert not list(disk.iterdir())
    assert deterministic_bytes(folder / "short.h5") == deterministic_bytes(
        serial / "short.h5"
    )


def test_a_run_that_heeds_no_warning_is_ended_before_the_limit(cluster, overrunning):
    job, folder = overrunning
    ended = cluster.wait(job)
    assert "generate does not stop in time" in log(folder, job)
    assert (ended["JobState"], ended["Restarts"]) == ("COMPLETED", "1"), log(folder, job)
